"""Tests of the finding `prior-dominated` and its directions."""

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


def findings_of_mount(sigma, prior=PRIOR, status="prior", **changed):
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
def test_direction_is_reported_from_95_percent(axis):
    """A direction is reported if its posterior sigma exceeds 95 % of the prior: at 0.96, not at 0.94."""
    (finding,) = findings_of_mount(with_share(axis, 0.96))
    assert (finding.code, finding.severity, finding.about) == ("prior-dominated", "info", (MOUNT,))
    assert ("translation of camera" if axis < 3 else "rotation of camera") in finding.message
    assert finding.message.count("translation") + finding.message.count("rotation") == 1
    assert findings_of_mount(with_share(axis, 0.94)) == []


def test_directions_share_one_finding():
    """Two translations and a rotation known only from the prior share one finding."""
    sigma = GOOD.copy()
    sigma[[0, 1, 5]] = 10.0
    (finding,) = findings_of_mount(sigma)
    assert "any translation of camera perpendicular to (0.00, 0.00, 1.00)" in finding.message
    assert "rotation of camera about the axis" in finding.message


def test_improved_prior_is_not_reported():
    """A prior that the data improve is not reported, nor a transform without a prior, nor a failed solution."""
    assert findings_of_mount(GOOD) == []
    assert findings_of_mount(with_share(0, 0.5), status="free") == []
    assert findings_of_mount(with_share(0, 0.96), converged=False) == []


def test_led_offset_has_three_directions():
    """An LED offset has three directions and no rotation.

    It is known to 10 um beforehand, which a few views do not improve.
    """
    scenario = Scenario(samples=5, target="led", camera_mount="fixed", target_mount="prior", mount_prior=(1e-5, 1e-5))
    made = simulate(scenario, 0)
    (found,) = prior_dominated(SimpleNamespace(solution=solve(made.cell, made.recording), cell=made.cell))
    assert found.about[0] == "hand_flange_from_board"
    assert "any translation of board" in found.message
    assert "rotation of board" not in found.message
