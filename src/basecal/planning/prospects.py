"""Predicted information of samples before they are taken, with the known or assumed noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.robot_parameters import calibrated_kinematics
from basecal.cell import (
    Calibration,
    Cell,
    Observation,
    PixelObservation,
    PoseObservation,
    Recording,
    Sample,
    TouchObservation,
)
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.noise.estimate import NoiseEstimate
from basecal.estimation.noise.robot_noise import with_robot_noise, without_errors
from basecal.estimation.observability.observability import analyse_observability
from basecal.estimation.outliers.inlier_mask import select_samples
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.solve import Solution
from basecal.estimation.view.measurement import Noise
from basecal.geometry import Array
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum
from basecal.planning.sketch import Sketch, possible_views, sketch_cell

ASSUMED_NOISE = Noise(pixel_px=0.3, pose_m=1e-3, pose_rad=3e-3, point_m=1e-3, touch_m=2e-4, grip_rad=1e-3)
"""Noise of views if it is neither stated nor calibrated: typical of detectors and trackers on real images."""

ASSUMED_ROBOT_SIGMAS = np.repeat([2e-4, 4e-4], 3)
"""Noise of a robot's pose if unknown, (6,) [m, rad]: real arms have 0.1 to 0.5 mm and 0.2 to 1 mrad per stop."""

_PRIOR_SIGMA = 0.3  # [m, rad] prior sigma of an unknown parameter
_PRIOR_LENS_SIGMA_PX = 1e3  # prior sigma of a lens parameter; more than the distortion of any lens


@dataclass(frozen=True, eq=False)
class Prospects:
    """Recorded samples and candidates of a cell, with the information of each.

    Attributes:
        problem: The views of recorded samples and of candidates.
        state: The state at which the problem is linearised.
        recorded: Numbers of the recorded samples.
        samples: The candidates with their predicted observations, numbered after the recorded samples.
        roots: (n, p, q) root U of each candidate: U U' is the information that it adds.
        covariance: (p, p) covariance with the recorded samples and a weak prior, which keeps it finite.
    """

    problem: Problem
    state: State
    recorded: frozenset[int]
    samples: tuple[Sample, ...]
    roots: Array
    covariance: Array

    def group_roots(self, size: int) -> Array:
        """Roots U of groups of `size` consecutive candidates, (n / size, p, p), with the stops that they share."""
        prior_hessian = linearise(select_samples(self.problem, []), self.state).hessian
        numbers = [sample.sample for sample in self.samples]
        blocks = (numbers[k : k + size] for k in range(0, len(numbers), size))
        hessians = (linearise(select_samples(self.problem, block), self.state).hessian for block in blocks)
        return np.stack([spectrum(hessian - prior_hessian, VIEW_ROUNDING).root for hessian in hessians])

    @property
    def recorded_problem(self) -> Problem:
        """The problem with only the recorded views."""
        return select_samples(self.problem, list(self.recorded))

    def solution(self, choice: Sequence[int]) -> Solution:
        """Predicted solution of the recorded samples and the chosen candidates."""
        numbers = [*self.recorded, *(self.samples[k].sample for k in choice)]
        problem = select_samples(self.problem, numbers)
        observability = analyse_observability(problem, self.state, linearise(problem, self.state).hessian, 1.0)
        noise = NoiseEstimate(Noise(), 1.0, (), True)
        return Solution(problem, self.state, observability.inverse, observability, noise, 0.0, 0, True, ())


def prospects(
    cell: Cell,
    recording: Recording,
    calibration: Calibration | None,
    offers: Sequence[tuple[Sketch, Sequence[Sample]]],
) -> Prospects:
    """Predict the information that candidates would add to a recording.

    Args:
        cell: The cell.
        recording: The recording; only samples with observations count as recorded.
        calibration: Calibration of the recording; None if there is none.
        offers: Sketches of cameras and targets, each with its candidates.
    """
    recorded = tuple(sample for sample in recording.samples if sample.observations)
    first = max((sample.sample for sample in recording.samples), default=-1) + 1
    offered = [(sketch, sample) for sketch, samples in offers for sample in samples]
    samples = [
        Sample(first + k, robots=sample.robots, observations=(_predict_observation(sketch, sample),))
        for k, (sketch, sample) in enumerate(offered)
    ]
    problem, _ = build_problem(cell, Recording((*recorded, *samples)))
    problem = _with_noise(problem, calibration)
    state = _state(cell, problem, calibration, offers[0][0])
    roots = np.zeros((len(samples), problem.width, 0))
    for group, group_views in zip(problem.groups, linearise(problem, state).views, strict=True):
        rows = np.flatnonzero(group.sample >= first)
        root = spectrum(group_views.information[rows], VIEW_ROUNDING).root
        group_roots = group_views.by_unknowns[rows].swapaxes(1, 2) @ root
        sample_roots = np.zeros((len(samples), problem.width, group_roots.shape[-1]))
        sample_roots[np.ix_(group.sample[rows] - first, group_views.columns)] = group_roots
        roots = _join_roots(roots, sample_roots)
    known = linearise(select_samples(problem, [sample.sample for sample in recorded]), state).hessian
    prior_sigmas = np.full(problem.width, _PRIOR_SIGMA)
    for name in problem.lenses.keys() & problem.columns.keys():
        prior_sigmas[problem.columns[name]] = _PRIOR_LENS_SIGMA_PX
    covariance = np.asarray(np.linalg.inv(known + np.diag(prior_sigmas**-2)), dtype=np.float64)
    return Prospects(problem, state, frozenset(s.sample for s in recorded), tuple(samples), roots, covariance)


def _join_roots(first: Array, second: Array) -> Array:
    """Join the roots of two groups of views, (n, p, q); no candidate is in both groups."""
    if first.shape[-1] == second.shape[-1]:
        return first + second
    return np.concatenate([first, second], axis=-1)


def _predict_observation(sketch: Sketch, sample: Sample) -> Observation:
    """Predict an observation: a touch of a tip, all target points of a camera with a lens, or the target's pose."""
    camera, target = sketch.view
    if sketch.camera.touches:
        return TouchObservation(camera, target)
    camera_from_target = sketch.camera_from_target(sample)
    shape = sketch.target.target
    if sketch.camera.intrinsics is None or shape is None:
        return PoseObservation(camera, target, camera_from_target)
    return PixelObservation(camera, target, shape.ids, sketch.lens.project(camera_from_target @ shape.points))


def _with_noise(problem: Problem, calibration: Calibration | None) -> Problem:
    """The problem with calibrated sigmas for unstated noise, or assumed sigmas without a calibration."""
    calibrated = {} if calibration is None else calibration.noise
    groups = []
    for group in problem.groups:
        camera_noise = calibrated.get("cameras", {}).get(group.camera, {})
        known = {field: camera_noise.get(field) or calibrated.get(field) for field in Noise._fields}
        groups.append(group.with_noise(ASSUMED_NOISE._replace(**{f: sigma for f, sigma in known.items() if sigma})))
    robots = {}
    for name in problem.unstated:
        noise = calibrated.get("robots", {}).get(name)
        robots[name] = ASSUMED_ROBOT_SIGMAS if noise is None else np.array([*noise["sigma_t_m"], *noise["sigma_r_rad"]])
    return with_robot_noise(problem.with_groups(groups), robots)


def _state(cell: Cell, problem: Problem, calibration: Calibration | None, sketch: Sketch) -> State:
    """State of the problem from the sketch and the calibrated kinematics; errors of stops are zero."""
    cameras = {
        name: camera.intrinsics.camera
        for name, camera in sketch.cell.cameras.items()
        if camera.intrinsics is not None and camera.intrinsics.camera is not None
    }
    robots = {} if calibration is None else calibrated_kinematics(cell, calibration)
    return without_errors(problem, State(dict(sketch.transforms), cameras, np.zeros((0, 6)), robots))


def sketches(cell: Cell, calibration: Calibration | None) -> tuple[Sketch, ...]:
    """Sketches of the cell, one for each camera and target that it may see, with calibrated or else guessed values.

    Raises:
        InputError: if no camera may see a target, or a transform has no value; the message names it.
    """
    calibrated = {} if calibration is None else calibration.transforms
    lenses = {} if calibration is None else calibration.cameras
    cameras = {
        name: replace(camera, intrinsics=replace(camera.intrinsics, camera=lenses[name][0]))
        if name in lenses and camera.intrinsics is not None
        else camera
        for name, camera in cell.cameras.items()
    }
    known = replace(cell, cameras=cameras)
    for name, unknown in cell.transforms.items():
        if name in calibrated:
            known = known.with_transform(name, replace(unknown, mean=calibrated[name].mean))
    first = sketch_cell(known)
    return tuple(replace(first, view=view) for view in possible_views(cell))


def calibrated_sketch(cell: Cell, calibration: Calibration | None) -> Sketch:
    """Sketch of the first camera and target of a cell, with calibrated or else guessed values.

    Its `cell` keeps the stated priors, so that none counts twice; only a lens without a value is the calibrated one.

    Raises:
        InputError: under the conditions of `sketches`.
    """
    calibrated = sketches(cell, calibration)[0]
    cameras = {
        name: replace(camera, intrinsics=calibrated.cell.cameras[name].intrinsics)
        if camera.intrinsics is not None and camera.intrinsics.camera is None
        else camera
        for name, camera in cell.cameras.items()
    }
    return replace(calibrated, cell=replace(cell, cameras=cameras))
