"""Subprocess that reads a bag: its connections, or its messages as bytes up to a damaged part.

The arguments are the path of the bag, and the topics of the messages; without topics the connections are returned.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2.metadata import parse_qos
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from basecal.box import Frame, is_own_fault
from basecal.errors import InputError, error_words

_MOST_MESSAGES = 5_000_000  # enough for a recording of hours
_LARGEST_VALUE_BYTES = 2**28  # bytes of a value in a database
_TABLES = ("messages", "topics")
_RECORD_HEADER_BYTES = 9  # header bytes of an MCAP record: its opcode and length


def read_frames(words: Sequence[str]) -> Iterator[Frame]:
    """Frames of a bag: `[topic, type, messages]`, `[topic, nanoseconds]` with a message, or `{"damage": why}`."""
    path, topics = Path(words[0]), set(words[1:])
    reader = _reader(path)
    reader.open()
    with closing(reader):
        if not topics:
            yield from (([each.topic, each.msgtype, each.msgcount], b"") for each in reader.connections)
        elif wanted := [each for each in reader.connections if each.topic in topics]:
            yield from _messages(reader, wanted)
        storages = getattr(reader, "storages", [reader])
        yield from (({"damage": why}, b"") for each in storages if (why := getattr(each, "damage", "")))


def _messages(reader: Any, connections: Collection[Connection]) -> Iterator[Frame]:
    found = reader.messages(connections=connections)
    for _ in range(_MOST_MESSAGES):
        try:
            connection, recorded_ns, raw = next(found)
        except StopIteration:
            return
        except MemoryError:
            raise
        except Exception as error:
            if is_own_fault(error):
                raise
            yield {"damage": error_words(error)}, b""
            return
        yield [connection.topic, recorded_ns], raw
    raise InputError(f"has more than {_MOST_MESSAGES} messages of these topics; cut it")


def _reader(path: Path) -> Any:
    if path.is_dir():
        return _Folder(path)
    return {".bag": Reader1, ".mcap": _Mcap, ".db3": _Sqlite}[path.suffix](path)


class _Mcap(McapReader):
    """MCAP reader; a truncated file is read without its index, up to the last complete record."""

    damage = ""

    def _open(self) -> None:
        try:
            super()._open()
        except Exception as error:
            if not self.data_start or is_own_fault(error):
                raise
            self.damage = error_words(error)
            self._scan()

    def _scan(self) -> None:
        self.schemas, self.channels, self.chunks, self.connections = {}, {}, [], []
        self.data_end = self._end_of_whole_records()
        self.meta_scan()
        counts = {} if self.statistics is None else self.statistics.channel_message_counts
        self.connections = [each._replace(msgcount=counts.get(each.id, 0)) for each in self.connections]

    def _end_of_whole_records(self) -> int:
        assert self.bio is not None
        size, end = self.path.stat().st_size, self.data_start
        while True:
            self.bio.seek(end)
            head = self.bio.read(_RECORD_HEADER_BYTES)
            following = end + _RECORD_HEADER_BYTES + int.from_bytes(head[1:], "little")
            if len(head) < _RECORD_HEADER_BYTES or following > size:
                return end
            end = following


class _Sqlite(Sqlite3Reader):
    """SQLite reader that rejects views; a damaged database is read row by row up to the damage."""

    damage = ""

    def __init__(self, path: Path) -> None:
        self._file = path
        super().__init__(Path(quote(str(path))))  # the base class builds a URI, in which # ? % must be quoted

    def open(self) -> None:
        """Open the database, and check its tables before reading them."""
        with closing(self._connect()) as database:
            _check_tables(database)
        self.damage = _missing_pages(self._file)
        if self.damage:
            self._count()
        else:
            super().open()

    def close(self) -> None:
        """Close the database."""
        if not self.damage:
            super().close()

    def messages(self, connections: Any, start: Any = None, stop: Any = None) -> Any:
        """Iterate over messages of connections as (connection, nanoseconds, bytes)."""
        return self._rows({each.id: each for each in connections}) if self.damage else super().messages(connections)

    def _count(self) -> None:
        with closing(self._connect()) as database:
            topics = database.execute("SELECT id, name, type, offered_qos_profiles FROM topics").fetchall()
        text = MessageDefinition(MessageDefinitionFormat.NONE, "")
        found = {
            key: Connection(key, name, kind, text, "", 0, ConnectionExtRosbag2("cdr", parse_qos(qos)), self)
            for key, name, kind, qos in topics
        }
        counts = dict.fromkeys(found, 0)
        for connection, _, _ in self._rows(found):
            counts[connection.id] += 1
        self.connections = [each._replace(msgcount=counts[key]) for key, each in found.items()]

    def _rows(self, connections: dict[int, Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        with closing(self._connect()) as database:
            try:
                for key, stamp, data in database.execute("SELECT topic_id, timestamp, data FROM messages"):
                    if not (isinstance(stamp, int) and isinstance(data, bytes)):
                        raise sqlite3.DataError("a message has no bytes, or no time")
                    if key in connections:
                        yield connections[key], stamp, data
            except sqlite3.DatabaseError as error:
                self.damage = str(error)

    def _connect(self) -> sqlite3.Connection:
        database = sqlite3.connect(f"file:{quote(str(self._file))}?mode=ro&immutable=1", uri=True)
        database.execute("PRAGMA trusted_schema = OFF")
        database.execute("PRAGMA writable_schema = ON")  # required to open a truncated database
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LARGEST_VALUE_BYTES)
        return database


def _missing_pages(path: Path) -> str:
    """Message about missing pages of a database; empty if it is complete. Source: sqlite.org/fileformat.html."""
    with path.open("rb") as file:
        head = file.read(32)
    page, stated = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
    present = path.stat().st_size // (2**16 if page == 1 else max(page, 1))
    return f"{present} of {stated} pages are there" if present < stated else ""


def _check_tables(database: sqlite3.Connection) -> None:
    """Check that the tables are plain tables, without computed content.

    Raises:
        InputError: if a table is a view, or has generated columns.
    """
    for name in _TABLES:
        found = database.execute("SELECT type, sql FROM sqlite_master WHERE name = ?", (name,)).fetchall()
        is_table = [(kind, str(sql)[:12].upper()) for kind, sql in found] == [("table", "CREATE TABLE")]
        columns = database.execute(f"PRAGMA table_xinfo({name})").fetchall()
        if not is_table or any(column[-1] for column in columns):
            raise InputError(f"its {name} are not a plain table")


class _Folder(DirectoryReader):
    """Reader of a folder with a metadata.yaml, which uses the readers above for its files."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.STORAGE_PLUGINS = {"mcap": _Mcap, "sqlite3": _Sqlite}
