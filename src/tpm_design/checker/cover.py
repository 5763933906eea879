"""Covers: a box split again and again, and what is claimed of each part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, cast

from tpm_design.checker.proof import halves
from tpm_design.checker.regions import Box

Letter = Literal["p", "o", "n", "u"]
LEAVES = "ponu"
SPLITS = "xyz"


@dataclass(frozen=True)
class Cover:
    """``tree``: the splits (x, y, z) and leaves (p, o, n, u) of ``root`` in preorder."""

    root: Box
    tree: str


def leaves(cover: Cover) -> Iterator[tuple[Box, Letter]]:
    """Every leaf's box and letter. Together the boxes are the root. Raises ValueError where the tree does not
    come out even."""
    waiting = [cover.root]
    for letter in cover.tree:
        if not waiting:
            raise ValueError("the tree goes on after its last leaf")
        box = waiting.pop()
        if letter in SPLITS:
            lower, upper = halves(box, SPLITS.index(letter))
            waiting += [upper, lower]
        elif letter in LEAVES:
            yield box, cast(Letter, letter)
        else:
            raise ValueError(f"the tree holds {letter!r}")
    if waiting:
        raise ValueError("the tree ends before its last leaf")
