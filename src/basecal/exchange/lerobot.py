"""LeRobot's recordings: joints of an episode, in degrees or normalised to a motor's range, the gripper left out.

Source: huggingface.co, LeRobotDataset v2.1 and v3.0: meta/info.json and data/**/*.parquet with the columns
observation.state, timestamp and episode_index; lerobot, motors_bus.py, `_normalize`: degrees are (ticks - middle of the
range) * 360 / 4095, normalised ones are -100 to 100 over the range, turned round by `drive_mode`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from basecal.bounded_file import read_bounded
from basecal.cell import RobotState
from basecal.errors import DatasetError, InputError, MissingExtra, list_names
from basecal.exchange.importing.imported import Row
from basecal.geometry import Array
from basecal.kinematics import SerialChain

JointUnit = Literal["deg", "rad", "normalised"]

_LARGEST_INFO = 2**24  # bytes
_LARGEST_DATA = 2**29  # bytes of a parquet file: v3.0 writes files of 100 MB
_LARGEST_CALIBRATION = 2**20  # bytes
_TICKS = 4096 - 1  # of a whole turn, as lerobot counts them
_STATE = "observation.state"


@dataclass(frozen=True, eq=False)
class Episode:
    """What was recorded of one episode.

    Attributes:
        names: Of the motors.
        values: (frames, motors), as they are written.
        stamps_s: (frames,).
    """

    names: tuple[str, ...]
    values: Array
    stamps_s: Array


def read_episode(folder: Path, number: int) -> Episode:
    """One episode of a dataset's folder.

    Raises:
        MissingExtra: if the library of parquet is not installed.
        DatasetError: if the folder is no dataset of LeRobot, or has no such episode.
    """
    try:
        from pyarrow import ArrowException, BufferReader
        from pyarrow.parquet import ParquetFile
    except ImportError:
        raise MissingExtra("lerobot", "a recording of LeRobot") from None
    names = _names(folder / "meta" / "info.json")
    values, stamps, known = [], [], set()
    for path in sorted((folder / "data").rglob("*.parquet")):
        content = BufferReader(read_bounded(path, _LARGEST_DATA))
        try:
            columns = ParquetFile(content).read(columns=[_STATE, "timestamp", "episode_index"]).to_pydict()
            episodes = np.array(columns["episode_index"], dtype=np.int64).reshape(-1)
            mine = np.flatnonzero(episodes == number)
            values += [columns[_STATE][i] for i in mine]
            stamps += [float(np.ravel(columns["timestamp"][i])[0]) for i in mine]
        except (ArrowException, OSError, ValueError, LookupError, TypeError) as error:
            message = f"not a table of LeRobot ({type(error).__name__}), expected {_STATE}, timestamp and episode_index"
            raise DatasetError(str(path), message) from None
        known |= set(episodes.tolist())
    if not values:
        raise DatasetError(
            str(folder), f"has no episode {number}; there are: {list_names([str(n) for n in sorted(known)])}"
        )
    return Episode(names, _array(folder, values, len(names)), np.array(stamps))


def joint_rows(
    episode: Episode,
    robot: str,
    chain: SerialChain,
    unit: JointUnit,
    calibration: Mapping[str, Mapping[str, float]] | None,
    every_s: float,
) -> tuple[Row, ...]:
    """Rows with a robot's joints [rad] at a frame every so often; the gripper is no joint of the chain.

    Args:
        episode: What was recorded.
        robot: Name of the robot.
        chain: Its kinematics; motors are found by its joints' names, else in order without the gripper.
        unit: Of what was recorded.
        calibration: Ranges of the motors, which normalised values need.
        every_s: Time between frames that are taken [s]; 0 for all.

    Raises:
        InputError: if the motors do not suit the chain, or the calibration lacks one.
    """
    by_name = {name: i for i, name in enumerate(episode.names)}
    places = [by_name[name] for name in chain.joint_names if name in by_name]
    if len(places) < chain.n:
        places = [i for i, name in enumerate(episode.names) if "gripper" not in name]
    if len(places) != chain.n:
        there = f"motors {', '.join(episode.names)}, the URDF has the joints {', '.join(chain.joint_names)}"
        raise InputError(f"{there}: as many as motors without the gripper are needed, or the same names")
    joints = np.stack([_radians(episode, place, unit, calibration) for place in places], axis=-1)
    taken, last = [], -math.inf
    for i, stamp in enumerate(episode.stamps_s):
        if stamp - last >= every_s:
            taken.append(i)
            last = float(stamp)
    return tuple(Row({robot: RobotState(joints_rad=joints[i])}, stamp_s=float(episode.stamps_s[i])) for i in taken)


def read_motor_ranges(path: Path) -> dict[str, dict[str, float]]:
    """Range and direction of each motor of a calibration file of LeRobot.

    Raises:
        DatasetError: if it is none.
    """
    expected = 'expected {"shoulder_pan": {"range_min": 1024, "range_max": 3072, "drive_mode": 0, ...}, ...}'
    text = read_bounded(path, _LARGEST_CALIBRATION)
    try:
        data = json.loads(text)
        found = {
            str(name): {key: float(motor[key]) for key in ("range_min", "range_max", "drive_mode")}
            for name, motor in data.items()
        }
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError):
        raise DatasetError(str(path), f"not a calibration of LeRobot, {expected}") from None
    for name, motor in found.items():
        if not 0 <= motor["range_min"] < motor["range_max"] <= _TICKS:
            raise DatasetError(str(path), f"range_min and range_max are not 0 to {_TICKS}, rising", field=name)
    return found


def _names(path: Path) -> tuple[str, ...]:
    text = read_bounded(path, _LARGEST_INFO)
    try:
        feature: Any = json.loads(text)["features"][_STATE]
        names = feature["names"]
        # Some write {"motors": [...]}.
        names = next(iter(names.values())) if isinstance(names, dict) else names
        return tuple(str(name).removesuffix(".pos") for name in names)
    except (ValueError, LookupError, TypeError, AttributeError, StopIteration, RecursionError):
        raise DatasetError(str(path), f"not the info.json of LeRobot, expected features.{_STATE}.names") from None


def _array(folder: Path, values: Sequence[Any], count: int) -> Array:
    try:
        array = np.array(values, dtype=np.float64)
    except (ValueError, TypeError):
        array = np.zeros(0)
    if array.shape != (len(values), count) or not np.isfinite(array).all():
        raise DatasetError(str(folder), f"expected {count} finite numbers in every {_STATE}")
    return array


def _radians(
    episode: Episode, place: int, unit: JointUnit, calibration: Mapping[str, Mapping[str, float]] | None
) -> Array:
    values: Array = episode.values[:, place]
    if unit != "normalised":
        return values if unit == "rad" else np.radians(values)
    name = episode.names[place]
    if calibration is None or name not in calibration:
        raise InputError(f"normalised values need the range of {name!r}: give --calibration with LeRobot's file of it")
    motor = calibration[name]
    ticks = values / 100 * (motor["range_max"] - motor["range_min"]) / 2
    turned: Array = (-1.0 if motor["drive_mode"] else 1.0) * ticks * 2 * math.pi / _TICKS
    return turned
