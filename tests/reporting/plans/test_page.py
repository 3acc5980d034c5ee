"""Tests of the page of a plan: the decision, the error over samples, and the arms at each sample."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import BudgetEntry, RobotState, Sample, TouchObservation
from basecal.geometry import SE3
from basecal.planning.plan import Plan, plan_for_task
from basecal.reporting.plans import page as page_module
from basecal.reporting.plans.page import plan_headline, plan_lines, plan_page, touch_lines
from basecal.simulation import Scenario, simulate

POINT = np.array([[-0.3, 0.7, 0.1]])
BUDGET = (BudgetEntry("views of wrist", 2e-4, 0.9, 1e-4),)


@pytest.fixture(scope="module")
def calibrated_cell():
    simulated = simulate(Scenario(samples=8, target="points"), 3)
    return simulated, calibrate(simulated.cell, simulated.recording)


@pytest.mark.journey
def test_plan_page_shows_verdict_and_command(calibrated_cell) -> None:
    """The page has the verdict, the command, and the tolerance as a line over the samples.

    It has a row for each sample, and a scene with all of them.
    """
    simulated, calibration = calibrated_cell
    plan = plan_for_task(simulated.cell, simulated.recording, calibration, POINT, 3e-3, 4)
    page = plan_page(
        simulated.cell, plan, calibration, 3e-3, title="my<cell>", steps=["`basecal capture my --plan p.jsonl`"]
    )
    assert '<span class="word">PASS</span>' in page
    assert "my&lt;cell&gt;" in page
    assert "<code>basecal capture my --plan p.jsonl</code>" in page
    rows = re.findall(r'<tr class="view" data-sample="(\d+)">', page)
    assert rows == [str(sample.sample) for sample in plan.samples]
    assert page.count('class="level"') == 1
    assert "Where the arms will be" in page
    assert 'max="3" value="0"' in page  # the first goal of the arms is shown
    assert [count for count, _ in plan.steps] == [0, 1, 2, 3, 4]
    errors = [error_m for _, error_m in plan.steps]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] == pytest.approx(plan.expected_m, rel=0.05)


@pytest.mark.journey
def test_plan_without_samples_has_no_command(calibrated_cell) -> None:
    """A tolerance that is already reached needs no command, no scene and no curve."""
    simulated, calibration = calibrated_cell
    plan = plan_for_task(simulated.cell, simulated.recording, calibration, POINT, 1.0)
    page = plan_page(simulated.cell, plan, calibration, 1.0, title="my", steps=["`basecal capture my`"])
    assert "already reached" in page
    for missing in ("What to do", "Where the arms will be", 'class="level"'):
        assert missing not in page


def plan(needed, reachable, recorded=12, count=3, place="recorded places"):
    return Plan(tuple(map(Sample, range(count))), needed, 4e-4, reachable, recorded, BUDGET, place=place)


@pytest.mark.parametrize(
    ("plan_result", "tolerance_m", "message"),
    [
        (plan(3, True), 5e-4, "PASS: 0.5 mm where the arms worked: 3 samples reach it."),
        (plan(1, True), 5e-4, "PASS: 0.5 mm where the arms worked: 1 sample reaches it."),
        (plan(2, True), 1.5, "PASS: 1500 mm where the arms worked: 2 samples reach it."),
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
def test_plan_headline_states_verdict(plan_result, tolerance_m, message) -> None:
    """Like the verdicts of calibrations, the headline is a word and a sentence."""
    assert str(plan_headline(plan_result, tolerance_m)) == message


def test_plan_lines_are_not_repeated() -> None:
    """The result of the samples is followed by the error by source. Samples are not mentioned if none is planned."""
    _, second, third = plan_lines(plan(3, True), 5e-4)
    assert second == "Expected error with 3 more samples: 0.40 mm (95 %) where the arms worked."
    assert third == "   90.0 % of the variance: views of wrist; total 0.10 mm rms if halved"
    assert len(list(plan_lines(plan(None, None), None))) == 2
    assert len(list(plan_lines(plan(0, True, count=0), 5e-4))) == 2


def test_plan_curve_requires_two_steps(calibrated_cell) -> None:
    """A single step has no curve."""
    simulated, calibration = calibrated_cell
    shown = [
        plan_page(
            simulated.cell, replace(plan(None, None, count=0), steps=steps), calibration, None, title="", steps=()
        )
        for steps in (((0, 1e-3),), ((0, 1e-3), (1, 5e-4)))
    ]
    assert ["0.50 mm with 13 samples" in each for each in shown] == [False, True]


def test_needed_samples_may_equal_planned_ones() -> None:
    """One more needed sample is doubtful. An unreachable tolerance without a budget has no cause."""
    assert plan_headline(plan(3, True), 1e-3).word == "PASS"
    assert plan_headline(plan(4, True), 1e-3).word == "DOUBTFUL"
    unknown = replace(plan(None, False), budget=(), expected_m=None)
    assert str(plan_headline(unknown, 1e-3)) == "FAIL: 1 mm where the arms worked cannot be reached."
    assert "an unknown error" in str(plan_headline(unknown, None))


def test_motions_are_between_consecutive_samples() -> None:
    """The first sample has no motion, nor has an arm that is not recorded in both. Others are in mm and deg."""
    arms = {"hand": RobotState(SE3.identity())}
    moved = {"hand": RobotState(SE3.from_rpy((0, 0, np.radians(2)), (0.0, 0.0, 0.0125)))}
    samples = (Sample(4, robots=arms), Sample(5, robots=moved), Sample(6))
    sketch = SimpleNamespace(movers=("hand",), base_from_flange=lambda _, state: state.base_from_flange)
    first, second, third = page_module._motion_rows(sketch, samples)
    assert (first, third) == (("4", ""), ("6", ""))
    assert second[0] == "5"
    assert second[1].startswith("12 mm and 2.0 deg")


def test_touches_are_listed_with_their_marks() -> None:
    """Positions of new marks are in m, and the orientation of the flange is in deg if it is planned."""
    seen = (TouchObservation("tip", "m1"),)
    turned = RobotState(SE3.from_rpy(np.radians([10, -20, 30]), np.zeros(3)))
    samples = (
        Sample(1, robots={"eye": turned}, observations=seen),
        Sample(2, robots={"eye": RobotState(joints_rad=np.zeros(6))}, observations=seen),
    )
    lines = list(touch_lines(replace(plan(3, True), samples=samples, marks={"m1": np.array([0.1, -0.25, 0.333])})))
    assert lines == [
        "Make a mark near (0.10, -0.25, 0.33) m in the reference's base: m1.",
        "  touch m1 with tip, flange turned by roll, pitch, yaw 10, -20, 30 deg",
        "  touch m1 with tip",
    ]
