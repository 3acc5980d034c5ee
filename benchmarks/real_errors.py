"""Errors of a real recording, and recordings of a known cell that are drawn with them.

The answer serves as the truth. The residuals of the recording are split into errors of the robots' stops and of the
views. One of all splits that add up to the measurements is drawn, with the probability that the estimated sigmas give
it (imputation; Rubin 1987). Stops and whole views are then resampled with random signs (Carpenter, Goldstein & Rasbash
2003). A view keeps the errors that its points share, and those of each point.

The drawn errors thus have the tails, the correlation of neighbouring points and coordinates, and the differences
between views of the real ones. They have no gross outliers, and nothing that is smooth in the poses.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from basecal.cell import Cell, Observation, PixelObservation, PoseObservation, Recording, Sample
from basecal.estimation.least_squares.jacobians import stop_error_jacobians
from basecal.estimation.outliers.noise_and_outliers import solve_with_noise, with_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_problem
from basecal.estimation.view.measurement import Measurement
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, BoolArray, IntArray

Rng = np.random.Generator


class Errors(NamedTuple):
    """Errors of stops, (k, 6) in sigmas, and of views by group: pixels (n, p, 2) [px], or poses (n, 6) in sigmas."""

    stops: Array
    views: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Reality:
    """A recording's answer and its errors.

    Attributes:
        cell: As declared.
        recording: The samples that the answer uses.
        problem: Their views with the sigmas in use, bows of boards among them.
        state: The answer, with the most likely errors of stops.
        root: (6 k, 6 k) inverse of the upper Cholesky factor of the information about the stops' errors.
        enlarged: Factor of the errors, which compensates for the unknowns that absorb a part of them.
    """

    cell: Cell
    recording: Recording
    problem: Problem
    state: State
    root: Array
    enlarged: float

    @property
    def truth(self) -> Mapping[str, SE3]:
        """The transforms with which recordings are drawn."""
        return self.state.transforms

    def impute(self, rng: Rng) -> Errors:
        """Draw one split of the measurements into errors of stops and of views."""
        stops = self.state.stop_errors + (self.root @ rng.standard_normal(len(self.root))).reshape(-1, 6)
        state = replace(self.state, stop_errors=stops)
        return Errors(stops, tuple(_errors(self.problem, group, state) for group in self.problem.groups))

    def scatter(self) -> list[float]:
        """Rms errors of views about the answer by group: of a pixel coordinate [px], or of a pose in sigmas."""
        groups = self.problem.groups
        used = [_errors(self.problem, group, self.state)[_used(group.measurement)] for group in groups]
        return [float(np.sqrt(np.mean(of**2))) for of in used]

    def resample(self, rng: Rng) -> Errors:
        """Resample errors of stops and of whole views of this recording."""
        errors = self.impute(rng)
        robots = np.array(self.problem.stops.robot, dtype=object)
        is_used = _used_stops(self.problem)
        stops = np.zeros_like(errors.stops)
        for robot in sorted(set(robots)):
            rows = np.flatnonzero(robots == robot)
            stops[rows] = _resample(errors.stops[rows[is_used[rows]]], len(rows), rng)
        dealt = [
            _resample_views(g.measurement, group_errors, rng)
            for g, group_errors in zip(self.problem.groups, errors.views, strict=True)
        ]
        return Errors(self.enlarged * stops, tuple(self.enlarged * views for views in dealt))

    def make_recording(self, errors: Errors) -> Recording:
        """The recording of the true cell with these errors; recorded robot states stay."""
        state = replace(self.state, stop_errors=errors.stops)
        observations: dict[int, list[Observation]] = {}
        for group, group_errors in zip(self.problem.groups, errors.views, strict=True):
            for k, observation in enumerate(_observations(self, group, state, group_errors)):
                observations.setdefault(int(group.sample[k]), []).append(observation)
        samples = tuple(
            replace(s, observations=tuple(observations[s.sample]), images={}) for s in self.recording.samples
        )
        return replace(self.recording, samples=samples)


def reality(cell: Cell, recording: Recording) -> Reality:
    """Solve a recording with noise and outliers as `calibrate` does, and take its answer and errors."""
    settings = Settings()
    problem, _ = build_problem(cell, recording)
    plain = solve_problem(problem, cell, replace(settings, robot_noise="stated"))
    solution = solve_with_noise(cell, settings, plain, with_noise(plain, settings)).solution
    used = {int(number) for group in solution.problem.groups for number in group.sample}
    samples = tuple(_without_observations(sample) for sample in recording.samples if sample.sample in used)
    information = _information(solution)
    root = np.linalg.inv(np.linalg.cholesky(information)).T
    views = sum(len(group) for group in solution.problem.groups)
    transform_unknowns = sum(
        w.stop - w.start for n, w in solution.problem.columns.items() if n in solution.problem.unknowns
    )
    enlarged = float(np.sqrt(6 * views / max(6 * views - transform_unknowns, 1)))
    return Reality(cell, replace(recording, samples=samples), solution.problem, solution.state, root, enlarged)


def _without_observations(sample: Sample) -> Sample:
    return replace(sample, observations=(), images={}, background={})


def _information(solution: Solution) -> Array:
    """Information about the errors of stops, (6 k, 6 k), with all else at the answer."""
    problem, state = solution.problem, solution.state
    out = np.eye(6 * len(problem.stops))
    for group in problem.groups:
        camera_from_target = state.camera_from_target(group, problem.stops)
        view = group.measurement.linearise(camera_from_target, state.cameras.get(group.camera), False)
        parts = stop_error_jacobians(group, chain(group, state, problem.stops), state, problem.stops, 6)
        for k in range(len(group)):
            columns = np.concatenate([6 * stop[k] + np.arange(6) for stop, _ in parts])
            error_jacobian = np.concatenate([jacobian[k] for _, jacobian in parts], -1)
            out[np.ix_(columns, columns)] += error_jacobian.T @ view.information[k] @ error_jacobian
    return out


def _used_stops(problem: Problem) -> BoolArray:
    is_used = np.zeros(len(problem.stops) + 1, dtype=bool)
    for group in problem.groups:
        for end in group.ends:
            is_used[end.stop] = True
    return is_used[:-1]


def _used(measurement: Measurement) -> BoolArray:
    """Mask of points that are used, (n, p), or of views of poses, (n,)."""
    if isinstance(measurement, PixelMeasurement):
        return np.asarray(measurement.seen & (measurement.weight > 0))
    return np.ones(len(measurement.equations()), dtype=bool)


def _errors(problem: Problem, group: ViewGroup, state: State) -> Array:
    """Measurements minus predictions of a state; 0 for points that are not used."""
    measurement, camera_from_target = group.measurement, state.camera_from_target(group, problem.stops)
    if isinstance(measurement, PixelMeasurement):
        errors = -measurement.residual_px(camera_from_target, state.cameras[group.camera])
        return np.where(_used(measurement)[..., None], errors, 0.0)
    assert isinstance(measurement, PoseMeasurement)
    return np.asarray(
        (camera_from_target.inverse() @ measurement.measured_camera_from_target).log() * measurement.weight
    )


def _signs(count: int, rng: Rng) -> Array:
    return 2.0 * rng.integers(0, 2, count) - 1


def _resample(errors: Array, count: int, rng: Rng) -> Array:
    """Draw a number of these errors with replacement and random signs."""
    return errors[rng.integers(0, len(errors), count)] * _signs(count, rng)[:, None]


def _resample_views(measurement: Measurement, errors: Array, rng: Rng) -> Array:
    """Draw for each view the errors of another; a point that the other does not show gets those of its nearest one."""
    if not isinstance(measurement, PixelMeasurement):
        return _resample(errors, len(errors), rng)
    used, points = _used(measurement), measurement.points_in_target
    n, out = len(errors), np.zeros_like(errors)
    for k, (donor, sign) in enumerate(zip(rng.integers(0, n, n), _signs(n, rng), strict=True)):
        rows = np.flatnonzero(used[donor])
        out[k] = sign * errors[donor][rows[_nearest(points, points[rows])]]
    return out


def _nearest(points: Array, candidates: Array) -> IntArray:
    return np.argmin(np.sum((points[:, None] - candidates[None]) ** 2, -1), 1)


def _observations(reality: Reality, group: ViewGroup, state: State, errors: Array) -> list[Observation]:
    """Observations of a group's views of the truth with these errors."""
    camera_from_target, measurement = state.camera_from_target(group, reality.problem.stops), group.measurement
    if isinstance(measurement, PoseMeasurement):
        poses = camera_from_target @ SE3.exp(errors / measurement.weight)
        return [PoseObservation(group.camera, group.target, poses[k]) for k in range(len(group))]
    assert isinstance(measurement, PixelMeasurement)
    pixels = measurement.pixels + measurement.residual_px(camera_from_target, state.cameras[group.camera]) + errors
    target = reality.cell.targets[group.target].target
    assert target is not None
    observations: list[Observation] = []
    for k, used in enumerate(_used(measurement)):
        sigma = None if measurement.relative is None else 1 / measurement.relative[k, used]
        observations.append(
            PixelObservation(group.camera, group.target, target.ids[used], pixels[k, used], sigma, True)
        )
    return observations
