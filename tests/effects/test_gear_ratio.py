"""Tests of gear ratios: a joint that rotates more than it records is detected and estimated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Recording, RobotState
from basecal.effects import gear_ratio as of
from basecal.effects.faces.effect import FoundEffect
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.simulation import Scenario, simulate
from made_views import moved_by_pose, views_of

SCENARIO = Scenario(samples=30, joints=True, robot_noise=(2e-5, 2e-5), position_m=0.3, spread_rad=0.8)
SHARE, JOINT = 0.004, 2


def record_short_angles():
    """Return a recording whose hand's third joint rotates by more than recorded."""
    made = simulate(SCENARIO, 3)
    samples = []
    for sample in made.recording.samples:
        joints = np.array(sample.robots["hand"].joints_rad)
        joints[JOINT] /= 1 + SHARE
        samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(joints_rad=joints)}))
    return made, Recording(tuple(samples))


def test_gear_ratio_rotates_joint_by_its_angle():
    """A share of each joint moves views like an arm whose joint rotated by that much more."""
    views = views_of(Scenario(samples=6, joints=True))
    (each,) = [c for c in of.candidates(views) if c.about[0] == "hand" and c.code == "gear-ratio"]
    shares = 1e-7 * np.arange(1.0, 7.0)
    moved = Kinematics(views.chains["hand"], {of.NAME: shares}).forward(views.groups[0].hand.joints)
    np.testing.assert_allclose(
        each.moves[0][..., 0].swapaxes(1, 2) @ shares, moved_by_pose(views, "hand", moved), atol=1e-11
    )


@pytest.mark.journey
def test_gear_ratio_is_estimated_with_prior():
    """The share is found within four sigmas if it has a prior, and the base is as accurate as with exact joints."""
    made, recording = record_short_angles()
    stated = {of.NAME: of.Stated(status="prior", sigma=0.01)}
    hand = replace(made.cell.robots["hand"], parameters=stated)
    cell = replace(made.cell, robots={**made.cell.robots, "hand": hand})
    found = calibrate(cell, recording)
    shares = found.robot_parameters[of.NAME]["hand"]
    assert abs(shares.values[JOINT] - SHARE) < 4 * shares.sigma[JOINT]
    assert shares.sigma[JOINT] < 0.25 * SHARE
    name = "eye_base_from_hand_base"
    off = (made.truth[name].inverse() @ found.transforms[name].mean).log()
    assert (
        off @ np.linalg.solve(found.transforms[name].covariance, off) < 22.5
    )  # 99.9 % limit of chi-square with 6 degrees of freedom


@pytest.mark.journey
def test_unstated_gear_ratio_error_is_detected():
    """The verdict is not good, and a finding blames the arm's model."""
    made, recording = record_short_angles()
    found = calibrate(made.cell, recording)
    assert found.verdict == "doubtful"
    (finding,) = [f for f in found.findings if f.code == "robot-model" and f.severity == "warning"]
    assert finding.about == ("hand",)


@pytest.mark.parametrize(("joint", "size", "what"), [
    (2, 0.004, "Joint 3 of hand rotates by 0.400 ± 0.010 % more than recorded."),
    (2, -0.004, "Joint 3 of hand rotates by 0.400 ± 0.010 % less than recorded."),
    (None, 0.004, "Gear ratios of hand are off; the clearest is that of joint 1, by 0.400 ± 0.010 %."),
])  # fmt: skip
def test_words(joint, size, what):
    """The size in percent, and an entry that does not contradict it."""
    found = FoundEffect(
        of.NAME, "gear-ratio", "hand", False, False, None, "", np.array([size]), np.array([[1e-8]]), np.zeros(6), joint
    )
    words = of.words(found)
    assert words.what == what
    assert "`gear_ratio: {status: prior, sigma: 0.01}`" in words.do[0]


def test_resting_joint_has_no_gear_ratio_candidate():
    """The ratio of a joint that hardly rotates equals an offset, so only the other joints are candidates."""
    views = views_of(SCENARIO)
    joints = np.array(views.groups[0].hand.joints)
    joints[:, 0] = 0.5 + 1e-3 * np.arange(len(joints))
    kept = of._turning_angles(None, joints)
    np.testing.assert_array_equal(kept[:, 0], 0.0)
    np.testing.assert_array_equal(kept[:, 1:], joints[:, 1:])
