"""Pictures of a camera or video, as OpenCV gives them, turned grey."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from basecal.vision.detection import Image


@dataclass(frozen=True, eq=False)
class Stream:
    """A source of pictures that is open; `capture` is OpenCV's."""

    capture: Any

    def read(self) -> Image | None:
        """The next picture, (h, w); None where there is none any more."""
        came, picture = self.capture.read()
        if not came:
            return None
        return picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))

    def close(self) -> None:
        """Let go of the source."""
        self.capture.release()


def open_stream(source: int | str) -> Stream | None:
    """The camera of that number, or the file or address of that name; None where OpenCV cannot open it."""
    capture = cv2.VideoCapture(source)
    if not capture.isOpened():
        capture.release()
        return None
    return Stream(capture)
