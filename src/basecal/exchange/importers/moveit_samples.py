"""Import of MoveIt Calibration's files: "Save samples", "Save joint states", and the JSON of its solver's tests.

Samples are pairs of 4x4 matrices, row by row, in metres. `effector_wrt_world` is base_from_flange in both arrangements
(the solver itself inverts it for a static camera), `object_wrt_sensor` is camera_from_target. The files do not state
the arrangement. Joint states (joint_names, joint_values) are radians, one row per sample.
Source: handeye_control_widget.cpp and handeye_solver_default.cpp of moveit/moveit_calibration.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from basecal.cell import RobotState
from basecal.errors import InputError, count_text, list_names
from basecal.exchange.fields import read_fields
from basecal.exchange.importing.hand_eye import Carriers, HandEyeRecord, hand_eye_of_file
from basecal.exchange.importing.imported import Imported, KnownCell, Row, known_cell
from basecal.geometry import SE3, Array, read_only

_ADVICE = "check that its lengths are metres, object_wrt_sensor is the target in the camera, and --camera-on"
_LARGEST = 2**22  # bytes: three thousand samples
_EXPECTED = "expected a list of effector_wrt_world and object_wrt_sensor, each of 16 numbers"


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
    """Import samples or joint states of MoveIt Calibration.

    Samples are pairs of effector_wrt_world and object_wrt_sensor, in metres;
    the file does not state the carrier of the camera. Joint states are radians
    and need a robot with a URDF in the cell; row i is sample i.

    For example:

        basecal import moveit-samples mycell samples.yaml --camera-on world
        basecal import moveit-samples mycell joint_states.yaml --robot arm

    Args:
        cell: Folder of the cell.
        file: File saved by MoveIt Calibration.
        camera_on: Carrier of the camera, if the cell does not state it: robot (eye-in-hand) or world (eye-to-hand).
        target_on: Carrier of the target, if it is another robot, which does not move.
        robot: Name of the robot in the cell.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.

    Raises:
        InputError: if the file cannot be read, or is inconsistent with the cell.
    """
    if is_joint_states(file):
        return imported_joint_states(known_cell(cell), read_joint_states(file), str(file), robot)
    read, carriers = partial(read_moveit_record, file), Carriers(camera_on, target_on)
    return hand_eye_of_file(cell, read, carriers, robot, camera, target, advice=_ADVICE)


@dataclass(frozen=True, eq=False)
class JointStates:
    """Joint positions (n, joints) [rad], and the joints' names."""

    names: tuple[str, ...]
    joints_rad: Array


def read_moveit_record(path: str | Path, camera_on_robot: bool | None) -> HandEyeRecord:
    """Read the samples of a hand-eye calibration of MoveIt.

    Args:
        path: Path of the file.
        camera_on_robot: Whether the robot carries the camera; the file does not state it.

    Raises:
        DatasetError: if the file is invalid.
        InputError: if `camera_on_robot` is None.
    """
    pairs = []
    for entry in read_fields(path, _LARGEST).items(f"samples, {_EXPECTED}"):
        if isinstance(entry.data, list):
            matrices = entry.items("two matrices")
            if len(matrices) != 2:
                raise entry.error(f"has {count_text(len(matrices), 'entry', 'entries')}; {_EXPECTED}")
            pairs.append((matrices[0].pose(), matrices[1].pose()))
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
        f"{count_text(len(pairs), 'sample')} of MoveIt (m): effector_wrt_world is base_from_flange, "
        f"object_wrt_sensor is camera_from_target; {arrangement}, as stated",
        camera_on_robot,
        SE3.stack([base_from_flange for base_from_flange, _ in pairs]),
        SE3.stack([camera_from_target for _, camera_from_target in pairs]),
    )


def read_joint_states(path: str | Path) -> JointStates:
    """Read the joint states saved by MoveIt Calibration.

    Raises:
        DatasetError: if the content is invalid, or the length of a row differs from the number of names.
    """
    root = read_fields(path, _LARGEST)
    names = tuple(name.text() for name in root.find("joint_names").items("names"))
    rows = [row.numbers(len(names)) for row in root.find("joint_values").items("rows of joint positions")]
    return JointStates(names, read_only(rows))


def is_joint_states(path: str | Path) -> bool:
    """Whether a file holds joint states instead of samples.

    Raises:
        DatasetError: if the file cannot be read.
    """
    return read_fields(path, _LARGEST).first("joint_names", "joint_values") is not None


def imported_joint_states(cell: KnownCell, states: JointStates, source: str, robot: str | None) -> Imported:
    """Import joint states of a robot with a URDF in the cell, one row per sample.

    Args:
        cell: The cell.
        states: The joint states.
        source: The file, as named by the user.
        robot: Name of the robot in the cell; the only robot with a URDF if None.

    Raises:
        InputError: if the cell has no such robot, or a joint of its chain is missing.
    """
    chains = {name: each.chain for name, each in cell.robots.items() if each.chain is not None}
    name = robot or (next(iter(chains)) if len(chains) == 1 else None)
    if name is None or name not in chains:
        known = list_names(list(chains))
        raise InputError(
            f"{source}: joint states need a robot with a URDF in cell.yaml, --robot; with one there are: {known}"
        )
    joint_names = chains[name].joint_names
    missing = [joint for joint in joint_names if joint not in states.names]
    if missing:
        raise InputError(
            f"{source}: has joints {list_names(states.names)}, "
            f"the chain of {name!r} in its URDF {list_names(joint_names)}: "
            f"{list_names(missing)} not recorded"
        )
    columns = [states.names.index(joint) for joint in joint_names]
    rows = tuple(Row({name: RobotState(joints_rad=row)}) for row in states.joints_rad[:, columns])
    what = f"{count_text(len(rows), 'joint state')} of {name} by MoveIt (rad), joints by their names"
    return Imported(source, what, rows, advice="check that they are radians, and of this robot")
