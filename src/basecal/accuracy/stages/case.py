"""A calibration on its way from what was read to its verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

from basecal.accuracy.clocks.search import Clocked
from basecal.accuracy.clocks.step import ClockStep
from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.residuals.fit import residuals
from basecal.accuracy.verdicts import judge_findings
from basecal.cell import Calibration, Cell, Certificate, Finding, Recording
from basecal.cell.fingerprint import Fingerprint
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.problem.problem import Problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution


@dataclass(frozen=True, eq=False)
class Case:
    """The knowledge of a calibration so far; a stage uses the results of those before it.

    Attributes:
        cell: What exists and what is known.
        recording: Samples as they were read; by clocks that were estimated, if any were.
        settings: How to solve.
        findings: Made so far.
        units_m: The length of a unit of poses that are up to scale [m], by target.
        clocked: The recording by estimated clocks; None if no stream was recorded.
        packed: Cell and recording as arrays, outliers among them.
        plain: The solution with the noise as stated.
        noisy: The same with unstated noise estimated; None if none is to be.
        robust: The solution without outliers.
        weighed: The answer, and what was computed to judge it.
        certificate: Of the answer; None if none was requested.
        answers: The answer as fitted, with the covariance of effects that noise is not, and of clocks.
        clock_step: The step of the clocks beside these effects; None if no clock was estimated.
        scene: Points of the static scene, if it takes part.
        calibration: The result.
        is_ended: Whether no stage is left to do.
    """

    cell: Cell
    recording: Recording
    settings: Settings
    findings: tuple[Finding, ...] = ()
    units_m: Mapping[str, float] = field(default_factory=dict)
    clocked: Clocked | None = None
    packed: Problem | None = None
    plain: Solution | None = None
    noisy: Solution | None = None
    robust: RobustSolution | None = None
    weighed: Evidence | None = None
    certificate: Certificate | None = None
    answers: tuple[Solution, ...] = ()
    clock_step: ClockStep | None = None
    scene: Fingerprint | None = None
    calibration: Calibration | None = None
    is_ended: bool = False

    @property
    def problem(self) -> Problem:
        """Cell and recording as arrays, outliers among them."""
        assert self.packed is not None
        return self.packed

    @property
    def solution(self) -> Solution:
        """Without outliers; before these are left out that with the noise as stated."""
        found = self.plain if self.robust is None else self.robust.solution
        assert found is not None
        return found

    @property
    def evidence(self) -> Evidence:
        """The answer, and what was computed to judge it."""
        assert self.weighed is not None
        return self.weighed

    @property
    def stated_settings(self) -> Settings:
        """The settings, with robots exact that state no noise."""
        return replace(self.settings, robot_noise="stated")

    def weighing(self, **parts: Any) -> Self:
        """The case with more evidence."""
        return replace(self, weighed=replace(self.evidence, **parts))

    def with_findings(self, findings: Iterable[Finding]) -> Self:
        """The case with more findings."""
        return replace(self, findings=(*self.findings, *findings))

    @property
    def is_refused(self) -> bool:
        """Whether one of the findings is an error."""
        return judge_findings(self.findings) == "refused"

    def refuse(self, findings: Iterable[Finding] | None = None) -> Self:
        """The case at its end without numbers: these would be of a cell that does not exist.

        Args:
            findings: In place of those so far.
        """
        found = self.findings if findings is None else tuple(findings)
        result = Calibration("refused", findings=found, settings=self.settings.as_dict())
        if self.plain is not None:
            result = replace(result, residuals=residuals(self.solution))
        return replace(self, findings=found, calibration=result, is_ended=True)
