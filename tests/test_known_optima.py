"""`optimize` on problems whose answers are known in closed form."""

from __future__ import annotations

from pathlib import Path

import pytest

import tpm_design as tpm

STUDIES = Path(__file__).parents[1] / "studies"


def test_the_smallest_orthoglide_for_a_cube() -> None:
    run = tpm.load_study(STUDIES / "04-orthoglide-velocity.yaml").optimize()
    assert run.best is not None
    assert run.best.status == "feasible"
    assert 0.2 / float(run.best.design["L"]) == pytest.approx(0.6439506, abs=1e-4)


@pytest.mark.parametrize("seed", [1, 2])
def test_reach_alone_as_a_distance_leads_to_the_shortest_links(tmp_path: Path, seed: int) -> None:
    """Links at their lower limits reach the cube: 3 (0.15 + 0.15) m."""
    study = f"""\
version: 1
name: reach
units: {{length: mm, angle: deg}}
mechanism:
  type: uru
  parameters: {{db: {{min: 0, max: 400}}, dp: 60, f: {{min: 150, max: 600}}, r: {{min: 150, max: 600}}, k: 1}}
  mode: {{octant: "+++", elbows: "+++"}}
region: {{type: box, size: [200, 200, 200], center: free}}
objectives: [{{metric: total_link_length, sense: minimize}}]
constraints: [{{metric: boundary_distance, min: 0}}]
optimizer: {{method: multistart, budget: 1500, seed: {seed}}}
"""
    path = tmp_path / "reach.yaml"
    path.write_text(study, encoding="utf-8")
    run = tpm.load_study(path).optimize()
    assert run.best is not None
    assert run.best.metrics["total_link_length"] == pytest.approx(0.9, rel=1e-4)
