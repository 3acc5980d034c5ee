"""The recording: robots' poses and cameras' observations, an instant at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from basecal.cell.calibration import Finding
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.rotation import nearest_rotation


@dataclass(frozen=True, eq=False)
class RobotState:
    """Where a robot was: `base_from_flange`, or `joints_rad`, (n,)."""

    base_from_flange: SE3 | None = None
    joints_rad: Array | None = None

    @property
    def vector(self) -> Array:
        """Joints [rad], or position [m] and rotation matrix of the pose, (k,)."""
        if self.joints_rad is not None:
            return self.joints_rad
        pose = self.base_from_flange
        assert pose is not None
        return np.concatenate([pose.translation, pose.rotation.ravel()])

    def with_vector(self, vector: Array) -> RobotState:
        """A state of this kind by another vector; its rotation is the nearest one."""
        if self.joints_rad is not None:
            return RobotState(joints_rad=vector)
        return RobotState(SE3(nearest_rotation(vector[3:].reshape(3, 3)), vector[:3]))


@dataclass(frozen=True, eq=False)
class PixelObservation:
    """Points of a target in an image.

    Attributes:
        camera: Name of the camera.
        target: Name of the target.
        ids: (n,) which points.
        pixels: (n, 2) [px], the centre of the top-left pixel is (0, 0).
        sigma_px: (n,) per coordinate [px]; None if not stated.
        detected: Whether `sigma_px` is a detector's own, which weighs points against one another and states nothing.
    """

    camera: str
    target: str
    ids: IntArray
    pixels: Array
    sigma_px: Array | None = None
    detected: bool = False


@dataclass(frozen=True, eq=False)
class CandidateObservation:
    """Bright spots of which at most one is the light: `pixels` (n, 2) [px], `sigma_px` (n,) or None, and `detected`."""

    camera: str
    target: str
    pixels: Array
    sigma_px: Array | None = None
    detected: bool = False


@dataclass(frozen=True, eq=False)
class PoseObservation:
    """A target's pose as another program measured it, with sigmas (6,) [m, rad] in the target's axes, or None."""

    camera: str
    target: str
    camera_from_target: SE3
    sigma: Array | None = None


@dataclass(frozen=True, eq=False)
class PointObservation:
    """Points of a target in 3-D: `ids` (n,), `points_in_camera` (n, 3) [m], `sigma_m` (n,) per axis or None."""

    camera: str
    target: str
    ids: IntArray
    points_in_camera: Array
    sigma_m: Array | None = None


@dataclass(frozen=True, eq=False)
class TouchObservation:
    """A tip at a mark, or at the tip of another robot; or a part in the grip of two robots.

    Attributes:
        tip: Name of the tip, or of the part.
        mark: Name of what it meets.
        sigma_m: Per axis [m]; None if not stated.
        kind: The field of `samples.jsonl` that says so.
        sigma_rad: Of the directions of a part [rad]; None if not stated.
    """

    tip: str
    mark: str
    sigma_m: float | None = None
    kind: Literal["touch", "tip2", "clamp"] = "touch"
    sigma_rad: float | None = None

    @property
    def camera(self) -> str:
        """The tip or the part, which takes the place of a camera."""
        return self.tip

    @property
    def target(self) -> str:
        """The touched target, at its own origin."""
        return self.mark


@dataclass(frozen=True, eq=False)
class TrackObservation:
    """Points of the static scene in an image, whose places nobody knows.

    Attributes:
        camera: Name of the camera.
        tracks: (n,) numbers of the points, the same in all images and for all cameras.
        pixels: (n, 2) [px], the centre of the top-left pixel is (0, 0).
    """

    camera: str
    tracks: IntArray
    pixels: Array


Observation = PixelObservation | CandidateObservation | PoseObservation | PointObservation | TouchObservation


@dataclass(frozen=True, eq=False)
class Sample:
    """One instant.

    Attributes:
        sample: Its number.
        stamp_s: Its time; None if not recorded.
        robots: Where each robot was, by name.
        observations: What the cameras saw.
        images: Paths relative to the cell, by camera.
        background: Images with the light off, by camera.
        tracks: What the cameras saw of the static scene.
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
    """All instants.

    Attributes:
        samples: In the order of the file.
        findings: What was found wrong while reading them (a truncated last line, a sample given twice).
        folder: The cell's folder, from which the paths of images count; None if it was not read from one.
    """

    samples: tuple[Sample, ...] = ()
    findings: tuple[Finding, ...] = ()
    folder: str | None = None

    def __repr__(self) -> str:
        """One line."""
        views = sum(len(sample.observations) for sample in self.samples)
        return f"<recording of {len(self.samples)} samples, {views} views>"

    def image_paths(self) -> dict[tuple[int, str], str]:
        """Paths of the images, by number of the sample and camera."""
        return {(s.sample, camera): path for s in self.samples for camera, path in s.images.items()}
