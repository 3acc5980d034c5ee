"""An automatic test of conventions: does another hypothesis of the input explain it better, or as well.

A hypothesis is named only if it predicts held-out samples, contradicts no hard fact and moves the requested transforms.
Nothing is ever applied. docs/conventions_test.md lists which data distinguish which mix-ups. `benchmarks.mutations`
judges its limits.
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

_SCREENED = 25  # samples of the quick look, of which a closed form of poses needs three
_SOLVED = 40  # samples of a fit in earnest: enough to tell hypotheses apart; bounds the time
_REWRITTEN = 400  # samples that are rewritten and judged by hard facts, which hold of all of them or of none
_LIGHTS_SCREENED = 14  # views of a light, each two equations: twice as many as there are unknowns
_MIN_SAMPLES = 5  # samples, of which three folds leave three to fit
_LEAST_REDUNDANCY = 1.25  # equations over unknowns without the largest fold

_OUT_OF_THE_RACE = 2.0  # times the error of the declared one, before the noise of poses is known
_NEAR_RATIO = 3.0  # how many times worse than the best a hypothesis may close its loops and still be fitted
_FLOOR_RAD = 0.01  # [rad] of loops of poses, within which the quick look of few samples does not rank
_HOPELESS_RAD = 0.25  # [rad] of loops that even the best hypothesis does not close: none of them is so
_OF_LIGHT = 0.2  # of both limits, of directions to a light, which have no rotation of their own
_MOST_SOLVED = 8  # hypotheses to fit, which bounds the time
_ODD = 0.08  # share of the motion unexplained that no recording in order has had, so that rare mix-ups are tried

_IN_STEP = 8  # pairs of camera and target of a cell of many robots: more gain little

_EXPLAINED = 1.15  # residuals over stated sigmas: nothing is left that a better hypothesis could explain

T = TypeVar("T")
_Pairs = list[tuple[PairViews, Problem]]
_Check = Generator[_Pairs, list[LoopFit | None], T]
"""A check that asks for pairs to be fitted, and is told the fits."""


def check_conventions(
    cell: Cell,
    recording: Recording,
    problem: Problem,
    solution: Solution,
    settings: Settings,
    is_explained: bool = False,
) -> tuple[Finding, ...]:
    """Findings about conventions that the input seems to break, or that it leaves open.

    Args:
        cell: As declared.
        recording: As recorded.
        problem: What was packed of both.
        solution: What they gave.
        settings: How they were solved.
        is_explained: Whether noise such as arms have explains the residuals of robots that were assumed exact.

    Returns:
        An error for each hypothesis that explains the data better than the declared one. If the declared one
        contradicts a known fact, a hypothesis that explains the data equally well is an error, too. Otherwise such
        hypotheses give an `ambiguous-convention`. If no hypothesis explains the data, there is one `poor-fit` at most.
    """
    declared = as_recorded(cell, recording, problem)
    if not has_many_robots(problem):
        return _run_checks([_check_reading(declared, solution.state, settings, is_explained)])[0]
    pairs = solve_single_pairs(declared, solution.state)
    found: list[tuple[Finding, ...]] = []
    for at in range(0, len(pairs), _IN_STEP):
        settings.part(at, len(pairs))
        found += _run_checks(
            [_check_reading(p.reading, p.state, settings, is_explained) for p in pairs[at : at + _IN_STEP]]
        )
    return merge_findings(pairs, found)


def _run_checks(checks: Sequence[_Check[T]]) -> list[T]:
    """Where several checks end; the pairs of camera and target that they want fitted at a time go side by side."""

    def fit_pairs(requests: Sequence[_Pairs]) -> Iterator[list[LoopFit | None]]:
        """The fits of the pairs of each check."""
        fits = iter(fit_loops([pair for of in requests for pair in of]))
        return ([next(fits) for _ in of] for of in requests)

    return run_in_step(checks, fit_pairs)


def _check_reading(
    baseline: Reading, state: State, settings: Settings, is_explained: bool
) -> _Check[tuple[Finding, ...]]:
    """Check the conventions of all robots at once, as `check_conventions`."""
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
    """Both with links as stated: no mix-up is as small as their errors, which would chase what they cannot explain."""
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
    """Whether two of three folds still have more equations than there are unknowns, by a quarter."""
    equations = sum(int(group.measurement.equations().sum()) for group in problem.groups)
    return equations * (FOLDS - 1) / FOLDS > _LEAST_REDUNDANCY * problem.width


def _as_declared(baseline: Reading, settings: Settings, state: State) -> HypothesisFit | None:
    """The fit of the declared hypothesis; a start that misled it, such as a wrong guess, is no mix-up."""
    cell, few = baseline.cell, baseline.thin(_SOLVED).problem
    fit = fit_hypothesis(cell, few, settings, state)
    if settings.start == "closed" or (fit is not None and plausible(fit)):
        return fit
    anew = fit_hypothesis(cell, few, replace(settings, start="closed"))
    found = [each for each in (fit, anew) if each is not None]
    return min(found, key=lambda each: each.core, default=None)


def _try_hypotheses(baseline: Reading, as_is: TriedHypothesis, settings: Settings) -> _Check[list[TriedHypothesis]]:
    """Hypotheses that survive a quick look, fitted in earnest."""
    lenses = _lenses(baseline, as_is.fit)
    known = as_is.fit.solution.state
    found: list[TriedHypothesis] = []
    common = convention_hypotheses(baseline)
    surviving = yield from _surviving(baseline, lenses, common)
    has_priors = any(unknown.status == "prior" for unknown in baseline.problem.unknowns.values())
    if not surviving and not plausible(as_is.fit) and has_priors:
        # Loops of arms that turn about one axis stay open without what is known by priors, whatever is tried.
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
    """Whether no session is left unexplained: one of two may fit under a hypothesis that is wrong."""
    return _is_possible(trial) and not has_tail(trial.fit)


def every_hypothesis(baseline: Reading, state: State, settings: Settings) -> list[ConventionHypothesis]:
    """All hypotheses of a reading that may be named, those among them whose number or sample is to be found.

    Args:
        baseline: As it was declared.
        state: Its fit.
        settings: How it was solved.
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
    """The hypothesis fitted in earnest; nothing if it contradicts a fact, or is out of the race."""
    reading = _reread(hypothesis, baseline)
    if impossible_reading(reading):
        return []
    few = reading.thin(_SOLVED).problem
    state = pair_state(few, *start) if isinstance(start, tuple) else start
    fit = fit_hypothesis(reading.cell, few, settings, state, _OUT_OF_THE_RACE * as_is.fit.core)
    return [] if fit is None else [TriedHypothesis(hypothesis, fit, impossible_answer(reading.cell, fit))]


def _reread(hypothesis: ConventionHypothesis, baseline: Reading) -> Reading:
    """The samples under a hypothesis, as many as determine it."""
    return hypothesis.reread(baseline if hypothesis.by_order else baseline.thin(_REWRITTEN))


def _surviving(
    baseline: Reading, lenses: Lenses, candidates: Sequence[ConventionHypothesis]
) -> _Check[list[tuple[ConventionHypothesis, Fits]]]:
    """Hypotheses that close the loops about as well as the one that closes them best."""
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
    """The fit of each hypothesis to the loops of its pairs of camera and target, all fitted side by side.

    A hypothesis has no fits where one of its pairs cannot be fitted.
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
    """Some views of each pair of camera and target, as a reading has them; none if they cannot be made ready."""
    problem = reading.thin(_SCREENED).problem
    known = known_transforms(problem)
    try:
        pairs = []
        for group in (g for g in problem.groups if not has_metric_start(g, known)):
            some = views.take(group, _SCREENED)
            if some.candidates is None:  # a light, whose search is longer
                some = views.take(group, _LIGHTS_SCREENED)
            pairs.append((some, problem))
        return pairs
    except (BasecalError, np.linalg.LinAlgError):
        return []


def _lenses(baseline: Reading, fit: HypothesisFit) -> dict[str, Camera]:
    """A lens for each camera with pixels: stated, of a good fit, or from its views, which no robot misleads."""
    found = {}
    for name, lens in baseline.problem.lenses.items():
        views = [g.measurement for g in baseline.problem.groups if g.camera == name]
        pixels = [m for m in views if isinstance(m, PixelMeasurement)]
        solved = fit.solution.state.cameras[name] if plausible(fit) else None
        found[name] = lens.camera or solved or lens_from_views(baseline.cell.cameras[name], pixels)
    return found


def _is_explained(fit: HypothesisFit) -> bool:
    """Whether stated sigmas explain every residual, so that no wider model can gain a tenth."""
    return not fit.solution.noise.estimated and ratio(fit.solution) < _EXPLAINED and not has_tail(fit)
