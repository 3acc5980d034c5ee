"""Survey of a bag before the import: frames, first images, lenses, URDFs, names of joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from basecal.errors import DatasetError
from basecal.exchange.bags.bag import CAMERA_INFO, COMPRESSED, IMAGE, JOINTS, TEXT, TF, Bag, Topic
from basecal.exchange.bags.frames import FrameTransform, Tree, transform_values

_STATIC = "tf_static"
_DESCRIPTION = "robot_description"


@dataclass(frozen=True, eq=False)
class Survey:
    """Content of a bag.

    Attributes:
        tree: Frames of tf.
        images: Topics of raw or compressed images.
        frame_ids: Frame of the images, by topic.
        infos: First camera_info of each topic.
        urdfs: Text of each robot_description, by topic.
        joints: Names of all joints in the messages of each topic of joint states.
    """

    tree: Tree
    images: tuple[Topic, ...] = ()
    frame_ids: Mapping[str, str] = field(default_factory=dict)
    infos: Mapping[str, Any] = field(default_factory=dict)
    urdfs: Mapping[str, str] = field(default_factory=dict)
    joints: Mapping[str, frozenset[str]] = field(default_factory=dict)


def survey_bag(bag: Bag) -> Survey:
    """Survey the content of a bag; only the first image of each topic is read."""
    images = tuple(bag.topics_of_type(IMAGE, COMPRESSED))
    texts = [topic for topic in bag.topics_of_type(TEXT) if topic.name.endswith(_DESCRIPTION)]
    joints: dict[str, frozenset[str]] = {}
    for message in bag.read(topic.name for topic in bag.topics_of_type(JOINTS)):
        known = joints.get(message.topic.name, frozenset())
        if not known.issuperset(message.data.name):
            joints[message.topic.name] = known.union(message.data.name)
    infos = tuple(bag.topics_of_type(CAMERA_INFO))
    firsts: dict[str, Any] = {}
    for topic in (*images, *infos, *texts):
        first = next(bag.read([topic.name]), None)
        if first is None:
            raise DatasetError(bag.path, f"{topic.name} has none of its {topic.messages} messages: the bag is damaged")
        firsts[topic.name] = first.data
    return Survey(
        _tree(bag),
        images,
        {topic.name: str(firsts[topic.name].header.frame_id) for topic in images},
        {topic.name: firsts[topic.name] for topic in infos},
        {topic.name: str(firsts[topic.name].data) for topic in texts},
        joints,
    )


def _tree(bag: Bag) -> Tree:
    """Read the tree of frames; a frame moves if its transform differs between messages."""
    transforms: dict[str, FrameTransform] = {}
    for message in bag.read(topic.name for topic in bag.topics_of_type(TF)):
        is_timed = not message.topic.name.endswith(_STATIC)
        for each in message.data.transforms:
            child, parent = plain_frame(each.child_frame_id), plain_frame(each.header.frame_id)
            known = transforms.get(child)
            if known is None:
                transforms[child] = FrameTransform(parent, transform_values(each.transform), True, is_timed)
            elif known.is_fixed and is_timed:
                is_fixed = np.array_equal(transform_values(each.transform), known.values)
                transforms[child] = known._replace(is_fixed=is_fixed, is_timed=True)
    return Tree(transforms)


def plain_frame(frame: str) -> str:
    """A frame's name without the leading slash that tf of ROS 1 used."""
    return frame.removeprefix("/")
