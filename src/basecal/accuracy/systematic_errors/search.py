"""Search for the systematic error that best explains the residuals of a solution, if there is one.

Score tests find candidates. Only these are solved for, with the noise estimated again, and must improve the prediction
of held-out blocks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from basecal.accuracy.covariance.widening import state_step
from basecal.accuracy.model_comparison.nested_models import (
    DISAGREEMENT_LEVEL,
    FALSE_DISCOVERY_RATE,
    SUSPECTED_LEVEL,
    compare_evidence,
    discoveries,
    largest_posterior,
    log_chance,
)
from basecal.accuracy.stated_sigmas import contradicted_sigmas
from basecal.accuracy.systematic_errors.confirm import HeldOut
from basecal.accuracy.systematic_errors.place_scatter import COUNT_PENALTY, Suspect, place_scatter
from basecal.accuracy.systematic_errors.score_tests import Linearised, log_chance_of_gain, score, view_sums
from basecal.accuracy.systematic_errors.situation import Situation, situate
from basecal.effects.faces.candidates import Candidates, combine_candidates
from basecal.effects.faces.effect import FoundEffect
from basecal.effects.registry import CHANGES_IN_TIME, EFFECTS, RANDOM_EFFECTS, ROBOT_PARAMETERS, largest_sigma
from basecal.estimation.noise.joint_estimate import model_sigmas, open_robots
from basecal.estimation.noise.random_effects import shared_term
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.problem.problem import Problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from
from basecal.geometry import SE3, Array, BoolArray
from basecal.numerics.spectral import spectrum

_RANK_DIGITS = 6  # digits that are equal for exactly confounded errors despite rounding
# Largest number of errors that are solved for, which bounds the time; assumed: `benchmarks.confounding` measures what
# is missed.
_MOST_TRIED = 3


def systematic_error(
    solution: Solution,
    recorded_problem: Problem,
    stamps: Mapping[int, float],
    settings: Settings,
    as_stated: Solution | None = None,
) -> FoundEffect | None:
    """Find the error that explains the residuals far better than noise, and improves predictions of held-out blocks.

    At most one error is returned: the remainder of a large error after its correction would look like further errors.

    Args:
        solution: The solution, with its noise.
        recorded_problem: The recorded problem, including outliers.
        stamps: Time of each sample by number [s].
        settings: Settings of the solution.
        as_stated: The solution with the stated sigmas, if its residuals contradict them.

    Returns:
        The error with the smallest p-value. If no error is certain, an uncertain error that improves the prediction of
        held-out blocks. None if no error is found.
    """
    if not solution.converged or not np.isfinite(solution.cost) or not solution.problem.groups:
        return None
    if as_stated is not None and not as_stated.problem.models:
        found = _reconciling_effect(
            solution, as_stated, recorded_problem, stamps, replace(settings, robot_noise="stated")
        )
        if found is not None:
            return found
    situation = situate(solution, recorded_problem, stamps)
    every = _suspects(situation)
    suspects = list(_confirmed_suspects(situation, _select_suspects(situation, every)))
    if solution.problem.models:
        # The poses of robots with estimated kinematics follow from their joints, so no pose can be corrected.
        discovered = _discovery_mask(
            suspects, [suspect.log_chance_beside_places(0.0, suspect.log_chance) for suspect in suspects]
        )
        certain = [suspects[k] for k in np.flatnonzero(discovered)]
        without_size = replace(certain[0], size=0 * certain[0].size) if certain else None
        return None if without_size is None else _describe(situation, without_size, solution, solution)
    if not suspects:
        return None
    before = solution if solution.noise.logs is not None else _solve_again(solution, settings)
    suspect, share, is_certain = _select_suspect(situation, suspects, before)
    if not is_certain and (_is_contained(solution, suspect) or situation.is_held_in_time(suspect.effect)):
        return None
    after = _solve_again(_without_suspect(solution, situation, suspect), settings)
    described = _describe(situation, suspect, solution, after)
    others = _alternatives(situation, suspect, every)
    return replace(described, is_certain=is_certain, alternatives=others, probability=share)


def _select_suspect(
    situation: Situation, suspects: Sequence[Suspect], solution: Solution
) -> tuple[Suspect, float, bool]:
    """Return the suspect with the smallest p-value, its largest posterior probability, and whether it is certain.

    Certain suspects come before uncertain ones. A step and a drift of one base may have the same score, but have
    different gains once the noise is estimated again.
    """
    gains = [_gain(situation, each, solution) for each in suspects]
    pairs = list(zip(suspects, gains, strict=True))
    chances = [min(each.log_chance, _log_chance(situation, each, gain)) for each, gain in pairs]
    beside = [each.log_chance_beside_places(gain, chances[i]) for i, (each, gain) in enumerate(pairs)]
    are_certain = _discovery_mask(suspects, beside)
    costs = [chance - COUNT_PENALTY * each.log_count for chance, each in zip(chances, suspects, strict=True)]
    are_held = [situation.is_held_in_time(each.effect) for each in suspects]
    k = min(range(len(costs)), key=lambda i: (not are_certain[i], are_held[i] and not are_certain[i], costs[i]))
    return suspects[k], largest_posterior(beside[k] + np.log(suspects[k].family)), bool(are_certain[k])


def running_error(solution: Solution, stamps: Mapping[int, float]) -> FoundEffect | None:
    """Find the likeliest systematic error during a recording; its size and its effect are of first order.

    Errors shared by all samples increase the noise that is estimated with them. If no error is certain, the effect that
    the random effects indicate is therefore tested with the noise estimated jointly with these random effects.

    Args:
        solution: The solution, with its noise and the random effects that stops share.
        stamps: Time of each sample by number [s].

    Returns:
        The error that held-out blocks confirm; None if there is none, or if robot kinematics are estimated.
    """
    if not solution.converged or not solution.problem.groups or solution.problem.models:
        return None
    situation = situate(solution, stamps=stamps)
    first = _confirm_first(solution, situation, _suspects(situation))
    if (first is not None and first.is_certain) or solution.noise.beside_common is None:
        return first
    held = solution.noise.beside_common.hold_sigmas(solution.problem)
    beside = Situation(held, without_errors(held, solution.state), solution.problem, stamps)
    random = [each for each in _suspects(beside) if _null_model(situation, each) is situation.linearisation]
    second = _confirm_first(solution, beside, random)
    return second if first is None or (second is not None and second.is_certain) else first


def _confirm_first(solution: Solution, situation: Situation, suspects: Sequence[Suspect]) -> FoundEffect | None:
    """Return the first suspect that held-out blocks confirm; it is certain if the p-value of its gain is small."""
    suspect = next(_confirmed_suspects(situation, _select_suspects(situation, suspects)), None)
    if suspect is None:
        return None
    gain = _gain(situation, suspect, solution)
    (is_certain,) = _discovery_mask(
        [suspect], [suspect.log_chance_beside_places(gain, _log_chance(situation, suspect, gain))], DISAGREEMENT_LEVEL
    )
    alternatives = _alternatives(situation, suspect, suspects)
    return replace(_to_first_order(situation, suspect), is_certain=bool(is_certain), alternatives=alternatives)


def _reconciling_effect(
    solution: Solution, as_stated: Solution, recorded_problem: Problem, stamps: Mapping[int, float], settings: Settings
) -> FoundEffect | None:
    """Return the error whose correction makes the residuals agree with the stated sigmas; None if there is none."""
    situation = situate(as_stated, recorded_problem, stamps)
    every = _suspects(situation)
    selected = _select_suspects(situation, every)
    certain = (
        each for each in selected if _discovery_mask([each], [each.log_chance_beside_places(0.0, each.log_chance)])[0]
    )
    for suspect in _confirmed_suspects(situation, certain):
        moved = _without_suspect(as_stated, situation, suspect).problem
        after = replace(solve_from(moved, as_stated.state, settings), noise=as_stated.noise)
        if not any(each.is_too_small for each in contradicted_sigmas(after)):
            described = _describe(situation, suspect, solution, after)
            return replace(described, alternatives=_alternatives(situation, suspect, every))
    return None


def _discovery_mask(
    suspects: Sequence[Suspect], log_chances: Sequence[float], share: float = FALSE_DISCOVERY_RATE
) -> BoolArray:
    """Mask of certain suspects, (n,), from their log p-values; `share` is the accepted share of false discoveries."""
    return discoveries(log_chances, max((suspect.family for suspect in suspects), default=1), share)


def _null_model(situation: Situation, suspect: Suspect) -> Linearised:
    return situation.null_model(suspect.effect, suspect.candidate.about[0])


def _confirmed_suspects(situation: Situation, suspects: Iterable[Suspect]) -> Iterator[Suspect]:
    """Yield the suspects that improve the prediction of held-out blocks.

    The score of a suspect is cleared if random errors in time may contain it; its gain alone then counts.
    """
    held_out = {model: HeldOut(situation, model) for model in (situation.linearisation, situation.null)}
    for each in suspects:
        if held_out[_null_model(situation, each)].confirms(each.candidate):
            is_held = situation.is_held_in_time(each.effect)
            yield replace(each, statistic=0.0, log_chance=0.0) if is_held else each


def _without_suspect(solution: Solution, situation: Situation, suspect: Suspect) -> Solution:
    """Correct the recorded hand pose of each view by a suspected error; the solution is then to be solved again."""
    groups = []
    for group, links, moves in zip(solution.problem.groups, situation.links, suspect.candidate.moves, strict=True):
        if moves is None:
            groups.append(group)
            continue
        of_target = (moves[:, 0] @ suspect.size)[..., None]
        tangent = (links.ends[1].target_from_flange.inverse().adjoint() @ of_target)[..., 0]
        hand = replace(group.hand, base_from_flange=group.hand.base_from_flange @ SE3.exp(tangent))
        groups.append(replace(group, ends=(group.eye, hand)))
    return replace(solution, problem=solution.problem.with_groups(groups))


def _suspects(situation: Situation) -> list[Suspect]:
    """Errors with a small p-value, the smallest first, at most one of each code and name."""
    tests: Counter[str] = Counter()
    unlikely = []
    for name, candidates in _candidates(situation):
        tests[candidates.code] += len(candidates.about)
        null, largest = situation.null_model(name, candidates.about[0]), largest_sigma(name)
        scores = score(null, candidates, largest)
        chances = single_chances = scores.log_chance
        if null is not situation.linearisation:
            single_chances = np.minimum(chances, score(situation.linearisation, candidates, largest).log_chance)
        for b in map(int, np.flatnonzero(single_chances < np.log(SUSPECTED_LEVEL))):
            figures = (
                int(scores.freedoms[b]),
                float(scores.statistic[b]),
                float(chances[b]),
                float(single_chances[b]),
            )
            unlikely.append(Suspect(name, candidates.single(b), scores.size[b], *figures, 0.0))
    likeliest: dict[tuple[str, str], tuple[float, Suspect]] = {}
    for suspect in unlikely:
        code, (name, *_) = suspect.candidate.code, suspect.candidate.about
        log_count = float(np.log(tests[code]))
        if suspect.single_log_chance + log_count >= np.log(SUSPECTED_LEVEL):
            continue
        rank = suspect.log_chance + COUNT_PENALTY * log_count
        if (code, name) not in likeliest or rank < likeliest[code, name][0]:
            chance = suspect.log_chance + log_count
            likeliest[code, name] = rank, replace(suspect, log_chance=chance, log_count=log_count, family=len(tests))
    ranked = sorted(likeliest.values(), key=lambda each: round(each[0], _RANK_DIGITS))
    beside = [_with_scatter(situation, suspect) for _, suspect in ranked]
    return [
        suspect
        for suspect in beside
        if suspect.log_chance_beside_places(0.0, suspect.single_log_chance) < np.log(SUSPECTED_LEVEL)
    ]


def _with_scatter(situation: Situation, suspect: Suspect) -> Suspect:
    """Add the scatter by place to a suspect that is a change in time; other suspects are returned unchanged."""
    if suspect.effect not in CHANGES_IN_TIME:
        return suspect
    return replace(suspect, scatter=place_scatter(situation, _null_model(situation, suspect), suspect.candidate))


def _select_suspects(situation: Situation, suspects: Sequence[Suspect]) -> list[Suspect]:
    """Select suspects to solve for: those with the smallest p-values whose effects on the data differ."""
    tried: list[Suspect] = []
    for suspect in suspects:
        if len(tried) < _MOST_TRIED and not any(
            _remaining_chi_square(situation, suspect, other)[1] == 0 for other in tried
        ):
            tried.append(suspect)
    return tried


def _alternatives(situation: Situation, suspect: Suspect, suspects: Sequence[Suspect]) -> tuple[FoundEffect, ...]:
    """Effects that the data do not distinguish from a suspect: if one is included, the suspect is not significant."""
    same = suspect.effect, suspect.candidate.about
    others = [each for each in suspects if (each.effect, each.candidate.about) != same]
    likely = [each for each in others if each.rank < suspect.rank - np.log(SUSPECTED_LEVEL)]
    return tuple(
        _to_first_order(situation, each)
        for each in likely
        if log_chance(*_remaining_chi_square(situation, suspect, each)) + suspect.log_count > np.log(SUSPECTED_LEVEL)
    )


def _remaining_chi_square(situation: Situation, suspect: Suspect, rival: Suspect) -> tuple[float, int]:
    """Chi-square and degrees of freedom of a suspect if a rival is included as well: docs/mathematics.md (11.5)."""
    nulls = [_null_model(situation, each) for each in (suspect, rival)]
    null = situation.linearisation if situation.linearisation in nulls else situation.null
    first, second = suspect.candidate, rival.candidate
    together, alone = score(null, combine_candidates((first, second), situation)), score(null, second)
    left = float(together.statistic[0] - alone.statistic[0])
    return max(left, 0.0), int(together.freedoms[0] - alone.freedoms[0])


def _candidates(situation: Situation) -> Iterator[tuple[str, Candidates]]:
    """Yield the candidates of all effects with the effects' names, one kind at a time to limit memory."""
    for name, effect in EFFECTS.items():
        for kind in () if effect.candidates is None else effect.candidates(situation):
            yield name, kind


def _gain(situation: Situation, suspect: Suspect, solution: Solution) -> float:
    """Decrease of minus twice the log likelihood by an error, with the noise estimated again; 0 if noise is stated.

    Noise that is estimated without the correction is too large, so the score is smaller than the gain. All other
    quantities are of second order about the solution.
    """
    if solution.noise.logs is None:
        return 0.0
    name = situation.random_effect(suspect.effect, suspect.candidate.about[0])
    before = solution.noise.minus_2_log_evidence if name else solution.noise.plain_minus_2_log_evidence
    return before - _minus_2_log_evidence(_without_suspect(solution, situation, suspect), name)


def _log_chance(situation: Situation, suspect: Suspect, gain: float) -> float:
    """Log p-value of a gain, for estimated noise and several tests."""
    return log_chance_of_gain(gain, suspect.freedoms, situation.linearisation.residual_freedoms) + suspect.log_count


def _is_contained(solution: Solution, suspect: Suspect) -> bool:
    """Whether a suspect of a robot's joints is contained in the shared errors of joints and links of this robot."""
    noise, about = solution.noise, suspect.candidate.about[0]
    of_joints = (name for name, robots in noise.common.items() if RANDOM_EFFECTS[name].by_joints and about in robots)
    name = next(of_joints, "") if suspect.effect in ROBOT_PARAMETERS else ""
    gain = noise.plain_minus_2_log_evidence - noise.minus_2_log_evidence
    return bool(name) and compare_evidence(gain).is_taken


def candidate_log_chance(solution: Solution, candidate: Candidates, size: Array, log_count: float) -> float:
    """Log p-value of a candidate's gain; `log_count` is the logarithm of the number of candidates that were tested."""
    suspect, situation = Suspect("", candidate, size, len(size), 0.0, 0.0, 0.0, log_count), situate(solution)
    return _log_chance(situation, suspect, _gain(situation, suspect, solution))


def _minus_2_log_evidence(solution: Solution, name: str) -> float:
    """Minus twice the log evidence of a solution with the random effect `name`; without random effects if ""."""
    problem, noise = solution.problem, solution.noise
    if not name:
        return model_sigmas(problem, solution.state, noise).minus_2_log_evidence
    start, other = replace(noise, logs=noise.models[name].logs), next((n for n in noise.common if n != name), "")
    terms = (shared_term(problem, each, open_robots(problem)) for each in (name, other))
    return model_sigmas(problem, solution.state, start, list(filter(None, terms))).minus_2_log_evidence


def _describe(situation: Situation, suspect: Suspect, solution: Solution, corrected_solution: Solution) -> FoundEffect:
    """Return the error with its covariance, its size corrected to first order about `corrected_solution`.

    The random effects are those of the null model: the noise of single stops alone gives a different size.
    """
    noise = replace(corrected_solution.noise, common=solution.noise.common, beside_common=solution.noise.beside_common)
    corrected = situate(replace(corrected_solution, noise=noise), situation.recorded, situation.stamps)
    again = score(_null_model(corrected, suspect), suspect.candidate, largest_sigma(suspect.effect))
    return _make_effect(
        situation,
        suspect,
        suspect.size + again.size[0],
        again.information[0],
        state_step(solution.problem, solution.state, corrected_solution.state),
    )


def _to_first_order(situation: Situation, suspect: Suspect) -> FoundEffect:
    """Return the error with its size and the shift of the solution by its correction, to first order."""
    found = score(_null_model(situation, suspect), suspect.candidate, largest_sigma(suspect.effect))
    across = view_sums(situation.linearisation, suspect.candidate).across[0]
    return _make_effect(
        situation,
        suspect,
        found.size[0],
        found.information[0],
        -situation.linearisation.inverse @ across.T @ found.size[0],
    )


def _make_effect(situation: Situation, suspect: Suspect, size: Array, information: Array, shift: Array) -> FoundEffect:
    candidate, about = suspect.candidate, suspect.candidate.about[0]
    is_camera, is_target = (
        any(getattr(g, kind) == about for g in situation.problem.groups) for kind in ("camera", "target")
    )
    return FoundEffect(
        suspect.effect,
        candidate.code,
        about,
        is_camera,
        is_target,
        candidate.since[0],
        candidate.unit,
        size,
        spectrum(information).inverse,
        shift,
        next(iter(candidate.joint), None),
    )


def _solve_again(solution: Solution, settings: Settings) -> Solution:
    if settings.robot_noise != "stated":
        return with_noise(solution, settings, guess=solution)
    return solve_from(solution.problem, solution.state, settings, solution.findings)
