"""State of a calibration in progress, from the recording to the verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Self

from basecal.accuracy.clocks.search import ClockedRecording
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
    """Results of a calibration so far; each stage uses those of the previous stages.

    Attributes:
        cell: The cell.
        recording: The recording as read; with robot poses at estimated clock offsets, if clocks were estimated.
        settings: Settings of the solver.
        findings: Findings so far.
        units_m: Length unit of poses known up to scale, by target [m].
        clocked: Recording with estimated clocks; None if no stream was recorded.
        packed: Cell and recording as arrays, including outliers.
        plain: Solution with the noise as stated.
        noisy: Solution with unstated noise estimated; None if no noise is to be estimated.
        robust: Solution without outliers.
        gathered_evidence: The answer, and the evidence to judge it.
        certificate: Certificate of the answer; None if there is none.
        answers: Answer as fitted, with the covariance of systematic effects, and with that of clocks, too.
        clock_step: Remaining step of the clocks, including these effects; None if no clock was estimated.
        scene: Points of the static scene, if it is used.
        calibration: The result.
        is_ended: Whether the calibration is complete, so that no further stage runs.
    """

    cell: Cell
    recording: Recording
    settings: Settings
    findings: tuple[Finding, ...] = ()
    units_m: Mapping[str, float] = field(default_factory=dict)
    clocked: ClockedRecording | None = None
    packed: Problem | None = None
    plain: Solution | None = None
    noisy: Solution | None = None
    robust: RobustSolution | None = None
    gathered_evidence: Evidence | None = None
    certificate: Certificate | None = None
    answers: tuple[Solution, ...] = ()
    clock_step: ClockStep | None = None
    scene: Fingerprint | None = None
    calibration: Calibration | None = None
    is_ended: bool = False

    @property
    def problem(self) -> Problem:
        """Cell and recording as arrays, including outliers."""
        assert self.packed is not None
        return self.packed

    @property
    def solution(self) -> Solution:
        """The solution without outliers if there is one, else the solution with the noise as stated."""
        found = self.plain if self.robust is None else self.robust.solution
        assert found is not None
        return found

    @property
    def evidence(self) -> Evidence:
        """The answer, and the evidence to judge it."""
        assert self.gathered_evidence is not None
        return self.gathered_evidence

    @property
    def stated_settings(self) -> Settings:
        """The settings with robots of unstated noise assumed exact."""
        return replace(self.settings, robot_noise="stated")

    def with_evidence(self, **parts: Any) -> Self:
        """Copy of the case with further evidence."""
        return replace(self, gathered_evidence=replace(self.evidence, **parts))

    def with_findings(self, findings: Iterable[Finding]) -> Self:
        """Copy of the case with further findings."""
        return replace(self, findings=(*self.findings, *findings))

    @property
    def is_refused(self) -> bool:
        """Whether one of the findings is an error."""
        return judge_findings(self.findings) == "refused"

    def refuse(self, findings: Iterable[Finding] | None = None) -> Self:
        """Ended case with verdict `refused` and without estimates, which would not describe the real cell.

        Args:
            findings: Findings to replace those so far; None to keep those.
        """
        found = self.findings if findings is None else tuple(findings)
        result = Calibration("refused", findings=found, settings=self.settings.as_dict())
        if self.plain is not None:
            result = replace(result, residuals=residuals(self.solution))
        return replace(self, findings=found, calibration=result, is_ended=True)
