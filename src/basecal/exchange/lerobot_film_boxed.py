"""Subprocess that decodes a film: grey images at given times.

The arguments are the film and the times [s].
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

from basecal.box import Frame
from basecal.errors import InputError

# A file may be a disguised playlist of URLs: only these formats are read, and only local files are opened.
_OPTIONS = "threads;1|format_whitelist;mov,mp4,m4a,3gp,3g2,mj2|protocol_whitelist;file"
_MOST_FRAMES = 5_000_000  # limit of a film: 46 hours at 30 Hz
_MOST_PIXELS = 2**25  # limit of an image


def read_frames(words: Sequence[str]) -> Iterator[Frame]:
    """Frames `[index of the time]` with an image as PNG, by ascending times, until the end of the film."""
    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = _OPTIONS
    import cv2

    cv2.setNumThreads(1)
    film = cv2.VideoCapture(words[0], cv2.CAP_FFMPEG)
    rate_hz = film.get(cv2.CAP_PROP_FPS) if film.isOpened() else 0.0
    if not 0 < rate_hz < 1e4:
        raise InputError("cannot be decoded")
    width, height = film.get(cv2.CAP_PROP_FRAME_WIDTH), film.get(cv2.CAP_PROP_FRAME_HEIGHT)
    if width * height > _MOST_PIXELS:
        raise InputError(f"has images of {width:g} x {height:g} px, which is more than is read")
    requests = sorted((round(float(word) * rate_hz), index) for index, word in enumerate(words[1:]))
    grabbed = -1
    for frame, index in requests:
        while grabbed < min(frame, _MOST_FRAMES):
            if not film.grab():
                if grabbed < 0:
                    raise InputError("cannot be decoded")
                return
            grabbed += 1
        is_read, image = film.retrieve()
        if not is_read:
            raise InputError(f"frame {frame} cannot be decoded")
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
        yield [index], cv2.imencode(".png", grey)[1].tobytes()
