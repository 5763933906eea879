"""A multibody model written joint by joint, as MuJoCo reads it.

All frames are parallel to the base's where every joint is at zero. Names begin with the limb's number: a
limb is found again by its prefix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

Element = ElementTree.Element
FloatArray = NDArray[np.float64]
Vector = Sequence[float] | FloatArray
ORIGIN = (0.0, 0.0, 0.0)

# of one actuator: joint → its part in the actuator's coordinate
Readout = Mapping[str, float]


@dataclass(frozen=True)
class MultibodyModel:
    """``drives``: for each drive, how the coordinate of each actuator is read from joints."""

    xml: str
    drives: Mapping[str, tuple[Readout, ...]]


class MjcfWriter:
    """A base, a free body "platform", and what is added between them."""

    def __init__(self) -> None:
        self._root = Element("mujoco")
        ElementTree.SubElement(self._root, "compiler", angle="radian")
        ElementTree.SubElement(self._root, "option", jacobian="dense", gravity="0 0 0")
        self.base = ElementTree.SubElement(self._root, "worldbody")
        self.platform = self._body(self.base, "platform", ORIGIN)
        ElementTree.SubElement(self.platform, "freejoint", name="platform")
        self._equality = ElementTree.SubElement(self._root, "equality")

    def hinge(self, parent: Element, name: str, axis: Vector, at: Vector = ORIGIN) -> Element:
        """A body that turns about ``axis`` through the point ``at`` of its parent, its own origin."""
        return self._jointed(parent, name, "hinge", at, axis)

    def slide(self, parent: Element, name: str, axis: Vector, at: Vector = ORIGIN) -> Element:
        """A body that slides along ``axis`` from the point ``at`` of its parent."""
        return self._jointed(parent, name, "slide", at, axis)

    def ball(self, parent: Element, name: str, at: Vector) -> Element:
        """A body on a ball joint at the point ``at`` of its parent, its own origin."""
        return self._jointed(parent, name, "ball", at)

    def site(self, body: Element, name: str, at: Vector = ORIGIN) -> str:
        """A named point of a body."""
        ElementTree.SubElement(body, "site", name=name, pos=_text(at))
        return name

    def weld(self, name: str, first: str, second: str) -> None:
        """Two sites made one, frames and all."""
        ElementTree.SubElement(self._equality, "weld", name=name, site1=first, site2=second)

    def connect(self, name: str, first: str, second: str) -> None:
        """Two sites made one point."""
        ElementTree.SubElement(self._equality, "connect", name=name, site1=first, site2=second)

    def gear(self, name: str, driven: str, driving: str, ratio: float) -> None:
        """driven = ratio · driving, of two joints."""
        ElementTree.SubElement(
            self._equality,
            "joint",
            name=name,
            joint1=driven,
            joint2=driving,
            polycoef=_text((0.0, ratio, 0.0)),
        )

    def model(self, **drives: tuple[Readout, ...]) -> MultibodyModel:
        return MultibodyModel(ElementTree.tostring(self._root, encoding="unicode"), drives)

    def _jointed(
        self, parent: Element, name: str, kind: str, at: Vector, axis: Vector | None = None
    ) -> Element:
        body = self._body(parent, name, at)
        joint = ElementTree.SubElement(body, "joint", name=name, type=kind)
        if axis is not None:
            joint.set("axis", _text(axis))
        return body

    def _body(self, parent: Element, name: str, at: Vector) -> Element:
        body = ElementTree.SubElement(parent, "body", name=name, pos=_text(at))
        # a moving body needs mass; positions and Jacobians do not depend on it
        ElementTree.SubElement(body, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
        return body


def _text(numbers: Vector) -> str:
    return " ".join(repr(float(number)) for number in numbers)
