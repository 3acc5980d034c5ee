"""Import of arrays with OpenCV's names: `calibrateHandEye`, `calibrateRobotWorldHandEye`, and names for two arms.

`R_gripper2base` and `t_gripper2base` are base_from_flange, `R_target2cam` and `t_target2cam` camera_from_target, in
metres. A world is a target, and `R_base2gripper` is flange_from_base. With two arms, the eye carries the camera and
the hand carries the target. Rotations are matrices or rotation vectors [rad].
Source: OpenCV's documentation of calib3d.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from basecal.errors import DatasetError, InputError, count_text, list_names
from basecal.exchange.fields import read_fields
from basecal.exchange.importing.hand_eye import Carriers, HandEyeRecord, hand_eye_of_file
from basecal.exchange.importing.imported import Imported
from basecal.exchange.lens_files.file_storage import read_file_storage
from basecal.exchange.npz import read_arrays
from basecal.exchange.poses import LengthUnit, unit_length_m
from basecal.geometry import SE3, Array
from basecal.geometry.array import entry_clause
from basecal.geometry.rotation import project_rotation, rotation_exp

HAND_EYE = ("gripper2base", "target2cam")
"""Names of the arguments of `calibrateHandEye`."""
ROBOT_WORLD = ("base2gripper", "world2cam")
"""Names of the arguments of `calibrateRobotWorldHandEye`."""
BASE_TO_BASE = ("eye_gripper2base", "hand_gripper2base", "target2cam")
"""Names of the poses of two arms, and of the second arm's target in the first arm's camera."""

_KINDS = (BASE_TO_BASE, ROBOT_WORLD, HAND_EYE)
_TARGET_NAMES = {"rvecs": "R_target2cam", "tvecs": "t_target2cam"}  # names from `calibrateCamera`
_LARGEST = 2**24  # bytes of JSON: twenty thousand samples


def read_array_file(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera_on: str | None = None,
    target_on: str | None = None,
    robot: str | None = None,
    hand: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    unit: LengthUnit = "m",
) -> Imported:
    """Import arrays with OpenCV's names from a NumPy archive (.npz), JSON or FileStorage.

    Reads R_gripper2base, t_gripper2base, R_target2cam and t_target2cam of
    calibrateHandEye, or R_world2cam, t_world2cam, R_base2gripper and
    t_base2gripper of calibrateRobotWorldHandEye. Two arms have
    R_eye_gripper2base, t_eye_gripper2base, R_hand_gripper2base,
    t_hand_gripper2base, R_target2cam and t_target2cam. Rotations are matrices
    or rotation vectors [rad]. 4x4 matrices such as T_gripper2base replace the
    pair R and t. Creates the cell if there is none.

    For example:

        basecal import arrays mycell poses.npz
        basecal import arrays mycell poses.json --camera-on world
        basecal import arrays mycell two_arms.npz --robot left --hand right

    Args:
        cell: Folder of the cell.
        file: The archive, the JSON file, or the FileStorage (.yml, .xml).
        camera_on: Carrier of the camera with one arm: robot or world; by default as in the cell, otherwise robot.
        target_on: Carrier of the target, if it is another robot, which does not move.
        robot: Name of the robot in the cell; with two arms, of the one that carries the camera.
        hand: Name of the robot that carries the target, with two arms.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.
        unit: Unit of the translations.

    Raises:
        InputError: if the file cannot be read, or is inconsistent with the cell.
    """

    def read(camera_on_robot: bool | None) -> HandEyeRecord:
        """Read the record with the carrier from the cell or the user."""
        return read_record_of_arrays(file, camera_on_robot, unit_length_m(unit))

    advice = f"all lengths are read in {unit}: check --unit, or convert arrays of another unit; then check --camera-on"
    return hand_eye_of_file(cell, read, Carriers(camera_on, target_on), robot, camera, target, hand=hand, advice=advice)


def record_of_arrays(
    arrays: Mapping[str, ArrayLike], source: str, camera_on_robot: bool = True, metres: float = 1.0
) -> HandEyeRecord:
    """Create a record from arrays.

    Args:
        arrays: `R_...` (n, 3, 3) or (n, 3) [rad] and `t_...` (n, 3), with the names of `HAND_EYE`, `ROBOT_WORLD` or
            `BASE_TO_BASE`. Axes of length one are removed. `T_...` (n, 4, 4) replaces a pair `R_...` and `t_...`;
            `rvecs` and `tvecs` are target2cam.
        source: Source of the arrays.
        camera_on_robot: Whether the robot carries the camera; if False, it carries the target.
        metres: Unit of the translations [m].

    Raises:
        InputError: if an array is missing or invalid, lengths differ, or two arrays hold the same poses.
    """
    arrays = _rename_arrays(arrays)
    names = next((kind for kind in _KINDS if arrays.keys() >= {*_keys(kind)}), None)
    if names is None:
        keys = " or ".join(list_names(_keys(kind)) for kind in (HAND_EYE, ROBOT_WORLD, BASE_TO_BASE))
        raise InputError(f"{source}: holds {list_names(list(arrays))}, expected {keys}")
    poses = [_poses(arrays, name, metres) for name in names]
    counts = {f"R_{name}": len(pose) for name, pose in zip(names, poses, strict=True)}
    if len(set(counts.values())) > 1:
        lengths = ", ".join(f"{name} has {count}" for name, count in counts.items())
        raise InputError(f"{source}: {lengths}: expected the same number, one pose per sample")
    for name, pose in zip(names[:-1], poses[:-1], strict=True):
        if np.array_equal(pose.matrix, poses[-1].matrix):
            raise InputError(f"{source}: {name} and {names[-1]} are the same poses: one was given for both")
    what = f"{count_text(len(poses[0]), 'sample')} under OpenCV's names: {list_names(_keys(names))}"
    if names == BASE_TO_BASE:
        return HandEyeRecord(source, what, True, poses[0], poses[2], hand_base_from_flange=poses[1])
    base_from_flange = poses[0].inverse() if names == ROBOT_WORLD else poses[0]
    return HandEyeRecord(source, what, camera_on_robot, base_from_flange, poses[1])


def _rename_arrays(arrays: Mapping[str, ArrayLike]) -> dict[str, ArrayLike]:
    """Split matrices `T_...` into `R_...` and `t_...`, and rename `rvecs` and `tvecs` to those of the target."""
    found: dict[str, ArrayLike] = {}
    for key, values in arrays.items():
        letter, _, name = key.partition("_")
        if letter in ("T", "H") and name in {each for kind in _KINDS for each in kind}:
            matrices = _numbers(arrays, key, ((4, 4),))
            found |= {f"R_{name}": matrices[:, :3, :3], f"t_{name}": matrices[:, :3, 3]}
        else:
            found[_TARGET_NAMES.get(key, key)] = values
    return found


def read_record_of_arrays(path: str | Path, camera_on_robot: bool | None, metres: float) -> HandEyeRecord:
    """Read a record from a NumPy archive (`.npz`), a JSON file or a FileStorage; see `record_of_arrays`.

    JSON may be a list of samples, each a mapping.

    Raises:
        InputError: if the file cannot be read.
    """
    name = str(path)
    if name.lower().endswith((".npz", ".npy")):
        name, found = read_arrays(name)
        arrays: dict[str, ArrayLike] = dict(found)
    else:
        is_json = name.lower().endswith(".json")
        data = (read_fields(path, _LARGEST) if is_json else read_file_storage(path)).data
        if isinstance(data, list) and all(isinstance(each, dict) and each.keys() == data[0].keys() for each in data):
            data = {key: [each[key] for each in data] for key in (data[0] if data else ())}
        if not isinstance(data, dict):
            raise DatasetError(name, "expected a mapping of arrays by OpenCV's names, such as R_gripper2base")
        arrays = {key: _plain_matrices(value) for key, value in data.items()}
    try:
        return record_of_arrays(arrays, name, camera_on_robot is not False, metres)
    except InputError as error:
        raise DatasetError(name, str(error).removeprefix(f"{name}: ")) from None


def _plain_matrices(value: Any) -> Any:
    """Convert the matrices of a FileStorage in a value to nested lists."""
    if isinstance(value, list):
        return [_plain_matrices(each) for each in value]
    if not isinstance(value, dict) or not {"rows", "cols", "data"} <= value.keys():
        return value
    try:
        rows, columns, numbers = int(value["rows"]), int(value["cols"]), np.asarray(value["data"])
        return numbers.reshape((rows, columns, -1) if numbers.size > rows * columns else (rows, columns)).tolist()
    except (TypeError, ValueError):
        return value


def _keys(kind: tuple[str, ...]) -> list[str]:
    return [f"{letter}_{name}" for name in kind for letter in "Rt"]


def _poses(arrays: Mapping[str, ArrayLike], name: str, metres: float) -> SE3:
    """Transforms, (n,), from the arrays `R_<name>` and `t_<name>`."""
    rotations = _numbers(arrays, f"R_{name}", ((3, 3), (3,)))
    rotation = (
        project_rotation(rotations, f"R_{name}") if rotations.ndim == 3 else _rotation_of_vectors(rotations, name)
    )
    translation = _numbers(arrays, f"t_{name}", ((3,),)) * metres
    if len(rotation) != len(translation):
        raise InputError(
            f"R_{name} has {len(rotation)} entries and t_{name} {len(translation)}, expected equal numbers"
        )
    return SE3(rotation, translation)


def _rotation_of_vectors(vectors: Array, name: str) -> Array:
    """Rotations (n, 3, 3) of rotation vectors (n, 3) [rad]; a vector longer than 2 pi is rejected as degrees."""
    longest = float(np.linalg.norm(vectors, axis=-1).max(initial=0.0))
    if longest > 2 * np.pi:
        raise InputError(f"R_{name} has a rotation vector of length {longest:.4g}, expected radians: convert degrees")
    return rotation_exp(vectors)


def _numbers(arrays: Mapping[str, ArrayLike], key: str, shapes: tuple[tuple[int, ...], ...]) -> Array:
    """Finite numbers of an array, (n, *shape) with one of the shapes; axes of length one are removed."""
    if np.ma.is_masked(arrays[key]):
        raise InputError(f"{key} is a masked array, expected every number: leave masked entries out of all arrays")
    try:
        plain = np.asarray(arrays[key])
        is_complex, values = np.iscomplexobj(plain), np.asarray(plain.real, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{key} is not an array of numbers: its entries differ in shape, or are not numbers") from None
    if is_complex:
        raise InputError(f"{key} is a complex array, expected real numbers")
    if not values.size:
        raise InputError(f"{key} is empty, expected a pose for each sample")
    if values.shape[1:] == (9,) and (3, 3) in shapes:
        values = values.reshape(-1, 3, 3)
    if values.ndim == 3 and 1 in values.shape[1:]:
        values = values.reshape(len(values), -1)
    if values.ndim < 2 or values.shape[1:] not in shapes:
        expected = " or ".join(f"(n, {', '.join(map(str, shape))})" for shape in shapes)
        raise InputError(f"{key} has shape {values.shape}, expected {expected}")
    if np.any(is_wrong := ~np.isfinite(values.reshape(len(values), -1)).all(-1)):
        raise InputError(f"{key} holds NaN or infinity{entry_clause(is_wrong)}")
    return values
