"""Tests of the description of selected sources."""

from __future__ import annotations

from types import SimpleNamespace

from basecal.exchange.bags.sources import BagSources, ByFrames, ByJoints, ByPoses, ByTagPoses, CameraSource
from basecal.geometry import SE3
from basecal.kinematics import SerialChain


def test_each_source_has_description_line(arm: SerialChain) -> None:
    """Each robot, camera and target has one line with its topics, frames and URDF."""
    taken = BagSources(
        {
            "a": ByFrames("base", "tool"),
            "b": ByJoints("/js", arm, "b0", "b6", "/rd"),
            "c": ByJoints("/js", arm, "x", "y"),
        },
        {"eye": CameraSource("/eye/image_raw", "/eye/camera_info", "a"), "post": CameraSource("/p", None, "world")},
        {("eye", "tag"): ByPoses("/tag")},
    )
    assert taken.words == [
        "robot 'a': tf, base to tool",
        f"robot 'b': /js, {arm.n} joints from b0 to b6 by the URDF of /rd",
        f"robot 'c': /js, {arm.n} joints from x to y by the cell's URDF",
        "camera 'eye', on 'a': /eye/image_raw with /eye/camera_info",
        "camera 'post', on 'world': /p",
        "target 'tag' seen by 'eye': /tag",
    ]


def test_tag_sources_name_tag_numbers() -> None:
    """Tags are named by their numbers, or as the only one of each image."""
    for tags, words in (({3: SE3.identity(), 5: SE3.identity()}, "tag 3, 5"), ({}, "tag the only one of each image")):
        assert str(ByTagPoses("/tags", SimpleNamespace(tag_from_target=tags))) == f"poses of /tags, {words}"
