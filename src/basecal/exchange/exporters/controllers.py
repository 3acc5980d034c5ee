"""Export for the controllers of a cell's robots, in the frames of their recorded poses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from basecal.cell import Calibration, Cell, Robot
from basecal.errors import InputError
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.exchange.exports.choice import chosen_transforms
from basecal.exchange.exports.exporter import ExportRequest, NamedTransform, check_exportable, provenance


def controllers_text(calibration: Calibration, cell: Cell, transform: str | None = None, run: str | None = None) -> str:
    """Format the calibrated frames in the notation of each robot's controller.

    Args:
        calibration: The calibration.
        cell: The calibrated cell, with the controllers and the frames of the recorded poses.
        transform: Name of a transform in either direction; all requested transforms if None.
        run: Name of the calibration's run, for comments.

    Raises:
        RefusedCalibration: if the calibration is refused.
        FrameNotFound: if the transform does not exist.
        InputError: if no transform is in a frame of a robot.
    """
    check_exportable(calibration)
    remarks = provenance(calibration, run)
    texts = []
    for robot in cell.robots.values():
        transforms = tuple(_own_transforms(robot, calibration, cell, transform))
        if transforms:
            request = ExportRequest(transforms, (*remarks, recorded_frame(robot)), calibration, cell)
            texts.append(EXPORTERS[controller_kind(robot)].text(request))
    if not texts:
        raise InputError("no transform is in the base or flange of a robot: give --to, and --transform")
    return "\n".join(texts)


def controller_kind(robot: Robot) -> str:
    """Export format for a robot's controller; `matrix` if the controller is unknown."""
    driver = "" if robot.driver is None else robot.driver.kind
    known = (robot.controller.get("format", ""), driver, "ros" if robot.frames else "")
    return next((kind for kind in known if kind in EXPORTERS), "matrix")


def recorded_frame(robot: Robot) -> str:
    """Remark on the controller's frames in which the poses of a robot were recorded."""
    base, tool = robot.controller.get("base"), robot.controller.get("tool")
    own_base = robot.frames.get("base", f"{robot.name}_base")
    base_text = f"{own_base}, its base: no other was stated" if base is None else f"{base}, which is {own_base} here"
    tool_text = "" if tool is None else f"; {robot.name}_flange is {tool}"
    return f"for {robot.name}, in the frame that its poses were recorded in: {base_text}{tool_text}"


def _own_transforms(
    robot: Robot, calibration: Calibration, cell: Cell, transform: str | None
) -> Iterator[NamedTransform]:
    """Transforms whose parent is a frame of the robot; transforms between bases are inverted if necessary."""
    own = (f"{robot.name}_base", f"{robot.name}_flange")
    for chosen in chosen_transforms(calibration, cell, transform):
        parent, child = chosen.own_frames
        if parent in own:
            yield chosen
        elif child == own[0] and parent.endswith("_base"):
            (inverse,) = chosen_transforms(calibration, cell, f"{child}_from_{parent}")
            yield replace(inverse, status=chosen.status)
