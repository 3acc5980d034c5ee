"""Import of easy_handeye (ROS 1) and easy_handeye2 (ROS 2) files: `.samples`, and calibrations (`.yaml`, `.calib`).

Metres and quaternions x, y, z, w, as in ROS. `tracking` is camera_from_target in both arrangements. `robot` is
base_from_flange with the eye in hand, but its inverse with the eye on the base. One equation thereby solves both; the
inverse is undone here. A calibration is flange_from_camera in the first case, base_from_camera in the second.
The `.samples` of easy_handeye2 leave the arrangement empty, and the numbers cannot determine it because the equation is
the same. The arrangement is read from the file, otherwise from the user or the cell. The next source is a calibration
of the same name next to the file. The last source is the file's name, if it has the words of the program's examples
(`eih`, `eob`). easy_handeye stores no file of its samples: the reply of its service take_sample or get_sample_list
(hand_world_samples, camera_marker_samples) is read.
Source: HandeyeSampler and HandeyeCalibration of IFL-CAMP/easy_handeye and marcoesposito1988/easy_handeye2.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from basecal.errors import DatasetError, count_text, list_names
from basecal.exchange.fields import Field, read_fields
from basecal.exchange.importing.hand_eye import Carriers, HandEyeRecord, hand_eye_of_file
from basecal.exchange.importing.imported import Imported
from basecal.geometry import SE3

_LARGEST = 2**22  # bytes: five thousand samples
_ON_ROBOT = {"eye_in_hand": True, "eye_on_hand": True, "eye_on_base": False}
_IN_NAMES = {"eih": True, "eob": False, **_ON_ROBOT}
_FRAMES = {"base": "robot_base_frame", "flange": "robot_effector_frame", "camera": "tracking_base_frame"}


def read_easy_handeye(
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
    """Import samples or a calibration of easy_handeye (ROS 1) or easy_handeye2 (ROS 2).

    Reads `.samples`, `.calib`, the calibration's `.yaml`, and the replies of the
    services take_sample and get_sample_list as YAML, in metres. Eye-on-base
    robot poses, which the program inverts, are inverted back. A calibration
    becomes the initial guess of the camera mount. Creates the cell if there is
    none. A second arm at rest may carry the camera or the target; its pose is
    one row of `basecal import poses --still`.

    For example:

        basecal import easy-handeye mycell ur5_eob.samples
        basecal import easy-handeye mycell run.samples --camera-on world
        basecal import easy-handeye mycell left.samples --camera-on left \\
            --target-on right

    Args:
        cell: Folder of the cell.
        file: A file of easy_handeye.
        camera_on: Carrier of the camera, if neither file nor cell states it: robot (eye in hand), world (on base), or
            the name of a robot.
        target_on: Carrier of the target, if it is another robot, which does not move.
        robot: Name of the robot in the cell.
        camera: Name of the camera in the cell.
        target: Name of the target in the cell.

    Raises:
        InputError: if the file cannot be read, or is inconsistent with the cell.
    """
    read = partial(read_easy_handeye_record, file)
    return hand_eye_of_file(cell, read, Carriers(camera_on, target_on), robot, camera, target)


@dataclass(frozen=True)
class _Arrangement:
    """Whether the robot carries the camera, and the source of this information."""

    on_robot: bool
    source: str


def read_easy_handeye_record(path: str | Path, camera_on_robot: bool | None = None) -> HandEyeRecord:
    """Read samples or a calibration of easy_handeye.

    Args:
        path: Path of the file.
        camera_on_robot: Whether the robot carries the camera, if the user or the cell states it.

    Raises:
        DatasetError: if the file is neither, or the arrangement is unknown.
    """
    root = read_fields(path, _LARGEST)
    arrangement = _arrangement(root, camera_on_robot)
    parameters = root.first("parameters") or root
    stated = {
        name: field.text().lstrip("/") for name, key in _FRAMES.items() if (field := parameters.first(key)) is not None
    }
    frames = {name: frame for name, frame in stated.items() if frame}
    camera_frame = frames.pop("camera", "")
    mount = root.first("transform", "transformation")
    carried = "flange" if arrangement.on_robot else "base"
    if mount is not None:
        what = f"a calibration of easy_handeye, {carried}_from_camera (m; {arrangement.source})"
        record = HandEyeRecord(str(path), what, arrangement.on_robot, frames=frames, camera_frame=camera_frame)
        return replace(record, camera_mount=mount.pose())
    robot, tracking = _samples(root)
    inverted = "" if arrangement.on_robot else ", written as flange_from_base and inverted here"
    what = f"{count_text(len(robot), 'sample')} of easy_handeye (m): base_from_flange{inverted}, and camera_from_target"
    return HandEyeRecord(
        str(path),
        f"{what}; {'camera on the robot' if arrangement.on_robot else 'target on the robot'} ({arrangement.source})",
        arrangement.on_robot,
        SE3.stack(robot) if arrangement.on_robot else SE3.stack(robot).inverse(),
        SE3.stack(tracking),
        frames=frames,
        camera_frame=camera_frame,
    )


def _arrangement(root: Field, on_robot: bool | None) -> _Arrangement:
    """Arrangement from the first available source: file, user or cell, calibration, file name.

    Raises:
        DatasetError: if no source states it, or the user or cell contradicts the file.
    """
    stated = _stated_arrangement(root)
    if on_robot is not None and stated is not None and stated.on_robot != on_robot:
        raise root.error(f"{stated.source}, which contradicts --camera-on or cell.yaml")
    found = stated or (None if on_robot is None else _Arrangement(on_robot, "as stated"))
    found = found or _sibling_arrangement(Path(root.path)) or _arrangement_from_name(Path(root.path))
    if found is None:
        raise root.error(
            "does not say whether the camera is on the robot (eye_in_hand) or beside it (eye_on_base). The direction "
            "of its robot poses depends on that: give --camera-on robot or --camera-on world"
        )
    return found


def _stated_arrangement(root: Field) -> _Arrangement | None:
    parameters = root.first("parameters") or root
    if (kind := parameters.first("calibration_type")) is not None and kind.text():
        if kind.data not in _ON_ROBOT:
            raise kind.error(f"is {kind.data!r}, expected one of {list_names(list(_ON_ROBOT))}")
        return _Arrangement(_ON_ROBOT[kind.data], f"calibration_type is {kind.data}")
    if (on_hand := parameters.first("eye_on_hand")) is not None:
        return _Arrangement(on_hand.boolean(), f"eye_on_hand is {str(on_hand.boolean()).lower()}")
    return None


def _sibling_arrangement(path: Path) -> _Arrangement | None:
    """Arrangement from the calibration of the same name; None if there is none."""
    for ending in (".calib", ".yaml", ".yml"):
        other = path.with_suffix(ending)
        if other != path and other.is_file():
            found = _stated_arrangement(read_fields(other, _LARGEST))
            return found and _Arrangement(found.on_robot, f"{found.source} in {other.name}")
    return None


def _arrangement_from_name(path: Path) -> _Arrangement | None:
    words = f"_{re.sub(r'[^a-z0-9]+', '_', path.stem.lower())}_"
    found = {on_robot: word for word, on_robot in _IN_NAMES.items() if f"_{word}_" in words}
    if len(found) != 1:
        return None
    ((on_robot, word),) = found.items()
    return _Arrangement(on_robot, f"by {word} in its name; --camera-on says otherwise")


def _samples(root: Field) -> tuple[list[SE3], list[SE3]]:
    """Poses `robot` and `tracking` of each sample."""
    samples = root.first("samples")
    if samples is not None and isinstance(samples.data, list):
        entries = samples.items("samples")
        return (
            [entry.find("robot").pose() for entry in entries],
            [entry.find("tracking", "optical").pose() for entry in entries],
        )
    lists = samples or root
    if lists.first("hand_world_samples") is None:
        raise root.error(
            f"holds {list_names(root.names())}, expected samples, hand_world_samples, transform or transformation"
        )
    fields = [lists.find(key) for key in ("hand_world_samples", "camera_marker_samples")]
    robot, tracking = (
        [each.pose() for each in (field.first("transforms") or field).items("transforms")] for field in fields
    )
    if len(robot) != len(tracking):
        raise DatasetError(root.path, f"{len(robot)} hand_world_samples and {len(tracking)} camera_marker_samples")
    return robot, tracking
