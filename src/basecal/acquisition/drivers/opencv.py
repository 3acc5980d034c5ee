"""Any camera or stream that OpenCV opens: a device's number, a file of a video, an address.

The stamp is that of the kernel if the camera is one of V4L2, else this machine's monotonic clock when the image came.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from pydantic import Field

from basecal.acquisition.driver import CameraImage, Place, checked_options
from basecal.acquisition.reaching import external_path
from basecal.errors import DriverError
from basecal.fields.values import Entry, PathText
from basecal.vision.stream import Stream, open_stream


class OpencvOptions(Entry):
    """`source`: the number of a device, a path from the cell's folder, or an address."""

    source: Annotated[int, Field(ge=0)] | PathText = 0


class OpencvCamera:
    """A stream; a file of a video gives its next image when asked, and is not live."""

    def __init__(self, name: str, stream: Stream, is_file: bool = False) -> None:
        self._name, self._stream = name, stream
        self.is_live, self.is_on_demand = not is_file, is_file
        self.is_stamped = stream.is_stamped

    def image(self) -> CameraImage:
        """The next image of the stream.

        Raises:
            DriverError: if it has ended.
        """
        grey = self._stream.read()
        if grey is None:
            raise DriverError(f"{self._name}: the stream has ended, or the camera was pulled out")
        return CameraImage(self._stream.stamp_s() if self.is_stamped else time.monotonic(), grey)

    def close(self) -> None:
        """Release the device."""
        self._stream.close()


def reaches(place: Place) -> str:
    """The device or the address, or a path that is outside of the cell's folder.

    Raises:
        DatasetError: if an option is wrong.
    """
    source = _source(place)
    if isinstance(source, Path):
        return external_path(place.folder, source, "film or device")
    return f"camera {source} of this computer" if isinstance(source, int) else source


def _source(place: Place) -> int | str | Path:
    """The number of a device, an address, or a path."""
    source = checked_options(place, OpencvOptions).source
    return source if isinstance(source, int) or "://" in source else place.folder / source


def open_camera(place: Place) -> OpencvCamera:
    """The stream, opened.

    Raises:
        DatasetError: if an option is wrong.
        DriverError: if OpenCV cannot open it.
    """
    source = _source(place)
    stream = open_stream(source)
    if stream is None:
        name = str(source) if isinstance(source, Path) else source
        raise DriverError(f"{place.name}: OpenCV cannot open {name!r}; is it plugged in, and used by nobody else?")
    return OpencvCamera(place.name, stream, isinstance(source, Path) and source.is_file())
