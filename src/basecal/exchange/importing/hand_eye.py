"""Import of a hand-eye program's record into a cell."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from basecal.cell import WORLD, PoseObservation, RobotState, Unknown
from basecal.cell.format.plain import pose_dict
from basecal.errors import InputError
from basecal.exchange.importing.imported import Imported, KnownCell, NoCell, Row, check_robot, choose_name, known_cell
from basecal.geometry import SE3

_CARRIER_WORDS = ("robot", WORLD)


@dataclass(frozen=True)
class Carriers:
    """Carriers of camera and target, if the user states them.

    Attributes:
        camera_on: Carrier of the camera: `robot` (of the file), `world`, or the name of a robot.
        target_on: Carrier of the target, if the camera is on the robot: `world`, or the name of another robot.
    """

    camera_on: str | None = None
    target_on: str | None = None


@dataclass(frozen=True)
class Names:
    """Names in a cell of the robot, the camera, the target and a second robot of a hand-eye recording."""

    robot: str
    camera: str
    target: str
    hand: str = "hand"


def hand_eye_of_file(
    folder: str | Path,
    read: Callable[[bool | None], HandEyeRecord],
    carriers: Carriers,
    robot: str | None,
    camera: str | None,
    target: str | None,
    is_linked: bool = False,
    hand: str | None = None,
    advice: str = "check --camera-on",
) -> Imported:
    """Read a hand-eye record for the cell in a folder.

    Args:
        folder: Folder of the cell, or of a new cell.
        read: Function that reads the record; its argument is whether the robot carries the camera, None if unknown.
        carriers: Carriers of camera and target, if stated by the user.
        robot: Name of the robot in the cell; by default the carrier of the camera or target, or the only robot.
        camera: Name of the camera; the only camera if None.
        target: Name of the target; the only target if None.
        is_linked: Whether images are linked instead of copied.
        hand: Name of a second robot, which carries the target.
        advice: Which option to check if the record is implausible.

    Raises:
        InputError: if the record cannot be read, or is inconsistent with the cell.
    """
    cell = known_cell(folder)
    record = read(is_camera_on_robot(cell, camera, carriers.camera_on, robot))
    if robot is None and record.camera_on_robot and carriers.camera_on not in (None, *_CARRIER_WORDS):
        robot = carriers.camera_on
    names = chosen_names(cell, robot, camera, target, record.camera_on_robot)
    found = imported_hand_eye(cell, record, replace(names, hand=hand or names.hand), is_linked, carriers)
    return replace(found, advice=advice)


def chosen_names(cell: KnownCell, robot: str | None, camera: str | None, target: str | None, on_robot: bool) -> Names:
    """Choose names: the given ones, else the only ones in the cell, else the defaults of a new cell.

    Args:
        cell: The cell, if there is one.
        robot: Given name of the robot, or None.
        camera: Given name of the camera, or None.
        target: Given name of the target, or None.
        on_robot: Whether the robot carries the camera; if False, it carries the target.

    Raises:
        InputError: if a name is not given and the cell has several.
    """
    if isinstance(cell, NoCell):
        return Names(robot or ("eye" if on_robot else "hand"), camera or "camera", target or "target")
    camera = choose_name("camera", camera, cell.cameras, "camera")
    target = choose_name("target", target, cell.targets, "target")
    carried = cell.cameras.get(camera) if on_robot else cell.targets.get(target)
    if robot is None and carried is not None and carried.on in cell.robots:
        robot = carried.on
    return Names(choose_name("robot", robot, cell.robots, "eye"), camera, target)


def is_camera_on_robot(
    cell: KnownCell, camera: str | None, camera_on: str | None = None, robot: str | None = None
) -> bool | None:
    """Whether the robot of a file carries the camera; None if neither the user nor the cell states it.

    Args:
        cell: The cell, if there is one.
        camera: Name of the camera; the only camera if None.
        camera_on: Carrier of the camera, if stated by the user.
        robot: Name of the file's robot, if stated by the user.
    """
    if camera_on is None and cell.cameras and (camera is not None or len(cell.cameras) == 1):
        found = cell.cameras.get(camera or next(iter(cell.cameras)))
        camera_on = None if found is None else found.on
        if robot is None and camera_on not in (None, WORLD):
            others = {target.on for target in cell.targets.values()} - {WORLD, camera_on}
            if others:  # either robot may be the one that moved
                return None
    if camera_on is None:
        return None
    return camera_on == "robot" or (camera_on != WORLD and robot in (None, camera_on))


def imported_hand_eye(
    cell: KnownCell,
    record: HandEyeRecord,
    names: Names,
    is_linked: bool = False,
    carriers: Carriers = Carriers(),
) -> Imported:
    """Convert a record to rows and to additions to the cell; existing values of the cell are not changed.

    Args:
        cell: The cell, if there is one.
        record: The record.
        names: Names of robot, camera and target in the cell.
        is_linked: Whether images are linked instead of copied.
        carriers: Carriers of camera and target, if stated by the user.

    Raises:
        InputError: if camera and target have the same carrier.
    """
    known_camera, known_target = cell.cameras.get(names.camera), cell.targets.get(names.target)
    camera_on, target_on = _carriers(cell, record, names, carriers)
    is_world_base = isinstance(cell, NoCell) or cell.reference == names.robot
    # An estimated mount is a pose in the frames of the file's robot.
    known_frames = (names.robot, WORLD) if is_world_base else (names.robot,)
    camera_guess = record.camera_mount if camera_on in known_frames else None
    target_guess = record.target_mount if target_on in known_frames else None
    camera: dict[str, Any] = {
        "on": camera_on,
        **_mount(None if known_camera is None else known_camera.mount, camera_guess),
    }
    target: dict[str, Any] = {
        "on": target_on,
        **_mount(None if known_target is None else known_target.mount, target_guess),
    }
    if known_camera is None or known_camera.intrinsics is None:
        camera |= record.lens
    if record.camera_frame and (known_camera is None or known_camera.frame is None):
        camera["frame"] = record.camera_frame
    if known_target is None or known_target.target is None:
        target |= record.target
    known_robot = cell.robots.get(names.robot)
    robot: dict[str, Any] = {}
    if known_robot is None or not known_robot.frames:
        robot = {"frames": dict(record.frames)} if record.frames else {}
    robots = {
        names.robot: robot,
        **{carrier: {} for carrier in (camera_on, target_on) if carrier not in (names.robot, WORLD)},
    }
    data = {"robots": robots, "cameras": {names.camera: camera}, "targets": {names.target: target}}
    rows = _rows(record, names)
    return Imported(record.path, record.what, rows, data, is_linked=is_linked)


def _carriers(cell: KnownCell, record: HandEyeRecord, names: Names, carriers: Carriers) -> tuple[str, str]:
    """Carriers of the camera and the target: the file's robot carries one; the other's carrier does not move."""
    if record.hand_base_from_flange is not None:
        return names.robot, names.hand
    known = cell.targets if record.camera_on_robot else cell.cameras
    name = names.target if record.camera_on_robot else names.camera
    stated = carriers.target_on if record.camera_on_robot else carriers.camera_on
    known_carrier = known[name].on if name in known else WORLD
    other = stated or (WORLD if known_carrier == names.robot else known_carrier)
    check_robot(cell, other)
    if other == names.robot:
        raise InputError(f"camera {names.camera!r} and target {names.target!r} are both on {other!r}")
    return (names.robot, other) if record.camera_on_robot else (other, names.robot)


def _mount(cell_mount: Unknown | None, estimate: SE3 | None) -> dict[str, Any]:
    """Entry of a free mount with an estimate as its guess; empty if the cell has a value or there is no estimate."""
    has_value = cell_mount is not None and (cell_mount.status != "free" or cell_mount.mean is not None)
    if has_value or (cell_mount is not None and estimate is None):
        return {}
    guess = {} if estimate is None else {"guess": pose_dict(estimate)}
    return {"mount": {"status": "free", **guess}}


def _rows(record: HandEyeRecord, names: Names) -> tuple[Row, ...]:
    rows = []
    for i in range(len(record.base_from_flange)):
        poses = record.camera_from_target
        views = () if poses is None else (PoseObservation(names.camera, names.target, poses[i]),)
        images = {names.camera: record.images[i]} if record.images else {}
        image = record.images[i].name if record.images else None
        robots = {names.robot: RobotState(record.base_from_flange[i])}
        if record.hand_base_from_flange is not None:
            robots[names.hand] = RobotState(record.hand_base_from_flange[i])
        rows.append(Row(robots, views, images, image))
    return tuple(rows)


@dataclass(frozen=True, eq=False)
class HandEyeRecord:
    """Record of a hand-eye program: robot poses, target poses or images, and earlier results.

    Attributes:
        path: Path of the file.
        what: Content with frames and units.
        camera_on_robot: Whether the robot carries the camera; if False, it carries the target.
        base_from_flange: (n,) poses of the robot; empty if the file has only a result.
        camera_from_target: (n,) poses of the target; None if there are images instead.
        images: One image per pose; empty if there are target poses.
        frames: Names of the robot's `base` and `flange` in the file.
        camera_frame: Name of the camera's frame in the file; empty if not stated.
        camera_mount: Estimated pose of the camera in the flange or the base; None if not stated.
        target_mount: Estimated pose of the target in the flange or the base; None if not stated.
        lens: Fields of `cell.yaml` for the lens; empty if not stated.
        target: Fields of `cell.yaml` for the target's kind and sizes; empty if not stated.
        hand_base_from_flange: (n,) poses of a second robot, which carries the target; None if there is one robot.
    """

    path: str
    what: str
    camera_on_robot: bool
    base_from_flange: SE3 = field(default_factory=lambda: SE3.identity((0,)))
    camera_from_target: SE3 | None = None
    images: tuple[Path, ...] = ()
    frames: Mapping[str, str] = field(default_factory=dict)
    camera_frame: str = ""
    camera_mount: SE3 | None = None
    target_mount: SE3 | None = None
    lens: Mapping[str, Any] = field(default_factory=dict)
    target: Mapping[str, Any] = field(default_factory=dict)
    hand_base_from_flange: SE3 | None = None
