"""The recording: robot poses and camera observations, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from basecal.cell.calibration import Finding
from basecal.errors import count_text
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.array import read_only
from basecal.geometry.rotation import nearest_rotation


def _lists_to_arrays(item: object, *names: str) -> None:
    """Convert the named fields of a dataclass to arrays if they are lists; arrays are not copied.

    Raises:
        InputError: if a list does not hold numbers.
    """
    for name in names:
        values = getattr(item, name)
        if values is not None and not isinstance(values, np.ndarray):
            array = read_only(values, name=name)
            is_whole = name in ("ids", "tracks") and bool(np.all(array == np.floor(array)))
            object.__setattr__(item, name, array.astype(np.int64) if is_whole else array)


@dataclass(frozen=True, eq=False)
class RobotState:
    """Recorded state of a robot: `base_from_flange`, or `joints_rad`, (n,)."""

    base_from_flange: SE3 | None = None
    joints_rad: Array | None = None

    def __post_init__(self) -> None:
        _lists_to_arrays(self, "joints_rad")

    @property
    def vector(self) -> Array:
        """Joints [rad], or position [m] and rotation matrix of the pose, (k,)."""
        if self.joints_rad is not None:
            return self.joints_rad
        pose = self.base_from_flange
        assert pose is not None
        return np.concatenate([pose.translation, pose.rotation.ravel()])

    def with_vector(self, vector: Array) -> RobotState:
        """Return a state of the same kind from another vector; the matrix is projected to the nearest rotation."""
        if self.joints_rad is not None:
            return RobotState(joints_rad=vector)
        return RobotState(SE3(nearest_rotation(vector[3:].reshape(3, 3)), vector[:3]))


@dataclass(frozen=True, eq=False)
class PixelObservation:
    """Points of a target in an image.

    Attributes:
        camera: Name of the camera.
        target: Name of the target.
        ids: (n,) ids of the points.
        pixels: (n, 2) [px], the centre of the top-left pixel is (0, 0).
        sigma_px: (n,) per coordinate [px]; None if not stated.
        detected: Whether `sigma_px` comes from a detector: it then sets relative weights, not the noise level.
    """

    camera: str
    target: str
    ids: IntArray
    pixels: Array
    sigma_px: Array | None = None
    detected: bool = False

    def __post_init__(self) -> None:
        _lists_to_arrays(self, "ids", "pixels", "sigma_px")


@dataclass(frozen=True, eq=False)
class CandidateObservation:
    """Bright spots, at most one of them the LED: `pixels` (n, 2) [px], `sigma_px` (n,) or None, and `detected`."""

    camera: str
    target: str
    pixels: Array
    sigma_px: Array | None = None
    detected: bool = False

    def __post_init__(self) -> None:
        _lists_to_arrays(self, "pixels", "sigma_px")


@dataclass(frozen=True, eq=False)
class PoseObservation:
    """A target's pose measured by another program, with sigmas (6,) [m, rad] in the target's axes, or None."""

    camera: str
    target: str
    camera_from_target: SE3
    sigma: Array | None = None

    def __post_init__(self) -> None:
        _lists_to_arrays(self, "sigma")


@dataclass(frozen=True, eq=False)
class PointObservation:
    """Points of a target in 3-D: `ids` (n,), `points_in_camera` (n, 3) [m], `sigma_m` (n,) per axis or None."""

    camera: str
    target: str
    ids: IntArray
    points_in_camera: Array
    sigma_m: Array | None = None

    def __post_init__(self) -> None:
        _lists_to_arrays(self, "ids", "points_in_camera", "sigma_m")


@dataclass(frozen=True, eq=False)
class TouchObservation:
    """A touch of a tip at a mark or at another robot's tip, or a part held by two robots.

    Attributes:
        tip: Name of the tip, or of the part.
        mark: Name of the touched mark or tip, or of the part's other end.
        sigma_m: Sigma of the position per axis [m]; None if not stated.
        kind: The field of `samples.jsonl` for this kind of observation.
        sigma_rad: Sigma of the direction of a held part [rad]; None if not stated.
    """

    tip: str
    mark: str
    sigma_m: float | None = None
    kind: Literal["touch", "tip2", "clamp"] = "touch"
    sigma_rad: float | None = None

    @property
    def camera(self) -> str:
        """Name of the tip or the part, which serves as the camera."""
        return self.tip

    @property
    def target(self) -> str:
        """Name of the touched target."""
        return self.mark


@dataclass(frozen=True, eq=False)
class TrackObservation:
    """Points of the static scene in an image; their positions in space are unknown.

    Attributes:
        camera: Name of the camera.
        tracks: (n,) numbers of the points, the same in all images and for all cameras.
        pixels: (n, 2) [px], the centre of the top-left pixel is (0, 0).
    """

    camera: str
    tracks: IntArray
    pixels: Array

    def __post_init__(self) -> None:
        _lists_to_arrays(self, "tracks", "pixels")


Observation = PixelObservation | CandidateObservation | PoseObservation | PointObservation | TouchObservation


@dataclass(frozen=True, eq=False)
class Sample:
    """Robot states and observations recorded at one time.

    Attributes:
        sample: Number of the sample.
        stamp_s: Time stamp [s]; None if not recorded.
        robots: States of the robots by name.
        observations: Observations of targets.
        images: Paths of images relative to the cell, by camera.
        background: Paths of images with the LED off, by camera.
        tracks: Observations of the static scene.
    """

    sample: int
    stamp_s: float | None = None
    robots: Mapping[str, RobotState] = field(default_factory=dict)
    observations: tuple[Observation, ...] = ()
    images: Mapping[str, str] = field(default_factory=dict)
    background: Mapping[str, str] = field(default_factory=dict)
    tracks: tuple[TrackObservation, ...] = ()


@dataclass(frozen=True, eq=False)
class Recording:
    """The samples of a cell.

    Attributes:
        samples: Samples in the order of the file.
        findings: Problems found while reading (a truncated last line, a duplicate sample).
        folder: The cell's folder, to which image paths are relative; None if it was not read from a folder.
    """

    samples: tuple[Sample, ...] = ()
    findings: tuple[Finding, ...] = ()
    folder: str | None = None

    def __repr__(self) -> str:
        """Return a one-line summary."""
        views = sum(len(sample.observations) for sample in self.samples)
        return f"<recording of {count_text(len(self.samples), 'sample')}, {views} views>"

    @property
    def stamps(self) -> dict[int, float]:
        """Time of each sample that has one, by number [s]."""
        return {s.sample: s.stamp_s for s in self.samples if s.stamp_s is not None}

    def image_paths(self) -> dict[tuple[int, str], str]:
        """Return the paths of the images by sample number and camera."""
        return {(s.sample, camera): path for s in self.samples for camera, path in s.images.items()}
