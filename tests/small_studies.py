"""Texts of small studies of a 3-URU: the shortest links that reach a cube."""

from __future__ import annotations

SHORTEST = """\
version: 1
name: small
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters:
    db: 100
    dp: 60
    f: {min: 100, max: 500, initial: 250}
    r: {min: 100, max: 500, initial: 250}
    k: {values: [1, 2]}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [70, 70, 70], center: [150, 150, 150]}
objectives:
  - {metric: total_link_length, sense: minimize}
constraints:
  - {metric: coverage, min: 1}
  - {metric: conditioning_min, min: 0.2}
"""
"""Further constraints may follow, and what else a study holds."""

CERTIFIED = """\
version: 1
name: small
units: {length: mm, angle: deg}
mechanism:
  type: uru
  parameters: {db: 178, dp: 60, f: {min: 100, max: 400}, r: {min: 100, max: 400}, k: 1}
  mode: {octant: "+++", elbows: "+++"}
region: {type: box, size: [60, 60, 60], center: [150, 150, 150]}
objectives: [{metric: total_link_length, sense: minimize}]
constraints: [{metric: conditioning_min, label: even, norm: frobenius, min: 0.8}]
optimizer: {method: scipy.differential_evolution, budget: 120, seed: 1, polish: nlopt.cobyla}
certify: {tolerance: {f: 0.1, r: 0.1}, boxes: 20000}
"""
"""Its first optimum is refuted, its second one proved."""
