"""What a cell must have for what is taken of a bag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tests.bag_of_cell import BEGIN_S, new_bag

from basecal.cell import Cell, CellCamera, CellTarget, Robot
from basecal.exchange.bags.entry import bag_entry, urdf_name
from basecal.exchange.bags.frames import Tree
from basecal.exchange.bags.sources import Asked, ByFrames, ByJoints, ByPoses, CameraSource, Taken
from basecal.exchange.bags.survey import Survey
from basecal.exchange.importing.cell_content import NO_CELL
from basecal.kinematics import SerialChain


def test_a_new_cell(tmp_path: Path, arm: SerialChain) -> None:
    bag = new_bag(tmp_path, "mcap")
    bag.camera_info("/w/camera_info", BEGIN_S, (64, 48), np.array([50.0, 0, 32, 0, 50, 24, 0, 0, 1]), np.zeros(5))
    survey = Survey(Tree({}), infos={"/w/camera_info": bag.messages[0][3]})
    taken = Taken(
        {"a": ByJoints("/js", arm, "base", "tool", "/robot_description"), "b": ByFrames("b0", "b6")},
        {"w": CameraSource("/w/image_raw", "/w/camera_info", "a"), "d": CameraSource("/d/image_raw", None, "world")},
        {("w", "tag"): ByPoses("/tag")},
    )
    entry = bag_entry(NO_CELL, "x", survey, taken, Asked(on={"tag": "b"}), {"d": (32, 24), "w": (64, 48)})
    assert entry["reference"] == "a"
    frames = {"frames": {"base": "b0", "flange": "b6"}}
    assert entry["robots"] == {"a": {"urdf": urdf_name("a"), "base_link": "base", "flange_link": "tool"}, "b": frames}
    assert entry["cameras"]["w"]["intrinsics"]["status"] == "fixed"
    assert entry["cameras"]["d"]["size_px"] == [32, 24]
    assert entry["cameras"]["d"]["intrinsics"] == {"status": "free"}
    assert entry["targets"] == {"tag": {"on": "b"}}


def test_what_the_cell_says_stays() -> None:
    cell = Cell("a", {"a": Robot("a")}, {}, {"w": CellCamera("w", "a")}, {"tag": CellTarget("tag", "world")})
    taken = Taken(
        {"a": ByFrames("b0", "b6")}, {"w": CameraSource("/w/image_raw", None, "a")}, {("w", "tag"): ByPoses("/tag")}
    )
    entry = bag_entry(cell, "x", Survey(Tree({})), taken, Asked(), {"w": (64, 48)})
    assert entry == {"robots": {"a": {}}, "cameras": {"w": {}}, "targets": {"tag": {}}}
