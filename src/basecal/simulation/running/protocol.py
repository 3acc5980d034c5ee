"""The protocol of a running cell: one JSON object per line as request and as reply; see docs/capture.md."""

from __future__ import annotations

import json
import secrets
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from basecal.bounded_file import read_bounded
from basecal.cell.format.consent import allow, withdraw
from basecal.cell.format.writing import write_private
from basecal.errors import DatasetError, DriverError, InputError
from basecal.fields.values import Entry

HOST = "127.0.0.1"
"""The only address a running cell listens on."""

ADDRESS_FILE = Path("derived", "simulated.json")
"""File in the cell's folder with the address of the running cell; only its owner may read it."""

LONGEST_LINE_BYTES = 2**24
"""Largest line in bytes: 16 MB, a quarter of which an image of two megapixels needs."""

MOST_JOINTS = 100
"""Largest number of joints of an arm in requests and replies."""

_IMAGE_TIMEOUT_S = 60.0  # for an image that is rendered on a busy machine
_ANSWER_TIMEOUT_S = 10.0  # for any other reply, and for the connection
_LEAST_TIMEOUT_S = 1e-3  # a timeout of zero would make the socket non-blocking
_RECEIVED_BYTES = 2**16  # per call
_TOKEN_BYTES = 24
_LARGEST_ADDRESS_BYTES = 2**16  # bytes


class Address(Entry):
    """Port, token and process id of a running cell."""

    port: int = Field(gt=0, lt=2**16)
    token: str
    pid: int


def new_token() -> str:
    """A new random token."""
    return secrets.token_urlsafe(_TOKEN_BYTES)


def describe_address(address: Address) -> str:
    """Description of an address."""
    return f"a simulated cell at {HOST}:{address.port}"


def write_address(folder: Path, address: Address) -> Path:
    """Write the address file of a running cell, and allow its use without a prompt; the path of the file.

    Raises:
        InputError: if the file cannot be written.
    """
    write_private(folder / ADDRESS_FILE, json.dumps(address.model_dump()) + "\n", base_folder=folder)
    allow(folder, [describe_address(address)])
    return folder / ADDRESS_FILE


def remove_address(folder: Path, address: Address) -> None:
    """Remove the address file of a cell that has ended."""
    (folder / ADDRESS_FILE).unlink(missing_ok=True)
    withdraw(folder, describe_address(address))


def read_address(folder: Path) -> Address:
    """Read the address of the running cell of a folder.

    Raises:
        DriverError: if the folder has no valid address file.
    """
    path = folder / ADDRESS_FILE
    try:
        return Address.model_validate_json(read_bounded(path, _LARGEST_ADDRESS_BYTES))
    except (DatasetError, ValidationError):
        raise DriverError(f"no simulated cell runs here: start it with `basecal simulate {folder} --process`") from None


def encode(message: Mapping[str, Any]) -> bytes:
    """Encode a message as a line."""
    return json.dumps(message, allow_nan=False).encode() + b"\n"


def decode(line: bytes) -> dict[str, Any]:
    """Decode a message from a line.

    Raises:
        InputError: if the line is not one complete JSON object.
    """
    if not line.endswith(b"\n"):
        raise InputError("a line was cut off, or is too long")
    try:
        message = json.loads(line)
    except (ValueError, RecursionError):
        raise InputError("expected one JSON object a line") from None
    if not isinstance(message, dict):
        raise InputError("expected one JSON object a line")
    return message


@dataclass(frozen=True, eq=False)
class Connection:
    """A connection to a running cell."""

    token: str
    link: socket.socket

    def ask(self, **request: Any) -> dict[str, Any]:
        """Send a request; the reply without its `ok`.

        Raises:
            DriverError: if the cell refuses the request, or does not answer.
        """
        wait_s = _IMAGE_TIMEOUT_S if request.get("do") == "image" else _ANSWER_TIMEOUT_S
        try:
            reply = decode(self._exchange_lines(encode({"token": self.token, **request}), time.monotonic() + wait_s))
        except (OSError, InputError) as error:
            raise DriverError(f"the simulated cell does not answer any more ({error or 'it has ended'})") from None
        if reply.pop("ok", False) is not True:
            raise DriverError(f"the simulated cell refuses {request.get('do')!r}: {reply.get('error')}")
        return reply

    def _exchange_lines(self, request: bytes, deadline_s: float) -> bytes:
        """Send a line and return the reply; an incomplete reply if the connection closes or the reply is too long.

        Raises:
            OSError: if the connection is broken, or a read takes longer than until the deadline [s].
        """
        reply = bytearray()
        self.link.settimeout(_ANSWER_TIMEOUT_S)
        self.link.sendall(request)
        while not reply.endswith(b"\n") and len(reply) < LONGEST_LINE_BYTES:
            self.link.settimeout(max(deadline_s - time.monotonic(), _LEAST_TIMEOUT_S))
            received = self.link.recv(_RECEIVED_BYTES)
            if not received:
                break
            reply += received
        return bytes(reply)

    def close(self) -> None:
        """Close the connection."""
        with suppress(OSError):
            self.link.close()


def connect(address: Address) -> Connection:
    """Connect to a running cell.

    Raises:
        DriverError: if nothing listens at the address.
    """
    try:
        link = socket.create_connection((HOST, address.port), timeout=_ANSWER_TIMEOUT_S)
    except OSError as error:
        raise DriverError(
            f"no simulated cell listens on port {address.port} ({error.strerror}): start it again"
        ) from None
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return Connection(address.token, link)
