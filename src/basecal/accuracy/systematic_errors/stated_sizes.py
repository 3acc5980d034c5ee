"""Sizes of targets are known to a print's accuracy: what that leaves uncertain in the answer, to first order.

Given the data an error of sigma s has the variance v = 1 / (P + 1 / s^2) about -v U, with U and P of
docs/mathematics.md (11.1). The answer is that of the stated size; its covariance covers both.
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.systematic_errors.score_tests import score_of, sums
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Cell
from basecal.effects import target_size
from basecal.effects.faces.found import FoundEffect
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.solve import Solution
from basecal.geometry import Array


def moved_by_sizes(cell: Cell, solution: Solution, found: FoundEffect | None) -> list[Array]:
    """By how much the answer's columns move with one sigma of each target's size, (p,) each.

    Args:
        cell: As declared.
        solution: The answer.
        found: The systematic error, which counts separately if it is a size; None if there is none.
    """
    if not solution.converged or not solution.problem.width:
        return []
    problem = solution.noise.held_by(solution.problem)
    situation = Situation(problem, solution.state, problem, {})
    counted = () if found is None else {e.about for e in (found, *found.alternatives) if e.effect == target_size.NAME}
    moves = []
    for candidate in target_size.candidates(situation):
        sigma = _sigma(cell, solution.problem.groups, candidate.about[0])
        if not sigma or candidate.about[0] in counted:
            continue
        known = sums(situation.about, candidate)
        score = score_of(situation.about, known)
        variance = 1 / (score.information[0, 0, 0] + sigma**-2)
        mean = -variance * score.gradient[0, 0]
        moves.append(situation.about.inverse @ known.across[0, 0] * np.hypot(np.sqrt(variance), mean))
    return moves


def _sigma(cell: Cell, groups: tuple[ViewGroup, ...], target: str) -> float:
    """Of a target's size as a share: as stated, else as usual; 0 of one whose views all state their noise."""
    stated = cell.targets[target].size_sigma
    if stated is not None:
        return stated
    counts = (g.measurement.counts() for g in groups if g.target == target)
    is_open = any(count.get("pixel_px", 0) or count.get("pose_m", 0) for count in counts)
    return target_size.STATED.sigma if is_open else 0.0
