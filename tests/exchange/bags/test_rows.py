"""Tests of rows of stops and of streams, and of writing images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, new_bag

from basecal.cell import PoseObservation
from basecal.errors import InputError
from basecal.exchange.bags import rows
from basecal.exchange.bags.bag import open_bag
from basecal.exchange.bags.rows import (
    _LARGEST_GAP_S,
    _REST_MARGIN_S,
    _STILL_RAD_M,
    _state_at_rest,
    collect_entries,
    explain_no_stop,
    find_stops,
    make_rows,
    still_instants,
    stream_instants,
    write_images,
)
from basecal.exchange.bags.sources import BagSources, CameraSource
from basecal.exchange.bags.tracks import Track, Tracks
from basecal.geometry import SE3

TIMES = BEGIN_S + np.arange(0, 1, 0.05)
ARM = Track(TIMES, SE3.exp(np.zeros((20, 6))))
TAG = Track(TIMES[5:7], SE3.exp(np.ones((2, 6)) * 0.1))
RATE = 100.0


def test_each_record_and_view_has_row(tmp_path: Path) -> None:
    """Rows are sorted by time, with robots and views on separate lines."""
    tracks = Tracks({"arm": ARM}, {("eye", "tag"): TAG}, {})
    rows = list(make_rows(tracks, stream_instants(tracks, "x"), {}))
    assert len(rows) == 22
    assert [row.stamp_s for row in rows] == sorted(row.stamp_s for row in rows)
    assert sum(bool(row.robots) for row in rows) == 20
    assert not any(row.robots and row.observations for row in rows)


def test_only_middle_image_of_stop_is_written(tmp_path: Path) -> None:
    """The middle one of three images of a stop is written under its time, beside the pose of a target."""
    writer, seen = new_bag(tmp_path, "mcap"), BEGIN_S + np.array([0.3, 0.5, 0.7])
    for k, time in enumerate(seen):
        writer.image("/eye/image_raw", float(time), np.full((3, 4), k, np.uint8))
    tracks = Tracks({"arm": ARM}, {("eye", "tag"): TAG}, {"eye": seen})
    instants = still_instants(tracks, "x")
    folder = tmp_path / "pictures"
    folder.mkdir()
    with open_bag(writer.close()) as bag:
        taken = BagSources(cameras={"eye": CameraSource("/eye/image_raw", None, "arm")})
        written = write_images(bag, taken, instants, folder)
    (row,) = make_rows(tracks, instants, written)
    assert [path.name for path in folder.rglob("*.*")] == [f"{seen[1]:.6f}.pgm"]
    assert row.images["eye"].read_bytes().endswith(bytes([1] * 12))
    assert isinstance(row.observations[0], PoseObservation)


@pytest.mark.journey
def test_too_many_lines_are_refused() -> None:
    """More lines than a recording may hold are an error with both counts."""
    many = Track(np.arange(200_001.0), joints=np.zeros((200_001, 1)))
    with pytest.raises(InputError, match="200001 lines, expected at most 200000"):
        stream_instants(Tracks({"arm": many}, {}, {}), "x")


def test_stops_without_images_or_views_are_refused() -> None:
    """Without images and views the error refers to --view and --list."""
    with pytest.raises(InputError, match=r"no image, and no --view names a topic .*: --list shows"):
        still_instants(Tracks({"arm": ARM}, {}, {}), "x")


def path(times: np.ndarray, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Return (n, 2) joints that rest for a second at 0, 1, 2 ... and move for a second between."""
    part = times / 2
    at = np.floor(part) + np.clip((part - np.floor(part)) * 2 - 1, 0, 1)
    return np.stack([at, -at], axis=1) + noise * np.random.default_rng(seed).standard_normal((len(times), 2))


def tracks(noise: float = 0.0, images: np.ndarray | None = None, rate: float = RATE) -> Tracks:
    times = np.arange(0, 7, 1 / rate)
    seen = np.arange(0.0, 7, 0.1) if images is None else images
    return Tracks({"arm": Track(times, joints=path(times, noise))}, {}, {"eye": seen})


def test_each_stop_gives_one_middle_sample() -> None:
    """Each stop gives one sample from its middle with its mean joints."""
    found = find_stops(tracks())
    assert [round(stop.entries[0].stamp_s, 1) for stop in found] == [0.5, 2.5, 4.5, 6.5]
    for k, stop in enumerate(found):
        np.testing.assert_allclose(stop.robots["arm"].joints_rad, [k, -k], atol=1e-12)


def test_read_back_noise_is_averaged() -> None:
    """Noise of 0.1 mrad equals a tenth of a degree per second over 0.06 s; all stops are found nevertheless."""
    found = find_stops(tracks(noise=1e-4))
    assert len(found) == 4
    off = [np.abs(stop.robots["arm"].joints_rad - [k, -k]).max() for k, stop in enumerate(found)]
    # A mean of 30 has a sigma of 0.018 mrad; the limit is four sigmas.
    assert max(off) < 8e-5


def test_slow_motion_is_no_stop() -> None:
    """A motion of a milliradian per second, which over 0.3 s is three times the stillness limit, is no stop."""
    times = np.arange(0, 3, 1 / RATE)
    slow = Track(times, joints=1e-3 * times[:, None])
    assert find_stops(Tracks({"arm": slow}, {}, {"eye": np.array([1.0, 2.0])})) == ()
    turning = Track(times, joints=2e-2 * (times[:, None] - 1.0) ** 2)
    assert find_stops(Tracks({"arm": turning}, {}, {"eye": np.array([1.0])})) == ()


def test_all_robots_must_rest() -> None:
    """While any robot moves there is no stop."""
    times = np.arange(0, 7, 1 / RATE)
    both = {"a": Track(times, joints=path(times)), "b": Track(times, joints=np.sin(times)[:, None])}
    assert find_stops(Tracks(both, {}, {"eye": np.arange(0, 7, 0.1)})) == ()


def test_stops_are_separated_without_images_between() -> None:
    """One image at each stop gives one sample each, and two images at one stop give one sample."""
    assert len(find_stops(tracks(images=np.array([0.5, 2.5, 4.5])))) == 3
    assert len(find_stops(tracks(images=np.array([0.4, 0.6])))) == 1


def test_poses_are_averaged_on_manifold() -> None:
    """The mean of equal poses is that pose."""
    times = np.arange(0, 1, 1 / RATE)
    pose = SE3.exp(np.array([0.3, 0.2, 0.5, 1.0, 2.0, 0.1]))
    track = Track(times, SE3.stack([pose] * len(times)))
    found = find_stops(Tracks({"arm": track}, {}, {"eye": np.array([0.5])}))[0].robots["arm"].base_from_flange
    assert found is not None
    np.testing.assert_allclose(found.matrix, pose.matrix, atol=1e-12)


def test_missing_stops_are_explained() -> None:
    """The message names a low rate, missing views, or a robot that never rests."""
    assert "recorded every 1 s" in explain_no_stop(tracks(rate=1.0))
    assert "no --view names a topic of poses or tags" in explain_no_stop(tracks(images=np.array([])))
    assert "never all at rest" in explain_no_stop(tracks(images=np.array([1.5])))


def test_entries_are_sorted_and_unique() -> None:
    """Entries have ascending and distinct times."""
    found = collect_entries(tracks(images=np.array([2.0, 1.0, 2.0])))
    assert [(entry.stamp_s, entry.position) for entry in found] == [(1.0, 1), (2.0, 0)]


def test_large_noise_counts_as_motion() -> None:
    """States that scatter by 2 mrad exceed read-back noise, so no stop is found."""
    assert len(find_stops(tracks(noise=3e-4))) == 4
    assert find_stops(tracks(noise=2e-3)) == ()


@pytest.mark.parametrize("time", [0.5004, 0.501, 0.7349, 1.0003])
def test_resting_state_is_mean_around_time(time: float) -> None:
    """The mean includes all records within about a tenth of a second, and the neighbouring ones."""
    times = np.arange(0, 2, 0.01)
    joints = np.stack([1e-6 * times**2, -1e-6 * times], axis=1)
    near = np.abs(times - time) <= _REST_MARGIN_S + 1e-9
    found = _state_at_rest(Track(times, joints=joints), time)
    np.testing.assert_allclose(found, joints[near].mean(0), rtol=1e-9)


def test_resting_state_needs_records_on_both_sides() -> None:
    """A time must have records on both sides within the margin, without a long gap."""
    times = 10 + np.arange(0, 2, 0.01)
    still = Track(times, joints=np.zeros((len(times), 2)))
    first, last = times[0] + _REST_MARGIN_S, times[-1] - _REST_MARGIN_S
    for time, is_known in ((first + 1e-4, True), (first - 1e-4, False), (last - 1e-4, True), (last + 1e-4, False)):
        assert (_state_at_rest(still, time) is not None) == is_known
    for gap_s, is_known in ((0.9 * _LARGEST_GAP_S, True), (1.1 * _LARGEST_GAP_S, False)):
        apart = np.concatenate([times, times[-1] + gap_s + times - times[0]])
        track = Track(apart, joints=np.zeros((len(apart), 2)))
        assert (_state_at_rest(track, times[-1] + 1e-3) is not None) == is_known


def test_four_records_estimate_noise() -> None:
    """Read-back that alternates between two values is at rest with four records; with three it counts as motion."""
    hop = 1.2 * _STILL_RAD_M
    for count, is_known in ((4, True), (3, False)):
        times = np.concatenate([[-10.0], np.linspace(-0.9, 0.9, count) * _REST_MARGIN_S, [10.0]])
        joints = np.array([[0.0], *([hop * (k % 2)] for k in range(count)), [0.0]])
        assert (_state_at_rest(Track(times, joints=joints), 0.0) is not None) == is_known


@pytest.mark.parametrize("most", [22, 21])
def test_line_limit_includes_images_and_views(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """A recording at its limit is accepted, and one line more is refused."""
    monkeypatch.setattr(rows, "MOST_SAMPLES", most)
    both = Tracks({"arm": ARM}, {("eye", "tag"): TAG}, {})
    if most == 22:
        assert len(stream_instants(both, "x")) == 22
    else:
        with pytest.raises(InputError, match="22 lines, expected at most 21: shorten it"):
            stream_instants(both, "x")


def test_all_stream_images_are_written(tmp_path: Path) -> None:
    """The images of a camera are all written into one folder."""
    writer, seen = new_bag(tmp_path, "mcap"), BEGIN_S + np.array([0.3, 0.5])
    for k, time in enumerate(seen):
        writer.image("/eye/image_raw", float(time), np.full((3, 4), k, np.uint8))
    instants = stream_instants(Tracks({}, {}, {"eye": seen}), "x")
    (tmp_path / "images").mkdir()
    with open_bag(writer.close()) as bag:
        taken = BagSources(cameras={"eye": CameraSource("/eye/image_raw", None, "arm")})
        written = write_images(bag, taken, instants, tmp_path / "images")
    assert sorted(path.name for path in written.values()) == [f"{time:.6f}.pgm" for time in seen]
    assert [path.read_bytes()[-1] for _, path in sorted(written.items(), key=lambda item: item[1])] == [0, 1]
