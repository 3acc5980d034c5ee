"""Where robots and targets were, and when images were taken: one pass over a bag, in which no image is kept."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from basecal.cell.target import Tags
from basecal.errors import InputError
from basecal.exchange.bags.bag import TF, Bag, Message, message_time
from basecal.exchange.bags.frames import Tree, compose_path, pose_from_values, transform_values
from basecal.exchange.bags.sources import ByFrames, ByJoints, ByPoses, ByTagPoses, ByTags, Taken
from basecal.exchange.bags.survey import Survey, plain
from basecal.exchange.bags.tags import SeenTags, tag_corners
from basecal.fields.values import LARGEST_VALUE
from basecal.geometry import SE3, Array

LEAST_APART_S = 0.0075
"""Between records of one robot that are kept [s]: 125 a second, as many as arms that stand or swing say anything by."""


_Source = ByFrames | ByPoses | ByJoints | ByTagPoses


@dataclass(frozen=True, eq=False)
class Track:
    """Something at instants.

    Attributes:
        times: (n,) [s], rising.
        poses: (n,); None if something else was recorded.
        joints: (n, k) [rad]; None if something else was.
        tags: n times corners of tags; likewise.
    """

    times: Array
    poses: SE3 | None = None
    joints: Array | None = None
    tags: tuple[SeenTags, ...] | None = None


@dataclass(frozen=True, eq=False)
class Tracks:
    """The tracks that were read in one pass.

    Attributes:
        robots: By name.
        views: Of targets by cameras, by their names.
        images: Of each camera, by name, the times [s] of its images in the order in which they were recorded.
    """

    robots: Mapping[str, Track]
    views: Mapping[tuple[str, str], Track]
    images: Mapping[str, Array]


@dataclass(eq=False)
class _Gathered:
    """Numbers of one source as they come."""

    width: int
    times: array[float] = field(default_factory=lambda: array("d"))
    values: array[float] = field(default_factory=lambda: array("d"))

    def add(self, time: float, values: Array) -> None:
        """Keep them, unless they are hardly later than the last that were kept."""
        if not self.times or not 0 <= time - self.times[-1] < LEAST_APART_S:
            self.times.append(time)
            self.values.extend(values.tolist())

    def arrays(self) -> tuple[Array, Array]:
        """Times, rising, and values, (n, width)."""
        times, first = np.unique(np.array(self.times), return_index=True)
        return times, np.array(self.values).reshape(-1, self.width)[first]


def read_tracks(bag: Bag, survey: Survey, selection: Taken) -> Tracks:
    """Where all that is taken was.

    Raises:
        InputError: if something was never recorded, or what was is no pose.
    """
    listeners: dict[str, list[Callable[[Message], None]]] = {}
    sources: dict[str | tuple[str, str], _Source] = dict(selection.robots.items())
    sources.update({key: view for key, view in selection.views.items() if not isinstance(view, ByTags)})
    seen: dict[tuple[str, str], list[tuple[float, SeenTags]]] = {}
    for key, view in selection.views.items():
        if isinstance(view, ByTags):
            seen[key] = []
            listeners.setdefault(view.topic, []).append(_tag_listener(seen[key], view.tags))
    gathered = {key: _collector(bag, survey.tree, source, listeners) for key, source in sources.items()}
    images = {name: array("d") for name in selection.cameras}
    for name, camera in selection.cameras.items():
        listeners.setdefault(camera.topic, []).append(_time_listener(images[name]))
    for message in bag.read(listeners):
        for listener in listeners[message.topic.name]:
            listener(message)
    tracks = {key: _track(bag.path, survey.tree, key, source, gathered[key]) for key, source in sources.items()}
    tags = {key: _tags(bag.path, key, selection.views[key], found) for key, found in seen.items()}
    return Tracks(
        {name: tracks[name] for name in selection.robots},
        {key: tags[key] if key in tags else tracks[key] for key in selection.views},
        {name: np.array(times) for name, times in images.items()},
    )


def _collector(
    bag: Bag,
    tree: Tree,
    source: _Source,
    listeners: dict[str, list[Callable[[Message], None]]],
) -> _Gathered:
    """The collector of a source's messages."""
    if isinstance(source, ByFrames):
        moving = _moving_frames(tree, source)
        found = _Gathered(7 * len(moving))
        for topic in bag.topics_of_type(TF):
            listeners.setdefault(topic.name, []).append(_frame_listener(found, moving))
    elif isinstance(source, ByPoses):
        found = _Gathered(7)
        listeners.setdefault(source.topic, []).append(_pose_listener(found))
    elif isinstance(source, ByTagPoses):
        found = _Gathered(8)
        listeners.setdefault(source.topic, []).append(_tag_pose_listener(found, source))
    else:
        found = _Gathered(len(source.chain.joint_names))
        listeners.setdefault(source.topic, []).append(_joint_listener(found, source.chain.joint_names))
    return found


def _moving_frames(tree: Tree, source: ByFrames) -> list[str]:
    """The frames of a way that move, or where none does one that /tf reports again and again."""
    children = [step.child for step in tree.way(source.parent, source.child)]
    moving = [child for child in children if not tree.hangs[child].is_fixed]
    timed = [child for child in children if tree.hangs[child].is_timed]
    if not moving and not timed:
        raise InputError(f"{source}: nothing but /tf_static is between them, so that nothing says when: other frames?")
    return moving or timed[:1]


def _frame_listener(collection: _Gathered, moving: list[str]) -> Callable[[Message], None]:
    """A listener to /tf, which keeps instants that all frames that move have."""
    latest: dict[str, tuple[tuple[int, int], Array]] = {}

    def listen(message: Message) -> None:
        """Keep the instant once the last frame of it has come."""
        for each in message.data.transforms:
            child = plain(each.child_frame_id)
            if child not in moving:
                continue
            stamp = each.header.stamp
            latest[child] = (stamp.sec, stamp.nanosec), transform_values(each.transform)
            if len(latest) == len(moving) and len({time for time, _ in latest.values()}) == 1:
                values = np.concatenate([latest[child][1] for child in moving])
                collection.add(message_time(each.header, message.recorded_s), values)

    return listen


def _pose_listener(collection: _Gathered) -> Callable[[Message], None]:
    def listen(message: Message) -> None:
        """Keep a pose at its time."""
        pose = message.data.pose
        p, q = pose.position, pose.orientation
        values = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w], dtype=np.float64)
        collection.add(message_time(message.data.header, message.recorded_s), values)

    return listen


def _tag_pose_listener(collection: _Gathered, source: ByTagPoses) -> Callable[[Message], None]:
    def listen(message: Message) -> None:
        """Keep the pose of the nearest tag that is looked for, at its time."""
        values = source.frames.nearest_tag(message.data)
        if values is not None:
            collection.add(message_time(message.data.header, message.recorded_s), values)

    return listen


def _joint_listener(collection: _Gathered, names: tuple[str, ...]) -> Callable[[Message], None]:
    def listen(message: Message) -> None:
        """Keep the joints at their time, in the order of `names`."""
        place = {name: k for k, name in enumerate(message.data.name)}
        if all(name in place and place[name] < len(message.data.position) for name in names):
            values = np.array([message.data.position[place[name]] for name in names], dtype=np.float64)
            collection.add(message_time(message.data.header, message.recorded_s), values)

    return listen


def _time_listener(times: array[float]) -> Callable[[Message], None]:
    def listen(message: Message) -> None:
        """Keep the time of an image."""
        times.append(message_time(message.data.header, message.recorded_s))

    return listen


def _tag_listener(collection: list[tuple[float, SeenTags]], tags: Tags) -> Callable[[Message], None]:
    def listen(message: Message) -> None:
        """Keep what is seen of the tags at its time."""
        corners = tag_corners(message.data, tags)
        if corners is not None:
            collection.append((message_time(message.data.header, message.recorded_s), corners))

    return listen


def _tags(path: str, key: tuple[str, str], source: object, collection: list[tuple[float, SeenTags]]) -> Track:
    if not collection:
        raise InputError(f"{path}: {key[1]} seen by {key[0]}: {source}: no tag was found in any image")
    by_time = dict(sorted(collection, key=lambda each: each[0]))
    return Track(np.array(list(by_time)), tags=tuple(by_time.values()))


def _track(path: str, tree: Tree, key: str | tuple[str, str], source: _Source, collection: _Gathered) -> Track:
    name = key if isinstance(key, str) else " seen by ".join(reversed(key))
    if not collection.times:
        why = "its frames never have one stamp" if isinstance(source, ByFrames) else "no message says where it was"
        raise InputError(f"{path}: {name}: {source}: {why}")
    times, values = collection.arrays()
    about = f"{path}: {name}: {source}"
    if not np.all(np.abs(values) <= LARGEST_VALUE):
        raise InputError(f"{about}: not all numbers are finite, and within {LARGEST_VALUE:g}")
    if isinstance(source, ByJoints):
        return Track(times, joints=values)
    if isinstance(source, ByPoses):
        return Track(times, pose_from_values(values, about))
    if isinstance(source, ByTagPoses):
        return Track(times, source.frames.target_poses(pose_from_values(values[:, :7], about), values[:, 7]))
    moving = _moving_frames(tree, source)
    moved = {child: values[:, 7 * k : 7 * k + 7] for k, child in enumerate(moving)}
    return Track(times, compose_path(tree, tree.way(source.parent, source.child), moved, about))
