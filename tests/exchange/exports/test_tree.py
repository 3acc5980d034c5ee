"""Tests of frames as a tree."""

from __future__ import annotations

import numpy as np

from basecal.exchange.exports.choice import chosen_transforms
from basecal.exchange.exports.exporter import NamedTransform
from basecal.exchange.exports.tree import frame_trees
from basecal.geometry import SE3, PoseEstimate
from export_example import BASE, CALIBRATION, CELL, MOUNT

ESTIMATE = PoseEstimate.exact(SE3.from_rpy([0, 0, 0], [1, 0, 0]))


def test_transform_becomes_root_with_child():
    """Names are those of the other program; the root has no pose."""
    (root,) = frame_trees(chosen_transforms(CALIBRATION, CELL, BASE))
    assert (root.name, root.parent_from_frame) == ("left base's", None)
    (child,) = root.children
    assert child.name == "right_base"
    np.testing.assert_array_equal(child.parent_from_frame.matrix, CALIBRATION[BASE].mean.matrix)


def test_chained_transforms_are_nested():
    """A frame known in a second one that is known in a third is nested; unconnected frames are separate trees."""
    named = {name: name.split("_from_") for name in ("b_from_c", "a_from_b", "x_from_y")}
    chain = tuple(NamedTransform(name, *frames, ESTIMATE, "free") for name, frames in named.items())
    first, second = frame_trees(chain)
    assert (first.name, first.children[0].name, first.children[0].children[0].name) == ("a", "b", "c")
    assert (second.name, second.children[0].name) == ("x", "y")


def test_colliding_frames_keep_cell_names():
    """Two flanges called `tool0` keep the names of the cell."""
    (mount,) = chosen_transforms(CALIBRATION, CELL, MOUNT)
    other = NamedTransform("hand_flange_from_board", mount.parent, "board", ESTIMATE, "free")
    assert [place.name for place in frame_trees((mount, other))] == ["eye_flange", "hand_flange"]
