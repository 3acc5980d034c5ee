"""`far-task`: a task far from where arms were recorded."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.findings.far_task import far_task
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate
from evidence import evidence_of

MADE = simulate(Scenario(samples=8), 0)


def evidence_at(made, aside_m):
    """Evidence of a task point so far above all flanges of both arms; without one if None."""
    solution = solve(made.cell, made.recording)
    flanges = solution.problem.robot_ends("eye")[0].base_from_flange.translation
    highest = flanges[np.argmax(flanges[:, 2])]
    point = None if aside_m is None else tuple(highest + np.array([0, 0, aside_m]))
    return replace(evidence_of(made.cell, solution), settings=Settings(task_point=point))


@pytest.mark.parametrize(("aside_m", "robots"), [(None, ()), (0.0, ()), (3.0, ("eye", "hand"))])
def test_a_task_far_from_samples_is_named(aside_m, robots):
    """With all arms whose errors there are not those of their samples; not if one was recorded there."""
    assert [finding.about for finding in far_task(evidence_at(MADE, aside_m))] == ([robots] if robots else [])


def test_arms_that_record_joints_are_not():
    """What their joints and links are off by is known elsewhere, too."""
    made = simulate(Scenario(samples=8, joints=True), 0)
    assert far_task(evidence_at(made, 3.0)) == []


def test_words_have_the_distance():
    """The smallest of all arms."""
    (found,) = far_task(evidence_at(MADE, 3.0))
    assert found.severity == "info"
    assert found.message.startswith("The task point is ")
    assert 2 < float(found.message.split()[4]) < 4
