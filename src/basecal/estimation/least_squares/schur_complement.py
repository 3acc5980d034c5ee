"""Elimination of the errors of shared stops by the Schur complement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy  # its parts are loaded when they are first used

from basecal.geometry import Array, IntArray
from basecal.numerics.batch import SHARED
from basecal.numerics.group_sums import GroupSums

_MOST_INVERTED = 400  # maximum number of stops with a full joint covariance: 2,400 columns, 46 MB; assumed


@dataclass(frozen=True, eq=False)
class StopViews:
    """Views of a group at shared, or private, stops of one robot.

    Attributes:
        view: (n,) rows in the group.
        stop: (n,) numbers among the shared stops; of private stops, among all stops.
        by_error: (..., n, q, 6) derivative of the views with respect to the errors.
    """

    view: IntArray = field(metadata=SHARED)
    stop: IntArray = field(metadata=SHARED)
    by_error: Array


@dataclass(frozen=True, eq=False)
class SchurComplement:
    """Schur complement of the errors of k shared stops.

    Attributes:
        by_unknowns: (..., k, 6, p) mixed second derivative with respect to errors and unknowns.
        solution: (..., 6 k, p + 1) inverse of the errors' information times `by_unknowns` and, last, the gradient.
        eliminated_cost: (...) decrease of the cost by the optimal step of the errors alone.
        log_det: (...) log determinant of the errors' information.
        precision: (..., k, 6, 6) diagonal blocks of the errors' information.
        factor: Factorisation of the errors' information; None if it is block-diagonal, and for a batch.
    """

    by_unknowns: Array
    solution: Array
    eliminated_cost: Array
    log_det: Array
    precision: Array
    factor: scipy.sparse.linalg.SuperLU | None

    def covariance(self, first: IntArray, second: IntArray) -> Array:
        """Blocks (n, 6, 6) of the errors' covariance, given the unknowns, at pairs of stops (n,)."""
        if self.factor is None or len(self.precision) > _MOST_INVERTED:
            # Off-diagonal blocks of many stops are neglected, which underestimates their covariance.
            inverse = np.linalg.inv(self.precision)
            return np.where((first == second)[:, None, None], inverse[first], 0.0)
        blocks = self._inverse[first, :, second]
        return blocks

    def stop_solutions(self, stops: IntArray) -> Array:
        """Rows of `solution` at m stops, (6 m, p + 1)."""
        return np.asarray(self.solution.reshape(len(self.precision), 6, -1)[stops].reshape(6 * len(stops), -1))

    def solve_stops(self, stops: IntArray, right: Array) -> Array:
        """Covariance of the errors, given the unknowns, times `right`, at m stops, (6 m, r).

        Args:
            stops: (m,) stops.
            right: (6 m, r) right-hand sides, zero at all other stops.
        """
        if self.factor is None:
            blocks = np.linalg.solve(self.precision[stops], right.reshape(len(stops), 6, -1))
            return np.asarray(blocks.reshape(right.shape))
        rows = (6 * stops[:, None] + np.arange(6)).ravel()
        padded = np.zeros((6 * len(self.precision), right.shape[1]))
        padded[rows] = right
        return np.asarray(self.factor.solve(padded)[rows])

    @cached_property
    def _inverse(self) -> Array:
        assert self.factor is not None
        k = len(self.precision)
        inverse: Array = self.factor.solve(np.eye(6 * k)).reshape(k, 6, k, 6)
        return inverse

    def reduce(self, hessian: Array, gradient: Array) -> tuple[Array, Array]:
        """Eliminate the errors from the unknowns' normal equations."""
        shape = self.solution.shape
        transposed = np.swapaxes(self.by_unknowns.reshape(*shape[:-1], shape[-1] - 1), -1, -2)
        reduced = transposed @ self.solution
        return hessian - reduced[..., :-1], gradient - reduced[..., -1]

    def step(self, unknowns_step: Array) -> Array:
        """Optimal step of the errors, (..., k, 6), given the step of the unknowns, (..., p)."""
        step = -(self.solution[..., :-1] @ unknowns_step[..., None])[..., 0] - self.solution[..., -1]
        return step.reshape(*step.shape[:-1], step.shape[-1] // 6, 6)


class SchurAccumulator:
    """Accumulator of the shared stops' normal equations over views, used within one linearisation."""

    def __init__(self, errors: Array, width: int) -> None:
        self.diagonal = np.broadcast_to(np.eye(6), (*errors.shape, 6)).copy()
        self.gradient = errors.copy()
        self.by_unknowns = np.zeros((*errors.shape, width))
        self.pairs: list[tuple[IntArray, IntArray, Array]] = []

    def add(
        self,
        shared_views: Sequence[StopViews],
        gradient: Array,
        information: Array,
        unknown_jacobian: Array,
        columns: IntArray,
    ) -> None:
        """Add a group's views: gradient (..., n, q), information (..., n, q, q), derivative (..., n, q, m)."""
        for part in shared_views:
            if not len(part.view):
                continue
            transposed = part.by_error.mT
            weighted = transposed @ information[..., part.view, :, :]
            to_diagonal, to_unknowns = weighted @ part.by_error, weighted @ unknown_jacobian[..., part.view, :, :]
            to_gradient = (transposed @ gradient[..., part.view, :, None])[..., 0]
            if np.bincount(part.stop).max() == 1:
                self.diagonal[..., part.stop, :, :] += to_diagonal
                self.gradient[..., part.stop, :] += to_gradient
                self.by_unknowns[..., part.stop[:, None, None], np.arange(6)[:, None], columns] += to_unknowns
                continue
            by_stop = GroupSums(part.stop, self.diagonal.shape[-3])
            self.diagonal += by_stop.sum(to_diagonal, -3)
            self.gradient += by_stop.sum(to_gradient, -2)
            self.by_unknowns[..., columns] += by_stop.sum(to_unknowns, -3)
        if len(shared_views) == 2:
            self._add_pairs(shared_views[0], shared_views[1], information)

    def add_scene(self, stop: IntArray, gradient: Array, by_unknowns: Array, information: Array) -> None:
        """Add a scene that links k stops: gradient (..., 6 k), mixed (..., 6 k, p) and information (..., 6 k, 6 k)."""
        k = len(stop)
        self.gradient[..., stop, :] += gradient.reshape(*gradient.shape[:-1], k, 6)
        self.by_unknowns[..., stop, :, : by_unknowns.shape[-1]] += by_unknowns.reshape(*gradient.shape[:-1], k, 6, -1)
        blocks = np.swapaxes(information.reshape(*information.shape[:-2], k, 6, k, 6), -3, -2)
        self.diagonal[..., stop, :, :] += blocks[..., np.arange(k), np.arange(k), :, :]
        first, second = np.triu_indices(k, 1)
        if len(first):
            self.pairs.append((stop[first], stop[second], blocks[..., first, second, :, :]))

    def _add_pairs(self, eye: StopViews, hand: StopViews, information: Array) -> None:
        views, a, b = np.intersect1d(eye.view, hand.view, assume_unique=True, return_indices=True)
        if not len(views):
            return
        transposed = eye.by_error[..., a, :, :].mT
        block = transposed @ information[..., views, :, :] @ hand.by_error[..., b, :, :]
        self.pairs.append((eye.stop[a], hand.stop[b], block))

    def solve(self) -> SchurComplement:
        """Solve for the errors."""
        *batch, k, _, width = self.by_unknowns.shape
        right = np.concatenate([self.by_unknowns, self.gradient[..., None]], -1)
        if not self.pairs:
            # With many small systems and many right-hand sides, explicit inverses take a fifth of the time.
            solution = (np.linalg.inv(self.diagonal) @ right).reshape(*batch, 6 * k, width + 1)
            log_det = np.asarray(np.linalg.slogdet(self.diagonal)[1].sum(-1))
            return SchurComplement(
                self.by_unknowns, solution, self._eliminated_cost(solution), log_det, self.diagonal, None
            )
        right = right.reshape(*batch, 6 * k, width + 1)
        solution, log_det = np.empty_like(right), np.empty(tuple(batch))
        for entry in np.ndindex(*batch):
            try:
                factor = scipy.sparse.linalg.splu(
                    self._matrix(entry), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
                )
            except RuntimeError as error:  # SciPy raises it for a singular matrix; NumPy raises LinAlgError
                raise np.linalg.LinAlgError("the normal equations of the shared stops are singular") from error
            solution[entry] = factor.solve(right[entry])
            log_det[entry] = np.log(np.abs(factor.U.diagonal())).sum()
        results = solution, self._eliminated_cost(solution), log_det
        return SchurComplement(self.by_unknowns, *results, self.diagonal, None if batch else factor)

    def _eliminated_cost(self, solution: Array) -> Array:
        """Decrease of the cost by the optimal step of the errors alone, (...)."""
        flat = self.gradient.reshape(*self.gradient.shape[:-2], -1)
        return np.asarray(np.sum(flat * solution[..., -1], -1))

    def _matrix(self, entry: tuple[int, ...]) -> scipy.sparse.csc_array:
        """Information of the errors for one entry of the batch."""
        k = self.diagonal.shape[-3]
        pairs = [(a, b, block[entry]) for a, b, block in self.pairs]
        row = [np.arange(k), *(a for a, _, _ in pairs), *(b for _, b, _ in pairs)]
        column = [np.arange(k), *(b for _, b, _ in pairs), *(a for a, _, _ in pairs)]
        blocks = [self.diagonal[entry], *(m for _, _, m in pairs), *(m.mT for _, _, m in pairs)]
        at_row = 6 * np.concatenate(row)[:, None, None] + np.arange(6)[:, None]
        at_column = 6 * np.concatenate(column)[:, None, None] + np.arange(6)
        values = np.concatenate(blocks)
        indices = (np.broadcast_to(at_row, values.shape).ravel(), np.broadcast_to(at_column, values.shape).ravel())
        return scipy.sparse.csc_array((values.ravel(), indices), shape=(6 * k, 6 * k))
