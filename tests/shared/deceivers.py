"""Adversarial cells for the certificate, and the results of random starts in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from basecal.cell import Unknown
from basecal.estimation.certificate.certificate import certify, proven_loops
from basecal.estimation.problem.problem import Problem, State, Stops
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.solve import Solution, solve_from
from basecal.estimation.start.closed_form import Loop
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import rotation_exp
from basecal.simulation.draw import draw_in_ball
from tests.shared.random_starts import Trio, least_cost, least_value, random_rotations, random_trio

POSITION_M = 2e-3
ADVERSARIES = ("bad start", "narrow", "outliers", "few", "one axis", "loud", "far out of scale")
NAMES = {"x": "eye_flange_from_camera", "y": "eye_base_from_hand_base", "z": "hand_flange_from_target"}
COST_GAIN = 1e-6
STARTS = 1000


def _poses(rng: np.random.Generator, count: int, spread: float, axis: bool) -> SE3:
    """Flange poses with rotations up to `spread` [rad], about one axis or all."""
    turns = draw_in_ball(rng, count, spread)
    if axis:
        turns = turns[:, :1] * np.array([0.0, 0.0, 1.0]) + 1e-3 * rng.standard_normal((count, 3))
    home = random_rotations(rng, 1)[0]
    return SE3(rotation_exp(turns) @ home, draw_in_ball(rng, count, 0.4))


def _noisy(pose: SE3, rng: np.random.Generator, sigma: tuple[float, float]) -> SE3:
    noise = rng.standard_normal((len(pose), 6)) * np.repeat(sigma, 3)
    return pose @ SE3.exp(noise)


def adversarial(kind: str, seed: int) -> tuple[Problem, State, Loop, Array]:
    """An adversarial cell, a start for it, its loop and weights.

    The arms' noise is not stated; the sigmas of the poses are stated, and often wrong.
    """
    rng = np.random.default_rng([seed, ADVERSARIES.index(kind)])
    dual = bool(rng.random() < 0.5)
    count = int(rng.integers(4, 8) if kind == "few" else rng.integers(8, 16))
    spread = float(10 ** rng.uniform(-2, -0.3) if kind == "narrow" else rng.uniform(0.5, 3.0))
    noise = float(10 ** rng.uniform(-0.7, 0.2) if kind == "loud" else 10 ** rng.uniform(-3, -1))
    sigma = (noise * float(10 ** rng.uniform(-2, 0)), noise)
    axis = kind == "one axis"
    a, c = _poses(rng, count, spread, axis), _poses(rng, count, spread, axis)
    x, y, z = (SE3(random_rotations(rng, 1)[0], draw_in_ball(rng, 1, 0.5)[0]) for _ in range(3))
    if not dual:
        c, y = SE3.identity((count,)), SE3.identity()
    b = _noisy((a @ x).inverse() @ y @ c @ z, rng, sigma)
    a, c = _noisy(a, rng, (1e-3, noise / 3)), _noisy(c, rng, (1e-3, noise / 3)) if dual else c
    if kind == "outliers":
        b = _with_outliers(b, rng)
    stated = np.array(sigma) * (10 ** rng.uniform(-1.5, 1.5, 2) if kind == "far out of scale" else 1.0)
    weight = np.tile(1 / np.repeat(stated, 3), (count, 1))
    problem = _problem(a, b, c, weight, dual)
    loop = Loop(a, b, c, None, None if dual else SE3.identity(), None, np.ones(count))
    start = random_trio(loop, rng, 1) if kind == "bad start" else Trio(*(SE3.stack([t]) for t in (x, y, z)))
    state = State({NAMES[name]: value[0] for name, value in start._asdict().items()}, {}, np.zeros((0, 6)))
    return problem, state, loop, weight


def _with_outliers(b: SE3, rng: np.random.Generator) -> SE3:
    """Some poses at random, or all of these with the same rotation."""
    wrong = rng.random(len(b)) < rng.uniform(0.05, 0.5)
    rotations = random_rotations(rng, 1) if rng.random() < 0.5 else random_rotations(rng, len(b))
    rotation = np.where(wrong[:, None, None], b.rotation @ rotations, b.rotation)
    return SE3(rotation, b.translation + wrong[:, None] * draw_in_ball(rng, len(b), 0.3))


def _problem(a: SE3, b: SE3, c: SE3, weight: Array, dual: bool) -> Problem:
    rows, none = np.arange(len(a)), np.full(len(a), -1)
    views = PoseMeasurement(b, weight, weight)
    hand, base = ("hand", NAMES["y"]) if dual else (None, None)
    ends = End("eye", NAMES["x"], None, a, none, rows), End(hand, NAMES["z"], base, c, none, rows)
    group = ViewGroup("camera", "target", ends, rows, views)
    names = [NAMES[name] for name in ("xyz" if dual else "xz")]
    columns = {name: slice(6 * i, 6 * i + 6) for i, name in enumerate(names)}
    return Problem("eye", (group,), {n: Unknown() for n in names}, frozenset(), {}, Stops(np.zeros((0, 6))), columns)


class Verdict(NamedTuple):
    """One adversarial cell: the claim, and the results of random starts."""

    kind: str
    seed: int
    claim: str
    cost: float
    starts: int
    least: float
    false: bool


def trial(kind: str, seed: int) -> Verdict:
    """Solve and certify an adversarial cell, and test a claim by a thousand random starts."""
    problem, start, loop, weight = adversarial(kind, seed)
    solution = solve_from(problem, start)
    result = certify(solution)
    if result.better is not None:
        first = solution.cost
        solution = solve_from(problem, result.better)
        result = certify(solution)
        if not solution.cost < first:
            return Verdict(kind, seed, "worse", solution.cost, 0, first, True)
    if not result.certificate.is_global:
        return Verdict(kind, seed, "none", solution.cost, 0, np.nan, False)
    rng = np.random.default_rng([seed, 99])
    least = least_cost(loop, weight, random_trio(loop, rng, STARTS), solution.cost)
    false = least < solution.cost * (1 - COST_GAIN) or _rotations_undercut(solution, rng)
    return Verdict(kind, seed, "global", solution.cost, STARTS, least, bool(false))


def _rotations_undercut(solution: Solution, rng: np.random.Generator) -> bool:
    """Whether random starts of the rotations alone end below their proven bound."""
    proven = proven_loops(solution)[0][0]
    if proven is None:
        return True
    return least_value(proven.form.form, len(proven.bound.factors), rng, STARTS) < proven.bound.lower - 1e-12
