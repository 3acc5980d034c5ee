"""What is known of a transform by its prior alone is told, along the directions in which it is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import MOUNT, pose_problem

from basecal.accuracy.findings.prior_dominated import prior_dominated
from basecal.cell import Unknown
from basecal.estimation.solve import solve, solve_from
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

PRIOR = np.full(6, 1e-2)
GOOD = np.full(6, 1e-3)
VIEWS = 4


def told(sigma, prior=PRIOR, status="prior", **changed):
    """Findings about a mount with a prior, seen as four poses with these sigmas."""
    problem, state = pose_problem(np.zeros((VIEWS, 6)), sigma, Unknown(status, SE3.identity(), prior))
    solution = replace(solve_from(problem, state), **changed)
    cell = SimpleNamespace(requested_transforms=[MOUNT], targets={}, cameras={}, mount_name=str)
    return prior_dominated(SimpleNamespace(solution=solution, cell=cell))


def with_share(axis, share):
    """Sigmas of poses that leave the posterior this share of the prior's sigma along one axis."""
    sigma = GOOD.copy()
    sigma[axis] = PRIOR[axis] * np.sqrt(VIEWS * share**2 / (1 - share**2))
    return sigma


@pytest.mark.parametrize("axis", range(6))
def test_one_direction_is_told_from_nineteen_twentieths_on(axis):
    """Where the posterior's sigma is 0.96 of the prior's there is a finding about it, at 0.94 there is none."""
    (finding,) = told(with_share(axis, 0.96))
    assert (finding.code, finding.severity, finding.about) == ("prior-dominated", "info", (MOUNT,))
    assert ("translation of camera" if axis < 3 else "rotation of camera") in finding.message
    assert finding.message.count("translation") + finding.message.count("rotation") == 1
    assert told(with_share(axis, 0.94)) == []


def test_directions_are_said_together():
    """Nothing but the prior along two shifts and a turn."""
    sigma = GOOD.copy()
    sigma[[0, 1, 5]] = 10.0
    (finding,) = told(sigma)
    assert "any translation of camera perpendicular to (0.00, 0.00, 1.00)" in finding.message
    assert "rotation of camera about the axis" in finding.message


def test_a_prior_that_the_data_improve_is_not_told():
    """Nor a transform without a prior, nor what is no answer."""
    assert told(GOOD) == []
    assert told(with_share(0, 0.5), status="free") == []
    assert told(with_share(0, 0.96), converged=False) == []


def test_the_offset_of_a_light_has_three_directions():
    """Known to ten micrometres beforehand, which a few views do not better: all of them are told, and no turn."""
    scenario = Scenario(samples=5, target="led", camera_mount="fixed", target_mount="prior", mount_prior=(1e-5, 1e-5))
    made = simulate(scenario, 0)
    (found,) = prior_dominated(SimpleNamespace(solution=solve(made.cell, made.recording), cell=made.cell))
    assert found.about[0] == "hand_flange_from_board"
    assert "any translation of board" in found.message
    assert "rotation of board" not in found.message
