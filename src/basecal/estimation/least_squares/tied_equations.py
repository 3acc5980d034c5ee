"""Second-order expansion of views of a static scene, which its points couple; see `TiedViews`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.estimation.least_squares.jacobians import stop_error_jacobians, unknown_jacobian
from basecal.estimation.least_squares.schur_complement import SchurAccumulator
from basecal.estimation.problem.problem import Problem, State, chain
from basecal.estimation.problem.tied_views import TiedViews
from basecal.estimation.problem.view_group import ViewGroup
from basecal.geometry import SE3, Array
from basecal.geometry.se3_jacobians import right_jacobian_inverse


@dataclass(frozen=True, eq=False)
class TiedEquations:
    """Second-order expansion of the scene's views about a state, or about each state of a batch.

    Attributes:
        cost: (...).
        gradient: (..., q) with respect to the columns of `TiedViews`.
        information: (q, q).
        by_unknowns: (..., q, p) derivative of these columns with respect to the unknowns.
        by_errors: (..., q, 6 k) derivative of these columns with respect to the errors, in sigmas, of the k stops.
    """

    cost: Array
    gradient: Array
    information: Array
    by_unknowns: Array
    by_errors: Array

    def add(self, hessian: Array, gradient: Array, problem: Problem, sums: SchurAccumulator | None) -> None:
        """Add the scene to sums over other views, whose first columns are the unknowns."""
        assert problem.tied is not None
        weighted, width = self.information @ self.by_unknowns, problem.width
        hessian[..., :width, :width] += self.by_unknowns.mT @ weighted
        gradient[..., :width] += (self.by_unknowns.mT @ self.gradient[..., None])[..., 0]
        if sums is not None and len(problem.tied.stops):
            sums.add_scene(
                problem.shared_stops[problem.tied.stops],
                (self.by_errors.mT @ self.gradient[..., None])[..., 0],
                self.by_errors.mT @ weighted,
                self.by_errors.mT @ self.information @ self.by_errors,
            )


def linearise_scene(problem: Problem, scene: TiedViews, state: State) -> TiedEquations:
    """Expand the scene's views of a problem about a state."""
    parts, first = [], 0  # offsets, derivatives in unknowns and derivatives in errors, to join over the views
    for group in scene.groups:
        reference = scene.camera_from_world[first : first + len(group)]
        parts.append(_linearise_group(problem, scene, group, reference, state))
        first += len(group)
    for camera, reference_lens in scene.lenses.items():
        deviation = state.cameras[camera].parameters - reference_lens.parameters
        rows = np.zeros((*state.batch, deviation.shape[-1], problem.width))
        rows[..., problem.columns[camera]] = np.eye(deviation.shape[-1])
        no_errors = np.zeros((*rows.shape[:-1], 6 * len(scene.stops)))
        parts.append((np.broadcast_to(deviation, rows.shape[:-1]), rows, no_errors))
    offset, by_unknowns, by_errors = (
        np.concatenate(blocks, axis) for blocks, axis in zip(zip(*parts, strict=True), (-1, -2, -2), strict=True)
    )
    weighted = offset @ scene.information
    cost = scene.cost + np.sum(offset * (2 * scene.gradient + weighted), -1)
    return TiedEquations(cost, scene.gradient + weighted, scene.information, by_unknowns, by_errors)


def _linearise_group(
    problem: Problem, scene: TiedViews, group: ViewGroup, reference: SE3, state: State
) -> tuple[Array, Array, Array]:
    """Tangents from the reference (..., 6 n), derivatives in unknowns (..., 6 n, p) and errors (..., 6 n, 6 k)."""
    links, n = chain(group, state, problem.stops), len(group)
    offset = (reference.inverse() @ links.camera_from_target).log()
    log_derivative = right_jacobian_inverse(offset)
    by_unknowns = np.zeros((*offset.shape, problem.width))
    derivative, columns = unknown_jacobian(problem, group, links, state, 6)
    by_unknowns[..., columns] = log_derivative @ derivative
    by_errors = np.zeros((*offset.shape[:-1], len(scene.stops), 6, 6))
    for stop, by_error in stop_error_jacobians(group, links, state, problem.stops, 6):
        by_errors[..., np.arange(n), np.searchsorted(scene.stops, stop), :, :] = log_derivative @ by_error
    flat = *offset.shape[:-2], 6 * n
    errors = np.swapaxes(by_errors, -3, -2).reshape(*flat, 6 * len(scene.stops))
    return offset.reshape(flat), by_unknowns.reshape(*flat, problem.width), errors
