"""What errors a real recording has, and recordings of a known cell that are drawn with them.

The answer stands for the truth. What is left of the recording is split into errors of the robots' stops and of the
views: of all splits that add up to what was measured one is drawn, as likely as the estimated sigmas make it
(imputation; Rubin 1987). Stops and whole views, with all that their points have in common and each for itself, are then
dealt out anew with random signs (Carpenter, Goldstein & Rasbash 2003). The tails, the correlation of neighbouring
points, what coordinates share and how views differ are thus reality's; gross outliers and what is smooth in poses are
not in it.
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
    """Of stops, (k, 6) in sigmas, and of views by group: of pixels (n, p, 2) [px], or of poses (n, 6) in sigmas."""

    stops: Array
    views: tuple[Array, ...]


@dataclass(frozen=True, eq=False)
class Reality:
    """A recording's answer and its errors.

    Attributes:
        cell: As declared.
        recording: The samples that the answer rests on.
        problem: Their views with the sigmas in use, bows of boards among them.
        state: The answer; its errors of stops are the most likely ones.
        root: (6 k, 6 k) inverse of the upper Cholesky factor of the information about the stops' errors.
        enlarged: What errors are multiplied by, since unknowns took their share of them.
    """

    cell: Cell
    recording: Recording
    problem: Problem
    state: State
    root: Array
    enlarged: float

    @property
    def truth(self) -> Mapping[str, SE3]:
        """What recordings are drawn with."""
        return self.state.transforms

    def imputed(self, rng: Rng) -> Errors:
        """One split of what was measured into errors of stops and of views."""
        stops = self.state.stop_errors + (self.root @ rng.standard_normal(len(self.root))).reshape(-1, 6)
        there = replace(self.state, stop_errors=stops)
        return Errors(stops, tuple(_errors(self.problem, group, there) for group in self.problem.groups))

    def scatter(self) -> list[float]:
        """Rms of errors of views about the answer by group: a coordinate of a pixel [px], of a pose in sigmas."""
        groups = self.problem.groups
        used = [_errors(self.problem, group, self.state)[_used(group.measurement)] for group in groups]
        return [float(np.sqrt(np.mean(of**2))) for of in used]

    def resampled(self, rng: Rng) -> Errors:
        """Errors of stops and whole views of this recording, dealt out anew."""
        found = self.imputed(rng)
        robots = np.array(self.problem.stops.robot, dtype=object)
        seen = _stops_seen(self.problem)
        stops = np.zeros_like(found.stops)
        for robot in sorted(set(robots)):
            mine = np.flatnonzero(robots == robot)
            stops[mine] = _dealt(found.stops[mine[seen[mine]]], len(mine), rng)
        dealt = [_dealt_views(g.measurement, of, rng) for g, of in zip(self.problem.groups, found.views, strict=True)]
        return Errors(self.enlarged * stops, tuple(self.enlarged * views for views in dealt))

    def draw_fault(self, errors: Errors) -> Recording:
        """A recording of the truth with these errors; robots say what they said."""
        there = replace(self.state, stop_errors=errors.stops)
        seen: dict[int, list[Observation]] = {}
        for group, of in zip(self.problem.groups, errors.views, strict=True):
            for k, observation in enumerate(_observed(self, group, there, of)):
                seen.setdefault(int(group.sample[k]), []).append(observation)
        samples = tuple(replace(s, observations=tuple(seen[s.sample]), images={}) for s in self.recording.samples)
        return replace(self.recording, samples=samples)


def reality(cell: Cell, recording: Recording) -> Reality:
    """What a recording says: `solve` with noise and outliers, as `calibrate` has it, nothing else."""
    settings = Settings()
    problem, _ = build_problem(cell, recording)
    plain = solve_problem(problem, cell, replace(settings, robot_noise="stated"))
    solution = solve_with_noise(cell, settings, plain, with_noise(plain, settings)).solution
    used = {int(number) for group in solution.problem.groups for number in group.sample}
    samples = tuple(_bare(sample) for sample in recording.samples if sample.sample in used)
    information = _information(solution)
    root = np.linalg.inv(np.linalg.cholesky(information)).T
    views = sum(len(group) for group in solution.problem.groups)
    of_poses = sum(w.stop - w.start for n, w in solution.problem.columns.items() if n in solution.problem.unknowns)
    enlarged = float(np.sqrt(6 * views / max(6 * views - of_poses, 1)))
    return Reality(cell, replace(recording, samples=samples), solution.problem, solution.state, root, enlarged)


def _bare(sample: Sample) -> Sample:
    return replace(sample, observations=(), images={}, background={})


def _information(solution: Solution) -> Array:
    """About the errors of stops, (6 k, 6 k), all else at the answer."""
    problem, state = solution.problem, solution.state
    out = np.eye(6 * len(problem.stops))
    for group in problem.groups:
        at = state.camera_from_target(group, problem.stops)
        view = group.measurement.linearise(at, state.cameras.get(group.camera), False)
        parts = stop_error_jacobians(group, chain(group, state, problem.stops), state, problem.stops, 6)
        for k in range(len(group)):
            columns = np.concatenate([6 * stop[k] + np.arange(6) for stop, _ in parts])
            by_error = np.concatenate([by[k] for _, by in parts], -1)
            out[np.ix_(columns, columns)] += by_error.T @ view.information[k] @ by_error
    return out


def _stops_seen(problem: Problem) -> BoolArray:
    seen = np.zeros(len(problem.stops) + 1, dtype=bool)
    for group in problem.groups:
        for end in group.ends:
            seen[end.stop] = True
    return seen[:-1]


def _used(measurement: Measurement) -> BoolArray:
    """Points that are used, (n, p), or views of poses, (n,)."""
    if isinstance(measurement, PixelMeasurement):
        return np.asarray(measurement.seen & (measurement.weight > 0))
    return np.ones(len(measurement.equations()), dtype=bool)


def _errors(problem: Problem, group: ViewGroup, state: State) -> Array:
    """What was measured less what a state predicts; 0 of points that are not used."""
    measurement, at = group.measurement, state.camera_from_target(group, problem.stops)
    if isinstance(measurement, PixelMeasurement):
        off = -measurement.residual_px(at, state.cameras[group.camera])
        return np.where(_used(measurement)[..., None], off, 0.0)
    assert isinstance(measurement, PoseMeasurement)
    return np.asarray((at.inverse() @ measurement.measured_camera_from_target).log() * measurement.weight)


def _signs(count: int, rng: Rng) -> Array:
    return 2.0 * rng.integers(0, 2, count) - 1


def _dealt(errors: Array, count: int, rng: Rng) -> Array:
    """So many of these errors, with repetition and random signs."""
    return errors[rng.integers(0, len(errors), count)] * _signs(count, rng)[:, None]


def _dealt_views(measurement: Measurement, errors: Array, rng: Rng) -> Array:
    """Errors of other views for each view; of points that the other does not show, those of the nearest it does."""
    if not isinstance(measurement, PixelMeasurement):
        return _dealt(errors, len(errors), rng)
    used, points = _used(measurement), measurement.points_in_target
    n, out = len(errors), np.zeros_like(errors)
    for k, (other, sign) in enumerate(zip(rng.integers(0, n, n), _signs(n, rng), strict=True)):
        rows = np.flatnonzero(used[other])
        out[k] = sign * errors[other][rows[_nearest(points, points[rows])]]
    return out


def _nearest(points: Array, among: Array) -> IntArray:
    return np.argmin(np.sum((points[:, None] - among[None]) ** 2, -1), 1)


def _observed(of: Reality, group: ViewGroup, state: State, errors: Array) -> list[Observation]:
    """What a group's views show of the truth with these errors."""
    at, measurement = state.camera_from_target(group, of.problem.stops), group.measurement
    if isinstance(measurement, PoseMeasurement):
        poses = at @ SE3.exp(errors / measurement.weight)
        return [PoseObservation(group.camera, group.target, poses[k]) for k in range(len(group))]
    assert isinstance(measurement, PixelMeasurement)
    pixels = measurement.pixels + measurement.residual_px(at, state.cameras[group.camera]) + errors
    target = of.cell.targets[group.target].target
    assert target is not None
    seen: list[Observation] = []
    for k, used in enumerate(_used(measurement)):
        sigma = None if measurement.relative is None else 1 / measurement.relative[k, used]
        seen.append(PixelObservation(group.camera, group.target, target.ids[used], pixels[k, used], sigma, True))
    return seen
