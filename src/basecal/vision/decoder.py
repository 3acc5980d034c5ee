"""Decoding of images, with the decoder's error messages, which it writes only to stderr."""

from __future__ import annotations

import os
import re
import struct
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from basecal.vision.image_header import with_stored_order

_STDERR = 2
_MOST_COMPLAINT_BYTES = 2**16  # [bytes] of a decoder's messages that are read
_STDERR_LOCK = threading.Lock()
_WARNING = re.compile(r"^(\[ *(WARN|INFO)|Warning: )")  # of OpenCV about unknown tags, and of libjpeg about JFIF
_EXTRANEOUS_BYTES = re.compile(r"(\d+) extraneous bytes before marker 0xd9")
_END_MARKER = b"\xff\xd9"
_RIFF_HEADER_BYTES, _CHUNK_HEADER_BYTES = 12, 8  # [bytes]
_UNUSED_BYTES = 16  # bytes at the end of a lossy WebP's pixels: an encoder leaves less than two of them unused
_LEAST_PIXEL_BYTES = 100  # bytes of a lossy WebP, below which `_UNUSED_BYTES` may belong to a uniform image
_DECODER_LINE = re.compile(
    r"^(Corrupt JPEG data|Premature end of JPEG|JPEG|Invalid |Unsupported |Inconsistent |Warning: unknown JFIF|libpng)"
    r"|^\[ *"
)
_CONTINUATION = re.compile(r"^(> .*)?$")  # further lines of a message of OpenCV
_PREFIX = re.compile(r"^(Corrupt JPEG data: |libpng \w+: |\[ *ERROR[^\]]*\] global \S+ \S+ )")


class Decoded(NamedTuple):
    """Stored pixels of an image, (h, w) or (h, w, channels), None if unreadable, and its damage, empty if none."""

    pixels: NDArray[Any] | None
    damage: str


def decode(data: bytes) -> Decoded:
    """Decode an image without applying the orientation for display, and report damage."""
    complaints: list[str] = []
    with _capture_complaints(complaints, data):
        try:
            stored = np.frombuffer(with_stored_order(data), dtype=np.uint8)
            pixels = cv2.imdecode(stored, cv2.IMREAD_UNCHANGED)
        except cv2.error:
            pixels = None
        has_unused_end = pixels is not None and data.startswith(b"RIFF") and _has_unused_end(data, pixels)
    return Decoded(pixels, complaints[0] if complaints else "its last bytes change no pixel" if has_unused_end else "")


def _has_unused_end(data: bytes, pixels: NDArray[Any]) -> bool:
    """Whether the last bytes of a lossy WebP have no effect on its pixels, as after corruption of a byte.

    The format has no checksum, but a changed byte alters how all following bytes are decoded. The decoder then finishes
    before the end, or needs more bytes; it reports the latter itself. Source: RFC 6386 (7).
    """
    cut = _without_end(data)
    try:
        without = None if cut is None else cv2.imdecode(np.frombuffer(cut, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return False
    return without is not None and np.array_equal(pixels, without)


def _without_end(data: bytes) -> bytes | None:
    """A lossy WebP without the last bytes of its pixels; None for other formats and for very small images."""
    position = _RIFF_HEADER_BYTES
    while position + _CHUNK_HEADER_BYTES <= len(data):
        name, size = struct.unpack_from("<4sI", data, position)
        first, end = position + _CHUNK_HEADER_BYTES, position + _CHUNK_HEADER_BYTES + size
        if name == b"VP8 " and size >= _LEAST_PIXEL_BYTES and end <= len(data):
            kept = data[first : end - _UNUSED_BYTES]
            chunk = struct.pack("<4sI", name, len(kept)) + kept + bytes(len(kept) % 2)
            body = data[_RIFF_HEADER_BYTES:position] + chunk
            return b"RIFF" + struct.pack("<I4s", 4 + len(body), b"WEBP") + body
        position = end + size % 2
    return None


@contextmanager
def _capture_complaints(complaints: list[str], data: bytes) -> Iterator[None]:
    """Append messages that decoders write to stderr to `complaints`; forward all other lines to stderr."""
    with _STDERR_LOCK:
        try:
            stderr_copy = os.dup(_STDERR)
        except OSError:  # there is no stderr
            yield
            return
        with tempfile.TemporaryFile() as captured:
            os.dup2(captured.fileno(), _STDERR)
            try:
                yield
            finally:
                os.dup2(stderr_copy, _STDERR)
                os.close(stderr_copy)
                captured.seek(0)
                text = captured.read(_MOST_COMPLAINT_BYTES).decode("utf-8", "replace")
                lines = [line for line in text.splitlines() if _DECODER_LINE.match(line) and not _WARNING.match(line)]
                complaints += [_PREFIX.sub("", line).strip() for line in lines if not _is_padding(line, data)]
                _forward_other_lines(text)


def _is_padding(line: str, data: bytes) -> bool:
    """Whether the extraneous bytes at the end of a JPEG are padding; otherwise its decoder lost synchronisation."""
    match = _EXTRANEOUS_BYTES.search(line)
    end = data.rfind(_END_MARKER)
    return match is not None and len(set(data[max(end - int(match[1]), 0) : end])) == 1


def _forward_other_lines(text: str) -> None:
    others, within = [], False
    for line in text.splitlines(keepends=True):
        within = bool(_DECODER_LINE.match(line) or (within and _CONTINUATION.match(line)))
        others += [] if within else [line]
    if others:
        os.write(_STDERR, "".join(others).encode("utf-8", "replace"))
