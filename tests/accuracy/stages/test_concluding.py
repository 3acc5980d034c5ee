"""Tests of the stages that make the calibration."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from basecal.accuracy.covariance.widening import widen
from basecal.accuracy.stages import concluding
from basecal.accuracy.stages.case import Case
from basecal.cell import Certificate, ClockOffset, Finding
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate
from evidence import evidence_of

MADE = simulate(Scenario(samples=6), seed=0)
SOLUTION = solve(MADE.cell, MADE.recording)
WIDER = widen(SOLUTION, np.sqrt(np.diag(SOLUTION.covariance)))


def case(**parts):
    evidence = evidence_of(MADE.cell, SOLUTION)
    return Case(
        MADE.cell,
        MADE.recording,
        Settings(),
        gathered_evidence=evidence,
        robust=evidence.robust,
        **{"answers": (SOLUTION, WIDER, WIDER), **parts},
    )


def test_calibration_includes_covariance_of_effects():
    """The calibration has the covariance with effects, and the certificate, findings and verdict of the case."""
    warning = Finding("drift", "warning", ("wrist",), "It drifts.")
    found = concluding.conclude(case(certificate=Certificate(0.0, True, ""), findings=(warning,)))
    calibration = found.calibration
    assert calibration.verdict == "doubtful"
    assert set(calibration.verdicts.values()) == {"doubtful"}
    assert calibration.certificate.is_global
    assert calibration.findings == (warning,)
    np.testing.assert_allclose(calibration.joint_covariance, WIDER.covariance)
    assert not found.is_ended
    at_work = concluding.find_error_at_task(found).calibration
    assert at_work.meeting.where == "recorded places"
    assert (at_work.budget, at_work.error_map, at_work.local) == (None, None, None)


def test_curvature_of_the_fit_widens_the_covariance(monkeypatch):
    """The second moments of the first answer's arcs are added to the covariance with effects, also of transforms."""
    asked = []

    def curved(solution, order):
        asked.append(solution)
        return 1e-3 * np.eye(6 * len(order))

    monkeypatch.setattr(concluding, "curved_covariance", curved)
    calibration = concluding.conclude(case()).calibration
    wider = WIDER.covariance + 1e-3 * np.eye(len(WIDER.covariance))
    np.testing.assert_allclose(calibration.joint_covariance, wider)
    first = calibration.order[0]
    np.testing.assert_allclose(calibration.transforms[first].covariance, wider[:6, :6])
    assert asked == [SOLUTION]


def test_clocks_widen_answer_and_are_reported(monkeypatch):
    """Clocks widen the answer, and their findings count in the verdict."""
    late = Finding("prior-contradicted", "warning", ("wrist",), "The clock is off.")
    last = widen(WIDER, np.sqrt(np.diag(WIDER.covariance)))
    monkeypatch.setattr(concluding, "clock_findings", lambda clocked, left: [late])
    monkeypatch.setattr(concluding, "clock_offsets", lambda clocked, left: {"wrist": ClockOffset(0.1, 0.01)})
    monkeypatch.setattr(concluding, "line_times", lambda clocked, left: {})
    found = concluding.conclude(case(clocked=SimpleNamespace(), clock_step="left", answers=(SOLUTION, WIDER, last)))
    assert found.calibration.verdict == "doubtful"
    assert found.calibration.clocks == {"wrist": ClockOffset(0.1, 0.01)}
    np.testing.assert_allclose(found.calibration.joint_covariance, last.covariance)


def test_task_error_has_budget_and_map():
    """A task adds a budget and an error map; the budget counts the variance that effects add to the fit."""
    asked = replace(concluding.conclude(case()), settings=Settings(task_point=(0.5, 0.0, 0.3)))
    found = concluding.find_error_at_task(asked).calibration
    assert found.budget is not None
    assert found.error_map is not None
