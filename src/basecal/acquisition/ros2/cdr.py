"""Messages to bytes and back: plain CDR, the serialisation of ROS 2 on the wire and in bags.

Source: OMG DDSI-RTPS 2.5, 10.2; Common Data Representation of OMG CORBA 3.4, part 2, 9.3: each primitive stands at a
multiple of its size, counted from behind the header of four bytes.
"""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any

import numpy as np

from basecal.acquisition.ros2.types import Fields, core, members
from basecal.errors import InputError

_CODES = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H",
    "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
_HEADER = 4
_LITTLE = b"\x00\x01\x00\x00"
_ORDERS = {0: ">", 1: "<"}  # by the second byte of the header; others are XCDR2 or parameter lists


def decoded(fields: Fields, data: bytes) -> Any:
    """A message with its fields as attributes; primitives in sequences and arrays are NumPy's.

    Raises:
        InputError: if the bytes end too early, or are of another serialisation.
    """
    if len(data) < _HEADER or data[0] != 0 or data[1] not in _ORDERS:
        raise InputError("a message is not in plain CDR, which is all that ROS 2 sends")
    try:
        return _Reader(memoryview(data)[_HEADER:], _ORDERS[data[1]]).message(fields)
    except (struct.error, ValueError, UnicodeDecodeError):
        raise InputError("a message ends too early: its type is not the one that it is sent as") from None


def encoded(fields: Fields, message: Any) -> bytes:
    """A message as bytes, the lowest byte of a number first."""
    writer = _Writer()
    writer.message(fields, message)
    return _LITTLE + bytes(writer.data)


class _Reader:
    def __init__(self, data: memoryview, order: str) -> None:
        self.data, self.order, self.at = data, order, 0

    def message(self, fields: Fields) -> Any:
        """The members of a message, read one after another, as a namespace."""
        return SimpleNamespace(**{name: self.value(kind) for name, kind in members(fields).items()})

    def value(self, kind: Any) -> Any:
        """The next member of a message, of any kind.

        Raises:
            ValueError: if it would reach beyond the bytes that there are.
        """
        if isinstance(kind, str):
            return self.text() if kind == "string" else self.number(_CODES[kind])
        if isinstance(kind, dict):
            return self.message(kind)
        if isinstance(kind, core().BoundedString):
            return self.text()
        count = kind.length if isinstance(kind, core().Array) else self.number("I")
        if isinstance(kind.subtype, str) and kind.subtype in _CODES:
            return self.numbers(_CODES[kind.subtype], count)
        if count > len(self.data) - self.at:
            raise ValueError
        return [self.value(kind.subtype) for _ in range(count)]

    def number(self, code: str) -> Any:
        """The next number, of a format of `struct`, aligned to its size."""
        size = struct.calcsize(code)
        self.at += -self.at % size
        (value,) = struct.unpack_from(self.order + code, self.data, self.at)
        self.at += size
        return value

    def numbers(self, code: str, count: int) -> Any:
        """The next numbers of one kind, (count,), a view of the bytes; nothing is aligned where there are none."""
        kind = np.dtype(self.order + code)
        self.at += -self.at % kind.itemsize if count else 0
        values = np.frombuffer(self.data, kind, count, self.at) if count else np.empty(0, kind)
        self.at += values.nbytes
        return values

    def text(self) -> str:
        """The next text, without the zero that ends it.

        Raises:
            ValueError: if it would reach beyond the bytes that there are.
        """
        size = self.number("I")
        if size > len(self.data) - self.at:
            raise ValueError
        word = bytes(self.data[self.at : self.at + size])
        self.at += size
        return word.rstrip(b"\0").decode()


class _Writer:
    def __init__(self) -> None:
        self.data = bytearray()

    def message(self, fields: Fields, message: Any) -> None:
        """Append the members of a message in their order."""
        for name, kind in members(fields).items():
            self.value(kind, getattr(message, name))

    def value(self, kind: Any, value: Any) -> None:
        """Append a member of any kind; a sequence begins with how many it has."""
        if isinstance(kind, str):
            self.text(value) if kind == "string" else self.number(_CODES[kind], value)
        elif isinstance(kind, dict):
            self.message(kind, value)
        elif isinstance(kind, core().BoundedString):
            self.text(value)
        else:
            if not isinstance(kind, core().Array):
                self.number("I", len(value))
            self.entries(kind.subtype, value)

    def entries(self, kind: Any, values: Any) -> None:
        """Append the entries of an array or a sequence; numbers as one block."""
        if isinstance(kind, str) and kind in _CODES:
            numbers = np.asarray(values, np.dtype("<" + _CODES[kind]))
            self.align(numbers.itemsize if numbers.size else 1)
            self.data += numbers.tobytes()
            return
        for value in values:
            self.value(kind, value)

    def number(self, code: str, value: Any) -> None:
        """Append a number, of a format of `struct`, aligned to its size."""
        self.align(struct.calcsize(code))
        self.data += struct.pack("<" + code, value)

    def text(self, word: str) -> None:
        """Append a text with its length in bytes and the zero that ends it."""
        data = word.encode() + b"\0"
        self.number("I", len(data))
        self.data += data

    def align(self, size: int) -> None:
        """Append zeros up to a multiple of `size` bytes."""
        self.data += bytes(-len(self.data) % size)
