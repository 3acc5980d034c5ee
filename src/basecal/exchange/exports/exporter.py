"""The class of an exporter: its module in `exporters` ends in an `EXPORTER` of this class."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from basecal.exchange.exports.wanted import Wanted

Takes = Literal["transform", "robot", "camera", "urdf", "joint"]


@dataclass(frozen=True)
class Exporter:
    """A calibration as the text of another program's file.

    Attributes:
        words: What it gives, for help.
        text: Writes the file.
        takes: What of a calibration it can write, what is usual first; each is an option of `basecal export`.
        is_pasted: Whether people paste it: of transforms, and text.
    """

    words: str
    text: Callable[[Wanted], str]
    takes: tuple[Takes, ...] = ("transform",)
    is_pasted: bool = False
