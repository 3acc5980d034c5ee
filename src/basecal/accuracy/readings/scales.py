"""Length unit of poses known up to scale, such as from structure from motion, estimated from robot motion.

Rotations do not depend on the unit. With known rotations, each loop is linear in the unit's inverse and in the
translations over the unit.
Source: Andreff, Horaud & Espiau 2001, "Robot hand-eye calibration using structure-from-motion".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from basecal.cell import Cell, Finding, PoseObservation, Recording
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.start.first_state import first_state
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array
from basecal.numerics.spectral import spectrum

_ALTERNATIONS = 6  # alternations of rotations and lengths: two or three suffice for an initial error of a third
_CONVERGED_LOG = 1e-4  # change of the logarithm of the unit at convergence: below any uncertainty of an estimate
_REWEIGHTED_ROUNDS = 20  # rounds of reweighting
_LEAST_USUAL = 1e-12  # [m] smallest scale of residuals: exact data have no scatter
_LEAST_UNEXPLAINED_SHARE = 1e-4  # unexplained share of the column of the unit, below which the unit is not determined


def convert_units(recording: Recording, units_m: Mapping[str, float]) -> Recording:
    """Convert the poses of targets, and their sigmas, to metres.

    Args:
        recording: The recording as read.
        units_m: Length of the unit, by target [m].
    """

    def convert(view: PoseObservation, unit_m: float) -> PoseObservation:
        """Convert an observed pose to metres."""
        pose = SE3(view.camera_from_target.rotation, unit_m * view.camera_from_target.translation)
        sigma = None if view.sigma is None else view.sigma * np.repeat([unit_m, 1.0], 3)
        return replace(view, camera_from_target=pose, sigma=sigma)

    samples = (
        replace(
            sample,
            observations=tuple(
                convert(seen, units_m[seen.target])
                if isinstance(seen, PoseObservation) and seen.target in units_m
                else seen
                for seen in sample.observations
            ),
        )
        for sample in recording.samples
    )
    return replace(recording, samples=tuple(samples))


def estimate_units(cell: Cell, recording: Recording) -> tuple[dict[str, float], list[Finding]]:
    """Length units of target poses known up to scale [m], by target, and an error for each undetermined one.

    Args:
        cell: The cell.
        recording: The recording as read.

    Raises:
        NotObservable: if no rotation can be determined.
    """
    names = [name for name, target in cell.targets.items() if target.has_free_scale]
    if not names:
        return {}, []
    problem = build_problem(cell, recording)[0]
    units_m = {name: _first_unit(problem, name) for name in names}
    for _ in range(_ALTERNATIONS):
        problem = build_problem(cell, convert_units(recording, units_m))[0]
        state = first_state(problem, cell, thorough=False)
        factors = {name: _linear_factor(problem, state, name) for name in names}
        units_m = {name: unit * (factors[name] or 1.0) for name, unit in units_m.items()}
        if all(factor is None or abs(np.log(factor)) < _CONVERGED_LOG for factor in factors.values()):
            break
    return units_m, [_undetermined_unit(name) for name, factor in factors.items() if factor is None]


def _undetermined_unit(name: str) -> Finding:
    what = f"The length unit of {name}'s poses is not determined, or its poses and the arms' do not agree."
    do = (
        "Record samples between which the camera moves by some decimetres, not only turns.",
        "Check that the poses belong to these samples.",
    )
    return Finding("scale-unobservable", "error", (name,), what, do)


def _groups(problem: Problem, target: str) -> Iterator[tuple[ViewGroup, SE3]]:
    """Groups of pose views of a target, each with its observed poses."""
    for group in problem.groups:
        if group.target == target and isinstance(group.measurement, PoseMeasurement):
            yield group, group.measurement.measured_camera_from_target


def _first_unit(problem: Problem, target: str) -> float:
    """Spread of the flanges over the spread of the poses [m]: correct within a factor of a few."""
    of_arms = of_poses = 0.0
    for group, poses in _groups(problem, target):
        of_arms += sum(len(group) * _variance(end.base_from_flange) for end in group.ends)
        of_poses += len(group) * max(_variance(poses), _variance(poses.inverse()))
    return float(np.sqrt(of_arms / of_poses)) if of_arms and of_poses else 1.0


def _variance(poses: SE3) -> float:
    return float(poses.translation.var(0).sum())


def _linear_factor(problem: Problem, state: State, target: str) -> float | None:
    """The true length of a unit over the assumed one; None if it is not determined.

    Observed poses have larger errors than robots: they are regressed on the robot poses.
    """
    free = [name for name, unknown in problem.unknowns.items() if unknown.status != "fixed"]
    columns = {name: 3 * k for k, name in enumerate(free)}
    rows, right = [], []
    for group, poses in _groups(problem, target):
        block, arms = np.zeros((len(group), 3, 3 * len(free))), np.zeros((len(group), 3))
        world_from_camera = _add_end(block, arms, group.eye, state, columns, 1)
        _add_end(block, arms, group.hand, state, columns, -1)
        rows.append(np.concatenate([block, arms[:, :, None]], 2).reshape(-1, 3 * len(free) + 1))
        right.append(-(world_from_camera @ poses.translation[..., None]).ravel())
    if not rows:
        return 1.0
    matrix = np.concatenate(rows)
    shorter = float(_robust_least_squares(matrix, np.concatenate(right))[-1])
    return 1 / shorter if shorter > 0 and _unexplained_share(matrix) >= _LEAST_UNEXPLAINED_SHARE else None


def _add_end(block: Array, constant: Array, end: End, state: State, columns: Mapping[str, int], sign: int) -> Array:
    """Add one end of a loop to its equations; return the rotations of camera or target in the world, (n, 3, 3)."""
    base = SE3.identity() if end.base is None else state.transforms.get(end.base, SE3.identity())
    mount, flange = state.transforms[end.mount], end.base_from_flange
    world_from_flange = np.broadcast_to(base.rotation @ flange.rotation, (len(block), 3, 3))
    constant += sign * (base.rotation @ flange.translation[..., None])[..., 0]
    for name, transform, rotation in ((end.base or "", base, np.eye(3)), (end.mount, mount, world_from_flange)):
        column = columns.get(name)
        if column is None:
            constant += sign * (rotation @ transform.translation)
        else:
            block[:, :, column : column + 3] += sign * rotation
    return world_from_flange @ mount.rotation


def _robust_least_squares(matrix: Array, right: Array) -> Array:
    """Least squares with Cauchy weights of 3-D points; the minimum-norm solution if it is not determined."""
    weight, found = np.ones(len(right)), np.zeros(matrix.shape[1])
    for _ in range(_REWEIGHTED_ROUNDS):
        weighed = weight[:, None] * matrix
        found = spectrum(weighed.T @ weighed).inverse @ weighed.T @ (weight * right)
        off = np.linalg.norm((matrix @ found - right).reshape(-1, 3), axis=1)
        usual = 2 * float(np.median(off)) + _LEAST_USUAL
        weight = np.repeat(1 / np.hypot(1.0, off / usual), 3)
    return found


def _unexplained_share(matrix: Array) -> float:
    """Share of the last column's norm that the other columns do not explain."""
    squares = matrix.T @ matrix
    others, across, own = squares[:-1, :-1], squares[:-1, -1], float(squares[-1, -1])
    left = own - float(across @ spectrum(others).inverse @ across)
    return float(np.sqrt(max(left, 0.0) / own)) if own else 0.0
