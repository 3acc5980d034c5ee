"""Tests of the finding `far-task`: a task point far from the recorded robot poses."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.findings.far_task import far_task
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate
from evidence import evidence_of

MADE = simulate(Scenario(samples=8), 0)


def evidence_at(made, aside_m):
    """Evidence with a task point so far above all flanges of both arms; without one if None."""
    solution = solve(made.cell, made.recording)
    flanges = solution.problem.robot_ends("eye")[0].base_from_flange.translation
    highest = flanges[np.argmax(flanges[:, 2])]
    point = None if aside_m is None else tuple(highest + np.array([0, 0, aside_m]))
    return replace(evidence_of(made.cell, solution), settings=Settings(task_point=point))


@pytest.mark.parametrize(("aside_m", "robots"), [(None, ()), (0.0, ()), (3.0, ("eye", "hand"))])
def test_far_task_names_arms(aside_m, robots):
    """A far task names all arms whose errors there differ from those of their samples.

    It names none if one was recorded there.
    """
    assert [finding.about for finding in far_task(evidence_at(MADE, aside_m))] == ([robots] if robots else [])


@pytest.mark.parametrize(("far", "is_reported"), [((0.34, 2.0), False), ((2.0, 0.36), True), ((), False)])
def test_task_is_far_from_half_the_error_length(monkeypatch, far, is_reported):
    """A task is far from half the length scale of smooth errors on, of the nearest arm.

    Without arms of recorded poses, none is.
    """
    distances = zip(("eye", "hand"), far, strict=False)
    monkeypatch.setattr("basecal.accuracy.findings.far_task._distances", lambda evidence, point_m: distances)
    found = far_task(SimpleNamespace(settings=Settings(task_point=(0.0, 0.0, 0.0))))
    assert bool(found) == is_reported
    for each in found:
        assert each.what == "The task point is 0.36 m from the nearest recorded flange of eye and hand."


def test_joint_robots_have_no_far_task():
    """Arms that record joints have no far task: errors of joints and links are known elsewhere, too."""
    made = simulate(Scenario(samples=8, joints=True), 0)
    assert far_task(evidence_at(made, 3.0)) == []


def test_far_task_message_has_smallest_distance():
    """The message states the smallest distance of all arms."""
    (found,) = far_task(evidence_at(MADE, 3.0))
    assert found.severity == "info"
    assert found.message.startswith("The task point is ")
    assert 2 < float(found.message.split()[4]) < 4
