"""Effects whose sizes are expected: by how much they move the answer, and what they leave uncertain in it.

To first order about the solution. The sizes of one effect have one sigma, which is integrated over its prior. If the
data show that the sizes are small, they leave little uncertainty. With U and P of docs/mathematics.md (11.1) and S the
variances of all sizes their precision is P + S^-1, about -(P + S^-1)^-1 U. Fields of errors are eliminated first.
Source: docs/mathematics.md (11.4).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from basecal.accuracy.systematic_errors.pose_fields import (
    AXES_PRIOR,
    LongAxes,
    PoseField,
    fields_prior,
    long_axes,
    stated_fields,
)
from basecal.accuracy.systematic_errors.score_tests import score_from_sums, sums
from basecal.accuracy.systematic_errors.situation import OpenOffsets, Situation, situate
from basecal.cell import Cell
from basecal.effects import target_size
from basecal.effects.faces.candidates import Candidates, combine_candidates
from basecal.effects.faces.effect import FoundEffect, SigmaPrior
from basecal.effects.registry import CONTAINED, EFFECTS
from basecal.estimation.least_squares.normal_equations import linearise, retract
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import Array
from basecal.numerics.mixtures import Gaussian, mixture, probabilities

_MOST_ARMS = 2  # with fields: of more, each goes alone
_FREE_SIGMA = 0.3  # of a unit's length about what loops say: far more than is left open
_MOST_TOGETHER = 60  # sizes: of more, those of each mount and target go alone, which bounds the time


class Expected(NamedTuple):
    """A candidate, what the sigma of its sizes may be, and whether the answer contains the sizes or is that of none."""

    effect: str
    candidate: Candidates
    prior: SigmaPrior
    is_contained: bool = True


class SizePosterior(NamedTuple):
    """The posterior of errors of arms and of sizes of effects.

    Attributes:
        mean: (q,) as the answer contains them.
        covariance: (q, q) about that.
        by_sizes: (c, q) how the columns of the null model move with them.
        of_arms: Errors of arms, and which sizes are theirs.
        field_m2: Mean of the variance of a field's shifts [m^2].
    """

    mean: Array
    covariance: Array
    by_sizes: Array
    of_arms: Sequence[tuple[PoseField | LongAxes, slice]]
    field_m2: float


class ContainedSizes(NamedTuple):
    """An answer that contains effects, and what these do to the offsets of r clocks.

    Attributes:
        solution: The answer.
        shift_s: (r,) by which the offsets move [s].
        offset_covariance: (r, r) what the effects add to theirs [s^2].
    """

    solution: Solution
    shift_s: Array
    offset_covariance: Array


def with_expected_sizes(cell: Cell, solution: Solution, error: FoundEffect | None) -> Solution:
    """The answer alone, of a recording without clocks, as `contain_expected_sizes` gives it."""
    return contain_expected_sizes(cell, solution, error).solution


def contain_expected_sizes(
    cell: Cell, solution: Solution, error: FoundEffect | None, offsets: OpenOffsets | None = None
) -> ContainedSizes:
    """The answer with effects as large as expected, given the data, and with the covariance that they leave.

    Args:
        cell: As declared.
        solution: The answer.
        error: The systematic error, which counts separately if it is the size of a target; None if there is none.
        offsets: Of clocks that are estimated beside the answer.
    """
    situation = situate(solution, offsets=offsets)
    problem = situation.problem
    unit_s = np.zeros(0) if offsets is None else offsets.sigma_s
    if not solution.converged or not problem.width:
        return ContainedSizes(solution, 0 * unit_s, 0 * np.outer(unit_s, unit_s))
    width = len(situation.null.gradient)
    moved, covariance = np.zeros(width), np.zeros((width, width))
    for known in known_sizes(cell, situation, error):
        moved += known.by_sizes @ known.mean
        covariance += known.by_sizes @ known.covariance @ known.by_sizes.T
    answer, clocks = slice(problem.width), slice(width - len(unit_s), width)
    state = retract(problem, solution.state, linearise(problem, solution.state), moved[answer])
    wider = replace(solution, state=state, covariance=solution.covariance + covariance[answer, answer])
    return ContainedSizes(wider, moved[clocks] * unit_s, covariance[clocks, clocks] * np.outer(unit_s, unit_s))


def known_sizes(cell: Cell, situation: Situation, error: FoundEffect | None) -> list[SizePosterior]:
    """The posteriors of all errors of arms and sizes of effects of a cell, by independent parts."""
    arms = stated_fields(cell, situation), long_axes(cell, situation)
    return [size_posterior(situation, *part) for part in _split(*arms, list(_cell_effects(cell, situation, error)))]


def size_posterior(
    situation: Situation, fields: Sequence[PoseField], effects: Sequence[Expected] = (), axes: Sequence[LongAxes] = ()
) -> SizePosterior:
    """The posterior of errors of arms and of sizes of effects, one sigma for all of one kind."""
    of_fields, of_axes = ([each.candidate(situation) for each in errors] for errors in (fields, axes))
    candidates = [*of_fields, *(each.candidate for each in effects), *of_axes]
    known = sums(situation.null, combine_candidates(candidates, situation))
    scores = score_from_sums(situation.null, known)
    places = [slice(*each) for each in pairwise(np.cumsum([0, *(each.sizes for each in candidates)]))]
    before, after = len(fields), len(fields) + len(effects)
    priors = [fields_prior(sum(each.width for each in fields)), _joint_prior(effects), *[AXES_PRIOR] * len(axes)]
    given = posteriors_by_sigma(scores.gradient[0], scores.information[0], priors)
    _, mean, covariance = mixture(priors[0].shares, given)
    contained = np.zeros_like(mean)
    for effect, place in zip(effects, places[before:after], strict=True):
        contained[place] = mean[place] if effect.is_contained else 0.0
    return SizePosterior(
        contained,
        covariance + np.outer(mean - contained, mean - contained),
        -situation.null.inverse @ known.across[0].T,
        list(zip([*fields, *axes], places[:before] + places[after:], strict=True)),
        float(probabilities(priors[0].shares, given.evidence) @ priors[0].sigmas[:, 0] ** 2) if fields else 0.0,
    )


def _joint_prior(effects: Sequence[Expected]) -> SigmaPrior:
    """The prior of the sigmas of all sizes, (m, q): every combination of those of the effects."""
    kinds = {each.effect: each.prior.shares for each in effects}
    places = [dict(zip(kinds, at, strict=True)) for at in product(*(range(len(shares)) for shares in kinds.values()))]
    sizes = [each.candidate.sizes for each in effects]
    sigmas = [np.repeat([each.prior.sigmas[at[each.effect]] for each in effects], sizes) for at in places]
    return SigmaPrior(
        np.array(sigmas), np.array([np.prod([kinds[name][k] for name, k in at.items()]) for at in places])
    )


def _split(
    fields: Sequence[PoseField], axes: Sequence[LongAxes], effects: Sequence[Expected]
) -> list[tuple[Sequence[PoseField], Sequence[Expected], Sequence[LongAxes]]]:
    """All at once; or of many arms each alone, and of many effects those of each mount and target alone."""
    robots = dict.fromkeys([*(field.robot for field in fields), *(axis.robot for axis in axes)])
    are_few = sum(each.candidate.sizes for each in effects) <= _MOST_TOGETHER
    if are_few and len(robots) <= _MOST_ARMS:
        return [(fields, effects, axes)] if robots or effects else []
    names = dict.fromkeys(each.candidate.about[0] for each in effects)
    of_robots = [([f for f in fields if f.robot == r], (), [a for a in axes if a.robot == r]) for r in robots]
    return [*of_robots, *(((), [each for each in effects if each.candidate.about[0] == name], ()) for name in names)]


def _cell_effects(cell: Cell, situation: Situation, error: FoundEffect | None) -> Iterator[Expected]:
    rigid = _tool_mounts(cell) | situation.problem.point_mounts
    for name in CONTAINED:
        effect = EFFECTS[name]
        assert effect.expected is not None
        assert effect.candidates is not None
        loaded = (each for each in effect.candidates(situation) if each.about[0] not in rigid)
        yield from (Expected(name, candidate, effect.expected.prior(len(CONTAINED))) for candidate in loaded)
    counted = () if error is None else {e.about for e in (error, *error.alternatives) if e.effect == target_size.NAME}
    for candidate in target_size.candidates(situation):
        sigma = _size_sigma(cell, situation.groups, candidate.about[0])
        is_free = cell.targets[candidate.about[0]].has_free_scale
        if sigma and (is_free or candidate.about[0] not in counted):
            yield Expected(target_size.NAME, candidate, SigmaPrior.single_value(sigma), is_free)


def unit_error(situation: Situation, target: str) -> tuple[float, float]:
    """The error of the assumed unit of a target's poses, as a share of its length, and its sigma."""
    (candidate,) = (each for each in target_size.candidates(situation) if each.about == (target,))
    known = size_posterior(situation, (), [Expected(target_size.NAME, candidate, SigmaPrior.single_value(_FREE_SIGMA))])
    return float(known.mean[0]), float(np.sqrt(known.covariance[0, 0]))


def _tool_mounts(cell: Cell) -> frozenset[str]:
    """Mounts of tips and grips: tools that touch at rest, no brackets that bend or slide under a camera or a board."""
    touching = [each.name for each in cell.cameras.values() if each.touches]
    touching += [each.name for each in cell.targets.values() if each.is_touched]
    return frozenset(map(cell.mount_name, touching))


def _size_sigma(cell: Cell, groups: tuple[ViewGroup, ...], target: str) -> float:
    """Sigma of a target's size as a share: as stated, else as usual; 0 of one whose views all state their noise."""
    if cell.targets[target].has_free_scale:
        return _FREE_SIGMA
    stated = cell.targets[target].size_sigma
    if stated is not None:
        return stated
    counts = (g.measurement.counts() for g in groups if g.target == target)
    is_open = any(count.get("pixel_px", 0) or count.get("pose_m", 0) for count in counts)
    return target_size.EXPECTED.sigma if is_open else 0.0


def posteriors_by_sigma(gradient: Array, information: Array, priors: Sequence[SigmaPrior]) -> Gaussian:
    """The posterior of all sizes by each sigma of the first, (..., m), those of the others integrated over.

    The cost of sizes s is 2 g's + s'Ps beside that of their prior. Source: docs/mathematics.md (11.4).

    Args:
        gradient: (..., q) g.
        information: (..., q, q) P.
        priors: Of the sigmas of all sizes in turn, (m, q1), (n, q2), ...; independent of one another.
    """
    prior, *others = priors
    sigmas = prior.sigmas
    count = sigmas.shape[1]
    u, v = gradient[..., None, :count, None], gradient[..., None, count:, None]
    p, across = information[..., None, :count, :count], information[..., None, :count, count:]
    inverse = np.linalg.inv(sigmas[:, :, None] * p * sigmas[:, None, :] + np.eye(count))
    spread = sigmas[:, :, None] * (0.5 * (inverse + inverse.mT)) * sigmas[:, None, :]
    mean = -spread @ u
    evidence = np.linalg.slogdet(inverse)[1] - (u.mT @ mean)[..., 0, 0]
    if not others:
        return Gaussian(evidence, mean[..., 0], spread)
    back = -spread @ across
    slope, curvature = v + back.mT @ u, information[..., None, count:, count:] + across.mT @ back
    rest = mixture(others[0].shares, posteriors_by_sigma(slope[..., 0], curvature, others))
    both = np.concatenate([back, np.broadcast_to(np.eye(back.shape[-1]), (*back.shape[:-2], *back.shape[-1:] * 2))], -2)
    covariance = both @ rest.covariance @ both.mT
    covariance[..., :count, :count] += spread
    means = (both @ rest.mean[..., None])[..., 0]
    means[..., :count] += mean[..., 0]
    return Gaussian(rest.evidence + evidence, means, covariance)
