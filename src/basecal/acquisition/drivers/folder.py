"""Images that another program saves into a folder.

A file counts if its name is new and does not begin with a dot, and the image is complete. The newest such file is used.
The timestamp is the file's time of modification.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from pydantic import Field

from basecal.acquisition.driver import CameraImage, Place, checked_options
from basecal.acquisition.reaching import describe_external_path
from basecal.errors import DriverError
from basecal.fields.values import Entry, PathText
from basecal.vision.image_file import grey_image, read_bytes

_POLL_S = 0.02  # polling period of the folder: short compared with a motion, long for a disk
_WRITING_S = 5.0  # longest pause of a program while it writes an image
_NEWEST_FILES = 3  # number of newest files that are read: some may be incomplete


class FolderOptions(Entry):
    """Options of a folder.

    Attributes:
        path: The folder, relative to the cell's folder.
        wait_s: Timeout for the next image [s].
        existing: Whether to use the files that exist at the start.
    """

    path: PathText
    wait_s: Annotated[float, Field(gt=0, le=86_400)] = 600.0
    existing: bool = False


class FolderCamera:
    """A folder of images as a camera."""

    is_live = False
    is_stamped = True

    def __init__(self, folder: Path, wait_s: float, existing: bool) -> None:
        self._folder, self.wait_s, self.is_on_demand = folder, wait_s, existing
        self._seen = set() if existing else {path.name for path in folder.iterdir()}
        self._has_given = False
        self._unreadable_s: dict[tuple[int, Path], float] = {}

    def image(self) -> CameraImage:
        """Wait for the newest image; with the option `existing`, for the oldest image not returned yet.

        Incomplete files are read again until they are complete.

        Raises:
            DriverError: if no image arrives before the timeout, or the first file does not become an image.
        """
        deadline_s, reason = time.monotonic() + self.wait_s, ""
        while True:
            new = sorted(self._new_files())
            for written_ns, path in new if self.is_on_demand else new[: -1 - _NEWEST_FILES : -1]:
                grey = grey_image(read_bytes(path), None)
                if not isinstance(grey, str):
                    older = [] if self.is_on_demand else [each.name for ns, each in new if ns < written_ns]
                    self._seen.update([path.name, *older])
                    self._has_given = True
                    return CameraImage(1e-9 * written_ns, grey, source=path.name)
                reason = f"; {path.name} {grey}"
                if not self._has_given:
                    self._check_first(written_ns, path, grey)
            if time.monotonic() >= deadline_s:
                raise DriverError(f"no new image in {self._folder} within {self.wait_s:g} s{reason}")
            time.sleep(_POLL_S)

    def _check_first(self, written_ns: int, path: Path, problem: str) -> None:
        """Check that a file becomes a readable image in time, before the first image was returned.

        Raises:
            DriverError: if an unreadable file has not changed for five seconds.
        """
        since_s = self._unreadable_s.setdefault((written_ns, path), time.monotonic())
        if time.monotonic() - since_s > _WRITING_S:
            raise DriverError(f"{path} {problem}. Save complete images, as PNG, JPEG or TIFF")

    def _new_files(self) -> Iterator[tuple[int, Path]]:
        """New files, with their times of modification [ns]."""
        for path in self._folder.iterdir():
            with suppress(FileNotFoundError):  # programs rename files after writing
                if path.name not in self._seen and not path.name.startswith(".") and path.is_file():
                    yield path.stat().st_mtime_ns, path

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


def reaches(place: Place) -> str:
    """Description of the folder if it is outside the cell's folder; else empty.

    Raises:
        DatasetError: if an option is wrong.
    """
    return describe_external_path(place.folder, place.folder / checked_options(place, FolderOptions).path, "folder")


def open_camera(place: Place) -> FolderCamera:
    """Open a folder as a camera.

    Raises:
        DatasetError: if an option is wrong, or the folder does not exist.
    """
    options = checked_options(place, FolderOptions)
    folder = place.folder / options.path
    if not folder.is_dir():
        raise place.error(f"there is no folder {folder}: create it, and save images into it", "driver.path")
    return FolderCamera(folder, options.wait_s, options.existing)
