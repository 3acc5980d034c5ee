"""Files of MoveIt Calibration: "Save samples", "Save joint states", and the JSON of its solver's tests.

A list of pairs of 4x4 matrices, row by row, in metres. `effector_wrt_world` is base_from_flange in both arrangements
(the solver itself inverts it for a camera beside the robot), `object_wrt_sensor` camera_from_target. No file says which
arrangement it is. Joint states (joint_names, joint_values) are radians, one row a sample.
Source: handeye_control_widget.cpp and handeye_solver_default.cpp of moveit/moveit_calibration.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from basecal.errors import InputError
from basecal.exchange.fields import read_fields
from basecal.exchange.hand_eye.record import HandEyeRecord
from basecal.geometry import SE3, Array, read_only

_LARGEST = 2**22  # bytes: three thousand samples
_EXPECTED = "expected a list of effector_wrt_world and object_wrt_sensor, each of 16 numbers"


@dataclass(frozen=True, eq=False)
class JointStates:
    """Joint positions (n, joints) [rad], and the joints' names."""

    names: tuple[str, ...]
    joints_rad: Array


def read_moveit_samples(path: str | Path, camera_on_robot: bool | None) -> HandEyeRecord:
    """The samples of a hand-eye calibration of MoveIt.

    Args:
        path: The file.
        camera_on_robot: Whether the robot carries the camera, which no such file says.

    Raises:
        DatasetError: if it is none.
        InputError: if `camera_on_robot` is not known.
    """
    pairs = []
    for entry in read_fields(path, _LARGEST).items(f"samples, {_EXPECTED}"):
        if isinstance(entry.data, list):
            both = entry.items("two matrices")
            if len(both) != 2:
                raise entry.error(f"has {len(both)} entries; {_EXPECTED}")
            pairs.append((both[0].pose(), both[1].pose()))
        else:
            pairs.append((entry.find("effector_wrt_world").pose(), entry.find("object_wrt_sensor").pose()))
    if camera_on_robot is None:
        raise InputError(
            f"{path} does not say whether the camera is on the robot (eye-in-hand) or beside it (eye-to-hand). "
            "Give --camera-on robot or --camera-on world"
        )
    arrangement = "camera on the robot" if camera_on_robot else "target on the robot"
    return HandEyeRecord(
        str(path),
        f"{len(pairs)} samples of MoveIt (m): effector_wrt_world is base_from_flange, object_wrt_sensor is "
        f"camera_from_target; {arrangement}, as stated",
        camera_on_robot,
        SE3.stack([base_from_flange for base_from_flange, _ in pairs]),
        SE3.stack([camera_from_target for _, camera_from_target in pairs]),
    )


def read_joint_states(path: str | Path) -> JointStates:
    """The joint states that MoveIt Calibration saved.

    Raises:
        DatasetError: if it holds anything else, or rows of another length than there are names.
    """
    root = read_fields(path, _LARGEST)
    names = tuple(name.text() for name in root.find("joint_names").items("names"))
    rows = [row.numbers(len(names)) for row in root.find("joint_values").items("rows of joint positions")]
    return JointStates(names, read_only(rows))


def is_joint_states(path: str | Path) -> bool:
    """Whether a file holds joint states, and not samples.

    Raises:
        DatasetError: if it cannot be read.
    """
    return read_fields(path, _LARGEST).first("joint_names", "joint_values") is not None
