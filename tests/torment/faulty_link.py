"""A link to an honest device that lies from some byte on: silent, cut, slow, without end, or changed."""

from __future__ import annotations

import re
import socket
import struct
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from random import Random

from torment.damage import torn_bytes

Address = tuple[str, int]
_CHUNK = 2**16
_DRIP_S = 0.05  # between bytes
_FLOOD = 2**20  # bytes at once
_CHANGED = 0.3  # of the chunks
_WIDTHS = ("B", ">H", "<H", ">I", "<I", ">Q", "<Q")  # of lengths and counts
_NUMBERS = (0.0, -1.0, 1e-310, 1e9, 1e308, float("nan"), float("inf"))
_DIGITS = re.compile(rb"-?\d+(\.\d+)?")
_ODD_DIGITS = (b"0", b"-1", b"1e999", b"99999999999999999999", b"NaN", b"1e308", b"null")
AFTER = (0, 0, 4, 40, 400, 4_000, 40_000)  # bytes from the device that pass unchanged, at most


def _flip(data: bytes, chance: Random) -> bytes:
    return torn_bytes(data, chance)


def _change_length(data: bytes, chance: Random) -> bytes:
    """One integer, mostly near the start where messages state their length, at an end of its range."""
    width = chance.choice(_WIDTHS)
    size = struct.calcsize(width)
    at = min(chance.choice([0, 2, 4, 8, chance.randrange(len(data))]), max(len(data) - size, 0))
    value = chance.choice([0, 1, 2 ** (8 * size - 1) - 1, 2 ** (8 * size) - 1, 2 ** (4 * size)])
    return data[:at] + struct.pack(width, value) + data[at + size :]


def _change_number(data: bytes, chance: Random) -> bytes:
    """A number, as text where there is text, else as eight bytes."""
    found = list(_DIGITS.finditer(data))
    if found and chance.random() < 0.5:
        one = chance.choice(found)
        return data[: one.start()] + chance.choice(_ODD_DIGITS) + data[one.end() :]
    at = chance.randrange(len(data))
    return data[:at] + struct.pack(chance.choice("<>") + "d", chance.choice(_NUMBERS)) + data[at + 8 :]


_CHANGES: dict[str, Callable[[bytes, Random], bytes]] = {
    "bytes changed": _flip,
    "lengths changed": _change_length,
    "numbers changed": _change_number,
}
FAULTS = (*_CHANGES, "silent", "cut", "reset", "dead", "drip", "garbage", "flood", "repeat", "old")


class FaultyLink:
    """What passes between a driver and a device, by a fault and from a byte on; each new connection has it anew."""

    def __init__(self, fault: str, after: int, chance: Random) -> None:
        self.fault, self.after, self.chance = fault, after, chance
        self.is_over = threading.Event()
        self._kept: list[bytes] = []

    def serve(self, server: socket.socket, device: Callable[[], socket.socket]) -> None:
        """Pass everything until the link is over."""
        refuses = False
        while not self.is_over.is_set():
            try:
                line, _ = server.accept()
            except OSError:
                return
            if refuses:
                line.close()
                continue
            refuses = self.fault == "dead"
            threading.Thread(target=self._connect, args=(line, device), daemon=True).start()

    def _connect(self, line: socket.socket, device: Callable[[], socket.socket]) -> None:
        with line, suppress(OSError), device() as other:
            threading.Thread(target=self._forward, args=(line, other), daemon=True).start()
            self._lie(other, line)

    def _forward(self, line: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while data := line.recv(_CHUNK):
                other.sendall(data)
            other.shutdown(socket.SHUT_RDWR)

    def _lie(self, device: socket.socket, driver: socket.socket) -> None:
        left = self.after
        while left > 0 and (data := device.recv(min(left, _CHUNK))):
            driver.sendall(data)
            self._kept = [*self._kept[-9:], data]
            left -= len(data)
        if self.fault == "reset":
            driver.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        if self.fault in ("cut", "reset", "dead"):
            return
        if self.fault in ("garbage", "flood", "silent"):
            self._invent(driver)
            return
        while not self.is_over.is_set() and (data := device.recv(_CHUNK)):
            self._pass(data, driver)

    def _invent(self, driver: socket.socket) -> None:
        """Say what no device says, and then nothing any more."""
        piece = self.chance.choice([b"\0", b"\n", b"{", b"\xff", self.chance.randbytes(1000), *self._kept])
        block = (piece * (_FLOOD // len(piece) + 1))[:_FLOOD]
        if self.fault == "garbage":
            driver.sendall(self.chance.randbytes(self.chance.choice([1, 100, 10_000])))
        while self.fault == "flood" and not self.is_over.is_set():
            driver.sendall(block)
        self.is_over.wait()

    def _pass(self, data: bytes, driver: socket.socket) -> None:
        if self.fault == "drip":
            for k in range(len(data)):
                driver.sendall(data[k : k + 1])
                if self.is_over.wait(_DRIP_S):
                    return
        elif self.fault == "old" and self._kept:
            driver.sendall(self.chance.choice(self._kept))
        elif self.fault == "repeat":
            driver.sendall(data * self.chance.choice([1, 2, 5]))
        else:
            change = _CHANGES.get(self.fault)
            is_changed = change is not None and self.chance.random() < _CHANGED
            driver.sendall(change(data, self.chance) if change is not None and is_changed else data)
        self._kept = [*self._kept[-9:], data]


def choose_link(chance: Random) -> FaultyLink:
    """A fault, and after how many bytes it begins."""
    return FaultyLink(chance.choice(FAULTS), chance.randint(0, chance.choice(AFTER)), Random(chance.random()))


@contextmanager
def linked(
    link: FaultyLink, devices: Sequence[Callable[[], socket.socket]], at: Sequence[Address]
) -> Iterator[list[int]]:
    """The link at some addresses, each before a device of its own; their ports."""
    with ExitStack() as servers:
        found = [servers.enter_context(socket.create_server(address)) for address in at]
        for server, device in zip(found, devices, strict=True):
            threading.Thread(target=link.serve, args=(server, device), daemon=True).start()
        try:
            yield [server.getsockname()[1] for server in found]
        finally:
            link.is_over.set()
            for server in found:
                with suppress(OSError):
                    server.shutdown(socket.SHUT_RDWR)


def reach(address: Address) -> Callable[[], socket.socket]:
    """A connection to a device's address, whenever one is needed."""
    return lambda: socket.create_connection(address)


def played(play: Callable[[socket.socket], None]) -> Callable[[], socket.socket]:
    """A device that is a function of this process, for each connection anew."""

    def connect() -> socket.socket:
        ours, theirs = socket.socketpair()
        threading.Thread(target=_play, args=(play, theirs), daemon=True).start()
        return ours

    return connect


def _play(play: Callable[[socket.socket], None], line: socket.socket) -> None:
    with line, suppress(OSError):
        play(line)
