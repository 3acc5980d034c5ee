"""An automatic test of conventions: search for hypotheses that explain the input as well or better.

A hypothesis is reported only if it predicts held-out samples, contradicts no hard fact and changes the requested
transforms. No hypothesis is ever applied. docs/conventions_test.md lists which data distinguish which mistakes.
`benchmarks.mutations` judges its limits.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from basecal.accuracy.input_check.hypotheses import AS_DECLARED, ConventionHypothesis, convention_hypotheses, streams
from basecal.accuracy.input_check.hypothesis_choice import (
    TriedHypothesis,
    decide_hypotheses,
    has_tail,
    is_observable,
)
from basecal.accuracy.input_check.hypothesis_fit import (
    FOLDS,
    HypothesisFit,
    fit_hypothesis,
    is_plausible,
    residual_ratio,
)
from basecal.accuracy.input_check.loop_fit import Fits, Lenses, LoopFit, ViewCache, fit_loops, pair_state, trimmed_rms
from basecal.accuracy.input_check.pairing import half_turn_hypotheses, slip_hypotheses
from basecal.accuracy.input_check.plausibility import impossible_answer, impossible_reading
from basecal.accuracy.input_check.rare_hypotheses import rare_hypotheses
from basecal.accuracy.input_check.target_sizes import size_hypotheses
from basecal.accuracy.input_check.unexplained_motion import is_hopeless, unexplained_motion
from basecal.accuracy.readings.reading import Reading, declared_reading
from basecal.accuracy.readings.single_pairs import has_many_robots, merge_findings, solve_single_pairs
from basecal.cell import Cell, Finding, Recording
from basecal.effects.link_parameters import NAME as LINKS
from basecal.errors import BasecalError
from basecal.estimation.noise.robot_noise import count_stops
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution
from basecal.estimation.start.first_state import known_transforms
from basecal.estimation.start.lens import lens_from_views
from basecal.estimation.start.metric_points import has_metric_start
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Camera
from basecal.numerics.steps import run_in_step

_SCREENED_SAMPLES = 25  # of the screening; a closed form from poses needs three
_SOLVED_SAMPLES = 40  # of a full fit: enough to distinguish hypotheses; bounds the time
_REWRITTEN_SAMPLES = 400  # that are reread and checked against hard facts, which hold for all samples or for none
_SCREENED_LED_VIEWS = 14  # of an LED, two equations each: twice as many as there are unknowns
_MIN_SAMPLES = 5  # samples, so that cross-validation with three folds fits three
_LEAST_REDUNDANCY = 1.25  # equations over unknowns without the largest fold

_WORST_RATIO = 2.0  # largest error of a hypothesis over that of the declared one, before the pose noise is known
_NEAR_RATIO = 3.0  # largest loop error of a hypothesis that is fitted, over that of the best one
_FLOOR_RAD = 0.01  # [rad] loop error of poses within which the screening of few samples does not rank
_HOPELESS_RAD = 0.25  # [rad] loop error of the best hypothesis above which none is plausible
_LED_FACTOR = 0.2  # of both limits for directions to an LED, which have no rotation
_MOST_FITTED = 8  # hypotheses to fit; bounds the time
_UNEXPLAINED_SHARE = 0.08  # of the motion, above which rare mistakes are tried; no correct recording has reached it

_BATCH_PAIRS = 8  # of camera and target, fitted as one batch in a cell of many robots: larger batches gain little

_EXPLAINED = 1.15  # residuals over stated sigmas below which no better hypothesis is needed

T = TypeVar("T")
_Pairs = list[tuple[PairViews, Problem]]
_Check = Generator[_Pairs, list[LoopFit | None], T]
"""A check that yields pairs to be fitted and receives the fits."""


def check_conventions(
    cell: Cell,
    recording: Recording,
    problem: Problem,
    solution: Solution,
    settings: Settings,
    is_explained: bool,
) -> tuple[Finding, ...]:
    """Findings about conventions that the input seems to violate, or that it cannot determine.

    Args:
        cell: The declared cell.
        recording: The recording.
        problem: The problem that was built from both.
        solution: Its solution.
        settings: Settings of the solution.
        is_explained: Whether typical robot noise explains the residuals of robots that were assumed exact.

    Returns:
        An error for each hypothesis that explains the data better than the declared one. If the declared one
        contradicts a known fact, a hypothesis that explains the data equally well is an error, too. Otherwise
        hypotheses that explain the data equally well give one `ambiguous-convention`. If no hypothesis explains the
        data, there is at most one `poor-fit`.
    """
    baseline = declared_reading(cell, recording, problem)
    groups = None
    if not has_many_robots(problem):
        (found,) = _run_checks([_check_reading(baseline, solution.state, settings, is_explained)])
        # A target that is seen once cannot be held out, so that no hypothesis is decided by all views together.
        groups = [] if found or len(problem.groups) == 1 else _unexplained_groups(problem, solution.state)
        if not groups:
            return found
    pairs = solve_single_pairs(baseline, solution.state, groups)
    findings: list[tuple[Finding, ...]] = []
    for first in range(0, len(pairs), _BATCH_PAIRS):
        settings.report_progress(first, len(pairs))
        batch = pairs[first : first + _BATCH_PAIRS]
        findings += _run_checks([_check_reading(each.reading, each.state, settings, is_explained) for each in batch])
    return merge_findings(pairs, findings)


def _unexplained_groups(problem: Problem, state: State) -> list[ViewGroup]:
    """Groups of views of a camera and a target that the solution does not explain."""
    return [group for group in problem.groups if is_hopeless(problem.with_groups((group,)), state)]


def _run_checks(checks: Sequence[_Check[T]]) -> list[T]:
    """Run several checks and return their results; the pairs that they yield are fitted as one batch."""

    def fit_pairs(requests: Sequence[_Pairs]) -> Iterator[list[LoopFit | None]]:
        """Fits of the pairs of each check."""
        fits = iter(fit_loops([pair for pairs in requests for pair in pairs]))
        return ([next(fits) for _ in pairs] for pairs in requests)

    return run_in_step(checks, fit_pairs)


def _check_reading(
    baseline: Reading, state: State, settings: Settings, is_explained: bool
) -> _Check[tuple[Finding, ...]]:
    """Check the conventions of all robots of one reading jointly, as `check_conventions`."""
    if any(LINKS in model.columns for model in baseline.problem.models.values()):
        baseline, state = _without_links(baseline, state)
    cell, problem = baseline.cell, baseline.problem
    if len(baseline.order) < _MIN_SAMPLES or not _can_hold_out(problem):
        return ()
    fit = _fit_baseline(baseline, settings, state)
    if fit is None:
        return ()
    reference = TriedHypothesis(AS_DECLARED, fit, (*impossible_reading(baseline), *impossible_answer(cell, fit)))
    if is_plausible(fit) and not reference.impossible and not is_observable(cell, fit):
        return ()
    # A guess or the axis-shift start belongs to the declared hypothesis alone.
    tried = yield from _try_hypotheses(baseline, reference, replace(settings, start="closed"))
    still_robots = frozenset(r for r in cell.robots if count_stops(problem, r) == 1)
    return decide_hypotheses(cell, reference, tried, is_explained, still_robots)


def _without_links(baseline: Reading, state: State) -> tuple[Reading, State]:
    """Reading and state without link parameters, whose errors are smaller than the effect of any input mistake."""
    robots = {
        name: replace(robot, parameters={kind: stated for kind, stated in robot.parameters.items() if kind != LINKS})
        for name, robot in baseline.cell.robots.items()
    }
    kinematics = {
        name: replace(errors, values={kind: values for kind, values in errors.values.items() if kind != LINKS})
        for name, errors in state.robots.items()
    }
    return baseline.restate(replace(baseline.cell, robots=robots)), replace(state, robots=kinematics)


def _can_hold_out(problem: Problem) -> bool:
    """Whether two of three folds have at least a quarter more equations than unknowns."""
    return problem.equation_count * (FOLDS - 1) / FOLDS > _LEAST_REDUNDANCY * problem.width


def _fit_baseline(baseline: Reading, settings: Settings, state: State) -> HypothesisFit | None:
    """Fit of the declared hypothesis; also from a closed-form start, since a wrong guess is no input mistake."""
    cell, few = baseline.cell, baseline.thin(_SOLVED_SAMPLES).problem
    fit = fit_hypothesis(cell, few, settings, state)
    if settings.start == "closed" or (fit is not None and is_plausible(fit)):
        return fit
    refit = fit_hypothesis(cell, few, replace(settings, start="closed"))
    fits = [each for each in (fit, refit) if each is not None]
    return min(fits, key=lambda each: each.trimmed_rms, default=None)


def _try_hypotheses(baseline: Reading, reference: TriedHypothesis, settings: Settings) -> _Check[list[TriedHypothesis]]:
    """Fully fit the hypotheses that survive the screening."""
    lenses = _lenses(baseline, reference.fit)
    known = reference.fit.solution.state
    found: list[TriedHypothesis] = []
    common = convention_hypotheses(baseline)
    surviving = yield from _screen_hypotheses(baseline, lenses, common)
    has_priors = any(unknown.status == "prior" for unknown in baseline.problem.unknowns.values())
    if not surviving and not is_plausible(reference.fit) and has_priors:
        # Without priors, the loops of robots that rotate about one axis do not close under any hypothesis.
        surviving = [(hypothesis, {}) for hypothesis in common if not hypothesis.is_wider]
    for hypothesis, fits in surviving:
        found += _fit_fully(baseline, hypothesis, settings, (fits, lenses), reference)
    if any(_explains_all(each) and each.compare(reference.fit).is_taken for each in found):
        return found
    if not _is_explained(reference.fit):
        wider = [hypothesis for hypothesis in common if hypothesis.is_wider]
        for hypothesis in [*wider, *size_hypotheses(baseline.thin(_SOLVED_SAMPLES), known)]:
            found += _fit_fully(baseline, hypothesis, settings, known, reference)
    if has_tail(reference.fit) or not (_is_possible(reference) or any(map(_explains_all, found))):
        moving = [name for name, track in baseline.tracks.items() if track.moves]
        for hypothesis, fits in slip_hypotheses(baseline, lenses, streams(moving)):
            found += _fit_fully(baseline, hypothesis, settings, (fits, lenses), reference)
        for hypothesis in half_turn_hypotheses(baseline):
            found += _fit_fully(baseline, hypothesis, settings, None, reference)
    if _is_possible(reference) or any(map(_explains_all, found)):
        return found
    if unexplained_motion(reference.fit.solution.problem, known) > _UNEXPLAINED_SHARE:
        rare = yield from _screen_hypotheses(baseline, lenses, rare_hypotheses(baseline))
        for hypothesis, fits in rare:
            found += _fit_fully(baseline, hypothesis, settings, (fits, lenses), reference)
    return found


def _is_possible(trial: TriedHypothesis) -> bool:
    return is_plausible(trial.fit) and not trial.impossible


def _explains_all(trial: TriedHypothesis) -> bool:
    """Whether every session is explained: under a wrong hypothesis one of two sessions may still fit."""
    return _is_possible(trial) and not has_tail(trial.fit)


def every_hypothesis(baseline: Reading, state: State, settings: Settings) -> list[ConventionHypothesis]:
    """List all hypotheses that may be reported, including those with an unknown number or sample.

    Args:
        baseline: The declared reading.
        state: Fitted state of the declared reading.
        settings: Settings of the fit.
    """
    found = [*convention_hypotheses(baseline), *rare_hypotheses(baseline), *half_turn_hypotheses(baseline)]
    found += size_hypotheses(baseline.thin(_SOLVED_SAMPLES), state)
    declared_fit = _fit_baseline(baseline, settings, state)
    if declared_fit is not None:
        moving = [name for name, track in baseline.tracks.items() if track.moves]
        found += [slip for slip, _ in slip_hypotheses(baseline, _lenses(baseline, declared_fit), streams(moving))]
    return found


def _fit_fully(
    baseline: Reading,
    hypothesis: ConventionHypothesis,
    settings: Settings,
    start: State | tuple[Fits, Lenses] | None,
    reference: TriedHypothesis,
) -> list[TriedHypothesis]:
    """Fully fit a hypothesis; empty if it contradicts a fact or its error is far above that of the declared one.

    Args:
        baseline: The declared reading.
        hypothesis: The hypothesis.
        settings: Settings of the fit.
        start: Initial state, or loop fits to start from; None to compute a start.
        reference: The declared hypothesis with its fit.
    """
    reading = _reread(hypothesis, baseline)
    if impossible_reading(reading):
        return []
    few = reading.thin(_SOLVED_SAMPLES).problem
    state = pair_state(few, *start) if isinstance(start, tuple) else start
    fit = fit_hypothesis(reading.cell, few, settings, state, _WORST_RATIO * reference.fit.trimmed_rms)
    return [] if fit is None else [TriedHypothesis(hypothesis, fit, impossible_answer(reading.cell, fit))]


def _reread(hypothesis: ConventionHypothesis, baseline: Reading) -> Reading:
    """Reading under a hypothesis; of at most 400 samples unless the hypothesis depends on their order."""
    return hypothesis.reread(baseline if hypothesis.depends_on_order else baseline.thin(_REWRITTEN_SAMPLES))


def _screen_hypotheses(
    baseline: Reading, lenses: Lenses, candidates: Sequence[ConventionHypothesis]
) -> _Check[list[tuple[ConventionHypothesis, Fits]]]:
    """Hypotheses whose loop errors are close to the smallest one, with their fits."""
    hypotheses, readings = [AS_DECLARED], [baseline]
    for hypothesis in candidates:
        is_still = any(name in baseline.tracks and not baseline.tracks[name].moves for name in hypothesis.about)
        if hypothesis.is_wider or (hypothesis.code == "pairing-shifted" and is_still):
            continue
        reading = _reread(hypothesis, baseline)
        if not impossible_reading(reading):
            hypotheses.append(hypothesis)
            readings.append(reading)
    fits = yield from _fit_readings(readings, lenses)
    scores = [max((trimmed_rms(fit.errors) for fit in by_pair.values()), default=np.inf) for by_pair in fits]
    has_led = any(fit.is_led for fit in fits[0].values())
    scale = _LED_FACTOR if has_led else 1.0
    if min(scores) > scale * _HOPELESS_RAD:
        return []
    limit = _NEAR_RATIO * min(scores) + scale * _FLOOR_RAD
    best = sorted(range(1, len(scores)), key=lambda k: scores[k])[:_MOST_FITTED]
    return [(hypotheses[k], fits[k]) for k in best if scores[k] < limit]


def _fit_readings(readings: Sequence[Reading], lenses: Lenses) -> _Check[list[Fits]]:
    """Fit the loops of each pair of camera and target of each reading, all as one batch.

    A reading has no fits if one of its pairs cannot be fitted.
    """
    cache = ViewCache(lenses)
    pairs = [_pairs(reading, cache) for reading in readings]
    fits = iter((yield [pair for of_reading in pairs for pair in of_reading]))
    found: list[Fits] = []
    for of_reading in pairs:
        named = {(sight.group.camera, sight.group.target): next(fits) for sight, _ in of_reading}
        solved = {key: fit for key, fit in named.items() if fit is not None}
        found.append(solved if len(solved) == len(named) else {})
    return found


def _pairs(reading: Reading, cache: ViewCache) -> _Pairs:
    """Prepared views of each pair of camera and target of a reading; empty if they cannot be prepared."""
    problem = reading.thin(_SCREENED_SAMPLES).problem
    known = known_transforms(problem)
    try:
        pairs = []
        for group in (g for g in problem.groups if not has_metric_start(g, known)):
            views = cache.prepare(group, _SCREENED_SAMPLES)
            if views.candidates is None:  # an LED, whose search takes longer
                views = cache.prepare(group, _SCREENED_LED_VIEWS)
            pairs.append((views, problem))
        return pairs
    except (BasecalError, np.linalg.LinAlgError):
        return []


def _lenses(baseline: Reading, fit: HypothesisFit) -> dict[str, Camera]:
    """Lens of each camera with pixels: stated, from a plausible fit, or from its views without any robot."""
    found = {}
    for name, lens in baseline.problem.lenses.items():
        views = [g.measurement for g in baseline.problem.groups if g.camera == name]
        pixels = [m for m in views if isinstance(m, PixelMeasurement)]
        solved = fit.solution.state.cameras[name] if is_plausible(fit) else None
        found[name] = lens.camera or solved or lens_from_views(baseline.cell.cameras[name], pixels)
    return found


def _is_explained(fit: HypothesisFit) -> bool:
    """Whether stated sigmas explain every residual, so that no wider model improves the fit noticeably."""
    return not fit.solution.noise.estimated and residual_ratio(fit.solution) < _EXPLAINED and not has_tail(fit)
