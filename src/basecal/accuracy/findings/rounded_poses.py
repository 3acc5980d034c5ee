"""`rounded-poses`: poses of a robot that were recorded with few digits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding
from basecal.cell.calibration import Severity
from basecal.estimation.noise.robot_noise import stop_poses
from basecal.estimation.problem.problem import Problem
from basecal.geometry import Array

# [m, rad, 1, 100 deg]: rounding to a tenth of these is below the repeatability of 0.02 mm that makers state.
_STEP_SIZES = (1e-2, 1e-3, 1e-4)
# Distinct numbers that all have to be multiples: each is one by chance with probability 1/500, twice the share below.
_FEWEST_NUMBERS = 10
_NEAR_SHARE = 1e-3  # of a step: rounding error of a multiple after conversion of degrees and rotations; assumed
# Noise in use over rounding noise. If the ratio is larger, the missing digits do not matter. If it is smaller, no
# digits are missing: the robot was sent to poses with round numbers.
_NOISE_RANGE = (0.5, 2.0)
_SMALLER_NOISE = "Noise far below this means that the robot was sent to such values, or its stated noise is too small."


@dataclass(frozen=True)
class _Rounding:
    """A rounded quantity: its step [m or rad] and the step as text, and the noise in use of the same unit, 1 sigma."""

    quantity: str
    step: float
    step_text: str
    noise: float

    @property
    def sigma(self) -> float:
        """Rounding error, 1 sigma per axis."""
        return float(self.step / np.sqrt(12))

    @property
    def severity(self) -> Severity:
        """`warning` if rounding is a large part of the noise, else `info`."""
        low, high = _NOISE_RANGE
        return "warning" if low * self.sigma < self.noise < high * self.sigma else "info"


def rounded_poses(evidence: Evidence) -> list[Finding]:
    """A finding about each robot whose translations or angles are all multiples of a step."""
    problem = evidence.solution.problem
    findings = []
    for robot in problem.robots:
        found = list(_roundings(problem, robot))
        if not found:
            continue
        what = " ".join(f"{r.quantity.capitalize()} of {robot} are all multiples of {r.step_text}." for r in found)
        rounding = " and ".join(_sigma_text(r.sigma, r) for r in found)
        noise = " and ".join(_sigma_text(r.noise, r) for r in found)
        why = f"Rounding gives errors of {rounding} (1 sigma per axis); the noise in use is {noise}."
        if any(r.noise < _NOISE_RANGE[0] * r.sigma for r in found):
            why += f" {_SMALLER_NOISE}"
        do = ("Record poses with all their digits.",)
        findings.append(
            Finding(
                "rounded-poses",
                "warning" if any(r.severity == "warning" for r in found) else "info",
                (robot,),
                what,
                do,
                why,
            )
        )
    return findings


def _sigma_text(sigma: float, rounding: _Rounding) -> str:
    return f"{1e3 * sigma:.2g} {'mm' if rounding.quantity == 'translations' else 'mrad'}"


def _roundings(problem: Problem, robot: str) -> Iterator[_Rounding]:
    sigma = problem.stops.sigma[problem.stops.robot_mask([robot])]
    noise_m, noise_rad = (float(sigma[0, 0]), float(sigma[0, 3])) if len(sigma) else (0.0, 0.0)
    joints = [end.joints for end in problem.robot_ends(robot)]
    recorded = [each for each in joints if each is not None]
    if len(recorded) == len(joints) > 0:
        yield from _angle_roundings("joints", [np.concatenate(recorded)], noise_rad)
        return
    poses, seen = stop_poses(problem, robot)
    poses = poses[np.flatnonzero(seen)]
    step = _step(poses.translation)
    if step is not None:
        yield _Rounding("translations", step, f"{1e3 * step:g} mm", noise_m)
    angles = list(_angle_roundings("angles", [poses.rotvec, poses.rpy], noise_rad))
    yield from angles or _quaternion_roundings(poses.quaternion, noise_rad)


def _angle_roundings(subject: str, formats: list[Array], noise: float) -> Iterator[_Rounding]:
    """Roundings of angles [rad] that were written in one of several formats, in degrees or radians."""
    for values in formats:
        hundreds, radians = _step(np.degrees(values) / 100), _step(values)
        if hundreds is not None:
            yield _Rounding(subject, float(np.radians(100 * hundreds)), f"{100 * hundreds:g} deg", noise)
            return
        if radians is not None:
            yield _Rounding(subject, radians, f"{1e3 * radians:g} mrad", noise)
            return


def _quaternion_roundings(quaternions: Array, noise: float) -> Iterator[_Rounding]:
    """Roundings of unit quaternions, (n, 4), that were normalised afterwards.

    An error of a component gives twice that rotation error [rad].
    """
    for step in _STEP_SIZES:
        numbers = _multiples(quaternions, step)
        if np.isfinite(numbers).all() and len(np.unique(numbers)) >= _FEWEST_NUMBERS:
            yield _Rounding("quaternions", 2 * step, f"{step:g} before normalisation", noise)
            return


def _multiples(quaternions: Array, step: float) -> Array:
    """Integer multiples of the step, (n, 4), that normalise to these quaternions, (n, 4); NaN if there are none."""
    largest = np.take_along_axis(quaternions, np.argmax(np.abs(quaternions), -1)[:, None], -1)
    found = np.full(quaternions.shape, np.nan)
    for off in (-1, 0, 1):  # rounding changes the norm, and therefore the largest component, by at most one step
        numbers = quaternions / largest * (np.round(largest / step) + off)
        fits = np.all(np.abs(numbers - np.round(numbers)) < _NEAR_SHARE, axis=-1)
        found[fits] = np.round(numbers[fits])
    return found


def _step(values: Array) -> float | None:
    """Largest step of which all values are multiples; None if there is none, or if too few values are distinct."""
    different = np.unique(np.round(values, 9))
    if len(different) < _FEWEST_NUMBERS:
        return None
    shares = {step: different / step for step in _STEP_SIZES}
    return next((step for step, each in shares.items() if np.all(np.abs(each - np.round(each)) < _NEAR_SHARE)), None)
