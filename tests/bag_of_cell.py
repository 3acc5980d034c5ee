"""Bags of ROS written from a recording: arms that go from stop to stop, and views of cameras at each stop."""

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
STOP_S, MOVE_S, RATE_HZ = 1.0, 0.6, 30.0  # durations of a stop and of a move, and rate of records


@dataclass
class BagWriter:
    """Messages of a bag of one kind, written by `close`.

    Attributes:
        kind: Kind of the bag.
        path: Path of the bag.
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

    def make(self, type_name: str, *values: Any) -> Any:
        return self.store.types[type_name](*values)

    def header(self, time: float, frame: str = "") -> Any:
        seconds, nanoseconds = divmod(round(time * 1e9), 10**9)
        stamp = self.make("builtin_interfaces/msg/Time", seconds, nanoseconds)
        sequence = (0,) if self.kind == "ros1" else ()
        return self.make("std_msgs/msg/Header", *sequence, stamp, frame)

    def add(self, topic: str, type_name: str, time: float, message: Any) -> None:
        self.messages.append((topic, type_name, time, message))

    def pose(self, topic: str, time: float, pose: SE3) -> None:
        point = self.make("geometry_msgs/msg/Point", *map(float, pose.translation))
        rotation = self.make("geometry_msgs/msg/Quaternion", *map(float, pose.quaternion))
        kind = "geometry_msgs/msg/PoseStamped"
        pose_message = self.make("geometry_msgs/msg/Pose", point, rotation)
        self.add(topic, kind, time, self.make(kind, self.header(time, "camera"), pose_message))

    def transforms(self, topic: str, time: float, poses: Mapping[tuple[str, str], SE3]) -> None:
        messages = []
        for (parent, child), pose in poses.items():
            translation = self.make("geometry_msgs/msg/Vector3", *map(float, pose.translation))
            rotation = self.make("geometry_msgs/msg/Quaternion", *map(float, pose.quaternion))
            transform = self.make("geometry_msgs/msg/Transform", translation, rotation)
            messages.append(
                self.make("geometry_msgs/msg/TransformStamped", self.header(time, parent), child, transform)
            )
        kind = "tf2_msgs/msg/TFMessage"
        self.add(topic, kind, time, self.make(kind, messages))

    def joints(self, topic: str, time: float, names: list[str], values: np.ndarray) -> None:
        kind, empty = "sensor_msgs/msg/JointState", np.zeros(0)
        self.add(topic, kind, time, self.make(kind, self.header(time), names, np.asarray(values), empty, empty))

    def text(self, topic: str, text: str) -> None:
        self.add(topic, "std_msgs/msg/String", BEGIN_S, self.make("std_msgs/msg/String", text))

    def image(self, topic: str, time: float, pixels: np.ndarray, encoding: str = "mono8", frame: str = "") -> None:
        height, width = pixels.shape[:2]
        data = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
        kind = "sensor_msgs/msg/Image"
        parts = (height, width, encoding, 0, data.shape[1], data.ravel())
        self.add(topic, kind, time, self.make(kind, self.header(time, frame), *parts))

    def compressed(self, topic: str, time: float, content: bytes, format_name: str = "jpeg") -> None:
        kind = "sensor_msgs/msg/CompressedImage"
        data = np.frombuffer(content, dtype=np.uint8)
        self.add(topic, kind, time, self.make(kind, self.header(time), format_name, data))

    def camera_info(
        self,
        topic: str,
        time: float,
        size: tuple[int, int],
        k: np.ndarray,
        d: np.ndarray,
        distortion_model: str = "plumb_bob",
    ) -> None:
        kind = "sensor_msgs/msg/CameraInfo"
        roi = self.make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        p = np.hstack([k.reshape(3, 3), np.zeros((3, 1))]).ravel()
        parts = (size[1], size[0], distortion_model, d, k, np.eye(3).ravel(), p, 0, 0, roi)
        self.add(topic, kind, time, self.make(kind, self.header(time), *parts))

    def close(self) -> Path:
        """Write all messages in the order of their times."""
        if self.kind == "ros1":
            writer: Any = Writer1(self.path)
        else:
            plugin = StoragePlugin.MCAP if self.kind == "mcap" else StoragePlugin.SQLITE3
            writer = Writer2(self.path, version=9, storage_plugin=plugin)
        serialize = self.store.serialize_ros1 if self.kind == "ros1" else self.store.serialize_cdr
        with writer:
            types = {topic: kind for topic, kind, *_ in self.messages}
            connections = {
                topic: writer.add_connection(topic, kind, typestore=self.store) for topic, kind in types.items()
            }
            for topic, kind, time, message in sorted(self.messages, key=lambda each: each[2]):
                writer.write(connections[topic], round(time * 1e9), serialize(message, kind))
        return self.path


def new_bag(folder: Path, kind: Kind) -> BagWriter:
    """Return an empty bag in a folder."""
    return BagWriter(kind, folder / ("bag.bag" if kind == "ros1" else f"bag_{kind}"))


def middles(count: int) -> np.ndarray:
    """Times [s] of the middles of stops."""
    return BEGIN_S + np.arange(count) * (STOP_S + MOVE_S) + STOP_S / 2


def journey(count: int) -> Iterator[tuple[float, int, float]]:
    """Yield for each record its time [s], the last stop, and the share of the way to the next stop."""
    duration_s = count * (STOP_S + MOVE_S) - MOVE_S
    for k in range(int(duration_s * RATE_HZ)):
        stop, since_s = divmod(k / RATE_HZ, STOP_S + MOVE_S)
        yield BEGIN_S + k / RATE_HZ, int(stop), max(0.0, since_s - STOP_S) / MOVE_S


def between(poses: SE3, stop: int, share: float) -> SE3:
    """Return the pose at a share of the way from a stop to the next."""
    if share == 0 or stop + 1 >= len(poses):
        return poses[stop]
    return poses[stop] @ SE3.exp(share * (poses[stop].inverse() @ poses[stop + 1]).log())


def bag_by_tf(folder: Path, kind: Kind, recording: Recording) -> BagWriter:
    """Return a bag with frames `<robot>_base_link` to `<robot>_tool0`, a link between, and views as PoseStamped."""
    bag, count = new_bag(folder, kind), len(recording.samples)
    robots = list(recording.samples[0].robots)
    poses = {name: SE3.stack([s.robots[name].base_from_flange for s in recording.samples]) for name in robots}
    wrist_from_tool = SE3.exp(np.array([0.1, 0.0, 0.2, 0.3, 0.0, 0.1]))
    bag.transforms("/tf_static", BEGIN_S, {(f"{name}_wrist", f"{name}_tool0"): wrist_from_tool for name in robots})
    for time, stop, share in journey(count):
        transforms = {
            (f"{name}_base_link", f"{name}_wrist"): between(poses[name], stop, share) @ wrist_from_tool.inverse()
            for name in robots
        }
        bag.transforms("/tf", time, transforms)
    for sample, time in zip(recording.samples, middles(count), strict=True):
        for view in sample.observations:
            assert isinstance(view, PoseObservation)
            for delay_s in (-0.2, 0.0, 0.2):
                bag.pose(f"/{view.camera}/{view.target}", float(time) + delay_s, view.camera_from_target)
    return bag
