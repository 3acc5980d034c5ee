"""What fields of errors add where flanges meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.task.arm_errors import ArmErrors
from basecal.accuracy.task.field_errors import field_covariance
from basecal.accuracy.task.meeting import Moves, make_meeting
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=12, robot_noise=(2e-4, 5e-4), position_m=0.03, spread_rad=0.3), 4)
SOLUTION = solve(MADE.cell, MADE.recording, Settings(robot_noise="stated"))
PLACES = SOLUTION.problem.robot_ends("hand")[0].base_from_flange.translation


def added(points_m, is_total=False, has_base=True):
    """What the field of the hand adds at its flange; beside the base, which takes up what all samples share."""
    robots = {name: replace(robot, is_total_noise=is_total) for name, robot in MADE.cell.robots.items()}
    name, cell = MADE.cell.requested_transforms[0], replace(MADE.cell, robots=robots)
    in_world = SOLUTION.state.transforms[name] @ points_m
    meeting = make_meeting(cell, SOLUTION.problem, SOLUTION.state, name, in_world)
    meeting = replace(meeting, places_m={"hand": points_m})
    if not has_base:
        vars(meeting)["moves"] = Moves(np.zeros((len(points_m), 6, 0)), np.zeros(0, dtype=np.int64))
    return field_covariance(meeting, ArmErrors(meeting.cell, SOLUTION, SOLUTION))


def test_far_from_samples_an_arm_errs_as_arms_do():
    """Two metres away all of the field's variance is there, and an axis may be long by so much of the distance."""
    far = added(PLACES + np.array([0.0, 0.0, 2.0]), has_base=False)
    np.testing.assert_allclose(far, far.mT, atol=1e-18)
    assert (np.linalg.eigvalsh(far) > -1e-18).all()
    assert far[:, 0, 0].min() > 1e-4**2
    assert (far[:, 2, 2] > 2 * far[:, 0, 0]).all()


def test_arms_whose_noise_is_total_have_none():
    """They are as accurate as they say."""
    assert not added(PLACES, is_total=True).any()


def test_what_the_answer_takes_up_counts_once():
    """Samples share most of a field, which moves the base instead: beside the base it adds less."""
    shared, alone = (np.trace(added(PLACES, has_base=each).mean(0)[:3, :3]) for each in (True, False))
    assert shared < 0.95 * alone
