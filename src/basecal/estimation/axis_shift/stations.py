"""Stations of the paper's method in a recording: a camera at rest, and an LED shifted without rotation.

Each station gives one estimate of the base. Estimates of several stations hold for different parts of the workspace.
Depending on the task, use the nearest station, a mean weighted by distance, or the mean of all stations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from basecal.errors import NotObservable
from basecal.estimation.axis_shift.closed_form import base_of_station, estimate, image_gradient
from basecal.estimation.problem.problem import Problem
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.geometry.rotation import lengths, nearest_rotation
from basecal.numerics.spectral import principal_axes

_STILL_M = 2e-4  # largest travel of a camera at rest: twice the largest repeatability that makers state, 0.1 mm [m]
_STILL_RAD = 1e-3  # largest rotation of a camera at rest and of a shifted LED [rad]; assumed
_FEWEST_VIEWS = 4  # views of a station: the paper's three shifts and their origin
# Extent of the shifts relative to the largest extent, above which they span three dimensions; assumed.
_LEAST_EXTENT_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class Station:
    """Views in which the camera was at rest and the LED was shifted.

    Attributes:
        camera: Name of the camera.
        target: Name of the LED.
        samples: (n,) sample numbers; the first is the origin of the shifts.
        focal_px: (2,) fu and fv [px].
        led_px: (n, 2) [px] undistorted image coordinates about the principal point, v down.
        shifts_in_led: (n, 3) [m] shifts along the LED's axes; the first is zero.
        eye_base_from_camera: Pose of the camera.
        hand_base_from_led: Pose of the LED before the shifts.
    """

    camera: str
    target: str
    samples: IntArray
    focal_px: Array
    led_px: Array
    shifts_in_led: Array
    eye_base_from_camera: SE3
    hand_base_from_led: SE3

    def camera_from_led(self, led_px: Array | None = None) -> SE3:
        """Estimate `camera_from_led` in closed form, from the recorded or other image coordinates, (..., n, 2)."""
        px = self.led_px if led_px is None else led_px
        gradient = image_gradient(px[..., 1:, :] - px[..., :1, :], self.shifts_in_led[1:])
        return estimate(px[..., 0, :], gradient, self.focal_px).camera_from_led

    def base(self, led_px: Array | None = None) -> SE3:
        """Estimate `eye_base_from_hand_base`, eq. (10), from the recorded or other image coordinates, (..., n, 2)."""
        return base_of_station(self.eye_base_from_camera, self.camera_from_led(led_px), self.hand_base_from_led)

    def predicted_px(self, eye_base_from_hand_base: SE3) -> Array:
        """Predicted image coordinates of the LED, (n, 2) [px], by exact projection instead of the closed form."""
        eye_base_from_led = eye_base_from_hand_base @ self.hand_base_from_led
        camera_from_led = self.eye_base_from_camera.inverse() @ eye_base_from_led
        led_in_camera = camera_from_led @ self.shifts_in_led
        return self.focal_px * led_in_camera[..., :2] / led_in_camera[..., 2:]

    @property
    def rms_shift_m(self) -> float:
        """Root mean square of the shifts [m]."""
        return float(np.sqrt(np.mean(np.sum(self.shifts_in_led[1:] ** 2, -1))))


def find_stations(problem: Problem, cameras: dict[str, Camera]) -> list[Station]:
    """Find all stations of a recording.

    Args:
        problem: Problem with the views; mounts of cameras and LEDs must be known.
        cameras: The lenses, by name.

    Raises:
        NotObservable: if a mount is not known, or no camera was at rest while an LED was shifted in three directions.
    """
    candidates = []
    for group in problem.groups:
        measurement = group.measurement
        if not isinstance(measurement, PixelMeasurement) or len(measurement.points_in_target) != 1:
            continue
        camera = cameras[group.camera]
        eye_flange_from_camera = _known_transform(problem, group.eye.mount)
        hand_flange_from_led = _known_transform(problem, group.hand.mount)
        bearings, valid = camera.undistort(measurement.pixels[:, 0])
        px = camera.focal * bearings[:, :2] / bearings[:, 2:]
        for run in _runs(group):
            views = run[valid[run]]
            eye_base_from_eye_flange, hand_base_from_hand_flange = (end.base_from_flange[views] for end in group.ends)
            eye_base_from_camera = eye_base_from_eye_flange @ eye_flange_from_camera
            hand_base_from_led = hand_base_from_hand_flange @ hand_flange_from_led
            candidates.append(_station(group, views, px[views], eye_base_from_camera, hand_base_from_led, camera.focal))
    stations = [station for station in candidates if station is not None]
    if not stations:
        raise NotObservable(
            "no station found: the axis-shift method needs stations with a single LED. At a station the camera is at "
            "rest. The LED shifts without rotating, along three directions that are not in one plane"
        )
    return stations


def fuse_bases(bases: Sequence[SE3], weights: ArrayLike) -> SE3:
    """Weighted mean of estimates of a base: least squares of the rotation matrices and of the translations."""
    shares = np.array(weights) / np.sum(weights)
    rotation = nearest_rotation(np.einsum("n,nij->ij", shares, np.stack([b.rotation for b in bases])))
    return SE3(rotation, np.einsum("n,ni->i", shares, np.stack([b.translation for b in bases])))


def task_weights(stations: Sequence[Station], task_in_eye_base: Array, is_nearest: bool) -> Array:
    """Weights of stations for a task at a point, (3,) [m]: the nearest station alone, or distance^-2, (n,)."""
    leds = np.stack([(s.base() @ s.hand_base_from_led).translation for s in stations])
    distance = np.maximum(lengths(leds - task_in_eye_base), 1e-6)
    return np.asarray(distance == distance.min(), dtype=np.float64) if is_nearest else 1 / distance**2


def _known_transform(problem: Problem, name: str) -> SE3:
    unknown = problem.unknowns[name]
    if unknown.status == "free" or unknown.mean is None:
        raise NotObservable(
            f"the axis-shift method needs {name}: state it as fixed or prior, or use the general solver"
        )
    return unknown.mean


def _runs(group: ViewGroup) -> Iterator[IntArray]:
    """Yield runs of consecutive views in which the camera was at rest and the LED did not rotate."""
    eye, hand = (end.base_from_flange for end in group.ends)
    start = 0
    for i in range(1, len(group)):
        travel = float(np.linalg.norm(eye[start].translation - eye[i].translation))
        if travel > _STILL_M or _has_rotated(eye[start], eye[i]) or _has_rotated(hand[start], hand[i]):
            yield np.arange(start, i)
            start = i
    yield np.arange(start, len(group))


def _has_rotated(first: SE3, second: SE3) -> bool:
    return float(np.linalg.norm((first.inverse() @ second).rotvec)) > _STILL_RAD


def _station(
    group: ViewGroup, views: IntArray, px: Array, eye_base_from_camera: SE3, hand_base_from_led: SE3, focal: Array
) -> Station | None:
    if len(views) < _FEWEST_VIEWS:
        return None
    positions = hand_base_from_led.translation
    first = int(np.argmin(np.linalg.norm(positions - positions.mean(0), axis=-1)))
    order = np.concatenate([[first], np.delete(np.arange(len(views)), first)])
    shifts = (positions[order] - positions[first]) @ hand_base_from_led.rotation[first]
    if principal_axes(shifts, _LEAST_EXTENT_SHARE).dimension < 3:
        return None
    samples = group.sample[views][order]
    camera_pose = eye_base_from_camera[first]
    return Station(
        group.camera, group.target, samples, focal, px[order], shifts, camera_pose, hand_base_from_led[first]
    )
