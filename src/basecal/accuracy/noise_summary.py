"""Summary of the noise that a calibration used: overall, per camera and per robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from basecal.cell import Cell, PixelObservation, Recording
from basecal.effects.registry import RANDOM_EFFECTS
from basecal.estimation.noise.random_effects import shared_errors
from basecal.estimation.noise.robot_noise import stop_poses
from basecal.estimation.solve import Solution


def noise_summary(cell: Cell, recording: Recording, solution: Solution) -> dict[str, Any]:
    """Sigmas by name, with those of `cameras` whose noise was estimated, and of `robots`, stated or estimated.

    An estimated sigma of views is the RMS over the cameras. `factor` of a camera is its sigma over the median of its
    detector's sigmas, or null if the detector has none.
    `targets` contains the coefficients of estimated target shapes, in sigmas, see `noise.target_shape`.
    `freedoms` of a robot are the degrees of freedom of its estimated sigmas. `rms_factor` is the RMS over the
    distribution of the sigmas, divided by the estimate. Errors that a robot's stops share are listed by their effect,
    with the sigma at the flange, RMS over stops [m, rad]. For joints and links it is the part that a base and a mount
    do not compensate. If an effect has one sigma of translations and one of rotations, both
    are added. Its figures are added, too.
    """
    noise = solution.noise
    cameras = _camera_noise(recording, solution) if noise.estimated else {}
    used: dict[str, Any] = {f: _rms_of_cameras(cameras, f, getattr(noise.noise, f)) for f in noise.estimated}
    if cell.pixel_px is not None and "pixel_px" not in used:
        used["pixel_px"] = cell.pixel_px
    if cell.correlated_px is not None:
        used["correlated_px"] = cell.correlated_px
    if noise.estimated:
        used["cameras"] = cameras
    stated = {name: robot.noise for name, robot in cell.robots.items() if robot.noise is not None}
    used["robots"] = {
        name: {"sigma_t_m": sigma[:3].tolist(), "sigma_r_rad": sigma[3:].tolist()}
        for name, sigma in {**stated, **noise.robots}.items()
    }
    for name, sigma in noise.robots.items():
        used["robots"][name]["freedoms"] = _freedoms(solution)
        if name in noise.robot_variances:
            used["robots"][name]["rms_factor"] = float(np.sqrt(np.mean(noise.robot_variances[name] / sigma**2)))
    if solution.problem.jitter_s:
        used["clocks"] = {name: {"jitter_s": sigma} for name, sigma in solution.problem.jitter_s.items()}
    if noise.shapes:
        used["targets"] = {name: {"shape": shape.tolist()} for name, (shape, _) in noise.shapes.items()}
    for key, sigmas in noise.common.items():
        for name, sigma in sigmas.items():
            effect, is_by_joints = RANDOM_EFFECTS[key], RANDOM_EFFECTS[key].by_joints is not None
            errors = shared_errors(effect, solution.problem, name)
            assert errors is not None
            left = errors.remove_frames(stop_poses(solution.problem, name)[0]) if is_by_joints else errors
            by_kind = {} if effect.is_by_coordinate else {"shift_m": float(sigma[0]), "turn_rad": float(sigma[1])}
            used["robots"][name][key] = {"sigma": left.flange_sigmas(sigma).tolist(), **by_kind, **effect.figures}
    return used


def _rms_of_cameras(cameras: Mapping[str, Mapping[str, Any]], field: str, default: float) -> float:
    """RMS over the cameras with a sigma; `default` if none has it."""
    sigmas = [entry[field] for entry in cameras.values() if field in entry] or [default]
    return float(np.sqrt(np.mean(np.square(sigmas))))


def _freedoms(solution: Solution) -> float:
    """Degrees of freedom: equations of the views minus unknowns; at least one."""
    return float(max(solution.problem.equation_count - solution.problem.width, 1))


def _camera_noise(recording: Recording, solution: Solution) -> dict[str, dict[str, Any]]:
    noise, found = solution.noise, dict[str, dict[str, Any]]()
    for group in solution.problem.groups:
        counts = group.measurement.counts()
        sigmas = noise.cameras.get(group.camera, noise.noise)
        fields = {field: getattr(sigmas, field) for field in noise.estimated if counts.get(field)}
        if fields:
            before = found.get(group.camera, {"views_count": 0})
            found[group.camera] = {**before, **fields, "views_count": before["views_count"] + len(group)}
    seen = [o for s in recording.samples for o in s.observations if isinstance(o, PixelObservation) and o.detected]
    for camera, entry in found.items():
        detector_sigmas = [o.sigma_px for o in seen if o.camera == camera and o.sigma_px is not None]
        has_both = bool(detector_sigmas) and "pixel_px" in entry
        entry["factor"] = entry["pixel_px"] / float(np.median(np.concatenate(detector_sigmas))) if has_both else None
    return found
