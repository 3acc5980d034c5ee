"""Evidence for findings: the input as read, and the answer with everything computed about it."""

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
    """The input as read, before solving.

    Attributes:
        problem: Problem built from cell and recording.
        findings: Findings from reading them.
        on_paths: Whether robot poses are interpolated at the instants of views, instead of recorded at stops.
        image_count: Number of recorded images in which a target can be searched.
        unit_count: Number of targets whose length unit was estimated from the same views.
    """

    problem: Problem
    findings: tuple[Finding, ...]
    on_paths: bool = False
    image_count: int = 0
    unit_count: int = 0


@dataclass(frozen=True, eq=False)
class Evidence:
    """An answer, with the results that judge it.

    Attributes:
        cell: The cell, with the requested transforms.
        settings: Settings of the solver.
        recorded: The recorded problem, including outliers.
        robust: The solution without outliers, and the outliers.
        solution: The answer: the solution of `robust`, or a better one that the certificate led to.
        cross_validation: Prediction errors of held-out samples; None if they cannot be computed.
        contradicted_sigmas: Stated sigmas that the residuals of the solution with these sigmas contradict.
        refuted: The solution with the sigmas as stated, if some of these are contradicted as too small.
        systematic_error: Systematic error that explains the residuals better than noise; None if there is none.
        lens_structures: Cameras whose residuals depend on the position in the image.
        held_out_places: Errors of touches at held-out places.
        robot_model: Choice of the robots' kinematic model by held-out samples; None if there was nothing to choose.
        units_m: Assumed length unit of poses known up to scale, by target [m].
        images: Paths of the recorded images, by sample number and camera.
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
        """Residuals of the answer."""
        return residuals(self.solution, self.robust.left_out)


InputCheck = Callable[[Input], list[Finding]]
AnswerCheck = Callable[[Evidence], list[Finding]]
