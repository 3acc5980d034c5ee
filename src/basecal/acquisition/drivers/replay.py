"""Replay of a recording: its robots move only to recorded samples.

`move` selects the recorded sample nearest to the goal; the cameras then return that sample's images repeatedly. All
robots and cameras of a recording share the selected sample and one clock, which advances with every read.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from basecal.acquisition.driver import CameraImage, Grey, Place, Reading, checked_options
from basecal.acquisition.reaching import describe_external_path
from basecal.cell import Cell, Recording, RobotState, Sample
from basecal.cell.files import read_cell, read_recording
from basecal.errors import DriverError
from basecal.fields.values import Entry, PathText
from basecal.vision.image_file import grey_image, read_bytes

_TICK_S = 0.01  # advance of the clock with each read


NEEDS_OWN_PROCESS = False
"""A replay moves no real robot."""


class ReplayOptions(Entry):
    """Option `recording`: folder of the recorded cell, relative to this cell's folder."""

    recording: PathText


class Playback:
    """A recording and its selected sample."""

    def __init__(self, cell: Cell, recording: Recording) -> None:
        self.cell, self.samples = cell, recording.samples
        self.folder = Path(recording.folder or ".")
        self.selected: Sample | None = None
        self._goals: dict[str, RobotState] = {}
        self._now_s = 0.0

    def tick(self) -> float:
        """Advance the clock; the new time [s]."""
        self._now_s += _TICK_S
        return self._now_s

    def select(self, robot: str, to: RobotState) -> None:
        """Select the sample nearest to the last goals of all robots."""
        self._goals[robot] = to
        self.selected = min(self.samples, key=self._distance)

    def current_sample(self, is_suitable: Callable[[Sample], bool], name: str) -> Sample:
        """The selected sample; before the first motion, the first suitable sample.

        Raises:
            DriverError: if the sample is not suitable.
        """
        if self.selected is None:
            self.selected = next((sample for sample in self.samples if is_suitable(sample)), None)
        if self.selected is None or not is_suitable(self.selected):
            where = "" if self.selected is None else f" in sample {self.selected.sample}"
            raise DriverError(f"{name}: the recording has no data of this device{where}")
        return self.selected

    def _distance(self, sample: Sample) -> float:
        distance = 0.0
        for name, to in self._goals.items():
            state = sample.robots.get(name)
            if state is None or (state.joints_rad is None) != (to.joints_rad is None):
                return math.inf
            distance += float(np.linalg.norm(state.vector - to.vector))
        return distance


class ReplayRobot:
    """A robot of a recording."""

    is_live = True

    def __init__(self, name: str, playback: Playback) -> None:
        self._name, self._playback = name, playback

    def state(self) -> Reading:
        """State of the robot in the selected sample.

        Raises:
            DriverError: if the sample has no state of the robot.
        """
        sample = self._playback.current_sample(lambda each: self._name in each.robots, self._name)
        return Reading(self._playback.tick(), replace(sample.robots[self._name]))

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        """Select the nearest sample, without delay at any speed."""
        self._playback.select(self._name, to)

    def stop(self) -> None:
        """Do nothing: a replayed robot moves without delay."""

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


class ReplayCamera:
    """A camera of a recording, with its images."""

    is_live = True
    is_on_demand = True

    def __init__(self, name: str, playback: Playback) -> None:
        self._name, self._playback, self._lit = name, playback, True

    def light(self, on: bool) -> None:
        """Select the images with the LED on, or those with the LED off."""
        self._lit = on

    def image(self) -> CameraImage:
        """Image of the camera in the selected sample.

        Raises:
            DriverError: if the sample has no image, or the image is unreadable.
        """
        sample = self._playback.current_sample(lambda each: self._name in each.images, self._name)
        paths = sample.images if self._lit else sample.background
        if self._name not in paths:
            raise DriverError(f"{self._name}: the recording has no image with the LED off in sample {sample.sample}")
        return CameraImage(self._playback.tick(), self._read(paths[self._name]))

    def _read(self, path: str) -> Grey:
        grey = grey_image(read_bytes(self._playback.folder / path), self._playback.cell.cameras[self._name].size_px)
        if isinstance(grey, str):
            raise DriverError(f"{self._name}: {path} {grey}")
        return grey

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


def reaches(place: Place) -> str:
    """Description of the recording if it is outside the cell's folder; else empty.

    Raises:
        DatasetError: if an option is wrong.
    """
    return describe_external_path(place.folder, _recording(place), "recording")


def open_robot(place: Place) -> ReplayRobot:
    """Open a robot of a recording.

    Raises:
        DatasetError: if an option is wrong, or the recording cannot be read or has no robot of this name.
    """
    return ReplayRobot(place.name, _playback_with(place))


def open_camera(place: Place) -> ReplayCamera:
    """Open a camera of a recording.

    Raises:
        DatasetError: if an option is wrong, or the recording cannot be read or has no camera of this name.
    """
    return ReplayCamera(place.name, _playback_with(place))


def _recording(place: Place) -> Path:
    return place.folder / checked_options(place, ReplayOptions).recording


def _playback_with(place: Place) -> Playback:
    playback = _read_playback(_recording(place).resolve())
    if place.name not in getattr(playback.cell, place.section):
        raise place.error(f"{playback.folder} has no {place.section[:-1]} {place.name!r}", "driver.recording")
    return playback


@cache
def _read_playback(folder: Path) -> Playback:
    cell = read_cell(folder)
    return Playback(cell, read_recording(folder, cell))
