"""Any camera or stream that OpenCV opens: a device number, a video file, or an address.

The timestamp is that of the kernel for V4L2 cameras, else the monotonic clock of this machine at the image's arrival.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from pydantic import Field

from basecal.acquisition.driver import CameraImage, Place, checked_options
from basecal.acquisition.reaching import describe_external_path
from basecal.errors import DriverError
from basecal.fields.values import Entry, PathText
from basecal.vision.stream import Stream, open_stream


class OpencvOptions(Entry):
    """Option `source`: a device number, a path relative to the cell's folder, or an address."""

    source: Annotated[int, Field(ge=0)] | PathText = 0


class OpencvCamera:
    """A stream of OpenCV; a video file is not live, and returns its next image on request."""

    def __init__(self, name: str, stream: Stream, is_file: bool) -> None:
        self._name, self._stream = name, stream
        self.is_live, self.is_on_demand = not is_file, is_file
        self.is_stamped = stream.is_stamped

    def image(self) -> CameraImage:
        """The next image of the stream.

        Raises:
            DriverError: if the stream has ended.
        """
        grey = self._stream.read()
        if grey is None:
            raise DriverError(f"{self._name}: the stream has ended, or the camera was pulled out")
        return CameraImage(self._stream.stamp_s() if self.is_stamped else time.monotonic(), grey)

    def close(self) -> None:
        """Release the device."""
        self._stream.close()


def reaches(place: Place) -> str:
    """Description of the device, the address, or the path if it is outside the cell's folder; else empty.

    Raises:
        DatasetError: if an option is wrong.
    """
    source = _source(place)
    if isinstance(source, Path):
        return describe_external_path(place.folder, source, "film or device")
    return f"camera {source} of this computer" if isinstance(source, int) else source


def _source(place: Place) -> int | str | Path:
    """Device number, address, or path."""
    source = checked_options(place, OpencvOptions).source
    return source if isinstance(source, int) or "://" in source else place.folder / source


def open_camera(place: Place) -> OpencvCamera:
    """Open the stream.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if OpenCV cannot open the stream.
    """
    source = _source(place)
    stream = open_stream(source)
    if stream is None:
        name = str(source) if isinstance(source, Path) else source
        raise DriverError(f"{place.name}: OpenCV cannot open {name!r}; is it plugged in, and used by nobody else?")
    return OpencvCamera(place.name, stream, isinstance(source, Path) and source.is_file())
