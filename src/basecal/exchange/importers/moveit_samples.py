"""Samples and joint states that MoveIt Calibration saved."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from basecal.exchange.hand_eye import moveit
from basecal.exchange.importing.cell_content import known_cell
from basecal.exchange.importing.hand_eye import Carriers, hand_eye_of_file, imported_joint_states
from basecal.exchange.importing.imported import Imported

_ADVICE = "check that its lengths are metres, object_wrt_sensor is the target in the camera, and --camera-on"


def read_moveit_samples(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera_on: str | None = None,
    target_on: str | None = None,
    robot: str | None = None,
    camera: str | None = None,
    target: str | None = None,
) -> Imported:
    """Samples or joint states that MoveIt Calibration saved.

    Samples are pairs of effector_wrt_world and object_wrt_sensor, in metres;
    the file does not say what carries the camera. Joint states are radians and
    need a robot with a URDF in the cell; row i is sample i.

    For example:

        basecal import moveit-samples mycell samples.yaml --camera-on world
        basecal import moveit-samples mycell joint_states.yaml --robot arm

    Args:
        cell: Folder of the cell.
        file: What MoveIt Calibration saved.
        camera_on: What carries the camera, where the cell does not say: robot (eye-in-hand) or world (eye-to-hand).
        target_on: What carries the target, if it is another robot, which is still.
        robot: Name of the robot in the cell.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.

    Raises:
        InputError: if it cannot be read, or does not fit the cell.
    """
    if moveit.is_joint_states(file):
        return imported_joint_states(known_cell(cell), moveit.read_joint_states(file), str(file), robot)
    read, carriers = partial(moveit.read_moveit_samples, file), Carriers(camera_on, target_on)
    return hand_eye_of_file(cell, read, carriers, robot, camera, target, advice=_ADVICE)
