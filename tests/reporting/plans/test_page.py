"""The page of a plan: the decision, the error over samples, the arms at each of them."""

from __future__ import annotations

import re

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.planning.plan import plan_for_task
from basecal.reporting.plans.page import plan_page
from basecal.simulation import Scenario, simulate

POINT = np.array([[-0.3, 0.7, 0.1]])


@pytest.fixture(scope="module")
def made():
    simulated = simulate(Scenario(samples=8, target="points"), 3)
    return simulated, calibrate(simulated.cell, simulated.recording)


def test_it_says_whether_it_is_enough_and_what_to_type(made) -> None:
    """The verdict, the tolerance as a line over the samples, a row for each, the scene with all of them."""
    simulated, calibration = made
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
    assert 'max="3" value="0"' in page  # the arms are shown where they go first
    assert [count for count, _ in plan.steps] == [0, 1, 2, 3, 4]
    errors = [error_m for _, error_m in plan.steps]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] == pytest.approx(plan.expected_m, rel=0.05)


def test_a_plan_without_samples_has_nothing_to_record(made) -> None:
    """What is reached already needs no command, no scene and no curve."""
    simulated, calibration = made
    plan = plan_for_task(simulated.cell, simulated.recording, calibration, POINT, 1.0)
    page = plan_page(simulated.cell, plan, calibration, 1.0, title="my", steps=["`basecal capture my`"])
    assert "already reached" in page
    for missing in ("What to do", "Where the arms will be", 'class="level"'):
        assert missing not in page
