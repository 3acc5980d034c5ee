"""Pixels from the bytes of an image, and what the decoder says of them, which it says to the terminal only."""

from __future__ import annotations

import os
import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

_STDERR = 2
_MOST_CHATTER = 2**16  # [bytes] that are read of what a decoder writes
_ONE_AT_A_TIME = threading.Lock()
_WARNING = re.compile(r"^(\[ *(WARN|INFO)|Warning: )")  # OpenCV's, of tags that it does not know; libjpeg's of JFIF's
_BEFORE_END = re.compile(r"(\d+) extraneous bytes before marker 0xd9")
_END = b"\xff\xd9"
_DECODERS = re.compile(
    r"^(Corrupt JPEG data|Premature end of JPEG|JPEG|Invalid |Unsupported |Inconsistent |Warning: unknown JFIF|libpng)"
    r"|^\[ *"
)
_GOES_ON = re.compile(r"^(> .*)?$")  # a line of OpenCV's after its first
_PREFIX = re.compile(r"^(Corrupt JPEG data: |libpng \w+: |\[ *ERROR[^\]]*\] global \S+ \S+ )")


class Decoded(NamedTuple):
    """An image as it is stored, (h, w) or (h, w, channels), or None; and what is amiss with it, or nothing."""

    pixels: NDArray[Any] | None
    amiss: str


def decoded(data: bytes) -> Decoded:
    """The pixels of an image, as the sensor gave them whatever EXIF says of turning them, and what is amiss."""
    said: list[str] = []
    with _heard(said, data):
        try:
            pixels = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:
            pixels = None
    return Decoded(pixels, said[0] if said else "")


@contextmanager
def _heard(said: list[str], data: bytes) -> Iterator[None]:
    """Complaints that decoders write to stderr meanwhile, in `said`; lines of others go on to stderr."""
    with _ONE_AT_A_TIME:
        try:
            kept = os.dup(_STDERR)
        except OSError:  # no stderr to hear
            yield
            return
        with tempfile.TemporaryFile() as written:
            os.dup2(written.fileno(), _STDERR)
            try:
                yield
            finally:
                os.dup2(kept, _STDERR)
                os.close(kept)
                written.seek(0)
                text = written.read(_MOST_CHATTER).decode("utf-8", "replace")
                said += [_PREFIX.sub("", line).strip() for line in _complaints(text) if not _is_padding(line, data)]
                _passed_on(text)


def _complaints(text: str) -> list[str]:
    return [line for line in text.splitlines() if _DECODERS.match(line) and not _WARNING.match(line)]


def _is_padding(line: str, data: bytes) -> bool:
    """Whether what is left over at the end of a JPEG is padding; else its decoder lost its way and came out short."""
    left = _BEFORE_END.search(line)
    end = data.rfind(_END)
    return left is not None and len(set(data[max(end - int(left[1]), 0) : end])) == 1


def _passed_on(text: str) -> None:
    others, within = [], False
    for line in text.splitlines(keepends=True):
        within = bool(_DECODERS.match(line) or (within and _GOES_ON.match(line)))
        others += [] if within else [line]
    if others:
        os.write(_STDERR, "".join(others).encode("utf-8", "replace"))
