"""Effects with a prior on their sizes: the shift and the covariance that they add to the solution.

All results are of first order about the solution. The sizes of one effect have a common sigma, which is integrated over
its prior. If the data show that the sizes are small, they add little uncertainty. With U and P of
docs/mathematics.md (11.1) and S the variances of all sizes, the posterior precision is P + S^-1. The posterior mean is
-(P + S^-1)^-1 U. Fields of errors are eliminated first. Source: docs/mathematics.md (11.4).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from basecal.accuracy.systematic_errors.pose_fields import (
    LENGTHS_PRIOR,
    AxisLengths,
    PoseField,
    axis_lengths,
    fields_prior,
    stated_fields,
)
from basecal.accuracy.systematic_errors.score_tests import score_from_sums, view_sums
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

_MOST_ARMS = 2  # arms with fields that are treated jointly; of more arms, each is treated separately
_FREE_SIGMA = 0.3  # relative sigma of an unknown unit of length, far larger than its posterior sigma
_MOST_TOGETHER = 60  # sizes that are treated jointly; of more, each mount and target is separate, to bound the time


class ExpectedEffect(NamedTuple):
    """A candidate with the prior of its sizes' sigma, and whether the solution is corrected by its mean sizes."""

    effect: str
    candidate: Candidates
    prior: SigmaPrior
    is_contained: bool = True


class SizePosterior(NamedTuple):
    """The posterior of arm errors and of sizes of effects.

    Attributes:
        mean: (q,) sizes by which the solution is corrected.
        covariance: (q, q) second moment about `mean`.
        by_sizes: (c, q) derivative of the null model's columns with respect to the sizes.
        of_arms: Errors of arms, each with the slice of its sizes.
        field_m2: Posterior mean of the variance of a field's shifts [m^2].
    """

    mean: Array
    covariance: Array
    by_sizes: Array
    of_arms: Sequence[tuple[PoseField | AxisLengths, slice]]
    field_m2: float


class ContainedSizes(NamedTuple):
    """A solution corrected by effects, and the influence of the effects on the offsets of r clocks.

    Attributes:
        solution: The corrected solution.
        shift_s: (r,) shift of the clock offsets [s].
        offset_covariance: (r, r) covariance that the effects add to the offsets [s^2].
    """

    solution: Solution
    shift_s: Array
    offset_covariance: Array


def with_expected_sizes(cell: Cell, solution: Solution, error: FoundEffect | None) -> Solution:
    """Return the solution of `contain_expected_sizes` for a recording without clocks."""
    return contain_expected_sizes(cell, solution, error).solution


def contain_expected_sizes(
    cell: Cell, solution: Solution, error: FoundEffect | None, offsets: OpenOffsets | None = None
) -> ContainedSizes:
    """Correct a solution by the posterior mean of expected effects, and add their posterior covariance.

    Args:
        cell: The cell as declared.
        solution: The solution.
        error: The systematic error that was found, or None; if it is a target's size, that size is treated separately.
        offsets: Clock offsets that are estimated with the solution; None without any.
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


def known_sizes(
    cell: Cell, situation: Situation, error: FoundEffect | None, arms_only: bool = False
) -> list[SizePosterior]:
    """Posteriors of all arm errors and effect sizes of a cell, one for each independent part.

    Args:
        cell: The cell as declared.
        situation: The situation.
        error: The systematic error that was found, or None.
        arms_only: Whether to leave out parts without arm errors.
    """
    arms = stated_fields(cell, situation), axis_lengths(cell, situation)
    parts = _split(*arms, list(_cell_effects(cell, situation, error)))
    return [size_posterior(situation, *part) for part in parts if part[0] or part[2] or not arms_only]


def size_posterior(
    situation: Situation,
    fields: Sequence[PoseField],
    effects: Sequence[ExpectedEffect] = (),
    axes: Sequence[AxisLengths] = (),
) -> SizePosterior:
    """Posterior of arm errors and of effect sizes; errors of one kind have a common sigma."""
    of_fields, of_axes = ([each.candidate(situation) for each in errors] for errors in (fields, axes))
    candidates = [*of_fields, *(each.candidate for each in effects), *of_axes]
    known = view_sums(situation.null, combine_candidates(candidates, situation))
    scores = score_from_sums(situation.null, known)
    places = [slice(*each) for each in pairwise(np.cumsum([0, *(each.sizes for each in candidates)]))]
    before, after = len(fields), len(fields) + len(effects)
    priors = [fields_prior(sum(each.width for each in fields)), _joint_prior(effects), *[LENGTHS_PRIOR] * len(axes)]
    given = posteriors_by_sigma(scores.gradient[0], scores.information[0], priors)
    _, mean, covariance = mixture(priors[0].probabilities, given)
    posterior = probabilities(priors[0].probabilities, given.two_log_evidence)
    contained = np.zeros_like(mean)
    for effect, place in zip(effects, places[before:after], strict=True):
        contained[place] = mean[place] if effect.is_contained else 0.0
    return SizePosterior(
        contained,
        covariance + np.outer(mean - contained, mean - contained),
        -situation.null.inverse @ known.across[0].T,
        list(zip([*fields, *axes], places[:before] + places[after:], strict=True)),
        float(posterior @ priors[0].sigmas[:, 0] ** 2) if fields else 0.0,
    )


def _joint_prior(effects: Sequence[ExpectedEffect]) -> SigmaPrior:
    """Joint prior of the sigmas of all sizes, (m, q): every combination of the effects' sigmas."""
    kinds = {each.effect: each.prior.probabilities for each in effects}
    places = [dict(zip(kinds, at, strict=True)) for at in product(*(range(len(shares)) for shares in kinds.values()))]
    sizes = [each.candidate.sizes for each in effects]
    sigmas = [np.repeat([each.prior.sigmas[at[each.effect]] for each in effects], sizes) for at in places]
    return SigmaPrior(
        np.array(sigmas), np.array([np.prod([kinds[name][k] for name, k in at.items()]) for at in places])
    )


def _split(
    fields: Sequence[PoseField], axes: Sequence[AxisLengths], effects: Sequence[ExpectedEffect]
) -> list[tuple[Sequence[PoseField], Sequence[ExpectedEffect], Sequence[AxisLengths]]]:
    """Split errors into parts that are treated jointly: one part, or one for each arm, mount and target if many."""
    robots = dict.fromkeys([*(field.robot for field in fields), *(axis.robot for axis in axes)])
    are_few = sum(each.candidate.sizes for each in effects) <= _MOST_TOGETHER
    if are_few and len(robots) <= _MOST_ARMS:
        return [(fields, effects, axes)] if robots or effects else []
    names = dict.fromkeys(each.candidate.about[0] for each in effects)
    of_robots = [([f for f in fields if f.robot == r], (), [a for a in axes if a.robot == r]) for r in robots]
    return [*of_robots, *(((), [each for each in effects if each.candidate.about[0] == name], ()) for name in names)]


def _cell_effects(cell: Cell, situation: Situation, error: FoundEffect | None) -> Iterator[ExpectedEffect]:
    rigid = _tool_mounts(cell) | situation.problem.point_mounts
    for name in CONTAINED:
        effect = EFFECTS[name]
        assert effect.expected is not None
        assert effect.candidates is not None
        loaded = (each for each in effect.candidates(situation) if each.about[0] not in rigid)
        yield from (ExpectedEffect(name, candidate, effect.expected.prior(len(CONTAINED))) for candidate in loaded)
    counted = () if error is None else {e.about for e in (error, *error.alternatives) if e.effect == target_size.NAME}
    for candidate in target_size.candidates(situation):
        sigma = _size_sigma(cell, situation.groups, candidate.about[0])
        is_free = cell.targets[candidate.about[0]].has_free_scale
        if sigma and (is_free or candidate.about[0] not in counted):
            yield ExpectedEffect(target_size.NAME, candidate, SigmaPrior.single_value(sigma), is_free)


def unit_error(situation: Situation, target: str) -> tuple[float, float]:
    """Relative error of the assumed length unit of a target's poses, and its sigma."""
    (candidate,) = (each for each in target_size.candidates(situation) if each.about == (target,))
    known = size_posterior(
        situation, (), [ExpectedEffect(target_size.NAME, candidate, SigmaPrior.single_value(_FREE_SIGMA))]
    )
    return float(known.mean[0]), float(np.sqrt(known.covariance[0, 0]))


def _tool_mounts(cell: Cell) -> frozenset[str]:
    """Mounts of tips and grips: tools that touch at rest, unlike brackets of cameras or boards, which may bend."""
    touching = [each.name for each in cell.cameras.values() if each.touches]
    touching += [each.name for each in cell.targets.values() if each.is_touched]
    return frozenset(map(cell.mount_name, touching))


def _size_sigma(cell: Cell, groups: tuple[ViewGroup, ...], target: str) -> float:
    """Relative sigma of a target's size: the stated or a typical value; 0 if all its views state their noise."""
    if cell.targets[target].has_free_scale:
        return _FREE_SIGMA
    stated = cell.targets[target].size_sigma
    if stated is not None:
        return stated
    counts = (g.measurement.counts() for g in groups if g.target == target)
    is_open = any(count.get("pixel_px", 0) or count.get("pose_m", 0) for count in counts)
    return target_size.EXPECTED.sigma if is_open else 0.0


def posteriors_by_sigma(gradient: Array, information: Array, priors: Sequence[SigmaPrior]) -> Gaussian:
    """Posterior of all sizes for each sigma of the first prior, (..., m), the other sigmas integrated out.

    The cost of sizes s is 2 g's + s'Ps plus the cost of their prior. Source: docs/mathematics.md (11.4).

    Args:
        gradient: (..., q) g.
        information: (..., q, q) P.
        priors: Independent priors of the sigmas of consecutive sizes, (m, q1), (n, q2), ...
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
    rest = mixture(others[0].probabilities, posteriors_by_sigma(slope[..., 0], curvature, others))
    both = np.concatenate([back, np.broadcast_to(np.eye(back.shape[-1]), (*back.shape[:-2], *back.shape[-1:] * 2))], -2)
    covariance = both @ rest.covariance @ both.mT
    covariance[..., :count, :count] += spread
    means = (both @ rest.mean[..., None])[..., 0]
    means[..., :count] += mean[..., 0]
    return Gaussian(rest.two_log_evidence + evidence, means, covariance)
