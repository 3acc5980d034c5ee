"""Reading of LeRobot's datasets: joints of an episode, in degrees or normalised to a motor's range, without gripper.

A dataset has meta/info.json and data/**/*.parquet with the columns observation.state, timestamp and episode_index.
Degrees are (ticks - middle of the range) * 360 / 4095. Normalised values are -100 to 100 over the range, with the sign
reversed by `drive_mode`. Source: huggingface.co, LeRobotDataset v2.1 and v3.0; lerobot, motors_bus.py, `_normalize`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from basecal.bounded_file import check_regular
from basecal.box import Frame, frames
from basecal.cell import RobotState
from basecal.errors import DatasetError, InputError, MissingExtra
from basecal.exchange.fields import read_fields
from basecal.exchange.importing.imported import Row
from basecal.exchange.importing.pairing import LARGEST_DIFFERENCE_S
from basecal.exchange.joints import radians_finding
from basecal.geometry import Array, IntArray
from basecal.kinematics import SerialChain

JointUnit = Literal["deg", "rad", "normalised"]

LARGEST_INFO = 2**24  # bytes
_LARGEST_CALIBRATION = 2**20  # bytes
_TICKS = 4096 - 1  # per revolution, as lerobot counts them
_STATE = "observation.state"
_REST_S = 0.15  # before and after a frame at rest: slow motion is invisible between successive frames


@dataclass(frozen=True, eq=False)
class Episode:
    """The recorded data of one episode.

    Attributes:
        names: Names of the motors.
        values: (frames, motors) in the unit of the dataset.
        stamps_s: (frames,) time stamps [s].
    """

    names: tuple[str, ...]
    values: Array
    stamps_s: Array


def read_episode(folder: Path, number: int) -> Episode:
    """Read an episode of a dataset in a separate process.

    Raises:
        MissingExtra: if the parquet library is not installed.
        DatasetError: if the folder is not a dataset of LeRobot, or has no such episode.
    """
    features = read_fields(folder / "meta" / "info.json", LARGEST_INFO).find("features")
    field = features.find(_STATE).find("names")
    entries = field.find(*field.names()) if field.names() else field
    names = tuple(name.text().removesuffix(".pos") for name in entries.items("names of motors"))
    rows = read_columns(folder, folder / "data", number, ["timestamp", _STATE], 1 + len(names))
    return Episode(names, rows[:, 1:], rows[:, 0])


def read_columns(folder: Path, tables: Path, number: int, columns: Sequence[str], width: int | None = None) -> Array:
    """Read columns of an episode from the tables of a dataset, (n, width).

    Args:
        folder: Folder of the dataset.
        tables: Folder of the tables.
        number: Number of the episode.
        columns: Names of the columns; the last may hold lists.
        width: Count of numbers in a row; the count of columns if None.

    Raises:
        MissingExtra: if the parquet library is not installed.
        DatasetError: if the tables cannot be read, or have no such episode.
    """
    if find_spec("pyarrow") is None:
        raise MissingExtra("lerobot", "a recording of LeRobot")
    width = len(columns) if width is None else width
    expected = f"expected {width - len(columns) + 1} finite numbers in every {columns[-1]}"
    parts: list[Array] = []
    episodes: list[int] = []
    for (count, *ends), content in _frames(folder, tables, number, columns):
        episodes = [min(episodes + ends), max(episodes + ends)]
        if content and count != width:
            raise DatasetError(folder, expected)
        parts += [np.frombuffer(content).reshape(-1, width)] if content else []
    if not parts:
        raise DatasetError(folder, f"has no episode {number}; it has {' to '.join(map(str, episodes)) or 'none'}")
    rows = np.concatenate(parts)
    if not np.isfinite(rows).all():
        raise DatasetError(folder, expected)
    return rows


def _frames(folder: Path, tables: Path, number: int, columns: Sequence[str]) -> Iterator[Frame]:
    paths = sorted(tables.rglob("*.parquet"))
    for path in paths:
        check_regular(path)
    words = [str(number), ",".join(columns), *(os.path.abspath(path) for path in paths)]
    size = sum(path.stat().st_size for path in paths)
    try:
        yield from frames("basecal.exchange.lerobot_boxed", words, size) if paths else ()
    except DatasetError:
        raise
    except InputError as error:
        raise DatasetError(folder, str(error)) from None


def select_motors(episode: Episode, pattern: str) -> Episode:
    """Select the motors whose names match a pattern such as `left_*`; the prefix before a final `*` is removed.

    Raises:
        InputError: if no name matches.
    """
    indices = [i for i, name in enumerate(episode.names) if fnmatchcase(name, pattern)]
    if not indices:
        raise InputError(f"no motor is named {pattern}; there are: {', '.join(episode.names)}")
    prefix = pattern.partition("*")[0] if pattern.endswith("*") else ""
    names = tuple(episode.names[i].removeprefix(prefix) for i in indices)
    return replace(episode, names=names, values=episode.values[:, indices])


def still_frames(episode: Episode, every_s: float) -> IntArray:
    """Frame of each period with the least motion around it, since image and joints may differ in time.

    Args:
        episode: The episode with the motors of all arms, so that each import takes the same frames.
        every_s: The period [s]; 0 for all frames.
    """
    values, stamps_s = episode.values, episode.stamps_s
    if every_s == 0 or len(values) < 2:
        return np.arange(len(values))
    spread = np.ptp(values, axis=0)
    reach = max(1, int(_REST_S / max(np.median(np.diff(stamps_s)), _REST_S / len(values))))
    extended = np.pad(values, ((reach, reach), (0, 0)), "reflect", reflect_type="odd")
    windows = sliding_window_view(extended, 2 * reach + 1, axis=0)
    motion = (np.ptp(windows, axis=-1) / np.where(spread > 0, spread, 1.0)).max(axis=1)
    period = np.floor((stamps_s - stamps_s[0]) / every_s).astype(np.int64)
    order = np.lexsort((motion, period))
    return np.sort(order[np.flatnonzero(np.diff(period[order], prepend=-1))])


def nearest_frames(episode: Episode, times_s: Array) -> IntArray:
    """Unique indices of the frames nearest to the given times [s], if they are within `LARGEST_DIFFERENCE_S`."""
    differences_s = np.abs(episode.stamps_s[:, None] - times_s)
    nearest = differences_s.argmin(0)
    return np.unique(nearest[differences_s[nearest, np.arange(len(times_s))] <= LARGEST_DIFFERENCE_S])


def joint_rows(
    episode: Episode,
    robot: str,
    chain: SerialChain,
    unit: JointUnit,
    calibration: Mapping[str, Mapping[str, float]] | None,
    frame_indices: IntArray,
) -> tuple[Row, ...]:
    """Rows with a robot's joints [rad] at the given frames, without the gripper.

    Args:
        episode: The recorded episode.
        robot: Name of the robot.
        chain: The robot's kinematics; motors are matched by joint names, else in order without the gripper.
        unit: Unit of the recorded values.
        calibration: Ranges of the motors, required for normalised values.
        frame_indices: (n,) indices of the frames.

    Raises:
        InputError: if the motors do not match the chain, a motor's range is missing, or degrees look like radians.
    """
    indices = motor_indices(episode.names, chain.joint_names)
    if unit == "deg" and (finding := radians_finding(episode.values[:, indices])):
        raise InputError(f"{finding}: give --unit rad")
    joints = np.stack([_radians(episode, index, unit, calibration) for index in indices], axis=-1)
    return tuple(
        Row({robot: RobotState(joints_rad=joints[i])}, stamp_s=float(episode.stamps_s[i])) for i in frame_indices
    )


def motor_indices(motors: Sequence[str], joints: Sequence[str]) -> list[int]:
    """Index of each joint's motor: by name if all joints are found, else in order without the gripper.

    Raises:
        InputError: if the numbers differ, or the order contradicts a name.
    """
    if set(joints) <= set(motors):
        return [motors.index(joint) for joint in joints]
    indices = [i for i, name in enumerate(motors) if "gripper" not in name]
    names = f"motors {', '.join(motors)}, the URDF has the joints {', '.join(joints)}"
    if len(indices) != len(joints):
        need = "as many as motors without the gripper are needed, or the same names; of two arms choose by --motors"
        raise InputError(f"{names}: {need}")
    for joint, index in zip(joints, indices, strict=True):
        if joint in motors and motors[index] != joint:
            raise InputError(f"{names}: in order, {motors[index]} would be {joint}; name all motors as the joints")
    return indices


def read_motor_ranges(path: Path) -> dict[str, dict[str, float]]:
    """Read the range and direction of each motor from a calibration file of LeRobot.

    Raises:
        DatasetError: if the file is invalid.
    """
    root = read_fields(path, _LARGEST_CALIBRATION)
    keys = ("range_min", "range_max", "drive_mode")
    # The name of a usual motor makes an empty file an error.
    found = {
        name: {key: root.find(name).find(key).number() for key in keys} for name in root.names() or ["shoulder_pan"]
    }
    for name, motor in found.items():
        if not 0 <= motor["range_min"] < motor["range_max"] <= _TICKS:
            raise DatasetError(path, f"range_min and range_max are not 0 to {_TICKS}, rising", field=name)
    return found


def _radians(
    episode: Episode, index: int, unit: JointUnit, calibration: Mapping[str, Mapping[str, float]] | None
) -> Array:
    values: Array = episode.values[:, index]
    if unit != "normalised":
        return values if unit == "rad" else np.radians(values)
    name = episode.names[index]
    if calibration is None or name not in calibration:
        raise InputError(f"normalised values need the range of {name!r}: give --calibration with LeRobot's file of it")
    motor = calibration[name]
    ticks = values / 100 * (motor["range_max"] - motor["range_min"]) / 2
    angles: Array = (-1.0 if motor["drive_mode"] else 1.0) * ticks * 2 * math.pi / _TICKS
    return angles
