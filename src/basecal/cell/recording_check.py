"""Check of a recording that was made in Python; a file is checked when it is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from basecal.cell.cell import Cell
from basecal.cell.recording import (
    CandidateObservation,
    Observation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Recording,
    RobotState,
    Sample,
    TouchObservation,
)
from basecal.errors import InputError, check_integer, check_type, list_names, spelling_hint
from basecal.geometry import SE3, Array

_KINDS = (PixelObservation, CandidateObservation, PoseObservation, PointObservation, TouchObservation)
_LEAVE_OUT = "leave out what was not measured"


def check_recording(cell: Cell, recording: Recording) -> None:
    """Check types, names, shapes and numbers of all samples.

    Raises:
        InputError: if one of them does not suit the cell, or a number is not finite. The message names the sample.
    """
    check_type("cell", cell, Cell)
    check_type("recording", recording, Recording)
    for sample in _items("samples of the recording", recording.samples):
        check_type("each of the samples", sample, Sample)
        try:
            _check_sample(cell, sample)
        except InputError as error:
            raise InputError(f"sample {sample.sample}: {error}") from None


def _check_sample(cell: Cell, sample: Sample) -> None:
    check_integer("its number", sample.sample, 0)
    if sample.stamp_s is not None:
        _check_numbers("stamp_s", np.asarray(sample.stamp_s), ())
    for name, state in sample.robots.items():
        _check_name("robot", name, cell.robots)
        check_type(f"the state of {name}", state, RobotState)
        _check_state(cell, name, state)
    for observation in _items("observations", sample.observations):
        _check_observation(cell, observation)
    for camera in (*sample.images, *sample.background):
        _check_name("camera", camera, cell.cameras)
    for view in sample.tracks:
        _check_name("camera", view.camera, cell.cameras)
        _check_points(f"tracks of {view.camera}", view.tracks, view.pixels, None, 2)


def _items(noun: str, values: Any) -> Sequence[Any]:
    if not isinstance(values, list | tuple):
        raise InputError(f"the {noun} are of type {type(values).__name__}, expected a tuple")
    return values


def _check_name(kind: str, name: str, known_names: Mapping[str, object]) -> None:
    if name not in known_names:
        names = list_names(list(known_names))
        raise InputError(f"no {kind} {name!r}{spelling_hint(name, known_names)}; the cell has: {names}")


def _check_state(cell: Cell, robot: str, state: RobotState) -> None:
    if (state.base_from_flange is None) == (state.joints_rad is None):
        got = "neither" if state.joints_rad is None else "both"
        raise InputError(f"the state of {robot} has {got} of base_from_flange and joints_rad, expected one")
    if state.base_from_flange is not None:
        _check_pose(f"base_from_flange of {robot}", state.base_from_flange)
    chain = cell.robots[robot].chain
    if state.joints_rad is not None:
        _check_numbers(f"joints_rad of {robot}", state.joints_rad, (None if chain is None else chain.n,))


def _check_observation(cell: Cell, observation: Observation) -> None:
    if not isinstance(observation, _KINDS):
        names = ", ".join(kind.__name__ for kind in _KINDS)
        raise InputError(f"an observation is of type {type(observation).__name__}, expected one of: {names}")
    camera, target = observation.camera, observation.target
    _check_name("camera", camera, cell.cameras)
    _check_name("target", target, cell.targets)
    subject = f"{target} seen by {camera}"
    if isinstance(observation, PoseObservation):
        _check_pose(f"camera_from_target of {subject}", observation.camera_from_target)
        _check_sigma(f"the sigmas of {subject}", observation.sigma, 6)
    elif isinstance(observation, CandidateObservation):
        _check_points(f"candidates of {subject}", None, observation.pixels, observation.sigma_px, 2)
    elif isinstance(observation, PointObservation):
        _check_points(subject, observation.ids, observation.points_in_camera, observation.sigma_m, 3)
    elif isinstance(observation, PixelObservation):
        _check_points(subject, observation.ids, observation.pixels, observation.sigma_px, 2)
    if isinstance(observation, PixelObservation | PointObservation):
        shape = cell.targets[target].target
        if shape is not None:
            shape.rows(observation.ids)


def _check_pose(noun: str, pose: SE3) -> None:
    check_type(noun, pose, SE3)
    if pose.shape:
        raise InputError(f"{noun} is a batch of shape {pose.shape}, expected a single pose")
    if not (np.isfinite(pose.translation).all() and np.isfinite(pose.rotation).all()):
        raise InputError(f"{noun} holds NaN or infinity: {_LEAVE_OUT}")


def _check_points(noun: str, ids: Any, points: Array, sigma: Array | None, columns: int) -> None:
    kind = "points" if columns == 3 else "pixels"
    _check_numbers(f"the {kind} of {noun}", points, (None, columns))
    if ids is not None:
        _check_numbers(f"the ids of {noun}", ids, (len(points),))
        if ids.dtype.kind not in "iu":
            raise InputError(f"the ids of {noun} are of type {ids.dtype}, expected whole numbers")
        if len(np.unique(ids)) != len(ids):
            raise InputError(f"the ids of {noun} hold one id twice, expected one point for each id")
    _check_sigma(f"the sigmas of {noun}", sigma, len(points))


def _check_sigma(noun: str, sigma: Array | None, count: int) -> None:
    if sigma is None:
        return
    _check_numbers(noun, sigma, (count,))
    if not (sigma > 0).all():
        raise InputError(f"{noun} are not all above zero; None if they are not known")


def _check_numbers(noun: str, values: Any, shape: tuple[int | None, ...]) -> None:
    """Check that values are an array of finite numbers; None in the shape is any length."""
    sizes = ", ".join("n" if each is None else str(each) for each in shape)
    expected = f"expected an array of numbers, ({sizes})" if shape else "expected a number"
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "iuf":
        got = values.dtype if isinstance(values, np.ndarray) else type(values).__name__
        raise InputError(f"{noun}: got {got}, {expected}")
    is_suitable = values.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, values.shape, strict=True))
    if not is_suitable:
        raise InputError(f"{noun}: got shape {values.shape}, {expected}")
    if not np.isfinite(values).all():
        row = f" in row {np.argwhere(~np.isfinite(values))[0][0]}, counted from 0" if shape else ""
        raise InputError(f"{noun}: NaN or infinity{row}: {_LEAVE_OUT}")
