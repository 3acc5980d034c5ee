"""Grey images from a camera or video through OpenCV."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from basecal.vision.detection import Image

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # otherwise it prints text from remote servers
_STAMPED_BACKEND = "V4L2"
_TIMEOUT_MS = 5000  # without an image; OpenCV's default is 30 s
_TIMEOUTS = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, _TIMEOUT_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, _TIMEOUT_MS]


@dataclass(frozen=True, eq=False)
class Stream:
    """An open source of images; `capture` is a `cv2.VideoCapture`."""

    capture: Any

    def read(self) -> Image | None:
        """Read the next image, (h, w); None at the end of the source."""
        is_read, image = self.capture.read()
        if not is_read:
            return None
        return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))

    @property
    def is_stamped(self) -> bool:
        """Whether images have time stamps, as from V4L2 cameras on Linux."""
        return str(self.capture.getBackendName()) == _STAMPED_BACKEND

    def stamp_s(self) -> float:
        """Time stamp of the last image by the kernel's clock [s]."""
        return 1e-3 * float(self.capture.get(cv2.CAP_PROP_POS_MSEC))

    def close(self) -> None:
        """Release the source."""
        self.capture.release()


def open_stream(source: int | str | Path) -> Stream | None:
    """Open a camera by index, a video file or device by path, or a URL; None if OpenCV cannot open it."""
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    capture = cv2.VideoCapture()
    if isinstance(source, int):
        is_open = capture.open(source)
    elif isinstance(source, str):
        is_open = capture.open(source, cv2.CAP_FFMPEG, _TIMEOUTS)
    else:
        is_open = (source.is_file() or source.is_char_device()) and capture.open(os.path.abspath(source))
    if is_open:
        return Stream(capture)
    capture.release()
    return None
