"""Certify that no other state fits better than a solution.

1. Rotations of each loop: the cost of views and robot errors is at least a sum of w_i sin^2(angle_i / 2) over views.
   The minimum of this sum is found and proven by `relaxation`, for all rotations and all signs of the quaternions.
2. All unknowns: for a state as good as the solution, the sum is bounded by the solution's cost. The proof includes how
   fast the sum grows. The rotations of such a state are therefore within a known angle of the proven rotations.
3. Within this angle, descents from random states must end in the solution. This is checked, not proven.

Source: docs/mathematics.md (10.5), (10.6).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from basecal.cell import Certificate
from basecal.estimation.certificate.relaxation import Bound, Factors, local_minimum, lower_bound
from basecal.estimation.certificate.rotation_cost import (
    LoopForm,
    loop_form,
    rotation_factors,
    rotations_from_factors,
    state_rotations,
)
from basecal.estimation.certificate.view_rotation import view_costs
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.noise.robot_noise import without_errors
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import SAME_COST, Solution
from basecal.estimation.start.closed_form import Rotations, solve_rotations, solve_translations
from basecal.estimation.start.rotation_search import pose_starts
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3

_TIGHT_GAP = 1e-3  # relative gap up to which a bound counts as tight: the remaining gap is far below the noise
_SMALLEST_COST = 1e-10  # lower limit of costs in the relative gap: for exact data it is rounding over rounding
_WIDEST_SINE2 = 0.5  # sin^2 of half the angle within which any better fit is: beyond 90 deg nothing is proven
_SEARCH_STARTS = 8  # additional starts if the first bound is not tight; evaluated by `benchmarks.certificate`
_SHORT_SWEEPS = 30  # alternations that rank starts; assumed: `benchmarks.certificate`
_FEWEST_VIEWS = 3  # views that determine the rotations of a loop
_DESCENTS = 8  # random starts that search for other optima near the solution; evaluated by `benchmarks.certificate`
_MOST_VIEWS = 30  # most views per group in this search; assumed: bounds the time
_DESCENT_STEPS = 60  # most steps of each descent
_SAME_M_RAD = 1e-6  # largest difference of transforms between descents to one optimum [m, rad]
_SEED = 20  # any seed works


class Certified(NamedTuple):
    """Certificate of a solution, and a state of lower cost if one was found."""

    certificate: Certificate
    better: State | None


class ProvenLoop(NamedTuple):
    """Quadratic form of a loop's rotations, with its proven lower bound."""

    form: LoopForm
    bound: Bound

    @property
    def gap(self) -> float:
        """Relative gap between the least value found and the proven bound; bounds below 1e-10 count as 1e-10."""
        return max(self.bound.value - self.bound.lower, 0.0) / max(self.bound.lower, _SMALLEST_COST)


def certify(solution: Solution) -> Certified:
    """Try to prove that no other state fits better than a solution.

    `is_global` is true if three conditions hold. The rotations are proven, a better fit can only be near them, and
    descents from random states near the solution end in it. If a descent ends at a lower cost, its state is returned
    and the certificate is undecided.

    Args:
        solution: The solution, with the noise in use.
    """
    reason = _scope_reason(solution)
    if reason:
        return _undecided_certificate(reason)
    loops, constant = proven_loops(solution)
    proven = [loop for loop in loops if loop is not None]
    if len(proven) < len(loops):
        group = solution.problem.groups[loops.index(None)]
        views = f"fewer than {_FEWEST_VIEWS} views of {group.target} by {group.camera}"
        return _undecided_certificate(f"no pose from a single view: {views} have an unambiguous pose")
    gap = max(loop.gap for loop in proven)
    better = _descend_from_proven(solution, proven)
    if better is not None:
        return Certified(Certificate(gap, None, "the proven rotations lead to a better fit"), better)
    if not solution.converged:
        return _undecided_certificate("the solution is not an optimum", gap)
    if gap > _TIGHT_GAP:
        return _undecided_certificate(
            "the relaxation is not tight: other rotations could cost less than those found", gap
        )
    floor = constant + sum(loop.form.weight * loop.bound.lower for loop in proven)
    sine2 = max(_largest_sine2(loop, solution.cost - floor) for loop in proven)
    if not sine2 <= _WIDEST_SINE2:
        return _undecided_certificate(
            "the noise is too large for how far the arms turn: a better fit could be far away", gap
        )
    return _explore_surroundings(solution, sine2, gap)


def proven_loops(solution: Solution) -> tuple[list[ProvenLoop | None], float]:
    """Proven loop of each group of views, None if it has too few poses, and a lower bound of the views' own costs."""
    problem, state = solution.problem, solution.state
    views = [view_costs(problem, state, group) for group in problem.groups]
    constant = float(sum(v.constant.sum() for v in views))
    loops: list[ProvenLoop | None] = []
    for group, costs in zip(problem.groups, views, strict=True):
        certain = costs.without_doubtful(solution.cost - constant)
        if np.count_nonzero(certain.weight) < _FEWEST_VIEWS:
            loops.append(None)
            continue
        form = loop_form(problem, state, group, certain)
        loops.append(ProvenLoop(form, _least_bound(form, state_rotations(state, group, form.merged))))
    return loops, constant


def _undecided_certificate(reason: str, gap: float | None = None) -> Certified:
    return Certified(Certificate(gap, None, reason), None)


def _scope_reason(solution: Solution) -> str:
    """Reason why a solution cannot be certified; empty if it can."""
    problem = solution.problem
    free_lens = next((name for name in problem.columns if name in problem.lenses), None)
    if not any(len(group) for group in problem.groups):
        return "nothing was seen"
    if free_lens is not None:
        return f"the lens of {free_lens} is estimated: a single view gives no pose without it"
    if any(name not in problem.unknowns for name in problem.columns):
        return "more than transforms is estimated"
    if problem.tied is not None:
        return "views of the static scene are tied by unknown points"
    if any(len(group.readings) > 1 for group in problem.groups):
        return "views can be read in several ways"
    if any(isinstance(g.measurement, PixelMeasurement) and g.measurement.weight.shape[1] < 4 for g in problem.groups):
        return "no pose from a single view: fewer than four points are seen"
    return ""


def _least_bound(form: LoopForm, own: Rotations) -> Bound:
    """Bound at the least value found from the solution, the closed form and, if the gap is not tight, a grid."""
    loop = form.loop
    if not loop.unknown:
        return Bound((), float(form.form[0, 0]), float(form.form[0, 0]), np.inf)
    first = _lowest_minimum(form, [own, solve_rotations(loop)])
    bound = lower_bound(form.form, first[0])
    if ProvenLoop(form, bound).gap <= _TIGHT_GAP:
        return bound
    second = _lowest_minimum(form, pose_starts([loop], _SEARCH_STARTS)[0])
    return lower_bound(form.form, second[0]) if second[1] < first[1] * (1 - SAME_COST) else bound


def _lowest_minimum(form: LoopForm, starts: list[Rotations]) -> tuple[Factors, float]:
    """Best minimum of several starts: short descents from all, then a full descent from the best."""
    ends = [local_minimum(form.form, rotation_factors(form.loop, start), _SHORT_SWEEPS) for start in starts]
    return local_minimum(form.form, min(ends, key=lambda end: end[1])[0])


def _largest_sine2(loop: ProvenLoop, slack: float) -> float:
    """Largest deviation from the proven rotations at a cost of at most `slack` above the bound, as a sin^2.

    The sin^2 is 1 minus the squared product of the cosines of half the angles between the rotations.
    """
    if not loop.form.loop.unknown:
        return 0.0
    return max(slack, 0.0) / max(loop.form.weight * loop.bound.growth, 1e-300)


def _descend_from_proven(solution: Solution, loops: list[ProvenLoop]) -> State | None:
    """State better than the solution, from a descent that starts at the proven rotations; None if there is none."""
    if len(loops) != 1 or loops[0].form.merged or not loops[0].form.loop.unknown:
        return None
    loop, rotations = loops[0].form.loop, rotations_from_factors(loops[0].form.loop, loops[0].bound.factors)
    x, y, z = solve_translations(loop, rotations)
    group, columns, transforms = solution.problem.groups[0], solution.problem.columns, dict(solution.state.transforms)
    placed = {group.eye.mount: x, group.hand.mount: z} | group.placed_base(y, transforms, columns)
    transforms |= {name: value for name, value in placed.items() if name in columns}
    return _better_state(solution, replace(solution.state, transforms=transforms))


def _better_state(solution: Solution, start: State) -> State | None:
    """Final state of a descent on all unknowns if its cost is lower than the solution's; else None."""
    dof = degrees_of_freedom(solution.problem)
    end = bundle_adjust(solution.problem, without_errors(solution.problem, start), dof, 2 * _DESCENT_STEPS)
    is_lower = end.cost < solution.cost * (1 - SAME_COST) - SAME_COST
    return end.state if is_lower and not _has_equal_transforms(end.state, solution.state) else None


def _explore_surroundings(solution: Solution, sine2: float, gap: float) -> Certified:
    """Certify by descents from random states, at the largest angle at which a better state may be."""
    few = solution.problem.with_groups(
        g if len(g) <= _MOST_VIEWS else g.take(np.linspace(0, len(g) - 1, _MOST_VIEWS).round().astype(np.int64))
        for g in solution.problem.groups
    )
    dof = degrees_of_freedom(few)
    reference = bundle_adjust(few, without_errors(few, solution.state), dof, _DESCENT_STEPS)
    angle = 2 * float(np.arcsin(np.sqrt(sine2)))
    for start in _perturbed_states(solution, angle):
        end = bundle_adjust(few, start, dof, _DESCENT_STEPS)
        has_other_cost = abs(end.cost - reference.cost) > SAME_COST * reference.cost
        if has_other_cost and not _has_equal_transforms(end.state, reference.state):
            better = _better_state(solution, end.state) if end.cost < reference.cost else None
            reason = f"within the {np.degrees(angle):.2g} deg in which a better fit could be there are several optima"
            return Certified(Certificate(gap, None, reason), better)
    return Certified(Certificate(gap, True), None)


def _has_equal_transforms(first: State, second: State) -> bool:
    """Whether all transforms of two states are equal; for tiny sigmas, rounding alone changes the cost."""
    transforms, others = first.transforms, second.transforms
    return all(float(np.abs((transforms[n].inverse() @ others[n]).log()).max()) < _SAME_M_RAD for n in transforms)


def _perturbed_states(solution: Solution, angle: float) -> list[State]:
    """States with randomly perturbed unknown rotations; the root of the sum of squared angles is `angle` [rad]."""
    problem, state = solution.problem, solution.state
    names = [n for n in problem.columns if n in state.transforms and n not in problem.point_mounts]
    rng = np.random.default_rng(_SEED)
    states = []
    for _ in range(_DESCENTS):
        rotvecs = rng.standard_normal((len(names), 3))
        rotvecs *= angle / max(float(np.linalg.norm(rotvecs)), 1e-300)
        perturbed = {
            name: state.transforms[name] @ SE3.exp(np.concatenate([np.zeros(3), rotvec]))
            for name, rotvec in zip(names, rotvecs, strict=True)
        }
        states.append(without_errors(problem, replace(state, transforms={**state.transforms, **perturbed})))
    return states
