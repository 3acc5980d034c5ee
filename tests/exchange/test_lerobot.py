"""Tests of LeRobot's recordings in their documented layout."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.errors import DatasetError, InputError
from basecal.exchange.lerobot import (
    Episode,
    joint_rows,
    motor_indices,
    nearest_frames,
    read_episode,
    read_motor_ranges,
    select_motors,
    still_frames,
)
from basecal.kinematics import SerialChain

pyarrow = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")

ALL = np.arange(1)
DEGREES = np.array([[0, -90, 90, 10, -20, 30, 40.0], [5, -80, 80, 12, -22, 33, 41], [9, -70, 70, 14, -24, 36, 42]])


def dataset(folder: Path, names: object, layout: str = "data/chunk-000/episode_{0:06d}.parquet") -> Path:
    """Write two episodes of three frames, half a second apart; the second one's first motor is 1 higher."""
    (folder / "meta").mkdir(parents=True)
    info = {"codebase_version": "v2.1", "fps": 2, "features": {"observation.state": {"shape": [7], "names": names}}}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    tables: dict[Path, list[dict[str, object]]] = {}
    for episode in (0, 1):
        for frame, row in enumerate(DEGREES + episode * np.eye(7)[0]):
            state = {"observation.state": [float(v) for v in row], "timestamp": frame / 2, "frame_index": frame}
            tables.setdefault(folder / layout.format(episode), []).append({**state, "episode_index": episode})
    for path, rows in tables.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(pyarrow.Table.from_pylist(rows), path)
    return folder


def names_of(chain: SerialChain) -> list[str]:
    return [*(f"{name}.pos" for name in chain.joint_names), "gripper.pos"]


@pytest.mark.parametrize("layout", ["data/chunk-000/episode_{0:06d}.parquet", "data/chunk-000/file-000.parquet"])
@pytest.mark.parametrize("motors", [False, True])
def test_episode_in_degrees_is_read(tmp_path: Path, arm: SerialChain, layout: str, motors: bool) -> None:
    """One file per episode (v2.1) or one for all (v3.0) is read, with names as a list or by motors.

    The gripper is left out.
    """
    names: object = {"motors": names_of(arm)} if motors else names_of(arm)
    for number in (0, 1):
        episode = read_episode(dataset(tmp_path / f"d{number}", names, layout), number)
        rows = joint_rows(episode, "left", arm, "deg", None, still_frames(episode, 0.0))
        joints = np.array([row.robots["left"].joints_rad for row in rows])
        np.testing.assert_allclose(np.degrees(joints), DEGREES[:, :6] + number * np.eye(6)[0], atol=1e-9)
        assert [row.stamp_s for row in rows] == [0, 0.5, 1]


def test_motors_are_assigned_by_name_or_order(tmp_path: Path, arm: SerialChain) -> None:
    """Motors are assigned by name in any order, or in order if their names differ; otherwise the error lists both."""
    names = names_of(arm)
    turned = read_episode(dataset(tmp_path / "a", [*names[1:6], names[6], names[0]]), 0)
    first = joint_rows(turned, "left", arm, "deg", None, ALL)[0].robots["left"].joints_rad
    np.testing.assert_allclose(np.degrees(first), DEGREES[0, [6, 0, 1, 2, 3, 4]])
    other = read_episode(dataset(tmp_path / "b", ["gripper", *"abcdef"]), 0)
    first = joint_rows(other, "left", arm, "deg", None, ALL)[0].robots["left"].joints_rad
    np.testing.assert_allclose(np.degrees(first), DEGREES[0, 1:])
    with pytest.raises(InputError, match="motors a, b, c, d, e, f, g, the URDF has the joints"):
        joint_rows(read_episode(dataset(tmp_path / "c", list("abcdefg")), 0), "left", arm, "deg", None, ALL)


def test_motor_order_contradicting_names_is_refused() -> None:
    """Five of six motors have joint names but in reverse, so in order they would be other joints."""
    motors = ["f", "E", "d", "c", "b", "a", "gripper"]
    with pytest.raises(InputError, match="in order, f would be a; name all motors as the joints"):
        motor_indices(motors, list("abcdef"))
    assert motor_indices(["a", "b", "gripper", "C"], list("abc")) == [0, 1, 3]


def test_radians_read_as_degrees_are_refused(tmp_path: Path, arm: SerialChain) -> None:
    """An episode in which no joint exceeds a few degrees is in radians."""
    degrees = read_episode(dataset(tmp_path / "a", names_of(arm)), 0)
    radians = replace(degrees, values=np.radians(degrees.values))
    with pytest.raises(InputError, match=r"no joint of 3 rows is beyond 1.57 degrees.*: give --unit rad"):
        joint_rows(radians, "left", arm, "deg", None, ALL)
    first = joint_rows(radians, "left", arm, "rad", None, ALL)[0].robots["left"].joints_rad
    np.testing.assert_allclose(first, np.radians(DEGREES[0, :6]))


def test_normalised_positions_use_motor_range(tmp_path: Path, arm: SerialChain) -> None:
    """-100 to 100 is a motor's range about its middle with 4095 ticks per turn, reversed by its drive mode."""
    episode = read_episode(dataset(tmp_path / "d", names_of(arm)), 0)
    motor = {"id": 1, "drive_mode": 0, "homing_offset": 12, "range_min": 1024, "range_max": 3072}
    motors = {name: motor | {"drive_mode": int(i == 1)} for i, name in enumerate(arm.joint_names)}
    (tmp_path / "arm.json").write_text(json.dumps(motors))
    ranges = read_motor_ranges(tmp_path / "arm.json")
    first = joint_rows(episode, "left", arm, "normalised", ranges, ALL)[0].robots["left"].joints_rad
    assert first is not None
    # lerobot: norm = (ticks - min) / (max - min) * 200 - 100, degrees = (ticks - middle) * 360 / 4095.
    ticks = (np.array([0, 90, 90, 10, -20, 30]) + 100) / 200 * 2048 + 1024
    np.testing.assert_allclose(np.degrees(first), (ticks - 2048) * 360 / 4095, atol=1e-9)
    with pytest.raises(InputError, match="give --calibration"):
        joint_rows(episode, "left", arm, "normalised", None, ALL)


def episode_of(values: np.ndarray, stamps_s: np.ndarray) -> Episode:
    return Episode(tuple(f"m{k}" for k in range(values.shape[1])), values, stamps_s)


def test_stillest_frame_of_each_period() -> None:
    """The frame with least motion of each second is chosen, whatever the units and beside resting motors.

    A period of zero keeps all frames.
    """
    moved = np.arange(20.0)
    moved[4], moved[14] = moved[3], moved[13]
    episode = episode_of(moved[:, None] * [1.0, 100.0, 0.0] + [0.0, 0.0, 40.0], np.arange(20) / 10)
    assert still_frames(episode, 1.0).tolist() == [3, 13]
    assert still_frames(episode, 0.0).tolist() == list(range(20))


def test_frames_at_rest_among_slow_motion() -> None:
    """Encoders jitter by a step at rest, so slow ends of a motion below one step per frame do not count as rest."""
    rng = np.random.default_rng(2)
    stops, step = rng.uniform(-60, 60, (37, 12)), 360 / 4096
    part = np.clip((np.arange(150) - 60) / 90, 0, 1)[:, None]
    share = part**3 * (10 - 15 * part + 6 * part**2)
    exact = (stops[:-1, None] + share * (stops[1:] - stops[:-1])[:, None]).reshape(-1, 12)
    values = step * np.round((exact + rng.normal(0, 0.06, exact.shape)) / step)
    chosen = still_frames(episode_of(values, np.arange(len(values)) / 30), 5.0)
    assert len(chosen) == 36
    assert (chosen % 150 < 60).all()


def test_nearest_frames_to_samples() -> None:
    """Each frame is used once, and none too far from its sample."""
    episode = episode_of(np.zeros((4, 1)), np.array([0.0, 1.0, 2.0, 3.0]))
    assert nearest_frames(episode, np.array([2.04, 0.96, 1.98, 2.9])).tolist() == [1, 2]


def test_invalid_datasets_are_reported(tmp_path: Path) -> None:
    """A missing episode, a folder without info, a table without its columns, and an invalid calibration are errors."""
    with pytest.raises(DatasetError, match="has no episode 7; it has 0 to 1"):
        read_episode(dataset(tmp_path / "a", list("abcdefg")), 7)
    with pytest.raises(DatasetError, match=r"info.json: cannot be read"):
        read_episode(tmp_path, 0)
    folder = dataset(tmp_path / "b", list("abcdefg"))
    (folder / "data" / "chunk-000" / "episode_000000.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(DatasetError, match="not a table of LeRobot"):
        read_episode(folder, 0)
    with pytest.raises(DatasetError, match="expected 6 finite numbers"):
        read_episode(dataset(tmp_path / "c", list("abcdef")), 0)
    (tmp_path / "x.json").write_text('{"a": {"range_min": 5, "range_max": 5, "drive_mode": 0}}')
    with pytest.raises(DatasetError, match="a: range_min and range_max"):
        read_motor_ranges(tmp_path / "x.json")
    (tmp_path / "x.json").write_text(f'{{"a": {{"range_min": 0, "range_max": 1{"0" * 400}, "drive_mode": 0}}}}')
    with pytest.raises(DatasetError, match=r"a\.range_max: is .* beyond|a.range_max"):
        read_motor_ranges(tmp_path / "x.json")


def test_motors_of_one_arm_are_selected(tmp_path: Path, arm: SerialChain) -> None:
    """Motors are selected by a name pattern and then named like the URDF's joints."""
    names = [*(f"left_{name}.pos" for name in arm.joint_names[:3]), *(f"right_{name}.pos" for name in "abcd")]
    episode = read_episode(dataset(tmp_path / "d", names), 0)
    left = select_motors(episode, "left_*")
    assert left.names == tuple(arm.joint_names[:3])
    np.testing.assert_array_equal(left.values, DEGREES[:, :3])
    with pytest.raises(InputError, match=r"no motor is named middle_\*; there are: left_"):
        select_motors(episode, "middle_*")


def test_periods_start_at_first_frame() -> None:
    """Periods do not depend on the start of the stamps.

    The earlier of two equally still frames is chosen, and a single frame is kept.
    """
    values = np.arange(12.0)[:, None]
    values[2], values[7] = values[1], values[6]
    for begin_s in (0.0, 0.3, 1e6):
        chosen = still_frames(episode_of(values, begin_s + np.arange(12) / 4), 1.5)
        assert chosen.tolist() == still_frames(episode_of(values, np.arange(12) / 4), 1.5).tolist()
        assert len(chosen) == 2
    assert still_frames(episode_of(values[:1], np.zeros(1)), 1.5).tolist() == [0]
    assert still_frames(episode_of(np.zeros((4, 1)), np.arange(4.0)), 2.0).tolist() == [0, 2]


@pytest.mark.parametrize("unit", [1.0, 1e-4, 1e4])
def test_motion_is_relative_to_motor_range(unit: float) -> None:
    """The frame with the least share of either range is chosen, in any units."""
    slow = np.array([[0.0, 0.0], [0.3, 0.0], [0.6, 0.0], [0.62, 0.01], [0.64, 0.02], [1.0, 1.0], [1.3, 2.0]])
    (frame,) = still_frames(episode_of(slow * [1e-3, unit], np.arange(7) * 1.0), 7.0)
    assert frame == 3


def test_nearest_frames_for_any_sample_count() -> None:
    """Each sample has its own nearest frame, with more or fewer frames than samples."""
    few = episode_of(np.zeros((2, 1)), np.array([0.0, 1.0]))
    assert nearest_frames(few, np.array([1.01, 0.0, 0.99, 5.0, 0.02])).tolist() == [0, 1]
    many = episode_of(np.zeros((5, 1)), np.arange(5.0))
    assert nearest_frames(many, np.array([3.0])).tolist() == [3]


@pytest.mark.parametrize(
    ("low", "high", "is_right"),
    [
        (0, 4095, True),
        (0, 1, True),
        (4094, 4095, True),
        (-1, 100, False),
        (0, 4096, False),
        (7, 7, False),
        (8, 7, False),
    ],
)
def test_motor_ranges_lie_within_one_turn(tmp_path: Path, low: int, high: int, is_right: bool) -> None:
    """A range lies within 4095 ticks, with the lower end below the upper one."""
    path = tmp_path / "x.json"
    path.write_text(json.dumps({"a": {"range_min": low, "range_max": high, "drive_mode": 0}}))
    if is_right:
        assert list(read_motor_ranges(path)) == ["a"]
    else:
        with pytest.raises(DatasetError, match="a: range_min and range_max"):
            read_motor_ranges(path)
