"""How large a target would have to be: the reading with a factor to be found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from basecal.accuracy.input_check.hypotheses import ConventionHypothesis, target_size
from basecal.accuracy.input_check.loop_fit import LoopFit, fit_loops, sight_for
from basecal.cell import Cell, Recording
from basecal.errors import BasecalError
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Problem, State, ViewGroup
from basecal.estimation.start.pair_views import PairViews
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import SE3, Array, Camera

_VIEWS = 20
_STEPS = 25
_LOG_STEP = 4e-3
_LARGEST_LOG_STEP = 0.1
_SETTLED_LOG = 1e-5
_ROUNDS = 4
_TRIED = (0.8, 0.9, 0.95, 1.05, 1.1, 1.25)


def size_hypotheses(
    cell: Cell, recording: Recording, lenses: Mapping[str, Camera], state: State
) -> list[ConventionHypothesis]:
    """For each target the size that fits best, where the recording shows one.

    Args:
        cell: As declared.
        recording: Likewise.
        lenses: By camera.
        state: The declared fit, from which sizes near the stated one are tried.
    """
    problem, _ = build_problem(cell, recording)
    found = []
    for name in dict.fromkeys(g.target for g in problem.groups):
        linear = _factor(problem, name, lenses)
        if linear is not None:
            found.append(target_size(name, _refined(cell, recording, name, linear, state), cell))
    return found


def _factor(problem: Problem, target: str, lenses: Mapping[str, Camera]) -> float | None:
    """How many times larger a target is than stated, by the group that sees it most; None where none shows it."""
    group = max((g for g in problem.groups if g.target == target), key=len)
    if isinstance(group.measurement, PointMeasurement):
        return _spread_ratio(group.measurement)
    sight = sight_for(group, lenses.get(group.camera), _VIEWS)
    if sight.candidates is None:
        return None
    (fit,) = fit_loops([(sight, problem)])
    return None if fit is None else _by_translations(sight, sight.candidates, fit, problem)


def _spread_ratio(measurement: PointMeasurement) -> float | None:
    views = zip(measurement.seen, measurement.points_in_camera, strict=True)
    ratios = [_spread(p[seen]) / _spread(measurement.points_in_target[seen]) for seen, p in views if seen.sum() > 1]
    return float(np.median(ratios)) if ratios else None


def _spread(points: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((points - points.mean(0)) ** 2, -1))))


def _by_translations(sight: PairViews, candidates: SE3, fit: LoopFit, problem: Problem) -> float:
    """The factor f of RA tX - tY - RY RC tZ + f RA RX tB == RY tC - tA, by least squares."""
    group = sight.group
    a, c = group.eye_base_from_eye_flange, group.hand_base_from_hand_flange
    x, y, _ = fit.triple
    seen = (a.rotation @ x.rotation @ candidates[:, 0].translation[..., None])[..., 0]
    parts = (a.rotation, np.broadcast_to(-np.eye(3), a.rotation.shape), -(y.rotation @ c.rotation))
    fixed = (_fixed(problem, group.camera_mount), _fixed(problem, *_bases(group)), _fixed(problem, group.target_mount))
    right = (y.rotation @ c.translation.T).T - a.translation
    columns = [seen[..., None]]
    for part, transform, known in zip(parts, fit.triple, fixed, strict=True):
        if known:
            right = right - part @ transform.translation
        else:
            columns.append(part)
    rows = np.concatenate(columns, -1)
    return float(np.linalg.lstsq(rows.reshape(-1, rows.shape[-1]), right.reshape(-1), rcond=1e-9)[0][0])


def _bases(group: ViewGroup) -> list[str]:
    return [name for name in (group.eye_base, group.hand_base) if name is not None]


def _fixed(problem: Problem, *names: str) -> bool:
    return all(problem.unknowns[name].status == "fixed" for name in names)


def _refined(cell: Cell, recording: Recording, name: str, linear: float, state: State) -> float:
    """The factor of least cost: the best of a few, one of them by `linear` equations, refined by parabolas."""
    tried = [linear, *_TRIED] if _TRIED[0] / 2 < linear < 2 * _TRIED[-1] else _TRIED
    try:
        ends = [(_cost(cell, recording, name, float(np.log(factor)), state), float(np.log(factor))) for factor in tried]
        ((state, _), log) = min(ends, key=lambda end: end[0][1])
        for _ in range(_ROUNDS):
            state, cost = _cost(cell, recording, name, log, state)
            less, more = (_cost(cell, recording, name, log + d, state)[1] for d in (-_LOG_STEP, _LOG_STEP))
            bend = less + more - 2 * cost
            if not bend > 0:
                break
            step = float(np.clip(_LOG_STEP * (less - more) / (2 * bend), -_LARGEST_LOG_STEP, _LARGEST_LOG_STEP))
            log += step
            if abs(step) < _SETTLED_LOG:
                break
    except (BasecalError, np.linalg.LinAlgError):
        return linear
    return float(np.exp(log))


def _cost(cell: Cell, recording: Recording, name: str, log: float, state: State) -> tuple[State, float]:
    problem, _ = build_problem(*target_size(name, float(np.exp(log)), cell).apply(cell, recording))
    start = replace(state, stop_errors=np.zeros((len(problem.stops), 6)))
    end = bundle_adjust(problem, start, 1, _STEPS)
    return end.state, end.cost
