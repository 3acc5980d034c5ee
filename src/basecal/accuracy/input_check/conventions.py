"""An automatic test of conventions: does another hypothesis of the input explain it better, or as well.

A hypothesis is named only where it predicts held-out samples, contradicts no hard fact and moves the transforms asked
for. Nothing is ever applied. docs/conventions_test.md says which mix-ups can be told apart by which data.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from basecal.accuracy.input_check.hypotheses import AS_DECLARED, ConventionHypothesis, convention_hypotheses, streams
from basecal.accuracy.input_check.hypothesis_choice import (
    WIDER,
    TriedHypothesis,
    better,
    decide_hypotheses,
    has_tail,
    is_observable,
)
from basecal.accuracy.input_check.hypothesis_fit import (
    FOLDS,
    HypothesisFit,
    fit_hypothesis,
    in_order,
    plausible,
    ratio,
    thinned,
)
from basecal.accuracy.input_check.loop_fit import LoopFit, ReadyViews, fit_loops, state_of, trimmed
from basecal.accuracy.input_check.pairing import half_turns, pairing_errors
from basecal.accuracy.input_check.plausibility import impossible_answer, impossible_input
from basecal.accuracy.input_check.rare_hypotheses import rare_hypotheses
from basecal.accuracy.input_check.rewriting import LINKS, without_links
from basecal.accuracy.input_check.target_sizes import size_hypotheses
from basecal.accuracy.input_check.unexplained_motion import unexplained_motion
from basecal.accuracy.many_robots.single_pairs import has_many_robots, merge_findings, solve_single_pairs
from basecal.cell import Cell, Finding, Recording
from basecal.errors import BasecalError
from basecal.estimation.noise.robot_noise import stops_made
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution
from basecal.estimation.start.lens import lens_from_views
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import Camera

_SCREENED = 25  # samples of the quick look, of which a closed form of poses needs three
_SOLVED = 40  # samples of a fit in earnest: enough to tell hypotheses apart; bounds the time
_REWRITTEN = 400  # samples that are rewritten and judged by hard facts, which hold of all of them or of none
_LIGHTS_SCREENED = 14  # views of a light, each two equations: twice as many as there are unknowns
_FEWEST = 5  # samples, of which three folds leave three to fit
_MARGIN = 1.25  # equations over unknowns without the largest fold

_OUT_OF_THE_RACE = 2.0  # times the error of the declared one, before the noise of poses is known
_NEAR = 3.0  # how many times worse than the best a hypothesis may close its loops and still be fitted
_FLOOR_RAD = 0.01  # [rad] of loops of poses, within which the quick look of few samples does not rank
_LIGHT_FLOOR_RAD = 0.002  # [rad] likewise of directions to a light, which have no rotation of their own
_HOPELESS_RAD = 0.25  # [rad] of loops that even the best hypothesis does not close: none of them is so
_LIGHT_HOPELESS_RAD = 0.05  # [rad] likewise of directions
_MOST_SOLVED = 8  # hypotheses to fit, which bounds the time
_ODD = 0.08  # share of the motion unexplained that no recording in order has had, so that rare mix-ups are tried

_IN_STEP = 8  # pairs of camera and target of a cell of many robots: more gain little

_EXPLAINED = 1.15  # residuals over stated sigmas: nothing is left that a better hypothesis could explain

T = TypeVar("T")
_Pairs = list[tuple[PairViews, Problem]]
_Check = Generator[_Pairs, list[LoopFit | None], T]
"""A check that asks for pairs to be fitted, and is told the fits."""

Lenses = Mapping[str, Camera]
Fits = Mapping[tuple[str, str], LoopFit]


def check_conventions(
    cell: Cell, recording: Recording, problem: Problem, solution: Solution, settings: Settings, explained: bool = False
) -> tuple[Finding, ...]:
    """Findings about conventions that the input seems to break, or that it leaves open.

    Args:
        cell: As declared.
        recording: As recorded.
        problem: What was packed of both.
        solution: What they gave.
        settings: How they were solved.
        explained: Whether noise such as arms have explains what robots taken for exact leave over.

    Returns:
        An error for each hypothesis that explains the data better than the declared one, or as well where the declared
        one cannot be; one `ambiguous-convention` for those that explain it as well. Nothing where no hypothesis does.
    """
    recording = in_order(recording)
    if not has_many_robots(problem):
        return _in_step([_checked(cell, recording, problem, solution.state, settings, explained)])[0]
    pairs = solve_single_pairs(cell, recording, problem, solution.state)
    found: list[tuple[Finding, ...]] = []
    for at in range(0, len(pairs), _IN_STEP):
        settings.part(at, len(pairs))
        some = ((pair, build_problem(pair.cell, pair.recording)[0]) for pair in pairs[at : at + _IN_STEP])
        found += _in_step([_checked(p.cell, p.recording, own, p.state, settings, explained) for p, own in some])
    return merge_findings(pairs, found)


def _in_step(checks: Sequence[_Check[T]]) -> list[T]:
    """Where several checks end; the pairs of camera and target that they want fitted at a time go side by side."""
    answers: dict[int, list[LoopFit | None] | None] = dict.fromkeys(range(len(checks)))
    ended: dict[int, T] = {}
    while answers:
        wanted: dict[int, _Pairs] = {}
        for number, answer in answers.items():
            try:
                wanted[number] = next(checks[number]) if answer is None else checks[number].send(answer)
            except StopIteration as end:
                ended[number] = end.value
        fits = iter(fit_loops([pair for of in wanted.values() for pair in of]))
        answers = {number: [next(fits) for _ in of] for number, of in wanted.items()}
    return [ended[number] for number in range(len(checks))]


def _checked(
    cell: Cell, recording: Recording, problem: Problem, known: State, settings: Settings, explained: bool
) -> _Check[tuple[Finding, ...]]:
    """As `check_conventions`, of all robots at once, the samples in order."""
    if any(LINKS in model.columns for model in problem.models.values()):
        cell, known = without_links(cell, known)
        problem = build_problem(cell, recording)[0]
    if len(recording.samples) < _FEWEST or not _can_hold_out(problem):
        return ()
    whole = _as_declared(cell, recording, settings, known)
    if whole is None:
        return ()
    declared = TriedHypothesis(
        AS_DECLARED, whole, (*impossible_input(cell, recording), *impossible_answer(cell, whole))
    )
    if plausible(whole) and not declared.impossible and not is_observable(cell, whole):
        return ()
    # A guess or the axis-shift start belongs to the declared hypothesis alone.
    tried = yield from _tried(cell, recording, problem, declared, replace(settings, start="closed"))
    still = frozenset(r for r in cell.robots if stops_made(problem, r) == 1)
    return decide_hypotheses(cell, declared, tried, explained, still)


def _can_hold_out(problem: Problem) -> bool:
    """Whether two of three folds still have more equations than there are unknowns, by a quarter."""
    equations = sum(int(group.measurement.equations().sum()) for group in problem.groups)
    return equations * (FOLDS - 1) / FOLDS > _MARGIN * problem.width


def _as_declared(cell: Cell, recording: Recording, settings: Settings, known: State) -> HypothesisFit | None:
    """The fit of the declared hypothesis; a start that misled it, such as a wrong guess, is no mix-up."""
    few = thinned(recording, _SOLVED)
    fit = fit_hypothesis(cell, few, settings, known)
    if settings.start == "closed" or (fit is not None and plausible(fit)):
        return fit
    anew = fit_hypothesis(cell, few, replace(settings, start="closed"))
    found = [each for each in (fit, anew) if each is not None]
    return min(found, key=lambda each: each.core, default=None)


def _tried(
    cell: Cell, recording: Recording, problem: Problem, declared: TriedHypothesis, settings: Settings
) -> _Check[list[TriedHypothesis]]:
    """Hypotheses that survive a quick look, fitted in earnest."""
    lenses = _lenses(cell, problem, declared.fit)
    known = declared.fit.solution.state
    found: list[TriedHypothesis] = []
    common = convention_hypotheses(cell, recording)
    surviving = yield from _surviving(cell, recording, lenses, common)
    has_priors = any(unknown.status == "prior" for unknown in problem.unknowns.values())
    if not surviving and not plausible(declared.fit) and has_priors:
        # Loops of arms that turn about one axis stay open without what is known by priors, whatever is tried.
        surviving = [(hypothesis, {}) for hypothesis in common if not hypothesis.nested]
    for hypothesis, fits in surviving:
        found += _try(cell, recording, hypothesis, settings, (fits, lenses), declared)
    if any(plausible(each.fit) and not each.impossible and better(each.fit, declared.fit, WIDER) for each in found):
        return found
    if not _explained(declared.fit):
        wider = [hypothesis for hypothesis in common if hypothesis.nested]
        for hypothesis in [*wider, *size_hypotheses(cell, thinned(recording, _SOLVED), lenses, known)]:
            found += _try(cell, recording, hypothesis, settings, known, declared)
    if has_tail(declared.fit) or not any(plausible(each.fit) and not each.impossible for each in (declared, *found)):
        for hypothesis, fits in pairing_errors(cell, recording, lenses, streams(_moving(recording))):
            found += _try(cell, recording, hypothesis, settings, (fits, lenses), declared)
        for hypothesis in half_turns(cell, recording):
            found += _try(cell, recording, hypothesis, settings, None, declared)
    if any(plausible(each.fit) and not each.impossible for each in (declared, *found)):
        return found
    if unexplained_motion(declared.fit.solution.problem, known) > _ODD:
        rare = yield from _surviving(cell, recording, lenses, rare_hypotheses(cell, recording))
        for hypothesis, fits in rare:
            found += _try(cell, recording, hypothesis, settings, (fits, lenses), declared)
    return found


def _try(
    cell: Cell,
    recording: Recording,
    hypothesis: ConventionHypothesis,
    settings: Settings,
    start: State | tuple[Fits, Lenses] | None,
    declared: TriedHypothesis,
) -> list[TriedHypothesis]:
    """The hypothesis fitted in earnest; nothing where it contradicts a fact, or is out of the race."""
    other_cell, rewritten = _applied(hypothesis, cell, recording)
    if impossible_input(other_cell, rewritten):
        return []
    few = thinned(rewritten, _SOLVED)
    state = state_of(build_problem(other_cell, few)[0], *start) if isinstance(start, tuple) else start
    fit = fit_hypothesis(other_cell, few, settings, state, _OUT_OF_THE_RACE * declared.fit.core)
    return [] if fit is None else [TriedHypothesis(hypothesis, fit, impossible_answer(other_cell, fit))]


def _applied(hypothesis: ConventionHypothesis, cell: Cell, recording: Recording) -> tuple[Cell, Recording]:
    """What a hypothesis says of as many samples as tell."""
    return hypothesis.apply(cell, recording if hypothesis.by_order else thinned(recording, _REWRITTEN))


def _surviving(
    cell: Cell, recording: Recording, lenses: Lenses, among: Sequence[ConventionHypothesis]
) -> _Check[list[tuple[ConventionHypothesis, Fits]]]:
    """Hypotheses that close the loops about as well as the one that closes them best."""
    moving = _moving(recording)
    hypotheses, inputs = [AS_DECLARED], [(cell, recording)]
    for hypothesis in among:
        if hypothesis.nested or (hypothesis.code == "pairing-shifted" and not set(hypothesis.about) <= set(moving)):
            continue
        rewritten = _applied(hypothesis, cell, recording)
        if not impossible_input(*rewritten):
            hypotheses.append(hypothesis)
            inputs.append(rewritten)
    fits = yield from _screened(inputs, lenses)
    scores = [max((trimmed(fit.off) for fit in of.values()), default=np.inf) for of in fits]
    of_light = any(fit.of_light for fit in fits[0].values())
    if min(scores) > (_LIGHT_HOPELESS_RAD if of_light else _HOPELESS_RAD):
        return []
    limit = _NEAR * min(scores) + (_LIGHT_FLOOR_RAD if of_light else _FLOOR_RAD)
    best = sorted(range(1, len(scores)), key=lambda k: scores[k])[:_MOST_SOLVED]
    return [(hypotheses[k], fits[k]) for k in best if scores[k] < limit]


def _screened(inputs: Sequence[tuple[Cell, Recording]], lenses: Lenses) -> _Check[list[Fits]]:
    """Of each hypothesis how nearly the loops of its pairs of camera and target close, all fitted side by side.

    A hypothesis has no fits where one of its pairs cannot be fitted.
    """
    views = ReadyViews(lenses)
    pairs = [_pairs(cell, recording, views) for cell, recording in inputs]
    fits = iter((yield [pair for of in pairs for pair in of]))
    found: list[Fits] = []
    for of in pairs:
        named = {(sight.group.camera, sight.group.target): next(fits) for sight, _ in of}
        whole = {key: fit for key, fit in named.items() if fit is not None}
        found.append(whole if len(whole) == len(named) else {})
    return found


def _pairs(cell: Cell, recording: Recording, views: ReadyViews) -> _Pairs:
    """Some views of each pair of camera and target, as a hypothesis has them; none where it makes no problem."""
    try:
        problem, _ = build_problem(cell, thinned(recording, _SCREENED))
        pairs = []
        for group in problem.groups:
            some = views.of(group, _SCREENED)
            if some.candidates is None:  # a light, whose search is longer
                some = views.of(group, _LIGHTS_SCREENED)
            pairs.append((some, problem))
        return pairs
    except (BasecalError, np.linalg.LinAlgError):
        return []


def _moving(recording: Recording) -> list[str]:
    """Robots that do not stand still throughout, by pose or joints."""
    states: dict[str, set[bytes]] = {}
    for sample in recording.samples:
        for name, state in sample.robots.items():
            pose = state.base_from_flange
            numbers = state.joints_rad if pose is None else np.append(pose.rotation, pose.translation)
            states.setdefault(name, set()).add(np.asarray(numbers).tobytes())
    return [name for name, different in states.items() if len(different) > 1]


def _lenses(cell: Cell, problem: Problem, declared: HypothesisFit) -> dict[str, Camera]:
    """A lens for each camera with pixels: stated, of a good fit, or from its views, which no robot misleads."""
    found = {}
    for name, lens in problem.lenses.items():
        views = [g.measurement for g in problem.groups if g.camera == name]
        pixels = [m for m in views if isinstance(m, PixelMeasurement)]
        solved = declared.solution.state.cameras[name] if plausible(declared) else None
        found[name] = lens.camera or solved or lens_from_views(cell.cameras[name], pixels)
    return found


def _explained(fit: HypothesisFit) -> bool:
    """Whether stated sigmas explain every residual, so that no wider model can gain a tenth."""
    return not fit.solution.noise.estimated and ratio(fit.solution) < _EXPLAINED and not has_tail(fit)
