"""Tests of the survey of a bag's contents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, new_bag

from basecal.errors import DatasetError
from basecal.exchange.bags.bag import IMAGE, Bag, Topic, open_bag
from basecal.exchange.bags.survey import plain_frame, survey_bag
from basecal.geometry import SE3


def test_survey_lists_all_sources(tmp_path: Path) -> None:
    """The survey has moving and fixed frames, frames of images, lenses, URDFs, and the joints of all messages."""
    writer = new_bag(tmp_path, "ros1")
    here, there = SE3.identity(), SE3.exp(np.full(6, 0.1))
    writer.transforms("/tf_static", BEGIN_S, {("/base", "/plate"): here})
    for k, pose in enumerate((here, there)):
        writer.transforms("/tf", BEGIN_S + k, {("base", "tool"): pose, ("tool", "eye"): here})
        writer.joints("/joint_states", BEGIN_S + k, ["a"] if k else ["b", "c"], np.zeros(1 if k else 2))
    writer.text("/left/robot_description", "<robot/>")
    writer.text("/chatter", "hello")
    writer.image("/eye/image_raw", BEGIN_S, np.zeros((4, 6), np.uint8), frame="/eye")
    writer.camera_info("/eye/camera_info", BEGIN_S, (6, 4), np.zeros(9), np.zeros(0))
    with open_bag(writer.close()) as bag:
        found = survey_bag(bag)
    assert set(found.tree.names) == {"base", "plate", "tool", "eye"}
    assert not found.tree.transforms["tool"].is_fixed
    assert found.tree.transforms["eye"].is_fixed
    assert found.tree.transforms["eye"].is_timed
    assert not found.tree.transforms["plate"].is_timed
    assert found.frame_ids == {"/eye/image_raw": "/eye"}
    assert found.infos["/eye/camera_info"].width == 6
    assert found.urdfs == {"/left/robot_description": "<robot/>"}
    assert found.joints == {"/joint_states": frozenset("abc")}
    assert plain_frame("/eye") == "eye"


def test_topic_without_its_messages_is_refused() -> None:
    """A topic with fewer messages than stated is an error, as after damage to a name in the bag."""
    bag = Bag("x.bag", {"/eye": Topic("/eye", IMAGE, 3)}, lambda names: iter(()))
    with pytest.raises(DatasetError, match="/eye has none of its 3 messages"):
        survey_bag(bag)


def test_frames_in_tf_are_timed(tmp_path: Path) -> None:
    """A frame in both /tf_static and /tf is timed, moving or not; one that only /tf_static changes is fixed."""
    writer = new_bag(tmp_path, "ros1")
    here, there = SE3.identity(), SE3.exp(np.full(6, 0.1))
    for k, pose in enumerate((here, there)):
        writer.transforms("/tf_static", BEGIN_S + k, {("base", "plate"): pose})
    writer.transforms("/tf_static", BEGIN_S, {("base", "tool"): here, ("base", "stand"): here})
    for k, pose in enumerate((there, here)):
        writer.transforms("/tf", BEGIN_S + 2 + k, {("base", "tool"): pose, ("base", "stand"): here})
    with open_bag(writer.close()) as bag:
        transforms = survey_bag(bag).tree.transforms
    assert (transforms["plate"].is_fixed, transforms["plate"].is_timed) == (True, False)
    assert (transforms["tool"].is_fixed, transforms["tool"].is_timed) == (False, True)
    assert (transforms["stand"].is_fixed, transforms["stand"].is_timed) == (True, True)
    np.testing.assert_array_equal(transforms["tool"].values, [0, 0, 0, 0, 0, 0, 1])
