"""Rows of stops and of streams, and images written one by one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, new_bag

from basecal.cell import PoseObservation
from basecal.errors import InputError
from basecal.exchange.bags.bag import open_bag
from basecal.exchange.bags.rows import make_rows, still_instants, stream_instants, write_images
from basecal.exchange.bags.sources import CameraSource, Taken
from basecal.exchange.bags.tracks import Track, Tracks
from basecal.geometry import SE3

TIMES = BEGIN_S + np.arange(0, 1, 0.05)
ARM = Track(TIMES, SE3.exp(np.zeros((20, 6))))
TAG = Track(TIMES[5:7], SE3.exp(np.ones((2, 6)) * 0.1))


def test_a_row_for_each_record_and_look(tmp_path: Path) -> None:
    """By time, robots and looks in lines of their own."""
    tracks = Tracks({"arm": ARM}, {("eye", "tag"): TAG}, {})
    rows = list(make_rows(tracks, stream_instants(tracks, "x"), {}))
    assert len(rows) == 22
    assert [row.stamp_s for row in rows] == sorted(row.stamp_s for row in rows)
    assert sum(bool(row.robots) for row in rows) == 20
    assert not any(row.robots and row.observations for row in rows)


def test_images_of_stops_only(tmp_path: Path) -> None:
    """Of three images of one stop the middle one is written, beside the pose of a target; under its time."""
    writer, seen = new_bag(tmp_path, "mcap"), BEGIN_S + np.array([0.3, 0.5, 0.7])
    for k, time in enumerate(seen):
        writer.image("/eye/image_raw", float(time), np.full((3, 4), k, np.uint8))
    tracks = Tracks({"arm": ARM}, {("eye", "tag"): TAG}, {"eye": seen})
    instants = still_instants(tracks, "x")
    folder = tmp_path / "pictures"
    folder.mkdir()
    with open_bag(writer.close()) as bag:
        taken = Taken(cameras={"eye": CameraSource("/eye/image_raw", None, "arm")})
        written = write_images(bag, taken, instants, folder)
    (row,) = make_rows(tracks, instants, written)
    assert [path.name for path in folder.rglob("*.*")] == [f"{seen[1]:.6f}.pgm"]
    assert row.images["eye"].read_bytes().endswith(bytes([1] * 12))
    assert isinstance(row.observations[0], PoseObservation)


def test_more_lines_than_a_recording_holds() -> None:
    many = Track(np.arange(200_001.0), joints=np.zeros((200_001, 1)))
    with pytest.raises(InputError, match="200001 lines, expected at most 200000"):
        stream_instants(Tracks({"arm": many}, {}, {}), "x")


def test_no_stop() -> None:
    with pytest.raises(InputError, match=r"no image, and no --view names a topic .*: --list shows"):
        still_instants(Tracks({"arm": ARM}, {}, {}), "x")
