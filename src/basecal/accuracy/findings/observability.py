"""What the data do not see, why by the robots' motions, and what rests on a prior alone: as findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from basecal.cell import Cell, Finding
from basecal.cell.calibration import Severity
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.observability.motions import HARDLY_RAD, Motion, attached, based, gauge_partners, motions
from basecal.estimation.observability.null_space_words import and_along, describe_null_space, twists_in_words
from basecal.estimation.observability.observability import observability_of, without_priors
from basecal.estimation.problem.problem import Problem
from basecal.estimation.solve import Solution
from basecal.geometry import Array

_WEAK = 0.15
_LITTLE_RAD = 0.15
_SHOWN_DEG = 0.005
_UNTOUCHED = 0.95


def observability_findings(cell: Cell, solution: Solution) -> list[Finding]:
    """Everything about what the data see: unseen, weak, and held by a prior.

    Where the solver found no optimum only what the recorded poses tell by themselves.
    """
    if not solution.converged:
        return gauge_findings(cell, solution.problem) or null_direction_findings(cell, solution)
    return (
        null_direction_findings(cell, solution)
        + weak_direction_findings(cell, solution)
        + prior_findings(cell, solution)
    )


def null_direction_findings(cell: Cell, solution: Solution) -> list[Finding]:
    """What is not seen, a finding each: an error where it is of what was asked."""
    told = motions(solution.problem) if solution.seen.unseen else {}
    blind_asked = [name for name in cell.asked if name in solution.seen.blind]
    severity: Severity = "error" if blind_asked else "warning"
    together: dict[tuple[str, ...], list[str]] = {}
    for unseen in solution.seen.unseen:
        together.setdefault(unseen.names, []).append(unseen.what)
    return [
        Finding(
            "unobservable-direction",
            severity,
            names,
            f"the data do not see {and_along(whats, names[1:])}: {reason(cell, solution.problem, told, names)}",
        )
        for names, whats in together.items()
    ]


def gauge_findings(cell: Cell, problem: Problem) -> list[Finding]:
    """What the recorded poses alone leave open whatever was seen, before anything is solved."""
    found = []
    for motion in motions(problem).values():
        names = gauge_partners(problem, motion)
        if names:
            words = twists_in_words(f"{motion.robot}_base", motion.twists_in_base)
            why = f"{motion_in_words(motion)}: {_advice(cell, problem, motion)}"
            message = f"by the recorded poses alone {words} cannot be told from a change of what it carries: {why}"
            found.append(Finding("unobservable-direction", "error", names, message))
    return found


def weak_direction_findings(cell: Cell, solution: Solution) -> list[Finding]:
    """What was asked and is seen, but known no better than to 0.15 rad, or to as much of the viewing distance."""
    found, length = [], solution.seen.length_m
    for name in cell.asked:
        if name in solution.seen.blind or name not in solution.problem.columns:
            continue
        sigma = np.sqrt(np.diag(solution.covariance_of([name])))
        shift, turn = float(sigma[:3].max()), float(sigma[3:].max())
        if shift > _WEAK * length or turn > _WEAK:
            why = reason(cell, solution.problem, motions(solution.problem), (name,))
            message = (
                f"{name} is known to {1e3 * shift:.0f} mm and {np.degrees(turn):.1f} deg along an axis only: {why}"
            )
            found.append(Finding("weak-direction", "warning", (name,), message))
    return found


def reason(cell: Cell, problem: Problem, told: Mapping[str, Motion], names: Sequence[str]) -> str:
    """Why something is not seen, by the motion of the robots that carry it, and what to do."""
    moved = [m for robot, m in told.items() if set(names) & {*attached(problem, robot), *based(problem, robot)}]
    poor = [m for m in moved if m.turn_rad[1] < _LITTLE_RAD]
    carrying = [m for m in poor if set(names) & set(attached(problem, m.robot))] or poor
    if len(carrying) == 1:
        return f"{motion_in_words(carrying[0])}: {_advice(cell, problem, carrying[0])}"
    if carrying:
        mounts = [n for m in carrying for n in attached(problem, m.robot) if problem.unknowns[n].status != "fixed"]
        causes = ", and ".join(map(motion_in_words, carrying))
        return f"{causes}: turn each about two axes that are not parallel{_or_state(mounts)}"
    return (
        "the views are too few or too much alike: add samples in which every arm is turned about two axes that are not "
        "parallel, or state a prior or the value of what is known"
    )


def motion_findings(problem: Problem) -> str:
    """How the robots move that hardly turn about a second axis; empty where all do."""
    return " and ".join(motion_in_words(m) for m in motions(problem).values() if m.turn_rad[1] < _LITTLE_RAD)


def motion_in_words(motion: Motion) -> str:
    """How a robot moves, such as "hand only shifts, it turns by at most 0.10 deg"."""
    robot, turn = motion.robot, np.degrees(motion.turn_rad)
    if motion.is_still:
        return f"{robot} never moves in {motion.samples} sample{'s' if motion.samples > 1 else ''}"
    if motion.only_shifts:
        return f"{robot} only shifts" + (f", it turns by at most {turn[0]:.2f} deg" if turn[0] >= _SHOWN_DEG else "")
    axis = ", ".join(f"{v + 0.0:.2f}" for v in _upright(motion.axes_in_base[:, 0]))
    if motion.turn_rad[1] < _LITTLE_RAD:
        only = "" if motion.turn_rad[1] < HARDLY_RAD else " mostly"
        least = f", and by at most {turn[1]:.2f} deg about any other" if turn[1] >= _SHOWN_DEG else ""
        if motion.orientations == 2:
            return f"{robot} has two orientations only"
        return f"{robot} turns{only} about one axis, along ({axis}) in {robot}_base{least}"
    return f"{robot} turns by up to {turn[0]:.0f} deg, and {turn[1]:.0f} deg about a second axis"


def _upright(axis: Array) -> Array:
    rounded: Array = np.round(axis * np.sign(axis[np.argmax(np.round(np.abs(axis), 3))]), 2)
    return rounded


def _advice(cell: Cell, problem: Problem, motion: Motion) -> str:
    robot = motion.robot
    unknown = [n for n in attached(problem, robot) if problem.unknowns[n].status != "fixed"]
    known = _or_state(unknown)
    if _cannot_turn(cell, robot) and not (motion.is_still or motion.only_shifts):
        joints = "all axes of its joints are parallel, so that it cannot turn about another"
        return f"{joints}; state {' and '.join(unknown or based(problem, robot))} as a prior or fixed"
    if motion.is_still:
        return f"move it, and turn it about two axes that are not parallel{known}"
    if motion.only_shifts:
        return f"add poses that turn it about two axes that are not parallel{known}"
    if motion.turn_rad[0] < _LITTLE_RAD:
        return f"turn it further, by 30 deg and more, about two axes that are not parallel{known}"
    return f"add poses that turn it by 30 deg and more about another axis{known}"


def _or_state(names: Sequence[str]) -> str:
    return f", or state {' and '.join(names)} as a prior or fixed" if names else ""


def _cannot_turn(cell: Cell, robot: str) -> bool:
    """Whether a robot's joints all turn it about one direction, as those of a SCARA arm do."""
    chain = cell.robots[robot].chain
    if chain is None:
        return False
    axes = chain.jacobian(np.zeros(chain.n))[3:]
    return bool(np.linalg.svd(axes, compute_uv=False)[1:].max(initial=0.0) < 1e-6)


def prior_findings(cell: Cell, solution: Solution) -> list[Finding]:
    """What of a prior the data hardly add to, and what was asked that nothing but priors holds."""
    problem = solution.problem
    held = [name for name in problem.columns if name in problem.unknowns and _is_prior(problem, name)]
    if not held:
        return []
    resting = _resting(cell, solution)
    return [found for name in held for found in _held_by_prior(solution, name, resting)]


def _is_prior(problem: Problem, name: str) -> bool:
    return problem.unknowns[name].status == "prior" and problem.unknowns[name].sigma is not None


def _resting(cell: Cell, solution: Solution) -> list[str]:
    """Names asked for that the data alone do not see."""
    problem = solution.problem
    alone = without_priors(problem)
    hessian = linearise(alone, solution.state).hessian
    blind = observability_of(alone, solution.state, hessian, solution.noise.factor).blind
    return [name for name in cell.asked if name in blind and name not in solution.seen.blind]


def _held_by_prior(solution: Solution, name: str, resting: Sequence[str]) -> list[Finding]:
    """A finding where the posterior of a transform is its prior along some directions."""
    problem, where = solution.problem, solution.problem.columns[name]
    sigma = problem.unknowns[name].sigma
    assert sigma is not None
    width = where.stop - where.start
    prior = sigma[:width]
    kept, directions = np.linalg.eigh(solution.seen.inverse[where, where] / np.outer(prior, prior))
    untouched = directions[:, np.sqrt(np.maximum(kept, 0.0)) > _UNTOUCHED]
    if not untouched.shape[1]:
        return []
    vectors = np.zeros((problem.width, untouched.shape[1]))
    vectors[where] = untouched
    scale = np.ones(problem.width)
    scale[where] = prior
    words = " and ".join(u.words for u in describe_null_space(problem, solution.state, vectors, scale))
    others = [n for n in resting if n != name]
    rests = f"; {' and '.join(others)} rest{'s' if len(others) == 1 else ''} on it" if others else ""
    message = f"known from its prior alone, to which the data add nothing: {words}{rests}"
    return [Finding("prior-dominated", "info", (name, *others), message)]
