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
    plausible,
    ratio,
)
from basecal.accuracy.input_check.loop_fit import Fits, Lenses, LoopFit, ReadyViews, fit_loops, pair_state, trimmed_rms
from basecal.accuracy.input_check.pairing import half_turns, pairing_errors
from basecal.accuracy.input_check.plausibility import impossible_answer, impossible_reading
from basecal.accuracy.input_check.rare_hypotheses import rare_hypotheses
from basecal.accuracy.input_check.target_sizes import size_hypotheses
from basecal.accuracy.input_check.unexplained_motion import unexplained_motion
from basecal.accuracy.readings.reading import Reading, as_recorded
from basecal.accuracy.readings.single_pairs import has_many_robots, merge_findings, solve_single_pairs
from basecal.cell import Cell, Finding, Recording
from basecal.effects.link_parameters import NAME as LINKS
from basecal.errors import BasecalError
from basecal.estimation.noise.robot_noise import count_stops
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution
from basecal.estimation.start.first_state import known_transforms
from basecal.estimation.start.lens import lens_from_views
from basecal.estimation.start.metric_points import has_metric_start
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Camera
from basecal.numerics.steps import run_in_step

_SCREENED = 25  # samples of the screening; a closed form from poses needs three
_SOLVED = 40  # samples of a full fit: enough to distinguish hypotheses; bounds the time
_REWRITTEN = 400  # samples that are rewritten and checked against hard facts, which hold for all samples or for none
_LIGHTS_SCREENED = 14  # views of an LED, two equations each: twice as many as there are unknowns
_MIN_SAMPLES = 5  # samples, so that cross-validation with three folds fits three
_LEAST_REDUNDANCY = 1.25  # equations over unknowns without the largest fold

_OUT_OF_THE_RACE = 2.0  # times the error of the declared hypothesis, before the pose noise is known
_NEAR_RATIO = 3.0  # largest loop error of a hypothesis that is fitted, over that of the best one
_FLOOR_RAD = 0.01  # [rad] loop error of poses within which the screening of few samples does not rank
_HOPELESS_RAD = 0.25  # [rad] loop error of the best hypothesis above which none is plausible
_OF_LIGHT = 0.2  # factor of both limits for directions to an LED, which have no rotation
_MOST_SOLVED = 8  # hypotheses to fit; bounds the time
_ODD = 0.08  # share of unexplained motion above which rare mistakes are tried; no correct recording has had it

_IN_STEP = 8  # pairs of camera and target fitted as one batch in a cell of many robots: larger batches gain little

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
    is_explained: bool = False,
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
    declared = as_recorded(cell, recording, problem)
    if not has_many_robots(problem):
        return _run_checks([_check_reading(declared, solution.state, settings, is_explained)])[0]
    pairs = solve_single_pairs(declared, solution.state)
    found: list[tuple[Finding, ...]] = []
    for at in range(0, len(pairs), _IN_STEP):
        settings.report_progress(at, len(pairs))
        found += _run_checks(
            [_check_reading(p.reading, p.state, settings, is_explained) for p in pairs[at : at + _IN_STEP]]
        )
    return merge_findings(pairs, found)


def _run_checks(checks: Sequence[_Check[T]]) -> list[T]:
    """Run several checks and return their results; the pairs that they yield are fitted as one batch."""

    def fit_pairs(requests: Sequence[_Pairs]) -> Iterator[list[LoopFit | None]]:
        """Fits of the pairs of each check."""
        fits = iter(fit_loops([pair for of in requests for pair in of]))
        return ([next(fits) for _ in of] for of in requests)

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
    whole = _as_declared(baseline, settings, state)
    if whole is None:
        return ()
    as_is = TriedHypothesis(AS_DECLARED, whole, (*impossible_reading(baseline), *impossible_answer(cell, whole)))
    if plausible(whole) and not as_is.impossible and not is_observable(cell, whole):
        return ()
    # A guess or the axis-shift start belongs to the declared hypothesis alone.
    tried = yield from _try_hypotheses(baseline, as_is, replace(settings, start="closed"))
    still = frozenset(r for r in cell.robots if count_stops(problem, r) == 1)
    return decide_hypotheses(cell, as_is, tried, is_explained, still)


def _without_links(baseline: Reading, state: State) -> tuple[Reading, State]:
    """Reading and state without link parameters, whose errors are smaller than the effect of any input mistake."""
    robots = {
        name: replace(robot, parameters={k: of for k, of in robot.parameters.items() if k != LINKS})
        for name, robot in baseline.cell.robots.items()
    }
    kinematics = {
        name: replace(of, values={k: values for k, values in of.values.items() if k != LINKS})
        for name, of in state.robots.items()
    }
    return baseline.restate(replace(baseline.cell, robots=robots)), replace(state, robots=kinematics)


def _can_hold_out(problem: Problem) -> bool:
    """Whether two of three folds have at least a quarter more equations than unknowns."""
    equations = sum(int(group.measurement.equations().sum()) for group in problem.groups)
    return equations * (FOLDS - 1) / FOLDS > _LEAST_REDUNDANCY * problem.width


def _as_declared(baseline: Reading, settings: Settings, state: State) -> HypothesisFit | None:
    """Fit of the declared hypothesis; also from a closed-form start, since a wrong guess is no input mistake."""
    cell, few = baseline.cell, baseline.thin(_SOLVED).problem
    fit = fit_hypothesis(cell, few, settings, state)
    if settings.start == "closed" or (fit is not None and plausible(fit)):
        return fit
    anew = fit_hypothesis(cell, few, replace(settings, start="closed"))
    found = [each for each in (fit, anew) if each is not None]
    return min(found, key=lambda each: each.core, default=None)


def _try_hypotheses(baseline: Reading, as_is: TriedHypothesis, settings: Settings) -> _Check[list[TriedHypothesis]]:
    """Fully fit the hypotheses that survive the screening."""
    lenses = _lenses(baseline, as_is.fit)
    known = as_is.fit.solution.state
    found: list[TriedHypothesis] = []
    common = convention_hypotheses(baseline)
    surviving = yield from _surviving(baseline, lenses, common)
    has_priors = any(unknown.status == "prior" for unknown in baseline.problem.unknowns.values())
    if not surviving and not plausible(as_is.fit) and has_priors:
        # Without priors, the loops of robots that rotate about one axis do not close under any hypothesis.
        surviving = [(hypothesis, {}) for hypothesis in common if not hypothesis.nested]
    for hypothesis, fits in surviving:
        found += _try(baseline, hypothesis, settings, (fits, lenses), as_is)
    if any(_explains_all(each) and each.compare(as_is.fit).is_taken for each in found):
        return found
    if not _is_explained(as_is.fit):
        wider = [hypothesis for hypothesis in common if hypothesis.nested]
        for hypothesis in [*wider, *size_hypotheses(baseline.thin(_SOLVED), known)]:
            found += _try(baseline, hypothesis, settings, known, as_is)
    if has_tail(as_is.fit) or not (_is_possible(as_is) or any(map(_explains_all, found))):
        moving = [name for name, track in baseline.tracks.items() if track.moves]
        for hypothesis, fits in pairing_errors(baseline, lenses, streams(moving)):
            found += _try(baseline, hypothesis, settings, (fits, lenses), as_is)
        for hypothesis in half_turns(baseline):
            found += _try(baseline, hypothesis, settings, None, as_is)
    if _is_possible(as_is) or any(map(_explains_all, found)):
        return found
    if unexplained_motion(as_is.fit.solution.problem, known) > _ODD:
        rare = yield from _surviving(baseline, lenses, rare_hypotheses(baseline))
        for hypothesis, fits in rare:
            found += _try(baseline, hypothesis, settings, (fits, lenses), as_is)
    return found


def _is_possible(trial: TriedHypothesis) -> bool:
    return plausible(trial.fit) and not trial.impossible


def _explains_all(trial: TriedHypothesis) -> bool:
    """Whether every session is explained: under a wrong hypothesis one of two sessions may still fit."""
    return _is_possible(trial) and not has_tail(trial.fit)


def every_hypothesis(baseline: Reading, state: State, settings: Settings) -> list[ConventionHypothesis]:
    """All hypotheses that may be reported, including those with an unknown number or sample.

    Args:
        baseline: The declared reading.
        state: Fitted state of the declared reading.
        settings: Settings of the fit.
    """
    found = [*convention_hypotheses(baseline), *rare_hypotheses(baseline), *half_turns(baseline)]
    found += size_hypotheses(baseline.thin(_SOLVED), state)
    whole = _as_declared(baseline, settings, state)
    if whole is not None:
        moving = [name for name, track in baseline.tracks.items() if track.moves]
        found += [slip for slip, _ in pairing_errors(baseline, _lenses(baseline, whole), streams(moving))]
    return found


def _try(
    baseline: Reading,
    hypothesis: ConventionHypothesis,
    settings: Settings,
    start: State | tuple[Fits, Lenses] | None,
    as_is: TriedHypothesis,
) -> list[TriedHypothesis]:
    """Fully fit a hypothesis; empty if it contradicts a fact or its error is far above that of the declared one."""
    reading = _reread(hypothesis, baseline)
    if impossible_reading(reading):
        return []
    few = reading.thin(_SOLVED).problem
    state = pair_state(few, *start) if isinstance(start, tuple) else start
    fit = fit_hypothesis(reading.cell, few, settings, state, _OUT_OF_THE_RACE * as_is.fit.core)
    return [] if fit is None else [TriedHypothesis(hypothesis, fit, impossible_answer(reading.cell, fit))]


def _reread(hypothesis: ConventionHypothesis, baseline: Reading) -> Reading:
    """Reading under a hypothesis; of at most 400 samples unless the hypothesis depends on their order."""
    return hypothesis.reread(baseline if hypothesis.by_order else baseline.thin(_REWRITTEN))


def _surviving(
    baseline: Reading, lenses: Lenses, candidates: Sequence[ConventionHypothesis]
) -> _Check[list[tuple[ConventionHypothesis, Fits]]]:
    """Hypotheses whose loop errors are close to the smallest one, with their fits."""
    hypotheses, inputs = [AS_DECLARED], [baseline]
    for hypothesis in candidates:
        still = [name for name in hypothesis.about if name in baseline.tracks and not baseline.tracks[name].moves]
        if hypothesis.nested or (hypothesis.code == "pairing-shifted" and still):
            continue
        reading = _reread(hypothesis, baseline)
        if not impossible_reading(reading):
            hypotheses.append(hypothesis)
            inputs.append(reading)
    fits = yield from _screen(inputs, lenses)
    scores = [max((trimmed_rms(fit.off) for fit in of.values()), default=np.inf) for of in fits]
    of_light = any(fit.of_light for fit in fits[0].values())
    scale = _OF_LIGHT if of_light else 1.0
    if min(scores) > scale * _HOPELESS_RAD:
        return []
    limit = _NEAR_RATIO * min(scores) + scale * _FLOOR_RAD
    best = sorted(range(1, len(scores)), key=lambda k: scores[k])[:_MOST_SOLVED]
    return [(hypotheses[k], fits[k]) for k in best if scores[k] < limit]


def _screen(inputs: Sequence[Reading], lenses: Lenses) -> _Check[list[Fits]]:
    """Fit each hypothesis to the loops of its pairs of camera and target, all as one batch.

    A hypothesis has no fits if one of its pairs cannot be fitted.
    """
    views = ReadyViews(lenses)
    pairs = [_pairs(reading, views) for reading in inputs]
    fits = iter((yield [pair for of in pairs for pair in of]))
    found: list[Fits] = []
    for of in pairs:
        named = {(sight.group.camera, sight.group.target): next(fits) for sight, _ in of}
        whole = {key: fit for key, fit in named.items() if fit is not None}
        found.append(whole if len(whole) == len(named) else {})
    return found


def _pairs(reading: Reading, views: ReadyViews) -> _Pairs:
    """Prepared views of each pair of camera and target of a reading; empty if they cannot be prepared."""
    problem = reading.thin(_SCREENED).problem
    known = known_transforms(problem)
    try:
        pairs = []
        for group in (g for g in problem.groups if not has_metric_start(g, known)):
            some = views.take(group, _SCREENED)
            if some.candidates is None:  # an LED, whose search takes longer
                some = views.take(group, _LIGHTS_SCREENED)
            pairs.append((some, problem))
        return pairs
    except (BasecalError, np.linalg.LinAlgError):
        return []


def _lenses(baseline: Reading, fit: HypothesisFit) -> dict[str, Camera]:
    """Lens of each camera with pixels: stated, from a plausible fit, or from its views without any robot."""
    found = {}
    for name, lens in baseline.problem.lenses.items():
        views = [g.measurement for g in baseline.problem.groups if g.camera == name]
        pixels = [m for m in views if isinstance(m, PixelMeasurement)]
        solved = fit.solution.state.cameras[name] if plausible(fit) else None
        found[name] = lens.camera or solved or lens_from_views(baseline.cell.cameras[name], pixels)
    return found


def _is_explained(fit: HypothesisFit) -> bool:
    """Whether stated sigmas explain every residual, so that no wider model improves the fit noticeably."""
    return not fit.solution.noise.estimated and ratio(fit.solution) < _EXPLAINED and not has_tail(fit)
