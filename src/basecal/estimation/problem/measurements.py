"""Observations of views as arrays: measurements and their alternative readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.cell import (
    CandidateObservation,
    Cell,
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Target,
    TouchObservation,
)
from basecal.errors import InputError
from basecal.estimation.problem.correspondence import MOST_CANDIDATES, half_turn, half_turn_views
from basecal.estimation.view.contacts import GRIPS, TOUCHES
from basecal.estimation.view.measurement import Measurement, Noise
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, BoolArray, IntArray

GRIP = "grip"
"""Kind of measurement: directions of a part that two robots hold, in addition to its position."""


def make_measurement(cell: Cell, camera: str, target: str, kind: str, observations: list[Observation]) -> Measurement:
    """Make the measurement of one camera's observations of one target, all of one kind.

    Args:
        cell: The cell.
        camera: Name of the camera.
        target: Name of the target.
        kind: Type name of the observations, or `GRIP`.
        observations: The observations.

    Raises:
        InputError: if points of a target without a `kind` are observed, a camera with pixels has no intrinsics, or
            `correlated_px` is stated without `pixel_px`.
    """
    shape = cell.targets[target].target
    if kind == "PoseObservation":
        with_pose = [o for o in observations if isinstance(o, PoseObservation)]
        poses = SE3.stack([o.camera_from_target for o in with_pose])
        stated = np.stack([np.zeros(6) if o.sigma is None else 1 / o.sigma for o in with_pose])
        return PoseMeasurement(poses, stated, stated).with_noise(Noise())
    if kind in ("TouchObservation", GRIP):
        contact, is_grip = cell.targets[target].contact, kind == GRIP
        touches = [o for o in observations if isinstance(o, TouchObservation)]
        sigmas = [o.sigma_rad if is_grip else o.sigma_m for o in touches]
        stated = np.array([[0.0 if sigma is None else 1 / sigma] for sigma in sigmas])
        seen, origins = np.ones((len(touches), 1), dtype=bool), np.zeros((len(touches), 1, 3))
        measurement_type = (GRIPS if is_grip else TOUCHES)[contact]
        return measurement_type(np.zeros((1, 3)), origins, seen, stated, stated).with_noise(Noise())
    if shape is None:
        raise InputError(f"target {target!r} is seen as points and has no `kind`")
    if kind == "PointObservation":
        points = [o for o in observations if isinstance(o, PointObservation)]
        inverse = [np.zeros(len(o.ids)) if o.sigma_m is None else 1 / o.sigma_m for o in points]
        arrays = _scatter(shape, [o.ids for o in points], [o.points_in_camera for o in points], inverse)
        return PointMeasurement(shape.points, *arrays, weight=arrays[2]).with_noise(Noise())
    if cell.cameras[camera].intrinsics is None:
        raise InputError(
            f"camera {camera!r} gives pixels and has no `intrinsics`; `intrinsics: {{status: free}}` estimates them"
        )
    if cell.correlated_px is not None and cell.pixel_px is None:
        raise InputError("correlated_px needs pixel_px: state the noise of single points too")
    pixels = [_as_pixels(o) for o in observations if isinstance(o, PixelObservation | CandidateObservation)]
    return replace(_pixel_measurement(shape, pixels, cell.pixel_px), common_px=cell.correlated_px or 0.0)


def _as_pixels(observation: PixelObservation | CandidateObservation, spot: int = 0) -> PixelObservation:
    """Convert to an observation of pixels: candidate number `spot`, or the first if there are fewer."""
    if isinstance(observation, PixelObservation):
        return observation
    o, k = observation, spot if spot < len(observation.pixels) else 0
    sigma = None if o.sigma_px is None else o.sigma_px[k : k + 1]
    return PixelObservation(o.camera, o.target, np.zeros(1, dtype=np.int64), o.pixels[k : k + 1], sigma, o.detected)


def alternative_readings(
    measurement: Measurement, shape: Target | None, observations: list[Observation]
) -> tuple[PixelMeasurement, ...]:
    """Alternative readings of the views, the measurement itself first; empty if there is no ambiguity."""
    if not isinstance(measurement, PixelMeasurement) or shape is None:
        return ()
    if half_turn(shape) is not None:
        return measurement, half_turn_views(measurement)
    candidates = [o for o in observations if isinstance(o, CandidateObservation)]
    count = min(max((len(o.pixels) for o in candidates), default=1), MOST_CANDIDATES)
    return tuple(_select_spot(measurement, observations, k) for k in range(count if count > 1 else 0))


def _select_spot(measurement: PixelMeasurement, observations: list[Observation], number: int) -> PixelMeasurement:
    """Read the LED as spot `number` of each view, with its sigma; as the first spot if there are fewer."""
    pixels = measurement.pixels.copy()
    ratio, detector_ratio = np.ones((2, len(observations), 1))  # 1 / sigma over that of the first spot
    for view, observation in enumerate(observations):
        if isinstance(observation, CandidateObservation):
            first, spot = _as_pixels(observation), _as_pixels(observation, number)
            pixels[view] = spot.pixels
            if first.sigma_px is not None and spot.sigma_px is not None:
                ratio[view] = first.sigma_px / spot.sigma_px
                detector_ratio[view] = ratio[view] if observation.detected else 1.0
    relative = None if measurement.relative is None else measurement.relative * detector_ratio
    stated, weight = measurement.stated * ratio, measurement.weight * ratio
    return replace(measurement, pixels=pixels, stated=stated, weight=weight, relative=relative)


def _scatter(
    target: Target, ids: list[IntArray], values: list[Array], inverse_sigmas: list[Array]
) -> tuple[Array, BoolArray, Array]:
    """Scatter points of views into dense arrays: values (n, p, d), seen (n, p) and 1 / sigma (n, p)."""
    view = np.repeat(np.arange(len(ids)), [len(i) for i in ids])
    row = target.rows(np.concatenate(ids))
    n, p = len(ids), len(target.ids)
    out = np.zeros((n, p, values[0].shape[-1]))
    seen, stated = np.zeros((n, p), dtype=bool), np.zeros((n, p))
    out[view, row] = np.concatenate(values)
    seen[view, row] = True
    stated[view, row] = np.concatenate(inverse_sigmas)
    return out, seen, stated


def _pixel_measurement(
    target: Target, observations: list[PixelObservation], pixel_px: float | None
) -> PixelMeasurement:
    default = 0.0 if pixel_px is None else 1 / pixel_px
    # 1 / sigma of each point from its detector, relative to the median point; 1 if the detector reports no sigma.
    sigmas = [o.sigma_px if o.detected else None for o in observations]
    reported = [sigma for sigma in sigmas if sigma is not None]
    median = float(np.median(np.concatenate(reported))) if reported else 1.0
    relative = [
        np.ones(len(o.ids)) if sigma is None else median / sigma for o, sigma in zip(observations, sigmas, strict=True)
    ]
    inverse = [
        default * share if o.sigma_px is None or o.detected else 1 / o.sigma_px
        for o, share in zip(observations, relative, strict=True)
    ]
    ids, pixels = [o.ids for o in observations], [o.pixels for o in observations]
    arrays = _scatter(target, ids, pixels, inverse)
    relative_weights = _scatter(target, ids, pixels, relative)[2] if any(o.detected for o in observations) else None
    return PixelMeasurement(target.points, *arrays, weight=arrays[2], relative=relative_weights).with_noise(Noise())
