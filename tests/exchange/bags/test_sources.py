"""What is taken, in words."""

from __future__ import annotations

from basecal.exchange.bags.sources import ByFrames, ByJoints, ByPoses, CameraSource, Taken
from basecal.kinematics import SerialChain


def test_a_line_for_each(arm: SerialChain) -> None:
    taken = Taken(
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
