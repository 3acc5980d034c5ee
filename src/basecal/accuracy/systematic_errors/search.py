"""The systematic error of a solution, if it has one: that which explains most.

Score tests find; only what they find is solved for, with noise estimated anew, and must predict held-out blocks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.significance import SIGNIFICANCE
from basecal.accuracy.systematic_errors.candidates import Candidates
from basecal.accuracy.systematic_errors.confirm import confirmed
from basecal.accuracy.systematic_errors.score_tests import linearised, score
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.accuracy.systematic_errors.table import TABLE
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.problem.problem import Problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from
from basecal.geometry import SE3, Array

_TRIES = 4  # candidates that may fail to be confirmed before the search ends


@dataclass(frozen=True, eq=False)
class SystematicError:
    """An error that is no noise.

    Attributes:
        code: Of its finding.
        about: The robot, camera, target or transform that has it.
        is_camera: Whether that is a camera.
        is_target: Whether that is a target.
        since: Number of the first sample that has it; None where all do.
        unit: Of the sizes, in words.
        size: (q,) what the recording is to be corrected by; see `table`.
        covariance: (q, q).
        log_chance: Logarithm of the chance of finding any of its kind in data without.
    """

    code: str
    about: str
    is_camera: bool
    is_target: bool
    since: int | None
    unit: str
    size: Array
    covariance: Array
    log_chance: float

    @property
    def sigma(self) -> float:
        """Of a single size."""
        return float(np.sqrt(self.covariance[0, 0]))


def systematic_error(
    solution: Solution, recorded: Problem, stamps: Mapping[int, float], settings: Settings
) -> SystematicError | None:
    """What explains the residuals far better than noise does, and predicts held-out blocks better.

    One at a time: where one is large, what is left of it when it is taken out would pass for others.

    Args:
        solution: The answer, with its noise.
        recorded: The problem as it was recorded, outliers among it.
        stamps: Time of each sample by number [s].
        settings: How the answer was solved.

    Returns:
        The error that is least likely to be chance; None where there is none.
    """
    if not solution.converged or not np.isfinite(solution.cost) or not solution.problem.groups:
        return None
    situation = Situation(solution.noise.held_by(solution.problem), solution.state, recorded, stamps)
    found = _found(situation)
    return None if found is None else _solved_for(solution, situation, *found, settings)


def _found(of: Situation) -> tuple[Candidates, float] | None:
    """The least likely of all errors to be chance, that is confirmed, and the logarithm of its chance.

    One of several that are looked for by one code, such as steps at many samples, counts by the chance of any of them.
    """
    about = linearised(of.problem, of.state)
    kinds = [kind for row in TABLE for kind in row(of)]
    tests = Counter(code for kind in kinds for code in [kind.code] * len(kind.about))
    # Among errors, one of many costs as much as the unknown that says which: half the logarithm of their number.
    ranked = sorted(
        (float(log_chance) + 0.5 * float(np.log(tests[kind.code])), i, b)
        for i, kind in enumerate(kinds)
        for b, log_chance in enumerate(score(about, kind).log_chance)
    )
    refused: set[tuple[str, str]] = set()
    for rank, i, b in ranked:
        candidate = kinds[i].only(b)
        log_chance = rank + 0.5 * float(np.log(tests[candidate.code]))
        if log_chance > np.log(SIGNIFICANCE) or len(refused) >= _TRIES:
            break
        key = (candidate.code, candidate.about[0])
        if key not in refused:
            if confirmed(of, candidate):
                return candidate, log_chance
            refused.add(key)
    return None


def _solved_for(
    solution: Solution, of: Situation, candidate: Candidates, log_chance: float, settings: Settings
) -> SystematicError:
    """The error, solved for beside everything else: the recorded poses corrected, and the noise estimated anew."""
    first = score(linearised(of.problem, of.state), candidate)
    moved = _corrected(solution.problem, of, candidate, first.size[0])
    after = _solved_again(replace(solution, problem=moved), settings)
    problem = after.noise.held_by(after.problem)
    again = score(linearised(problem, after.state), candidate)
    size = first.size[0] + again.size[0]
    covariance = np.linalg.pinv(again.information[0])
    about = candidate.about[0]
    is_camera, is_target = (any(getattr(g, kind) == about for g in of.problem.groups) for kind in ("camera", "target"))
    return SystematicError(
        candidate.code, about, is_camera, is_target, candidate.since[0], candidate.unit, size, covariance, log_chance
    )


def _solved_again(solution: Solution, settings: Settings) -> Solution:
    if settings.robot_noise != "stated":
        return with_noise(solution, settings)
    return solve_from(solution.problem, solution.state, settings, solution.findings)


def _corrected(problem: Problem, of: Situation, candidate: Candidates, size: Array) -> Problem:
    """The problem with every view moved by an error: its recorded hand is where that says it was."""
    groups = []
    for group, links, moves in zip(problem.groups, of.links, candidate.moves, strict=True):
        of_target = (moves[:, 0] @ size)[..., None]
        tangent = (links.target_from_hand_flange.inverse().adjoint() @ of_target)[..., 0]
        groups.append(replace(group, hand_base_from_hand_flange=group.hand_base_from_hand_flange @ SE3.exp(tangent)))
    return problem.with_groups(groups)
