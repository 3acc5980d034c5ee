"""Tests of `Case`: the state between stages."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from basecal.accuracy.stages.case import Case
from basecal.cell import Finding
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate
from evidence import evidence_of

MADE = simulate(Scenario(samples=3), seed=0)
CASE_WORDS = (MADE.cell, MADE.recording, Settings())
CASE = Case(*CASE_WORDS)
ERROR, WARNING = (Finding(s, s, (), s) for s in ("error", "warning"))


def test_missing_parts_of_case_raise():
    """A problem, solution or evidence that no stage has found yet raises an AssertionError."""
    for name in ("problem", "solution", "evidence"):
        with pytest.raises(AssertionError):
            getattr(CASE, name)


def test_solution_is_robust_one_if_present():
    """The solution is the robust one if there is one, else the plain one."""
    case = Case(*CASE_WORDS, plain="plain")
    assert case.solution == "plain"
    assert Case(*CASE_WORDS, plain="plain", robust=SimpleNamespace(solution="robust")).solution == "robust"


def test_findings_add_up():
    """Findings add up, and an error among them refuses the case."""
    assert not CASE.with_findings([WARNING]).is_refused
    both = CASE.with_findings([WARNING]).with_findings([ERROR])
    assert both.findings == (WARNING, ERROR)
    assert both.is_refused


def test_refused_case_has_no_transforms():
    """A refused case has its findings, given or own, and no transforms; it has residuals only if it was solved."""
    found = CASE.with_findings([WARNING]).refuse()
    assert found.is_ended
    assert (found.calibration.verdict, found.calibration.findings) == ("refused", (WARNING,))
    assert found.calibration.residuals.rms_px is None
    solution = solve(MADE.cell, MADE.recording)
    solved = Case(*CASE_WORDS, plain=solution).refuse([ERROR])
    assert solved.calibration.findings == (ERROR,)
    assert solved.calibration.residuals.rms_px is not None
    assert solved.calibration.transforms == {}


def test_evidence_is_extended_by_parts():
    """Evidence is extended by parts, and the other parts are unchanged."""
    solution = solve(MADE.cell, MADE.recording)
    case = Case(*CASE_WORDS, gathered_evidence=evidence_of(MADE.cell, solution))
    more = case.with_evidence(systematic_error="found")
    assert more.evidence.systematic_error == "found"
    assert more.evidence.solution is solution
