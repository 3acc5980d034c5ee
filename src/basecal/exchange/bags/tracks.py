"""Tracks of robots and targets, and times of images, from one pass over a bag without storing images."""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np

from basecal.errors import InputError
from basecal.exchange.bags.bag import TF, Bag, Message, message_time
from basecal.exchange.bags.frames import Tree, compose_path, pose_from_values, pose_values, transform_values
from basecal.exchange.bags.sources import BagSources, ByFrames, ByJoints, ByPoses, ByTagPoses, ByTags
from basecal.exchange.bags.survey import Survey, plain_frame
from basecal.exchange.bags.tags import SeenTags, tag_corners
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import SE3, Array

LEAST_APART_S = 0.0075
"""Shortest time between kept records of a robot [s]: more than 125 per second add no information."""


T = TypeVar("T")
_Listeners = defaultdict[str, list[Callable[[Message], None]]]
_Source = ByFrames | ByPoses | ByJoints | ByTagPoses


@dataclass(frozen=True, eq=False)
class Track:
    """Poses, joints or tag corners over time.

    Attributes:
        times: (n,) [s], ascending.
        poses: (n,) poses; None if not recorded.
        joints: (n, k) [rad]; None if not recorded.
        tags: n sets of tag corners; None if not recorded.
    """

    times: Array
    poses: SE3 | None = None
    joints: Array | None = None
    tags: tuple[SeenTags, ...] | None = None


@dataclass(frozen=True, eq=False)
class Tracks:
    """All tracks of a bag.

    Attributes:
        robots: Tracks of robots by name.
        views: Tracks of targets in cameras, by the names of camera and target.
        images: Times [s] of each camera's images, in the order of recording.
    """

    robots: Mapping[str, Track]
    views: Mapping[tuple[str, str], Track]
    images: Mapping[str, Array]


@dataclass(eq=False)
class _Buffer:
    """Buffer of the times and values of one source."""

    width: int
    times: array[float] = field(default_factory=lambda: array("d"))
    values: array[float] = field(default_factory=lambda: array("d"))

    def add(self, time: float, values: Array) -> None:
        """Append values, unless they follow the last ones within `LEAST_APART_S`."""
        if not self.times or not 0 <= time - self.times[-1] < LEAST_APART_S:
            self.times.append(time)
            self.values.extend(values.tolist())

    def arrays(self) -> tuple[Array, Array]:
        """Return ascending unique times, (n,), and values, (n, width)."""
        times, first = np.unique(np.array(self.times), return_index=True)
        return times, np.array(self.values).reshape(-1, self.width)[first]


def read_tracks(bag: Bag, survey: Survey, selection: BagSources) -> Tracks:
    """Read the tracks of all selected sources.

    Raises:
        InputError: if a source was never recorded, or its values are not valid poses.
    """
    listeners: _Listeners = defaultdict(list)
    sources: dict[str | tuple[str, str], _Source] = dict(selection.robots.items())
    sources.update({key: view for key, view in selection.views.items() if not isinstance(view, ByTags)})
    tags_by_time: dict[tuple[str, str], dict[float, SeenTags]] = {}
    for key, view in selection.views.items():
        if isinstance(view, ByTags):
            tags_by_time[key] = {}
            listeners[view.topic].append(_listener(partial(tag_corners, tags=view.tags), tags_by_time[key].__setitem__))
    buffers = {key: _collector(bag, survey.tree, source, listeners) for key, source in sources.items()}
    images = {name: array("d") for name in selection.cameras}
    for name, camera in selection.cameras.items():
        listeners[camera.topic].append(_listener(lambda message: message, partial(_keep_time, images[name])))
    for message in bag.read(listeners):
        for listener in listeners[message.topic.name]:
            listener(message)
    tracks = {key: _track(bag.path, survey.tree, key, source, buffers[key]) for key, source in sources.items()}
    tags = {key: _tags(bag.path, key, selection.views[key], found) for key, found in tags_by_time.items()}
    return Tracks(
        {name: tracks[name] for name in selection.robots},
        {key: tags[key] if key in tags else tracks[key] for key in selection.views},
        {name: np.array(times) for name, times in images.items()},
    )


def _collector(bag: Bag, tree: Tree, source: _Source, listeners: _Listeners) -> _Buffer:
    """Register listeners for a source's messages, and return their buffer."""
    if isinstance(source, ByFrames):
        moving = _moving_frames(tree, source)
        buffer = _Buffer(7 * len(moving))
        for topic in bag.topics_of_type(TF):
            listeners[topic.name].append(_frame_listener(buffer, moving))
        return buffer
    read: Callable[[Any], Array | None]
    if isinstance(source, ByPoses):
        width, read = 7, _stamped_pose
    elif isinstance(source, ByTagPoses):
        width, read = 8, source.frames.nearest_tag
    else:
        width, read = len(source.chain.joint_names), partial(_joint_values, source.chain.joint_names)
    buffer = _Buffer(width)
    listeners[source.topic].append(_listener(read, buffer.add))
    return buffer


def _moving_frames(tree: Tree, source: ByFrames) -> list[str]:
    """Frames on a source's path that move; if none moves, one that /tf reports repeatedly."""
    children = [step.child for step in tree.path(source.parent, source.child)]
    moving = [child for child in children if not tree.transforms[child].is_fixed]
    timed = [child for child in children if tree.transforms[child].is_timed]
    if not moving and not timed:
        raise InputError(f"{source}: only /tf_static connects these frames, without times: choose other frames")
    return moving or timed[:1]


def _frame_listener(buffer: _Buffer, moving: list[str]) -> Callable[[Message], None]:
    """Create a listener to /tf that stores times at which all moving frames are reported."""
    latest: dict[str, tuple[tuple[int, int], Array]] = {}

    def listen(message: Message) -> None:
        """Store the transforms once all moving frames have the same time stamp."""
        for each in message.data.transforms:
            child = plain_frame(each.child_frame_id)
            if child not in moving:
                continue
            stamp = each.header.stamp
            latest[child] = (stamp.sec, stamp.nanosec), transform_values(each.transform)
            if len(latest) == len(moving) and len({time for time, _ in latest.values()}) == 1:
                values = np.concatenate([latest[child][1] for child in moving])
                buffer.add(message_time(each.header, message.recorded_s), values)

    return listen


def _listener(read: Callable[[Any], T | None], keep: Callable[[float, T], None]) -> Callable[[Message], None]:
    """Create a listener that passes the values read from messages, with their times, to `keep`."""

    def listen(message: Message) -> None:
        """Pass the message's value on, if it has one."""
        found = read(message.data)
        if found is not None:
            keep(message_time(message.data.header, message.recorded_s), found)

    return listen


def _stamped_pose(message: Any) -> Array:
    return pose_values(message.pose)


def _keep_time(times: array[float], time: float, _: object) -> None:
    times.append(time)


def _joint_values(names: tuple[str, ...], message: Any) -> Array | None:
    """Joint values in the order of `names`; None if a joint is missing."""
    index = {name: k for k, name in enumerate(message.name)}
    if not all(name in index and index[name] < len(message.position) for name in names):
        return None
    return np.array([message.position[index[name]] for name in names], dtype=np.float64)


def _tags(path: str, key: tuple[str, str], source: object, by_time: Mapping[float, SeenTags]) -> Track:
    if not by_time:
        raise InputError(f"{path}: {key[1]} seen by {key[0]}: {source}: no tag was found in any image")
    times = sorted(by_time)
    return Track(np.array(times), tags=tuple(by_time[time] for time in times))


def _track(path: str, tree: Tree, key: str | tuple[str, str], source: _Source, buffer: _Buffer) -> Track:
    name = key if isinstance(key, str) else " seen by ".join(reversed(key))
    if not buffer.times:
        why = "its frames never share a time stamp" if isinstance(source, ByFrames) else "no message holds its pose"
        raise InputError(f"{path}: {name}: {source}: {why}")
    times, values = buffer.arrays()
    subject = f"{path}: {name}: {source}"
    if not np.all(np.abs(values) <= LARGEST_VALUE):
        raise InputError(f"{subject}: not all numbers are finite, and within {LARGEST_VALUE:g}")
    if isinstance(source, ByJoints):
        return Track(times, joints=values)
    if isinstance(source, ByPoses):
        return Track(times, pose_from_values(values, subject))
    if isinstance(source, ByTagPoses):
        return Track(times, source.frames.target_poses(pose_from_values(values[:, :7], subject), values[:, 7]))
    moving = _moving_frames(tree, source)
    motions = {child: values[:, 7 * k : 7 * k + 7] for k, child in enumerate(moving)}
    return Track(times, compose_path(tree, tree.path(source.parent, source.child), motions, subject))
