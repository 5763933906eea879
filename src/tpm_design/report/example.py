"""The line drawing of a mechanism's example, as a file."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from tpm_design.errors import UsageError, unwritable
from tpm_design.mechanisms.base import MechanismKind
from tpm_design.report.drawing import mechanism_figure
from tpm_design.report.good_pose import first_mode, good_pose
from tpm_design.report.style import save

FORMATS = (".svg", ".png")


def example_figure(kind: MechanismKind) -> Figure:
    """The example at the pose that the mechanism declares for its drawing, or at one well inside its
    workspace. Raises UsageError where there is none."""
    machine = kind.build(kind.example, {})
    mode = first_mode(machine)
    pose = kind.drawing.pose or good_pose(machine, mode)
    figure = None if pose is None else mechanism_figure(machine, mode, pose)
    if figure is None:
        raise UsageError(
            f"There is no pose at which the example of {kind.name} can be drawn.",
            remedy="Declare one that its first working mode reaches: drawing=Drawing(pose=…).",
        )
    return figure


def write_drawing(kind: MechanismKind, path: Path) -> None:
    """Draw the example. Raises UsageError, see ``report.write_drawing``."""
    if path.suffix not in FORMATS:
        raise UsageError(
            "A drawing is an SVG or PNG file.",
            where=str(path),
            remedy=f"Name it {path.stem or kind.name}.svg.",
        )
    figure = example_figure(kind)
    try:
        save(figure, path)
    except OSError as error:
        raise unwritable("The drawing cannot be written", error, path) from None
