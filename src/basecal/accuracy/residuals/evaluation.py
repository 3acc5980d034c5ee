"""Evaluate a recording at the transforms of a calibration, which may be new or read from a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.robot_parameters import calibrated_kinematics
from basecal.cell import Calibration, Cell, Recording
from basecal.effects.target_shape import unit_shifts
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.noise.robot_noise import with_robot_noise, without_errors
from basecal.estimation.noise.shaped_targets import reshape_targets, shaped_points
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.correspondence import choose_correspondence
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.measurement import Noise
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Camera

_STOP_ROUNDS = 4  # Gauss-Newton steps for the stop errors; they converge quadratically from zero


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The views whose transforms and lens a calibration contains, and their state.

    A calibration does not contain the errors of the robots' stops. The most probable errors at the calibration's
    transforms are used, estimated from the inlier views.
    """

    problem: Problem
    state: State


def evaluate_recording(cell: Cell, recording: Recording, calibration: Calibration) -> Evaluation:
    """Evaluate a recording at the transforms of a calibration.

    Args:
        cell: The calibrated cell.
        recording: The recording.
        calibration: The calibration of the cell.

    Raises:
        InputError: if the cell contradicts the recording.
    """
    known = known_views(cell, recording, calibration)
    found = apply_robot_noise(known.problem, known.state, calibration)
    problem, state = found.problem, found.state
    used = _without_outliers(problem, calibration)
    for _ in range(_STOP_ROUNDS if len(problem.stops) else 0):
        state = retract(used, state, linearise(used, state), np.zeros(0))
    return Evaluation(problem, state)


def _without_outliers(problem: Problem, calibration: Calibration) -> Problem:
    """Remove the views that are outliers as a whole: they would bias the errors of their stops."""
    outliers = calibration.outlier_views
    return problem.take_views(
        np.flatnonzero([(number, g.camera, g.target) not in outliers for number in g.sample.tolist()])
        for g in problem.groups
    )


def known_views(cell: Cell, recording: Recording, calibration: Calibration) -> Evaluation:
    """Select the views whose transforms and lens a calibration contains, with its noise and target shapes.

    Stop errors are zero.

    Raises:
        InputError: if the cell contradicts the recording.
    """
    problem, _ = build_problem(cell, recording)
    lenses = problem.lenses.items()
    fixed = {name: lens.camera for name, lens in lenses if lens.status == "fixed" and lens.camera is not None}
    cameras = fixed | {name: camera for name, (camera, _) in calibration.cameras.items()}
    transforms = calibration.known_transforms(cell)
    groups = [with_camera_noise(g, calibration) for g in problem.groups if _is_known(g, transforms, cameras)]
    # Estimated shapes of targets; a shape is left out if the target now has other points.
    shapes = {name: np.array(target["shape"]) for name, target in calibration.noise.get("targets", {}).items()}
    seen = {group.target: points for group in groups if group.target in shapes and len(points := shaped_points(group))}
    sizes = {name: unit_shifts(points).shape[-1] for name, points in seen.items()}
    shapes = {name: shape for name, shape in shapes.items() if sizes.get(name) == len(shape)}
    problem = reshape_targets(replace(problem, columns={}, groups=tuple(groups)), shapes)
    no_errors = np.zeros((len(problem.stops), 6))
    return Evaluation(problem, State(transforms, cameras, no_errors, calibrated_kinematics(cell, calibration)))


def apply_robot_noise(problem: Problem, state: State, calibration: Calibration) -> Evaluation:
    """Set the robots' noise of a calibration, and choose the point correspondences that agree best with a state.

    Stop errors are zero.
    """
    found = calibration.noise.get("robots", {}).items()
    estimated = {name: noise for name, noise in found if name in problem.unstated}
    sigmas = {name: np.array([*noise["sigma_t_m"], *noise["sigma_r_rad"]]) for name, noise in estimated.items()}
    problem = with_robot_noise(problem, sigmas)
    state = without_errors(problem, state)
    return Evaluation(choose_correspondence(problem, state)[0], state)


def with_camera_noise(group: ViewGroup, calibration: Calibration) -> ViewGroup:
    """Return a group with the estimated sigmas of its camera."""
    of_camera = calibration.noise.get("cameras", {}).get(group.camera, {})
    known = {field: of_camera.get(field) or calibration.noise.get(field) for field in Noise._fields}
    return group.with_noise(Noise(**{field: sigma for field, sigma in known.items() if sigma}))


def _is_known(group: ViewGroup, transforms: Mapping[str, SE3], cameras: Mapping[str, Camera]) -> bool:
    """Whether all transforms of a group are known, and also the lens if its views are in pixels."""
    has_lens = group.camera in cameras or not isinstance(group.measurement, PixelMeasurement)
    return has_lens and all(name in transforms for name in group.frames)
