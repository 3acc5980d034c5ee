"""`basecal import moveit-samples`."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.hand_eye_import import CameraOn, import_hand_eye, import_joint_states


def import_moveit_samples(
    cell: Path,
    file: Path,
    /,
    *,
    camera_on: CameraOn | None = None,
    robot: str | None = None,
    camera: str | None = None,
    target: str | None = None,
) -> int:
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
        robot: Name of the robot in the cell.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.
    """
    from basecal.exchange.hand_eye.moveit import is_joint_states, read_joint_states, read_moveit_samples

    if is_joint_states(file):
        return import_joint_states(cell, read_joint_states(file), str(file), robot)
    return import_hand_eye(
        cell,
        lambda on_robot: read_moveit_samples(file, on_robot),
        camera_on=camera_on,
        robot=robot,
        camera=camera,
        target=target,
    )
