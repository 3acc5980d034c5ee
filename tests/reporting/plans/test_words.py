"""A plan in sentences."""

from __future__ import annotations

import pytest

from basecal.cell import BudgetEntry, Sample
from basecal.planning.plan import Plan
from basecal.reporting.plans.words import plan_headline, plan_lines

BUDGET = (BudgetEntry("views of wrist", 2e-4, 0.9, 1e-4),)


def plan(needed, reachable, recorded=12, count=3, place="recorded places"):
    return Plan(tuple(map(Sample, range(count))), needed, 4e-4, reachable, recorded, BUDGET, place=place)


@pytest.mark.parametrize(
    ("made", "tolerance_m", "said"),
    [
        (plan(3, True), 5e-4, "PASS: 0.5 mm where the arms worked: 3 samples reach it."),
        (plan(4, True), 5e-4, "DOUBTFUL: 0.5 mm where the arms worked takes 4 samples, of which 3 are planned."),
        (
            plan(0, True, place="task box"),
            5e-4,
            "PASS: 0.5 mm in the task box is already reached (95 %: 0.40 mm with 12 samples).",
        ),
        (
            plan(None, False, place="task point"),
            1e-4,
            "FAIL: 0.1 mm at the task point cannot be reached. The largest part of the error is views of wrist.",
        ),
        (plan(None, None, 0), None, "GOOD: Expected error with 3 samples: 0.40 mm (95 %) where the arms worked."),
    ],
)
def test_the_decision_comes_first(made, tolerance_m, said) -> None:
    """As verdicts of calibrations do: a word and a sentence."""
    assert str(plan_headline(made, tolerance_m)) == said


def test_lines_are_said_once() -> None:
    """What the samples lead to, then the error by source; nothing of samples where none is planned."""
    _, second, third = plan_lines(plan(3, True), 5e-4)
    assert second == "Expected error with 3 more samples: 0.40 mm (95 %) where the arms worked."
    assert third == "   90.0 % of the variance: views of wrist; 0.10 mm rms in all with half of it"
    assert len(list(plan_lines(plan(None, None), None))) == 2
    assert len(list(plan_lines(plan(0, True, count=0), 5e-4))) == 2
