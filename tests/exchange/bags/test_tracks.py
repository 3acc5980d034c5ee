"""Tests of robot tracks, read from a bag in one pass."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, new_bag

from basecal.errors import InputError
from basecal.exchange.bags.bag import open_bag
from basecal.exchange.bags.sources import BagSources, ByFrames, ByPoses, CameraSource
from basecal.exchange.bags.survey import survey_bag
from basecal.exchange.bags.tracks import LEAST_APART_S, Tracks, _Buffer, read_tracks
from basecal.geometry import SE3

POSES = SE3.exp(np.random.default_rng(0).normal(0, 0.4, (5, 6)))


def read(path: Path, taken: BagSources) -> Tracks:
    with open_bag(path) as bag:
        return read_tracks(bag, survey_bag(bag), taken)


def test_moving_frames_are_composed_at_equal_stamps(tmp_path: Path) -> None:
    """Two moving frames of one message are composed with a third that never moves though it is in /tf."""
    writer, times = new_bag(tmp_path, "mcap"), BEGIN_S + np.arange(5) * 0.1
    for k, time in enumerate(times):
        both = {("base", "elbow"): POSES[k], ("elbow", "wrist"): POSES[-k], ("wrist", "tool"): POSES[2]}
        writer.transforms("/tf", float(time), both)
    track = read(writer.close(), BagSources({"arm": ByFrames("base", "tool")})).robots["arm"]
    np.testing.assert_allclose(track.times, times, rtol=0, atol=1e-6)
    assert track.poses is not None
    for k in range(5):
        np.testing.assert_allclose(track.poses[k].matrix, (POSES[k] @ POSES[-k] @ POSES[2]).matrix, atol=1e-12)


def test_frames_without_common_stamps_are_refused(tmp_path: Path) -> None:
    """Moving frames that never share a time stamp cannot be composed."""
    writer = new_bag(tmp_path, "mcap")
    for k in range(4):
        writer.transforms("/tf", BEGIN_S + k * 0.1, {("base", "elbow"): POSES[k]})
        writer.transforms("/tf", BEGIN_S + k * 0.1 + 0.03, {("elbow", "tool"): POSES[k]})
    with pytest.raises(InputError, match="its frames never share a time stamp"):
        read(writer.close(), BagSources({"arm": ByFrames("base", "tool")}))


def test_stationary_arm_keeps_all_records(tmp_path: Path) -> None:
    """An arm that never moves has a record for each message."""
    writer = new_bag(tmp_path, "ros1")
    for k in range(4):
        writer.transforms("/tf", BEGIN_S + k * 0.1, {("base", "tool"): POSES[1]})
    track = read(writer.close(), BagSources({"arm": ByFrames("base", "tool")})).robots["arm"]
    assert len(track.times) == 4


def test_stationary_arm_needs_no_common_stamps(tmp_path: Path) -> None:
    """One of two frames that never move gives the times of an arm, though they never share a time stamp."""
    writer = new_bag(tmp_path, "mcap")
    for k in range(4):
        writer.transforms("/tf", BEGIN_S + k * 0.1, {("base", "elbow"): POSES[1]})
        writer.transforms("/tf", BEGIN_S + k * 0.1 + 0.03, {("elbow", "tool"): POSES[2]})
    track = read(writer.close(), BagSources({"arm": ByFrames("base", "tool")})).robots["arm"]
    assert len(track.times) == 4
    assert track.poses is not None
    np.testing.assert_allclose(track.poses[3].matrix, (POSES[1] @ POSES[2]).matrix, atol=1e-12)


def test_dense_records_are_thinned(tmp_path: Path) -> None:
    """A thousand records per second are thinned to one per 7.5 ms; all image times are kept."""
    writer = new_bag(tmp_path, "mcap")
    for k in range(200):
        writer.pose("/pose", BEGIN_S + k * 1e-3, POSES[k % 5])
        if k % 50 == 0:
            writer.image("/eye/image_raw", BEGIN_S + k * 1e-3, np.zeros((2, 2), np.uint8))
    taken = BagSources({"arm": ByPoses("/pose")}, {"eye": CameraSource("/eye/image_raw", None, "arm")})
    found = read(writer.close(), taken)
    assert np.diff(found.robots["arm"].times).min() >= LEAST_APART_S - 1e-6
    assert len(found.robots["arm"].times) == 25
    np.testing.assert_allclose(found.images["eye"] - BEGIN_S, [0, 0.05, 0.1, 0.15], atol=1e-6)


def test_non_finite_pose_in_bag_is_refused(tmp_path: Path) -> None:
    """A pose with NaN is an error."""
    writer = new_bag(tmp_path, "mcap")
    writer.pose("/pose", BEGIN_S, POSES[0])
    writer.messages[0][3].pose.position.x = float("nan")
    with pytest.raises(InputError, match="not all numbers are finite"):
        read(writer.close(), BagSources({"arm": ByPoses("/pose")}))


def test_records_too_close_in_time_are_dropped() -> None:
    """Records at nearly the same time are dropped; those of clocks that jump back are kept and sorted."""
    gathered = _Buffer(1)
    for time in (1.0, 1.0, 1.0 + 0.5 * LEAST_APART_S, 1.0 + LEAST_APART_S, 0.5):
        gathered.add(time, np.array([time]))
    assert list(gathered.times) == [1.0, 1.0 + LEAST_APART_S, 0.5]
    times, values = gathered.arrays()
    np.testing.assert_array_equal(times, [0.5, 1.0, 1.0 + LEAST_APART_S])
    np.testing.assert_array_equal(values[:, 0], times)
