"""Effects whose sizes are expected: by how much they move the answer, and what they leave uncertain in it.

To first order about the solution. The sizes of one effect have one sigma, which is integrated over what it may be: if
the data tell that they are small, they leave little. With U and P of docs/mathematics.md (11.1) and S the variances of
all sizes their precision is P + S^-1, about -(P + S^-1)^-1 U. Source: docs/mathematics.md (11.4).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from basecal.accuracy.systematic_errors.score_tests import score_of, sums
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Cell
from basecal.effects import target_size
from basecal.effects.faces.candidates import Candidates
from basecal.effects.faces.found import FoundEffect
from basecal.effects.registry import CONTAINED, EFFECTS
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import Array, BoolArray

_NODES = np.arange(-2.0, 3.0)  # of the logarithm of a sigma, in standard deviations
_MOST_TOGETHER = 60  # sizes: of more, those of each mount and target go alone, which bounds the time


class Expected(NamedTuple):
    """A candidate and the sigmas that its sizes may have, (m,)."""

    effect: str
    candidate: Candidates
    sigmas: Array


class SizeShift(NamedTuple):
    """What sizes do to the columns of the answer: the shift that is expected, (p,), and its covariance, (p, p)."""

    mean: Array
    covariance: Array


def with_expected_sizes(cell: Cell, solution: Solution, error: FoundEffect | None) -> Solution:
    """The answer with effects as large as expected, given the data, and with the covariance that they leave.

    Args:
        cell: As declared.
        solution: The answer.
        error: The systematic error, which counts separately if it is the size of a target; None if there is none.
    """
    problem = solution.noise.held_by(solution.problem)
    if not solution.converged or not problem.width:
        return solution
    situation = Situation(problem, solution.state, problem, {}, solution.noise)
    shifts = [size_shift(situation, each) for each in _split_effects(list(_cell_effects(cell, situation, error)))]
    moved = sum((shift.mean for shift in shifts), np.zeros(problem.width))
    covariance = sum((shift.covariance for shift in shifts), solution.covariance)
    state = retract(problem, solution.state, linearise(problem, solution.state), moved)
    return replace(solution, state=state, covariance=covariance)


def size_shift(situation: Situation, effects: Sequence[Expected]) -> SizeShift:
    """What the sizes of some effects do to the answer, one sigma for all sizes of an effect."""
    known = sums(situation.null, _combine_candidates([each.candidate for each in effects], situation))
    scores = score_of(situation.null, known)
    mean, covariance = _sizes(scores.gradient[0], scores.information[0], _nodes(effects), _is_stated(effects))
    by_sizes = -situation.null.inverse[: situation.problem.width] @ known.across[0].T
    return SizeShift(by_sizes @ mean, by_sizes @ covariance @ by_sizes.T)


def _nodes(effects: Sequence[Expected]) -> Array:
    """Sigmas of all sizes, (m, q), by every combination of those of the effects."""
    kinds = {each.effect: len(each.sigmas) for each in effects}
    places = [dict(zip(kinds, at, strict=True)) for at in product(*map(range, kinds.values()))]
    sizes = [each.candidate.sizes for each in effects]
    return np.array([np.repeat([each.sigmas[at[each.effect]] for each in effects], sizes) for at in places])


def _is_stated(effects: Sequence[Expected]) -> BoolArray:
    """Of which sizes the answer is that of zero, (q,)."""
    return np.repeat([each.effect not in CONTAINED for each in effects], [each.candidate.sizes for each in effects])


def _sizes(gradient: Array, information: Array, sigmas: Array, is_stated: BoolArray) -> tuple[Array, Array]:
    """Sizes, (q,), zero if stated, and their second moment about these, (q, q), over equally likely sigmas, (m, q)."""
    scaled = sigmas[:, :, None] * information * sigmas[:, None, :] + np.eye(len(gradient))
    inverse = np.linalg.inv(scaled)
    means = -sigmas * (inverse @ (sigmas * gradient)[..., None])[..., 0]
    log_shares = -0.5 * (np.linalg.slogdet(scaled)[1] + means @ gradient)
    shares = np.exp(log_shares - log_shares.max())
    shares /= shares.sum()
    mean = np.where(is_stated, 0.0, shares @ means)
    spread = sigmas[:, :, None] * inverse * sigmas[:, None, :] + (means - mean)[..., None] * (means - mean)[:, None]
    return mean, np.tensordot(shares, spread, 1)


def _combine_candidates(candidates: Sequence[Candidates], situation: Situation) -> Candidates:
    """Candidates as one that has the sizes of all."""

    def moves(k: int) -> Array:
        """Moves of a group by all sizes, (n, 1, 6, q)."""
        still = np.zeros((len(situation.groups[k]), 1, 6, 0))
        parts = [(np.zeros((*still.shape[:3], each.sizes)), each.moves[k]) for each in candidates]
        return np.concatenate([still, *(none if own is None else own for none, own in parts)], axis=-1)

    return Candidates("", ("",), (None,), "", tuple(map(moves, range(len(situation.groups)))))


def _split_effects(effects: Sequence[Expected]) -> list[list[Expected]]:
    """All at once, or of many those of each mount and target alone."""
    if sum(each.candidate.sizes for each in effects) <= _MOST_TOGETHER:
        return [list(effects)] if effects else []
    names = dict.fromkeys(each.candidate.about[0] for each in effects)
    return [[each for each in effects if each.candidate.about[0] == name] for name in names]


def _cell_effects(cell: Cell, situation: Situation, error: FoundEffect | None) -> Iterator[Expected]:
    for name in CONTAINED:
        effect = EFFECTS[name]
        assert effect.expected is not None
        assert effect.candidates is not None
        sigmas = effect.expected.sigma * effect.expected.factor**_NODES
        yield from (Expected(name, candidate, sigmas) for candidate in effect.candidates(situation))
    counted = () if error is None else {e.about for e in (error, *error.alternatives) if e.effect == target_size.NAME}
    for candidate in target_size.candidates(situation):
        sigma = _size_sigma(cell, situation.groups, candidate.about[0])
        if sigma and candidate.about[0] not in counted:
            yield Expected(target_size.NAME, candidate, np.array([sigma]))


def _size_sigma(cell: Cell, groups: tuple[ViewGroup, ...], target: str) -> float:
    """Of a target's size as a share: as stated, else as usual; 0 of one whose views all state their noise."""
    stated = cell.targets[target].size_sigma
    if stated is not None:
        return stated
    counts = (g.measurement.counts() for g in groups if g.target == target)
    is_open = any(count.get("pixel_px", 0) or count.get("pose_m", 0) for count in counts)
    return target_size.EXPECTED.sigma if is_open else 0.0
