"""The evidence of findings: the input as it was read, and the answer with all that was computed about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from basecal.accuracy.cross_validation.robot_model_selection import RobotModelChoice
from basecal.accuracy.cross_validation.station_scores import PlaceError
from basecal.accuracy.cross_validation.validation import CrossValidation
from basecal.accuracy.lens_structure import LensStructure
from basecal.accuracy.residuals.fit import residuals
from basecal.accuracy.stated_sigmas import ContradictedSigma
from basecal.cell import Cell, Finding, Residuals
from basecal.effects.faces.effect import FoundEffect
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.problem.problem import Problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution


@dataclass(frozen=True, eq=False)
class Input:
    """The input as it was read, before anything is solved.

    Attributes:
        problem: Of cell and recording.
        findings: Made while these were read.
        on_paths: Whether robots' poses are read off their paths at the instants of views, not at stops.
        images: Number of recorded images in which a target can be searched.
    """

    problem: Problem
    findings: tuple[Finding, ...]
    on_paths: bool = False
    images: int = 0


@dataclass(frozen=True, eq=False)
class Evidence:
    """An answer, and what was computed to judge it.

    Attributes:
        cell: What exists, and what is requested.
        settings: How it was solved.
        recorded: The problem as it was recorded, outliers among it.
        robust: The solution without outliers, and these.
        solution: The answer: that of `robust`, or a better one that the certificate led to.
        cross_validation: How samples are predicted that were held out; None if the answer is none.
        contradicted_sigmas: Stated sigmas that the residuals of the solution with them contradict.
        refuted: The solution with the sigmas as stated, if some of these are contradicted as too small.
        systematic_error: What explains the residuals better than noise; None if nothing does.
        lens_structures: Cameras whose residuals go by their place in the image.
        held_out_places: What remains at places of touches that were held out.
        robot_model: What held-out samples say of the robots' kinematics; None if there was nothing to choose.
        units_m: The assumed length of a unit of poses that are up to scale [m], by target.
        images: Paths of the recorded images, by number of the sample and camera.
    """

    cell: Cell
    settings: Settings
    recorded: Problem
    robust: RobustSolution
    solution: Solution
    cross_validation: CrossValidation | None = None
    robot_model: RobotModelChoice | None = None
    contradicted_sigmas: tuple[ContradictedSigma, ...] = ()
    refuted: Solution | None = None
    systematic_error: FoundEffect | None = None
    lens_structures: Sequence[LensStructure] = ()
    held_out_places: tuple[PlaceError, ...] = ()
    units_m: Mapping[str, float] = field(default_factory=dict)
    images: Mapping[tuple[int, str], str] = field(default_factory=dict)

    @cached_property
    def residuals(self) -> Residuals:
        """How the answer fits."""
        return residuals(self.solution, self.robust.left_out)


InputCheck = Callable[[Input], list[Finding]]
AnswerCheck = Callable[[Evidence], list[Finding]]
