"""How large a target would have to be: the reading with a factor to be found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.input_check import rewriting
from basecal.accuracy.input_check.hypotheses import ConventionHypothesis, resized
from basecal.accuracy.input_check.loop_fit import LoopFit, fit_loops, sight_for
from basecal.cell import Cell, PoseObservation, Recording
from basecal.errors import BasecalError
from basecal.estimation.least_squares.bundle_adjustment import Optimum, bundle_adjust
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import SE3, Array, Camera
from basecal.numerics.levenberg_marquardt import CONVERGED_SIGMAS
from basecal.numerics.spectral import least_norm

_VIEWS = 20
# Steps of a descent: enough to rank factors by, and to an optimum.
_FEW_STEPS, _STEPS = 8, 25
# Steps of the factor's logarithm: of the first secant, at most, and when it has settled.
_LOG_STEP, _LARGEST_LOG_STEP, _SETTLED_LOG = 4e-3, 0.1, 1e-5
_NUDGE = 1e-4
# Of the root of the squares, what a descent may leave to rank sizes by: those that count differ by a thousandth.
_RANKED = 1e-3
_ROUNDS = 8
# By a smaller share of the squares no other size could predict so much better that it were named.
_WORTHWHILE = 0.25
# So near the stated size the parabola's vertex stands for the sizes tried: squares are quadratic in it there.
_NEAR_LOG = 0.05
_TRIED = (0.8, 0.9, 0.95, 1.05, 1.1, 1.25)


def size_hypotheses(
    cell: Cell, recording: Recording, lenses: Mapping[str, Camera], state: State
) -> list[ConventionHypothesis]:
    """For each target the size that fits best, where the recording shows one and it fits better by some.

    Args:
        cell: As declared.
        recording: Likewise.
        lenses: By camera.
        state: The declared fit, from which sizes near the stated one are tried.
    """
    problem, _ = build_problem(cell, recording)
    found = []
    for name in dict.fromkeys(g.target for g in problem.groups):
        sized = _Sized(cell, recording, name)
        gain, vertex = _parabola(sized, state)
        if gain < _WORTHWHILE:
            continue
        linear = _factor(problem, name, lenses)
        if linear is not None:
            tried = [vertex] if abs(vertex) < _NEAR_LOG else [float(np.log(f)) for f in (linear, *_TRIED) if f > 0]
            found.append(target_size(name, _refined(sized, tried, linear, state), cell))
    return found


def target_size(name: str, factor: float, cell: Cell) -> ConventionHypothesis:
    """A target `factor` times as large as stated, or so much further away than its observed poses say."""
    words = f"{name} is {factor:.4g} times as large as stated"
    if len(cell.robots) == 1:  # whose lengths by the inverse factor fit as well
        words += f", or poses of {next(iter(cell.robots))} are {factor:.4g} times as long as they are"
    return ConventionHypothesis(
        "board-size",
        (name,),
        words,
        f"measure {name} and state its true size{as_written(cell, name, factor)}",
        "",
        lambda cell, recording: (resized(cell, {name: factor}), _further(recording, name, factor)),
        nested=True,
    )


def as_written(cell: Cell, name: str, factor: float) -> str:
    """What the first length among a target's fields would be; nothing where it has none, such as points."""
    shape = cell.targets[name].target
    for field, value in ({} if shape is None else shape.options).items():
        if field.endswith("_m") and isinstance(value, float):
            return f": {field} would be {value * factor:.5g}"
    return ""


def _further(recording: Recording, name: str, factor: float) -> Recording:
    samples = [
        [
            replace(o, camera_from_target=rewriting.scaled(factor)(o.camera_from_target))
            if isinstance(o, PoseObservation) and o.target == name
            else o
            for o in s.observations
        ]
        for s in recording.samples
    ]
    return replace(
        recording,
        samples=tuple(replace(s, observations=tuple(o)) for s, o in zip(recording.samples, samples, strict=True)),
    )


def _parabola(sized: _Sized, state: State) -> tuple[float, float]:
    """The share of the squares that another size may gain, and its logarithm, by three sizes about the stated one."""
    try:
        less, here, more = (sized.optimum(log, state, _FEW_STEPS, _RANKED).cost for log in (-_LOG_STEP, 0.0, _LOG_STEP))
    except (BasecalError, np.linalg.LinAlgError):
        return 1.0, np.inf
    slope, bend = (more - less) / 2, more - 2 * here + less
    return (slope**2 / (2 * bend * here), -_LOG_STEP * slope / bend) if bend > 0 else (1.0, np.inf)


def _factor(problem: Problem, target: str, lenses: Mapping[str, Camera]) -> float | None:
    """How many times larger a target is than stated, by the group that sees it most; None where none shows it."""
    group = max((g for g in problem.groups if g.target == target), key=len)
    if isinstance(group.measurement, PointMeasurement):
        of = group.measurement
        views = zip(of.seen, of.points_in_camera, strict=True)
        ratios = [_spread(p[seen]) / _spread(of.points_in_target[seen]) for seen, p in views if seen.sum() > 1]
        return float(np.median(ratios)) if ratios else None
    sight = sight_for(group, lenses.get(group.camera), _VIEWS)
    if sight.candidates is None:
        return None
    (fit,) = fit_loops([(sight, problem)])
    return None if fit is None else _by_translations(sight, sight.candidates, fit, problem)


def _spread(points: Array) -> float:
    return float(np.sqrt(np.sum(points.var(0))))


def _by_translations(sight: PairViews, candidates: SE3, fit: LoopFit, problem: Problem) -> float:
    """The factor f of RA tX - tY - RY RC tZ + f RA RX tB == RY tC - tA, by least squares."""
    group = sight.group
    a, c = (end.base_from_flange for end in group.ends)
    x, y, _ = fit.triple
    seen = (a.rotation @ x.rotation @ candidates[:, 0].translation[..., None])[..., 0]
    parts = (a.rotation, np.broadcast_to(-np.eye(3), a.rotation.shape), -(y.rotation @ c.rotation))
    fixed = (
        _fixed(problem, group.eye.mount),
        _fixed(problem, *(end.base for end in group.ends if end.base is not None)),
        _fixed(problem, group.hand.mount),
    )
    right = (y.rotation @ c.translation.T).T - a.translation
    columns = [seen[..., None]]
    for part, transform, known in zip(parts, fit.triple, fixed, strict=True):
        if known:
            right = right - part @ transform.translation
        else:
            columns.append(part)
    rows = np.concatenate(columns, -1)
    return float(least_norm(rows.reshape(-1, rows.shape[-1]), right.reshape(-1))[0])


def _fixed(problem: Problem, *names: str) -> bool:
    return all(problem.unknowns[name].status == "fixed" for name in names)


@dataclass(frozen=True, eq=False)
class _Sized:
    """A cell and its recording with one target's points times a factor, by the factor's logarithm."""

    cell: Cell
    recording: Recording
    target: str

    def problem(self, log: float) -> Problem:
        """All that was seen, the target so large."""
        sized = target_size(self.target, float(np.exp(log)), self.cell)
        return build_problem(*sized.apply(self.cell, self.recording))[0]

    def optimum(self, log: float, state: State, steps: int, left: float = CONVERGED_SIGMAS) -> Optimum:
        """Downhill of a state, but for what may be left of the root of the squares."""
        problem = self.problem(log)
        start = replace(state, stop_errors=np.zeros((len(problem.stops), 6)))
        return bundle_adjust(problem, start, 1, steps, sigmas=left)

    def slope(self, log: float, state: State) -> float:
        """The derivative of the least cost, at the state where it is least: there the state's own change adds none."""
        less, more = (float(linearise(self.problem(log + d), state).cost) for d in (-_NUDGE, _NUDGE))
        return (more - less) / (2 * _NUDGE)


def _refined(sized: _Sized, tried: Sequence[float], linear: float, state: State) -> float:
    """The factor of least cost: the best of those whose logarithms are tried, refined by the secant rule.

    Where numbers end it is that of `linear` equations.
    """
    try:
        ends = [(sized.optimum(log, state, _FEW_STEPS, _RANKED), log) for log in tried]
        best, log = min(ends, key=lambda end: end[0].cost)
        state, before, slope_before = best.state, log, np.nan
        for _ in range(_ROUNDS):
            state = sized.optimum(log, state, _STEPS).state
            slope = sized.slope(log, state)
            bend = (slope - slope_before) / (log - before) if log != before else np.nan
            step = _LOG_STEP if np.isnan(bend) else -slope / bend if bend > 0 else 0.0
            if abs(step) < _SETTLED_LOG:
                break
            before, slope_before = log, slope
            log += float(np.clip(step, -_LARGEST_LOG_STEP, _LARGEST_LOG_STEP))
    except (BasecalError, np.linalg.LinAlgError):
        return linear
    return float(np.exp(log))
