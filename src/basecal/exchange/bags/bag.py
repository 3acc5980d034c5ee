"""Reading of ROS 1 bags, and of ROS 2 bags in sqlite3 or MCAP: topics, and messages one at a time.

Messages are decoded with the definitions of the standard packages, which are the same in all releases for the types
below. The definitions in the bag, of other recorded types, are not needed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from basecal.bounded_file import check_regular, read_bounded
from basecal.box import Frame, LibraryError, frames, is_own_fault
from basecal.errors import DatasetError, InputError, MissingExtra, error_words
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
_METADATA, _LARGEST_METADATA = "metadata.yaml", 2**24
_EXPECTED = "expected a .bag of ROS 1, or a folder, .mcap or .db3 of ROS 2"


class Topic(NamedTuple):
    """A topic: its name, and the type and number of its messages."""

    name: str
    kind: str
    messages: int


class Message(NamedTuple):
    """A message, and the time of its recording [s]."""

    topic: Topic
    recorded_s: float
    data: Any


@dataclass(frozen=True, eq=False)
class Bag:
    """A bag.

    Attributes:
        path: Path of the bag, as named by the user.
        topics: Topics by name.
        read: Function that reads the messages of topics, in the order of recording.
        damage: Cause of damage, if the bag was read only partly; otherwise empty.
    """

    path: str
    topics: dict[str, Topic]
    read: Callable[[Iterable[str]], Iterator[Message]]
    damage: list[str] = field(default_factory=list)

    def topics_of_type(self, *kinds: str) -> list[Topic]:
        """Return the topics of these types that have messages, sorted by name."""
        return [topic for _, topic in sorted(self.topics.items()) if topic.kind in kinds and topic.messages]


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag; each set of topics is read by a separate process.

    Raises:
        MissingExtra: if the library for bags is not installed.
        DatasetError: if the path is not a bag, or the bag is damaged from its start.
    """
    decode = _decoder(path.suffix == _BAG1 and not path.is_dir())
    _check_files(path)
    bag = Bag(str(path), {}, lambda names: _messages(bag, path, decode, set(names)))
    for (name, kind, count), _ in _frames(bag, path, ()):
        known = bag.topics.get(name, Topic(name, _EQUAL_TYPES.get(kind, kind), 0))  # the first of several types
        bag.topics[name] = known._replace(messages=known.messages + int(count))
    yield bag


def _decoder(is_ros1: bool) -> Callable[[bytes, str], Any]:
    """Create a decoder of messages from their bytes and the name of their type.

    Raises:
        MissingExtra: if the library for bags is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise MissingExtra("bags", "a bag of ROS") from None
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    if is_ros1:  # the store has no tf2_msgs of ROS 1
        store.register(get_types_from_msg(_TF_OF_ROS1, TF))
    for kind, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, kind))
    return store.deserialize_ros1 if is_ros1 else store.deserialize_cdr


def _check_files(path: Path) -> None:
    """Check that a path has the name of a bag, and that its files are regular files.

    Raises:
        DatasetError: if it does not.
    """
    if not path.exists():
        raise DatasetError(path, f"there is no such bag; {_EXPECTED}")
    if not path.is_dir() and path.suffix not in (_BAG1, *_BAG2):
        raise DatasetError(path, f"is not a bag: unknown file name extension; {_EXPECTED}")
    if path.is_dir() and not (path / _METADATA).exists():
        bags = sorted(each.name for each in path.iterdir() if each.suffix in (_BAG1, *_BAG2))
        content = (
            f"is a folder without a metadata.yaml; give the file in it: {', '.join(bags)}" if bags else "is not a bag"
        )
        raise DatasetError(path, f"{content}; {_EXPECTED}")
    for each in _files(path):
        check_regular(each)
    if path.is_dir():
        read_bounded(path / _METADATA, _LARGEST_METADATA)


def _files(path: Path) -> list[Path]:
    return sorted(path.iterdir()) if path.is_dir() else [path]


def _messages(bag: Bag, path: Path, decode: Callable[[bytes, str], Any], names: set[str]) -> Iterator[Message]:
    """Iterate over the decoded messages of topics."""
    names &= bag.topics.keys()
    for (name, recorded_ns), raw in _frames(bag, path, names) if names else ():
        topic = bag.topics[name]
        with _name_errors(path):
            data = decode(raw, topic.kind)
        yield Message(topic, recorded_ns * _NANO, data)


def _frames(bag: Bag, path: Path, names: Collection[str]) -> Iterator[Frame]:
    """Frames from the process that reads a bag; damage is stored in `bag.damage`."""
    size = sum(each.stat().st_size for each in _files(path))
    with _name_errors(path):
        for data, content in frames("basecal.exchange.bags.reader_process", [os.path.abspath(path), *names], size):
            if isinstance(data, dict):
                bag.damage[:] = [data["damage"]]
            else:
                yield data, content


@contextmanager
def _name_errors(path: Path) -> Iterator[None]:
    """Convert the library's various errors about a damaged bag to errors that name the bag."""
    try:
        yield
    except LibraryError as error:
        raise _damage_error(path, error) from None
    except InputError as error:
        raise error if isinstance(error, DatasetError) else DatasetError(path, str(error)) from None
    except OSError as error:
        raise DatasetError(path, f"cannot be read: {error.strerror or error}") from None
    except Exception as error:
        if is_own_fault(error):
            raise
        raise _damage_error(path, error) from None


def _damage_error(path: Path, error: Exception) -> DatasetError:
    cause = f"is damaged or was cut off ({error_words(error)})"
    return DatasetError(path, f"{cause}; {repair_command(path)} may save it")


def repair_command(path: Path) -> str:
    """Command of ROS that may repair a damaged bag."""
    return "`rosbag reindex`" if path.suffix == _BAG1 else "`ros2 bag reindex`, or `mcap recover`,"


def message_time(header: Any, recorded_s: float) -> float:
    """Time of a message [s]: of its header, or of its recording if the header has zero."""
    stamp = float(header.stamp.sec) + float(header.stamp.nanosec) * _NANO
    return stamp or recorded_s
