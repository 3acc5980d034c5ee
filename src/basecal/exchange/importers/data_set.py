"""Import of data sets of ROS-Industrial's industrial_calibration and robot_cal_tools: images, poses, lens and target.

The file lists pairs of `image` and `pose` files: under `data` in the first program, at the top level in the second. A
pose is base_from_flange, x, y, z [m] and qx, qy, qz, qw. The flange carries the camera, or the target if
`static_camera` is true. The lens is a pinhole without distortion; the image size is not stated. Rows and columns of a
ChArUco board count squares, and its dictionary is OpenCV's number; those of a grid of circles count circles.
Source: industrial_calibration's docs/extrinsic_hand_eye_calibration.md and examples; robot_cal_tools' rct_examples.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from basecal.cell.format.paths import path_resolver
from basecal.cell.targets.fiducials import DICTIONARIES
from basecal.errors import DatasetError, InputError, count_text, list_names
from basecal.exchange.fields import Field, read_fields
from basecal.exchange.importing.hand_eye import Carriers, HandEyeRecord, hand_eye_of_file
from basecal.exchange.importing.imported import Imported
from basecal.exchange.importing.lens import StatedLens, camera_entry, make_camera
from basecal.geometry import SE3


def read_data_set(
    cell: str | Path,
    file: str | Path,
    /,
    *,
    camera_on: str | None = None,
    target_on: str | None = None,
    robot: str | None = None,
    camera: str | None = None,
    target: str | None = None,
    intrinsics: Path | None = None,
    target_file: Path | None = None,
    link: bool = False,
) -> Imported:
    """Import images and robot poses of industrial_calibration or robot_cal_tools.

    Reads the list of images and poses (metres, quaternions). Reads the camera's
    intrinsics as an initial guess, and the ChArUco board or grid of circles.
    They may be in the list or in separate files. Guesses of mounts are used
    as initial guesses.

    For example:

        basecal import industrial-calibration mycell cal_data.yaml
        basecal import robot-cal-tools mycell cal_data.yaml --camera-on robot \\
            --intrinsics camera_intr.yaml --target-file target.yaml

    Args:
        cell: Folder of the cell.
        file: The list of images and poses.
        camera_on: Carrier of the camera, if neither file nor cell states it: robot, or world.
        target_on: Carrier of the target, if it is another robot, which does not move.
        robot: Name of the robot in the cell.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.
        intrinsics: File of the camera's intrinsics, if they are not in the list.
        target_file: File of the target, if it is not in the list.
        link: Make hard links to the images instead of copies.

    Raises:
        InputError: if a file cannot be read, or is inconsistent with the cell.
    """
    read = partial(read_data_set_record, file, lens=intrinsics, target=target_file)
    return hand_eye_of_file(cell, read, Carriers(camera_on, target_on), robot, camera, target, link)


def read_data_set_record(
    path: str | Path,
    camera_on_robot: bool | None = None,
    lens: str | Path | None = None,
    target: str | Path | None = None,
) -> HandEyeRecord:
    """Read images and poses of a `cal_data.yaml`, and the lens and target from it or from separate files.

    Args:
        path: The list of images and poses.
        camera_on_robot: Whether the robot carries the camera; from `static_camera` if None.
        lens: File with `intrinsics`; `path` if None.
        target: File with the target's sizes; `path` if None.

    Raises:
        DatasetError: if a file cannot be read, or the carrier of the camera is not stated.
    """
    root = read_fields(path)
    listing = root if isinstance(root.data, list) else root.find("data")
    folder = Path(path).parent
    entries = listing.items("`image: FILE` and `pose: FILE`")
    poses = SE3.stack([read_fields(_file(entry.find("pose"), folder)).pose() for entry in entries])
    images = tuple(_image(entry.find("image"), folder) for entry in entries)
    static = root.first("static_camera")
    if static is not None and camera_on_robot is not None and static.boolean() == camera_on_robot:
        raise static.error("contradicts --camera-on or cell.yaml")
    on_robot = camera_on_robot if static is None else not static.boolean()
    if on_robot is None:
        raise root.error(
            "does not say whether the camera is on the robot or beside it (static_camera): "
            "give --camera-on robot or --camera-on world"
        )
    stated_lens, stated_target = _lens(root, lens), _target(root, target)
    carried = "camera" if on_robot else "target"
    known = [name for name, stated in (("lens", stated_lens), ("target", stated_target)) if stated]
    return HandEyeRecord(
        str(path),
        f"{count_text(len(images), 'image')}, each with base_from_flange (m, quaternion), the {carried} on the flange; "
        f"{' and '.join(known) if known else 'neither lens nor target'} described",
        on_robot,
        poses,
        images=images,
        camera_mount=_guess(root, "camera_mount_to_camera_guess"),
        target_mount=_guess(root, "target_mount_to_target_guess"),
        lens=camera_entry(stated_lens.camera, "free") if stated_lens else {},
        target=stated_target or {},
    )


def _image(entry: Field, folder: Path) -> Path:
    path = _file(entry, folder)
    if not os.path.isfile(path):  # also false for a name that is too long
        raise entry.error(f"there is no image {path}: put the images beside the file, or correct the path")
    return path


def _file(entry: Field, folder: Path) -> Path:
    """Path of a file named in an entry; it must be inside the folder."""
    try:
        return folder / path_resolver(str(folder))(entry.text())
    except DatasetError:
        raise
    except InputError as error:
        raise entry.error(str(error)) from None


def _guess(root: Field, name: str) -> SE3 | None:
    found = root.first(name)
    return None if found is None else found.pose()


def _lens(root: Field, path: str | Path | None) -> StatedLens | None:
    intrinsics = (root if path is None else read_fields(path)).first("intrinsics")
    if intrinsics is None:
        return None
    values = [intrinsics.find(name).number() for name in ("fx", "fy", "cx", "cy")]
    # Distortion terms start at zero: without terms none would be estimated.
    camera = make_camera(intrinsics, "pinhole", [*values, *[0.0] * _TERMS], None)
    return StatedLens(camera, "pinhole without distortion")


def _target(root: Field, path: str | Path | None) -> dict[str, Any] | None:
    file = root if path is None else read_fields(path)
    finder = file.first("target_finder") or (file if path is not None else None)
    if finder is None:
        return None
    kind = finder.find("type")
    for name, read in _TARGETS.items():
        if name in kind.text():
            return read(finder)
    raise kind.error(f"{kind.data!r} is not supported; there are: {list_names(list(_TARGETS))}")


def _charuco(finder: Field) -> dict[str, Any]:
    number = finder.find("dictionary")
    if number.integer(0) >= _DICTIONARY_COUNT:
        raise number.error(f"is {number.data}, expected 0 to {_DICTIONARY_COUNT - 1}, as OpenCV counts dictionaries")
    return {
        "kind": "charuco",
        "squares": [finder.find("cols").integer(3), finder.find("rows").integer(3)],
        "square_m": finder.find("chessboard_dim").number(),
        "marker_m": finder.find("aruco_marker_dim").number(),
        "dictionary": DICTIONARIES[number.integer(0)],
    }


def _circles(finder: Field) -> dict[str, Any]:
    sides = [finder.find("cols").integer(2), finder.find("rows").integer(2)]
    return {"kind": "circles", "circles": sides, "spacing_m": finder.find("spacing").number()}


_TERMS = 5  # number of distortion terms, k1 k2 p1 p2 k3
_DICTIONARY_COUNT = 21  # number of OpenCV's dictionaries from DICT_4X4_50 to DICT_APRILTAG_36h11
_TARGETS: dict[str, Callable[[Field], dict[str, Any]]] = {
    "CharucoGridTargetFinder": _charuco,
    "ModifiedCircleGridTargetFinder": _circles,
}
