"""Tests of bags with false contents: each is refused within limits, or read up to its damage."""

from __future__ import annotations

import os
import sqlite3
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.bag_of_cell import BEGIN_S, new_bag

from basecal import box
from basecal.errors import DatasetError
from basecal.exchange.bags import bag as bags
from basecal.exchange.bags.bag import Bag, open_bag

COUNT = 200


def open_path(path: Path) -> Bag:
    """Return an open bag."""
    with open_bag(path) as bag:
        return bag


def write_joint_bag(folder: Path, kind: str, count: int = COUNT) -> Path:
    """Write a bag of joints."""
    folder.mkdir(exist_ok=True)
    writer = new_bag(folder, kind)
    for k in range(count):
        writer.joints("/joint_states", BEGIN_S + k, ["a"], np.full(1000, float(k)))
    return writer.close()


def storage(bag: Path) -> Path:
    """Return the file of a bag that holds its messages."""
    return bag if bag.is_file() else next(path for path in bag.iterdir() if path.suffix in (".db3", ".mcap"))


@pytest.mark.journey
@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_bag_is_read_from_any_path(tmp_path: Path, kind: str) -> None:
    """A bag is read whatever characters the folders of its path contain."""
    path = write_joint_bag(tmp_path / "plain", kind)
    folder = tmp_path / "a#b" / "a?b" / "a%41b" / "a b'\"" / "a\u00e9"
    folder.mkdir(parents=True)
    bag = open_path(path.rename(folder / path.name))
    assert len(list(bag.read(["/joint_states"]))) == COUNT
    assert not bag.damage


@pytest.mark.journey
@pytest.mark.parametrize(("kind", "count"), [("sqlite3", 200), ("mcap", 600)])
def test_truncated_bag_is_read_up_to_damage(tmp_path: Path, kind: str, count: int) -> None:
    """Completely written messages are read in order, and the bag states the damage."""
    path = storage(write_joint_bag(tmp_path, kind, count))
    os.truncate(path, path.stat().st_size * 6 // 10)
    bag = open_path(path)
    found = [message.data.position[0] for message in bag.read(["/joint_states"])]
    assert 0 < len(found) < count
    assert found == list(range(len(found)))
    assert bag.damage


def test_damaged_index_is_reported(tmp_path: Path) -> None:
    """All messages are read, and the bag states why its index was not used, also if the error has no message."""
    path = storage(write_joint_bag(tmp_path, "mcap"))
    content = bytearray(path.read_bytes())
    index = int.from_bytes(content[-28:-20], "little")
    content[index + 1 : index + 9] = (2**40).to_bytes(8, "little")  # length of its first record [bytes]
    path.write_bytes(content)
    bag = open_path(path)
    assert len(list(bag.read(["/joint_states"]))) == COUNT
    assert bag.damage == ["MemoryError"]


def test_oversized_bag_is_not_called_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Repairing a bag beyond the limits would not help, so it is not called damaged."""
    path = write_joint_bag(tmp_path, "ros1")
    monkeypatch.setattr(box, "_LEAST_OUTPUT_BYTES", 2**20)
    monkeypatch.setattr(box, "_OUTPUT_FACTOR", 0)
    bag = open_path(path)
    with pytest.raises(DatasetError, match=r"bag\.bag: gives more than 1 MB, the limit for its size$"):
        list(bag.read(["/joint_states"]))


def small_database(path: Path, messages: str) -> Path:
    """Write an sqlite3 bag whose table of messages is made by this SQL."""
    with sqlite3.connect(path) as database:
        database.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format, offered_qos_profiles)"
        )
        database.execute("INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr', '')")
        database.executescript(messages)
    return path


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"


@pytest.mark.parametrize(
    "messages",
    [
        f"CREATE VIEW messages AS {ENDLESS} SELECT i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data FROM n",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data AS (zeroblob(1000000000)));"
        "INSERT INTO messages(topic_id, timestamp) VALUES (1, 1), (1, 2)",
        "CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, data)",
    ],
)
def test_computed_tables_are_refused(tmp_path: Path, messages: str) -> None:
    """An endless view, computed columns and virtual tables are refused."""
    with pytest.raises(DatasetError, match="messages are not a plain table"):
        open_path(small_database(tmp_path / "a.db3", messages))


@pytest.mark.journey
@pytest.mark.parametrize("values", ["1, 'soon', x'00'", "1, 1, 1000000000"])
def test_invalid_rows_end_damaged_database(tmp_path: Path, values: str) -> None:
    """A number in place of bytes is not read as that many zeros."""
    table = "CREATE TABLE messages(topic_id, timestamp, data);"
    path = small_database(tmp_path / "a.db3", f"{table} INSERT INTO messages VALUES ({values})")
    content = bytearray(path.read_bytes())
    content[28:32] = (99).to_bytes(4, "big")  # stated number of pages
    path.write_bytes(content)
    bag = open_path(path)
    assert not list(bag.read(["/joint_states"]))
    assert bag.damage


def test_reader_fault_is_not_called_damage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault of the reader itself propagates unchanged with its traceback."""
    path = write_joint_bag(tmp_path, "ros1")
    fault = box.BoxFault("TypeError")

    def faulty(*given: object) -> Iterator[box.Frame]:
        raise fault
        yield

    monkeypatch.setattr(bags, "frames", faulty)
    with pytest.raises(box.BoxFault):
        open_path(path)


def mcap_of_one_chunk(path: Path, content: bytes, compression: bytes, size: int) -> Path:
    """Write an MCAP file without an index that holds one chunk."""

    def record(kind: int, data: bytes) -> bytes:
        return bytes([kind]) + struct.pack("<Q", len(data)) + data

    def text(data: bytes) -> bytes:
        return struct.pack("<I", len(data)) + data

    chunk = struct.pack("<QQQI", 0, 1, size, 0) + text(compression) + struct.pack("<Q", len(content)) + content
    path.write_bytes(b"\x89MCAP0\r\n" + record(1, text(b"ros2") + text(b"")) + record(6, chunk))
    return path


@pytest.mark.journey
def test_decompression_bomb_is_refused(tmp_path: Path) -> None:
    """A chunk of some kilobytes that unpacks to four gigabytes is an error, without memory use of this process."""
    from lz4.frame import LZ4FrameCompressor

    compressor, zeros = LZ4FrameCompressor(), b"\0" * 2**24
    content = compressor.begin() + b"".join(compressor.compress(zeros) for _ in range(64)) + compressor.flush()
    content = content[: len(content) - 4]
    path = mcap_of_one_chunk(tmp_path / "a.mcap", content, b"lz4", 2**30)
    with pytest.raises(DatasetError, match=r"a\.mcap: is damaged"):
        open_path(path)


@pytest.mark.journey
def test_compressed_folder_bag_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compressed file cannot fill the disk: unpacking stops at the limit, in a folder that is removed."""
    monkeypatch.setattr(box, "_LEAST_OUTPUT_BYTES", 2**26)
    bag = write_joint_bag(tmp_path, "mcap")
    path = storage(bag)
    zstd = pytest.importorskip("backports.zstd")
    compressor = zstd.ZstdCompressor()
    packed = compressor.compress(path.read_bytes())
    packed += b"".join(compressor.compress(b"\0" * 2**24) for _ in range(8)) + compressor.flush()
    (bag / f"{path.name}.zstd").write_bytes(packed)
    path.unlink()
    metadata = bag / "metadata.yaml"
    text = metadata.read_text().replace(path.name, f"{path.name}.zstd")
    text = text.replace("compression_format: ''", "compression_format: zstd")
    metadata.write_text(text.replace("compression_mode: ''", "compression_mode: FILE"))
    assert "FILE" in metadata.read_text()
    with pytest.raises(DatasetError, match=r"is damaged|File too large"):
        open_path(bag)


@pytest.mark.parametrize("name", ["a.mcap", "a.db3", "a.bag"])
def test_pipes_and_devices_are_refused(tmp_path: Path, name: str) -> None:
    """Pipes and devices are refused immediately, alone or in a folder."""
    began_s = time.monotonic()
    os.mkfifo(tmp_path / name)
    with pytest.raises(DatasetError, match="is not a file but a pipe"):
        open_path(tmp_path / name)
    (tmp_path / f"b{name}").symlink_to("/dev/zero")
    with pytest.raises(DatasetError, match="is not a file but a pipe"):
        open_path(tmp_path / f"b{name}")
    (tmp_path / "metadata.yaml").write_text("")
    with pytest.raises(DatasetError, match="is not a file but a pipe"):
        open_path(tmp_path)
    assert time.monotonic() - began_s < 5
