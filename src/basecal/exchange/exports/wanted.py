"""The request that an exporter answers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from basecal.cell import Calibration, Cell
from basecal.geometry import PoseEstimate


@dataclass(frozen=True, eq=False)
class NamedTransform:
    """A transform that has both a place and a rotation.

    Attributes:
        name: Such as `eye_base_from_hand_base`.
        parent: What its first frame is called in other programs.
        child: Likewise its second.
        estimate: `parent_from_child`.
        status: `fixed`, `prior` or `free`.
    """

    name: str
    parent: str
    child: str
    estimate: PoseEstimate
    status: str

    @property
    def own_frames(self) -> tuple[str, str]:
        """Its frames as the cell calls them."""
        parent, _, child = self.name.partition("_from_")
        return parent, child


@dataclass(frozen=True, eq=False)
class Wanted:
    """The content that an exporter may write.

    Attributes:
        transforms: The requested ones.
        remarks: What they were made from and whether that is doubtful, a line each, for comments.
        calibration: Where they come from.
        cell: What was calibrated; None if it is not known.
        folder: Where the cell's files are; None likewise.
        robot: The robot requested; None if none was.
        camera: Likewise the camera.
        urdfs: URDFs to build on.
        joint: The joint of one that is meant; None if it is clear.
    """

    transforms: tuple[NamedTransform, ...]
    remarks: tuple[str, ...]
    calibration: Calibration
    cell: Cell | None = None
    folder: Path | None = None
    robot: str | None = None
    camera: str | None = None
    urdfs: tuple[Path, ...] = ()
    joint: str | None = None

    def may_have_controller(self, robot: str, kind: str) -> bool:
        """Whether a robot's controller may be of a kind: it is not known to be of another."""
        known = None if self.cell is None else self.cell.robots.get(robot)
        return known is None or known.controller.get("format", kind) == kind
