"""Framed messages between two processes, over file descriptors that never block."""

from __future__ import annotations

import os
import struct
import threading
from contextlib import suppress
from enum import IntEnum, unique
from typing import NamedTuple

_HEADER = struct.Struct(">BBI")  # kind, number of the arm, length of the payload
_CHUNK_BYTES = 2**16
_FULL_BUFFER_BYTES = 2**22  # unsent bytes above which the other process counts as hung


@unique
class Kind(IntEnum):
    """The kind of a frame."""

    ALIVE = 0  # heartbeat; from an arm: one byte, whether it moves
    OPEN = 1  # to an arm: its place and the module search path, pickled
    OPENED = 2  # from an arm: its protocols, pickled
    FAILED = 3  # from an arm: the error of a failed opening, pickled
    REQUEST = 4  # to an arm: number, method and arguments, pickled
    ANSWER = 5  # from an arm: number, result and error, pickled
    READING = 6  # from an arm: the time at which a state came by `time.monotonic()`, and the state, pickled
    TROUBLE = 7  # from an arm: the reason why all arms must stop, as text
    STOP = 8  # to the supervisor: the reason, as text; to an arm: no payload
    STOPPED = 9  # from an arm: its controller accepted the stop
    CLOSE = 10  # end the process
    EVENT = 11  # from the supervisor: the reason of a stop, and the arms that did not confirm it, as JSON


class Frame(NamedTuple):
    """One message; `arm` is the number of the arm that sends or receives it."""

    kind: int
    arm: int
    payload: bytes


class Channel:
    """Bidirectional link to another process; any thread may send, one thread receives."""

    def __init__(self, read_fd: int, write_fd: int) -> None:
        self.read_fd, self._write_fd = read_fd, write_fd
        self._lock = threading.Lock()
        self._unsent, self._received = bytearray(), bytearray()
        self.is_broken = False
        for fd in (read_fd, write_fd):
            os.set_blocking(fd, False)

    def send(self, kind: Kind, payload: bytes = b"", arm: int = 0) -> None:
        """Send a frame, or buffer it until the other process reads; a broken link discards it."""
        with self._lock:
            self._unsent += _HEADER.pack(kind, arm, len(payload)) + payload
            self._flush()

    @property
    def has_unsent(self) -> bool:
        """Whether frames wait until the other process reads."""
        with self._lock:
            return bool(self._unsent)

    def flush(self) -> None:
        """Send buffered frames."""
        with self._lock:
            self._flush()

    def _flush(self) -> None:
        try:
            while self._unsent and not self.is_broken:
                del self._unsent[: os.write(self._write_fd, self._unsent[:_CHUNK_BYTES])]
        except BlockingIOError:
            self.is_broken = len(self._unsent) > _FULL_BUFFER_BYTES
        except OSError:
            self.is_broken = True

    def receive(self) -> list[Frame]:
        """Return the frames that have arrived.

        Raises:
            EOFError: if the other process has ended.
        """
        try:
            while part := os.read(self.read_fd, _CHUNK_BYTES):
                self._received += part
        except BlockingIOError:
            return self._whole_frames()
        except OSError:
            pass
        if frames := self._whole_frames():
            return frames
        raise EOFError

    def _whole_frames(self) -> list[Frame]:
        frames = []
        while len(self._received) >= _HEADER.size:
            kind, arm, length = _HEADER.unpack_from(self._received)
            end = _HEADER.size + length
            if len(self._received) < end:
                break
            frames.append(Frame(kind, arm, bytes(self._received[_HEADER.size : end])))
            del self._received[:end]
        return frames

    def close(self) -> None:
        """Close both directions; later sends do nothing, since another file may reuse the descriptor."""
        with self._lock:
            self.is_broken = True
            for fd in {self.read_fd, self._write_fd}:
                with suppress(OSError):
                    os.close(fd)
