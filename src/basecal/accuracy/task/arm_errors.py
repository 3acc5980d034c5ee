"""Models of arm errors about a solution, computed once for all meeting points of the arms."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from basecal.accuracy.systematic_errors.expected_sizes import SizePosterior, known_sizes
from basecal.accuracy.systematic_errors.situation import OpenOffsets, Situation, situate
from basecal.accuracy.task.kinematic_errors import EXPECTED_PRIOR, MODELS, kinematic_errors
from basecal.cell import Cell
from basecal.effects.faces.shared_errors import SharedTerm
from basecal.estimation.noise.joint_estimate import model_sigmas, open_robots
from basecal.estimation.noise.laplace import SigmaPosterior
from basecal.estimation.solve import Solution


@dataclass(frozen=True, eq=False)
class ArmErrors:
    """Errors of arms about a solution.

    Attributes:
        cell: The calibrated cell.
        fitted: The solution before its correction by expected effects. Errors are modelled about it, since models
            without such effects would undo the correction.
        solution: The corrected solution.
        offsets: Clock offsets that were estimated with the solution; None without any.
    """

    cell: Cell
    fitted: Solution
    solution: Solution
    offsets: OpenOffsets | None = None

    @cached_property
    def joint_models(self) -> list[tuple[tuple[str, ...], SigmaPosterior]]:
        """Models of errors of joints and links, with their kinds; empty if no noise of robots is estimated.

        If one kind has a prior, two of `MODELS` describe the same errors and count once.
        """
        problem, state, noise = self.fitted.problem, self.fitted.state, self.fitted.noise
        models: dict[tuple[int, ...], tuple[tuple[str, ...], SigmaPosterior]] = {}
        for kinds in () if noise.logs is None else MODELS:
            found = {robot: kinematic_errors(problem, state, robot, kinds) for robot in open_robots(problem)}
            arms = {robot: errors for robot, errors in found.items() if errors is not None}
            key = tuple(len(errors.is_turn) for errors in arms.values())
            if arms and key not in models:
                models[key] = kinds, model_sigmas(problem, state, noise, [SharedTerm(arms, EXPECTED_PRIOR)])
        return list(models.values())

    @cached_property
    def situation(self) -> Situation:
        """The situation of the corrected solution, with its noise."""
        return situate(self.solution, offsets=self.offsets)

    @cached_property
    def sizes(self) -> list[SizePosterior]:
        """Posteriors of fields and lengths of arms that record only poses, with effects that are not independent."""
        return known_sizes(self.cell, self.situation, None, arms_only=True)
