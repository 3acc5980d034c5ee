"""A bag of ROS 1, or of ROS 2 in sqlite3 or MCAP: its topics, and its messages one after the other.

Messages are read by the definitions of the standard packages, which are the same in all releases for the types below;
definitions in the bag, of whatever else was recorded, are not needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from basecal.errors import BasecalError, DatasetError, MissingExtra
from basecal.exchange.bags.tag_poses import POSE_DEFINITIONS
from basecal.exchange.bags.tags import DEFINITIONS

TF = "tf2_msgs/msg/TFMessage"
JOINTS = "sensor_msgs/msg/JointState"
POSE = "geometry_msgs/msg/PoseStamped"
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
TEXT = "std_msgs/msg/String"
_EQUAL_TYPES = {"tf/msg/tfMessage": TF}  # of ROS 1 before 2013
_TF_OF_ROS1 = "geometry_msgs/TransformStamped[] transforms"
_NANO = 1e-9  # [s]
_BAG1, _BAG2 = ".bag", (".mcap", ".db3")
_EXPECTED = "expected a .bag of ROS 1, or a folder, .mcap or .db3 of ROS 2"


class Topic(NamedTuple):
    """A topic: its name, the type of its messages, and how many there are."""

    name: str
    kind: str
    messages: int


class Message(NamedTuple):
    """A message, and when it was recorded [s]."""

    topic: Topic
    recorded_s: float
    data: Any


@dataclass(frozen=True, eq=False)
class Bag:
    """A bag that is open.

    Attributes:
        path: As the user named it.
        topics: By name.
        read: The messages of topics, as they were recorded.
    """

    path: str
    topics: Mapping[str, Topic]
    read: Callable[[Iterable[str]], Iterator[Message]]

    def topics_of_type(self, *kinds: str) -> list[Topic]:
        """Topics of these types that hold messages, by name."""
        return [topic for _, topic in sorted(self.topics.items()) if topic.kind in kinds and topic.messages]


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """A bag, for as long as it is read.

    Raises:
        MissingExtra: if the library of bags is not installed.
        DatasetError: if it is none, or is damaged.
    """
    try:
        from rosbags.rosbag1 import Reader as Reader1
        from rosbags.rosbag2 import Reader as Reader2
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise MissingExtra("bags", "a bag of ROS") from None
    if not path.exists():
        raise DatasetError(str(path), f"there is no such bag; {_EXPECTED}")
    if not path.is_dir() and path.suffix not in (_BAG1, *_BAG2):
        raise DatasetError(str(path), f"is no bag by its name; {_EXPECTED}")
    if path.is_dir() and not (path / "metadata.yaml").exists():
        bags = sorted(each.name for each in path.iterdir() if each.suffix in (_BAG1, *_BAG2))
        held = f"is a folder without a metadata.yaml; give the file in it: {', '.join(bags)}" if bags else "is no bag"
        raise DatasetError(str(path), f"{held}; {_EXPECTED}")
    is_first = path.suffix == _BAG1 and not path.is_dir()
    with _name_errors(path):
        reader: Any = Reader1(path) if is_first else Reader2(path)
        reader.open()
    try:
        store = get_typestore(Stores.ROS1_NOETIC if is_first else Stores.ROS2_HUMBLE)
        if is_first:  # the store has no tf2_msgs of ROS 1
            store.register(get_types_from_msg(_TF_OF_ROS1, TF))
        for kind, text in (DEFINITIONS | POSE_DEFINITIONS).items():
            store.register(get_types_from_msg(text, kind))
        decode = store.deserialize_ros1 if is_first else store.deserialize_cdr
        yield Bag(str(path), _topics(reader), lambda names: _messages(path, reader, decode, set(names)))
    finally:
        reader.close()


def _topics(reader: Any) -> dict[str, Topic]:
    """Topics by name; of one whose connections differ in type, the first of them counts."""
    found: dict[str, Topic] = {}
    for each in reader.connections:
        before = found.get(each.topic, Topic(each.topic, _EQUAL_TYPES.get(each.msgtype, each.msgtype), 0))
        found[each.topic] = before._replace(messages=before.messages + each.msgcount)
    return found


def _messages(path: Path, reader: Any, decode: Callable[[bytes, str], Any], names: set[str]) -> Iterator[Message]:
    """Messages of topics, one at a time."""
    topics = _topics(reader)
    connections = [each for each in reader.connections if each.topic in names]
    if not connections:
        return
    with _name_errors(path):
        for connection, recorded_ns, raw in reader.messages(connections=connections):
            topic = topics[connection.topic]
            yield Message(topic, recorded_ns * _NANO, decode(raw, topic.kind))


@contextmanager
def _name_errors(path: Path) -> Iterator[None]:
    """What a damaged bag makes the library raise, of a dozen kinds down to sizes beyond any memory, names the bag."""
    try:
        yield
    except BasecalError:
        raise
    except OSError as error:
        raise DatasetError(str(path), f"cannot be read: {error.strerror or error}") from None
    except Exception as error:
        why = " ".join(str(error).split()) or type(error).__name__
        mend = "`rosbag reindex`" if path.suffix == _BAG1 else "`ros2 bag reindex`, or `mcap recover`,"
        raise DatasetError(str(path), f"is damaged or was cut off ({why}); {mend} may save it") from None


def message_time(header: Any, recorded_s: float) -> float:
    """Time [s] of a message: of its header, or where that is zero when it was recorded."""
    stamp = float(header.stamp.sec) + float(header.stamp.nanosec) * _NANO
    return stamp or recorded_s
