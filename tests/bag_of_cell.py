"""Bags of ROS written from a recording: arms that go from stop to stop, and what cameras saw at each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from basecal.cell import PoseObservation, Recording
from basecal.geometry import SE3

Kind = Literal["ros1", "sqlite3", "mcap"]
KINDS: tuple[Kind, ...] = ("ros1", "sqlite3", "mcap")
BEGIN_S = 1_700_000_000.0
STOP_S, MOVE_S, RATE = 1.0, 0.6, 30.0  # how long arms stand and move, and records a second


@dataclass
class Wrote:
    """What writes messages of one kind of bag.

    Attributes:
        kind: Of the bag.
        path: Where it is.
        messages: (topic, type, time [s], message), in any order.
    """

    kind: Kind
    path: Path
    messages: list[tuple[str, str, float, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.store = get_typestore(Stores.ROS1_NOETIC if self.kind == "ros1" else Stores.ROS2_HUMBLE)
        if self.kind == "ros1":
            self.store.register(
                get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage")
            )

    def make(self, kind: str, *values: Any) -> Any:
        return self.store.types[kind](*values)

    def header(self, time: float, frame: str = "") -> Any:
        whole, part = divmod(round(time * 1e9), 10**9)
        stamp = self.make("builtin_interfaces/msg/Time", whole, part)
        first = (0,) if self.kind == "ros1" else ()
        return self.make("std_msgs/msg/Header", *first, stamp, frame)

    def add(self, topic: str, kind: str, time: float, message: Any) -> None:
        self.messages.append((topic, kind, time, message))

    def pose(self, topic: str, time: float, pose: SE3) -> None:
        point = self.make("geometry_msgs/msg/Point", *map(float, pose.translation))
        turn = self.make("geometry_msgs/msg/Quaternion", *map(float, pose.quaternion))
        kind = "geometry_msgs/msg/PoseStamped"
        inner = self.make("geometry_msgs/msg/Pose", point, turn)
        self.add(topic, kind, time, self.make(kind, self.header(time, "camera"), inner))

    def transforms(self, topic: str, time: float, each: Mapping[tuple[str, str], SE3]) -> None:
        found = []
        for (parent, child), pose in each.items():
            move = self.make("geometry_msgs/msg/Vector3", *map(float, pose.translation))
            turn = self.make("geometry_msgs/msg/Quaternion", *map(float, pose.quaternion))
            inner = self.make("geometry_msgs/msg/Transform", move, turn)
            found.append(self.make("geometry_msgs/msg/TransformStamped", self.header(time, parent), child, inner))
        kind = "tf2_msgs/msg/TFMessage"
        self.add(topic, kind, time, self.make(kind, found))

    def joints(self, topic: str, time: float, names: list[str], values: np.ndarray) -> None:
        kind, none = "sensor_msgs/msg/JointState", np.zeros(0)
        self.add(topic, kind, time, self.make(kind, self.header(time), names, np.asarray(values), none, none))

    def text(self, topic: str, text: str) -> None:
        self.add(topic, "std_msgs/msg/String", BEGIN_S, self.make("std_msgs/msg/String", text))

    def image(self, topic: str, time: float, pixels: np.ndarray, encoding: str = "mono8", frame: str = "") -> None:
        height, width = pixels.shape[:2]
        data = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
        kind = "sensor_msgs/msg/Image"
        parts = (height, width, encoding, 0, data.shape[1], data.ravel())
        self.add(topic, kind, time, self.make(kind, self.header(time, frame), *parts))

    def compressed(self, topic: str, time: float, content: bytes, name: str = "jpeg") -> None:
        kind = "sensor_msgs/msg/CompressedImage"
        data = np.frombuffer(content, dtype=np.uint8)
        self.add(topic, kind, time, self.make(kind, self.header(time), name, data))

    def camera_info(
        self, topic: str, time: float, size: tuple[int, int], k: np.ndarray, d: np.ndarray, model: str = "plumb_bob"
    ) -> None:
        kind = "sensor_msgs/msg/CameraInfo"
        roi = self.make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        p = np.hstack([k.reshape(3, 3), np.zeros((3, 1))]).ravel()
        parts = (size[1], size[0], model, d, k, np.eye(3).ravel(), p, 0, 0, roi)
        self.add(topic, kind, time, self.make(kind, self.header(time), *parts))

    def close(self) -> Path:
        """Write all messages by their times."""
        if self.kind == "ros1":
            writer: Any = Writer1(self.path)
        else:
            plugin = StoragePlugin.MCAP if self.kind == "mcap" else StoragePlugin.SQLITE3
            writer = Writer2(self.path, version=9, storage_plugin=plugin)
        serialize = self.store.serialize_ros1 if self.kind == "ros1" else self.store.serialize_cdr
        with writer:
            kinds = {topic: kind for topic, kind, *_ in self.messages}
            connections = {
                name: writer.add_connection(name, kind, typestore=self.store) for name, kind in kinds.items()
            }
            for topic, kind, time, message in sorted(self.messages, key=lambda each: each[2]):
                writer.write(connections[topic], round(time * 1e9), serialize(message, kind))
        return self.path


def new_bag(folder: Path, kind: Kind) -> Wrote:
    """A bag to be written."""
    return Wrote(kind, folder / ("bag.bag" if kind == "ros1" else f"bag_{kind}"))


def middles(count: int) -> np.ndarray:
    """Times [s] at which arms have stood for half a stop."""
    return BEGIN_S + np.arange(count) * (STOP_S + MOVE_S) + STOP_S / 2


def journey(count: int) -> Iterator[tuple[float, int, float]]:
    """Times of records [s], the stop that was left, and the share of the way to the next."""
    last = count * (STOP_S + MOVE_S) - MOVE_S
    for k in range(int(last * RATE)):
        stop, since = divmod(k / RATE, STOP_S + MOVE_S)
        yield BEGIN_S + k / RATE, int(stop), max(0.0, since - STOP_S) / MOVE_S


def between(poses: SE3, stop: int, share: float) -> SE3:
    """A pose between two stops."""
    if share == 0 or stop + 1 >= len(poses):
        return poses[stop]
    return poses[stop] @ SE3.exp(share * (poses[stop].inverse() @ poses[stop + 1]).log())


def bag_by_tf(folder: Path, kind: Kind, recording: Recording, seen: bool = True) -> Wrote:
    """Frames `<robot>_base_link` to `<robot>_tool0` with a link between, and views of a target as PoseStamped."""
    bag, count = new_bag(folder, kind), len(recording.samples)
    robots = list(recording.samples[0].robots)
    poses = {name: SE3.stack([s.robots[name].base_from_flange for s in recording.samples]) for name in robots}
    half = SE3.exp(np.array([0.1, 0.0, 0.2, 0.3, 0.0, 0.1]))
    bag.transforms("/tf_static", BEGIN_S, {(f"{name}_wrist", f"{name}_tool0"): half for name in robots})
    for time, stop, share in journey(count):
        moved = {
            (f"{name}_base_link", f"{name}_wrist"): between(poses[name], stop, share) @ half.inverse()
            for name in robots
        }
        bag.transforms("/tf", time, moved)
    for sample, time in zip(recording.samples, middles(count), strict=True):
        for view in sample.observations if seen else ():
            assert isinstance(view, PoseObservation)
            for late in (-0.2, 0.0, 0.2):
                bag.pose(f"/{view.camera}/{view.target}", float(time) + late, view.camera_from_target)
    return bag
