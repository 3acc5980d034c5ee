"""A case on its way."""

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


def test_what_no_stage_has_found_yet_cannot_be_used():
    """Neither problem nor solution nor evidence."""
    for name in ("problem", "solution", "evidence"):
        with pytest.raises(AssertionError):
            getattr(CASE, name)


def test_the_solution_is_the_last_one():
    """That without outliers, once there is one."""
    case = Case(*CASE_WORDS, plain="plain")
    assert case.solution == "plain"
    assert Case(*CASE_WORDS, plain="plain", robust=SimpleNamespace(solution="robust")).solution == "robust"


def test_findings_add_up():
    """An error among them refuses."""
    assert not CASE.with_findings([WARNING]).is_refused
    both = CASE.with_findings([WARNING]).with_findings([ERROR])
    assert both.findings == (WARNING, ERROR)
    assert both.is_refused


def test_a_refused_case_has_no_numbers():
    """Its findings, those given or its own; residuals only if something was solved."""
    found = CASE.with_findings([WARNING]).refuse()
    assert found.is_ended
    assert (found.calibration.verdict, found.calibration.findings) == ("refused", (WARNING,))
    assert found.calibration.residuals.rms_px is None
    solution = solve(MADE.cell, MADE.recording)
    solved = Case(*CASE_WORDS, plain=solution).refuse([ERROR])
    assert solved.calibration.findings == (ERROR,)
    assert solved.calibration.residuals.rms_px is not None
    assert solved.calibration.transforms == {}


def test_evidence_grows():
    """By its parts, the others as they are."""
    solution = solve(MADE.cell, MADE.recording)
    case = Case(*CASE_WORDS, gathered_evidence=evidence_of(MADE.cell, solution))
    more = case.with_evidence(systematic_error="found")
    assert more.evidence.systematic_error == "found"
    assert more.evidence.solution is solution
