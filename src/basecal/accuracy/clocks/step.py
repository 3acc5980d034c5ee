"""Step of the clock offsets at a solution, its covariance, and the derivative of the solution with respect to it.

An offset of a camera's clock shifts its views along the velocities of all flanges. The line time of a rolling shutter
shifts each pixel in proportion to its row. The effect of the other unknowns is projected out.
Source: docs/mathematics.md (12.2), (12.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from basecal.accuracy.systematic_errors.score_tests import score, view_sums
from basecal.accuracy.systematic_errors.situation import OpenOffsets, Situation, situate
from basecal.effects.faces.candidates import Candidates
from basecal.estimation.solve import Solution
from basecal.estimation.streams.rolling_shutter import line_time_name
from basecal.estimation.streams.streams import Streams, Synchronised
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.target_points import point_jacobians
from basecal.geometry import Array, BoolArray
from basecal.numerics.spectral import VIEW_ROUNDING, spectrum

# Sigma of an offset [s] above which it is unobservable: arms that hardly move, or a constant velocity.
_UNOBSERVABLE_SIGMA_S = 0.5
_UNOBSERVABLE_LINE_SIGMA_S = _UNOBSERVABLE_SIGMA_S / 1000  # of a line time: the same over the rows of an image


@dataclass(frozen=True, eq=False)
class ClockStep:
    """Step of the clock offsets from those of a solution.

    Attributes:
        clocks: Names of the q devices, and of cameras' line times by `line_time_name`.
        step_s: (q,) step of the offsets, or of the line times [s]; 0 if unobservable.
        covariance: (q, q) covariance of the offsets [s^2].
        by_offsets: (p, q) derivative of the solution's columns with respect to the offsets [per s].
        is_observable: (q,) whether the data or a prior determine each offset.
        offsets: The observable offsets, as additional unknowns of the solution.
    """

    clocks: tuple[str, ...]
    step_s: Array
    covariance: Array
    by_offsets: Array
    is_observable: BoolArray
    offsets: OpenOffsets | None = None

    def add_effects(self, shift_s: Array, covariance: Array) -> Self:
        """Add the shift of the observable offsets by effects, (r,) [s], and its covariance, (r, r) [s^2]."""
        step, total, indices = self.step_s.copy(), self.covariance.copy(), np.flatnonzero(self.is_observable)
        step[indices] += shift_s
        total[np.ix_(indices, indices)] += covariance
        return replace(self, step_s=step, covariance=total)


def clock_step(streams: Streams, samples: Synchronised, offsets_s: dict[str, float], solution: Solution) -> ClockStep:
    """Compute the most likely step of the open clocks about a solution, to first order.

    Args:
        streams: The recorded streams, with the priors of the clocks.
        samples: The synchronised samples of the solution.
        offsets_s: Clock offsets of the samples, by device [s].
        solution: The solution, with its noise.
    """
    situation = situate(solution)
    moves = tuple(
        _clock_jacobian(situation, k, streams.estimated_clocks, samples) for k in range(len(situation.groups))
    )
    model = situation.linearisation
    candidates = Candidates("clock-offset", ("",), (None,), "s", moves)
    scores = score(model, candidates)
    known = [streams.clocks[name] for name in streams.estimated_clocks]
    sigma = np.array([np.inf if clock.sigma_s is None else clock.sigma_s for clock in known])
    deviation = np.array(
        [offsets_s[name] - clock.offset_s for name, clock in zip(streams.estimated_clocks, known, strict=True)]
    )
    information = scores.information[0] + np.diag(sigma**-2)
    covariance = spectrum(information).inverse
    variance = np.diagonal(covariance)
    lines = {line_time_name(camera) for camera in streams.cell.cameras}
    limits = np.array(
        [_UNOBSERVABLE_LINE_SIGMA_S if name in lines else _UNOBSERVABLE_SIGMA_S for name in streams.estimated_clocks]
    )
    is_observable = (variance > 0) & (variance < limits**2)
    step = np.where(is_observable, -covariance @ (scores.gradient[0] + deviation / sigma**2), 0.0)
    _, across, _ = view_sums(model, candidates)
    by_offsets = -model.inverse @ across[0].T
    # A contradicted prior must not cause an effect: widen it to the distance of the new offset from it.
    widened = np.minimum(np.hypot(sigma, deviation + step), limits)
    values = np.where(np.isinf(sigma), 0.0, deviation / widened)
    offsets = OpenOffsets(
        tuple(each[:, 0][..., is_observable] for each in moves), widened[is_observable], values[is_observable]
    )
    return ClockStep(
        streams.estimated_clocks,
        step,
        covariance * np.outer(is_observable, is_observable),
        by_offsets * is_observable,
        is_observable,
        offsets,
    )


def _clock_jacobian(situation: Situation, k: int, clocks: tuple[str, ...], samples: Synchronised) -> Array:
    """Derivatives of a group's views with respect to the clock offsets, (n, 1, 6, q)."""
    group = situation.problem.groups[k]
    moves = np.zeros((len(group), 1, 6, len(clocks)))
    for robot in group.robots:
        velocity = np.stack([samples.robots[robot][int(sample)].velocity for sample in group.sample])
        moved = (situation.flange_jacobian(k, robot) @ velocity[..., None])[..., 0]
        for q, name in enumerate(clocks):
            if name == group.camera:
                moves[:, 0, :, q] += moved
            elif name == robot:
                moves[:, 0, :, q] -= moved
            elif name == line_time_name(group.camera):
                moves[:, 0, :, q] += (_mean_row(situation, k) @ moved[..., None])[..., 0]
    return moves


def _mean_row(situation: Situation, k: int) -> Array:
    """Mean row of the pixels of each view, weighted by their information in each direction, (n, 6, 6)."""
    group, poses = situation.problem.groups[k], situation.links[k].camera_from_target
    if not isinstance(group.measurement, PixelMeasurement):
        return np.zeros((len(group), 6, 6))
    jacobians = point_jacobians(group.measurement, poses, situation.state.cameras[group.camera], with_lens=False)
    transposed = np.moveaxis(jacobians.jacobian, -1, 1).reshape(len(group), 6, -1)
    row = np.repeat(group.measurement.pixels[..., 1], 2, axis=1)
    information = transposed @ transposed.mT
    by_row = (transposed * row[:, None]) @ transposed.mT
    return spectrum(information, VIEW_ROUNDING).inverse @ by_row
