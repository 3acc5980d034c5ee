"""Tests of the cell's entries for the sources selected from a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, Kind, new_bag

from basecal.cell import Cell, CellCamera, CellTarget, Robot
from basecal.errors import DatasetError
from basecal.exchange.bags.entry import bag_entry, bag_lens, urdf_name
from basecal.exchange.bags.frames import Tree
from basecal.exchange.bags.sources import BagRequest, BagSources, ByFrames, ByJoints, ByPoses, CameraSource
from basecal.exchange.bags.survey import Survey
from basecal.exchange.importing.imported import NO_CELL
from basecal.kinematics import SerialChain

K = np.array([500.0, 0, 320, 0, 510, 240, 0, 0, 1])
D = np.array([0.1, -0.2, 0.001, 0.002, 0.05])


def test_new_cell_entries_from_bag(tmp_path: Path, arm: SerialChain) -> None:
    """A new cell gets robots with URDF or frames, cameras with lens or size, and targets with their carrier."""
    bag = new_bag(tmp_path, "mcap")
    bag.camera_info("/w/camera_info", BEGIN_S, (64, 48), np.array([50.0, 0, 32, 0, 50, 24, 0, 0, 1]), np.zeros(5))
    survey = Survey(Tree({}), infos={"/w/camera_info": bag.messages[0][3]})
    taken = BagSources(
        {"a": ByJoints("/js", arm, "base", "tool", "/robot_description"), "b": ByFrames("b0", "b6")},
        {"w": CameraSource("/w/image_raw", "/w/camera_info", "a"), "d": CameraSource("/d/image_raw", None, "world")},
        {("w", "tag"): ByPoses("/tag")},
    )
    entry = bag_entry(NO_CELL, "x", survey, taken, BagRequest(on={"tag": "b"}), {"d": (32, 24), "w": (64, 48)})
    assert entry["reference"] == "a"
    frames = {"frames": {"base": "b0", "flange": "b6"}}
    assert entry["robots"] == {"a": {"urdf": urdf_name("a"), "base_link": "base", "flange_link": "tool"}, "b": frames}
    assert entry["cameras"]["w"]["intrinsics"]["status"] == "fixed"
    assert entry["cameras"]["d"]["size_px"] == [32, 24]
    assert entry["cameras"]["d"]["intrinsics"] == {"status": "free"}
    assert entry["targets"] == {"tag": {"on": "b"}}


def test_existing_cell_entries_are_kept() -> None:
    """Entries that the cell already states are not written again."""
    cell = Cell("a", {"a": Robot("a")}, {}, {"w": CellCamera("w", "a")}, {"tag": CellTarget("tag", "world")})
    taken = BagSources(
        {"a": ByFrames("b0", "b6")}, {"w": CameraSource("/w/image_raw", None, "a")}, {("w", "tag"): ByPoses("/tag")}
    )
    entry = bag_entry(cell, "x", Survey(Tree({})), taken, BagRequest(), {"w": (64, 48)})
    assert entry == {"robots": {"a": {}}, "cameras": {"w": {}}, "targets": {"tag": {}}}


def info(tmp_path: Path, kind: Kind = "mcap", k: np.ndarray = K, model: str = "plumb_bob") -> Any:
    bag = new_bag(tmp_path, kind)
    bag.camera_info("/eye/camera_info", BEGIN_S, (640, 480), k, D, model)
    return bag.messages[0][3]


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_lens_is_read_from_camera_info(kind: Kind, tmp_path: Path) -> None:
    """Parameters and size of a lens are read from the CameraInfo of ROS 1 and ROS 2."""
    found = bag_lens(info(tmp_path, kind), "x", "/eye/image_raw")
    assert found is not None
    assert found.camera.size_px == (640, 480)
    np.testing.assert_array_equal(found.camera.parameters, [500, 510, 320, 240, *D])


def test_rectified_images_have_no_distortion(tmp_path: Path) -> None:
    """The lens of a rectified topic has no distortion terms."""
    found = bag_lens(info(tmp_path), "x", "/eye/image_rect")
    assert found is not None
    np.testing.assert_array_equal(found.camera.parameters, [500, 510, 320, 240])


def test_missing_and_unsupported_lens(tmp_path: Path) -> None:
    """A CameraInfo of zeros gives no lens; an unknown distortion model is an error."""
    assert bag_lens(info(tmp_path, k=np.zeros(9)), "x", "/eye/image_raw") is None
    with pytest.raises(DatasetError, match="'odd' is not supported"):
        bag_lens(info(tmp_path, model="odd"), "x", "/eye/image_raw")


@pytest.mark.parametrize(("topic", "is_rectified"), [
    ("image_rect", True), ("/eye/image_rect_color", True), ("/eye/image_rect/compressed", True),
    ("/eye/image_raw", False), ("/eye/image_raw/compressed", False), ("/image_correct", False),
])  # fmt: skip
def test_rectified_topics_are_recognised_by_name(tmp_path: Path, topic: str, is_rectified: bool) -> None:
    """A part of the topic that begins with image_rect marks rectified images."""
    found = bag_lens(info(tmp_path), "x", topic)
    assert found is not None
    assert (len(found.camera.parameters) == 4) == is_rectified
