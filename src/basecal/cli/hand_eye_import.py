"""What the imports of hand-eye recordings share: the names that the cell has for what they are of."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from basecal.cli.imported import finish_import
from basecal.cli.lens_import import known_cell

if TYPE_CHECKING:
    from basecal.exchange.hand_eye.moveit import JointStates
    from basecal.exchange.hand_eye.record import HandEyeRecord

CameraOn = Literal["robot", "world"]


def import_hand_eye(
    folder: Path,
    read: Callable[[bool | None], HandEyeRecord],
    *,
    camera_on: CameraOn | None,
    robot: str | None,
    camera: str | None,
    target: str | None,
    link: bool = False,
) -> int:
    """The exit code, after a hand-eye recording is in the cell.

    Args:
        folder: The cell, or where one is to be made.
        read: The recording, given whether the robot carries the camera; None where neither user nor cell says so.
        camera_on: What carries the camera, where the user says so.
        robot: Its name in the cell; where None, that of what is carried, or of the only one.
        camera: Likewise.
        target: Likewise.
        link: Whether pictures are linked instead of copied.

    Raises:
        InputError: if it cannot be read, or does not fit the cell.
    """
    from basecal.exchange.importing.hand_eye import chosen_names, imported_hand_eye, told_by_cell

    cell = known_cell(folder)
    told = told_by_cell(cell, camera) if camera_on is None else camera_on == "robot"
    record = read(told)
    names = chosen_names(cell, robot, camera, target, record.camera_on_robot)
    imported = imported_hand_eye(cell, record, names)
    return finish_import(folder, imported, advice="check --camera-on", link=link)


def import_joint_states(folder: Path, states: JointStates, source: str, robot: str | None) -> int:
    """The exit code, after joint states are in the cell.

    Args:
        folder: The cell, in which the robot has a URDF.
        states: What was read.
        source: The file, as the user named it.
        robot: Its name in the cell; the only one with a URDF where None.

    Raises:
        InputError: if the cell has no such robot, or its joints have other names.
    """
    from basecal.exchange.importing.hand_eye import imported_joint_states

    imported = imported_joint_states(known_cell(folder), states, source, robot)
    return finish_import(folder, imported, advice="check that they are radians, and of this robot")
