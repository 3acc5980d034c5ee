"""The robots' model is chosen on samples left out."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.cross_validation.robot_model_selection import choose_robot_model, suggested_sigma
from basecal.accuracy.findings.robot_model import robot_model_findings
from basecal.accuracy.robot_parameters import robot_parameters
from basecal.accuracy.verdict import calibrate
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, SimulatedCell, simulate

ARMS = Scenario(samples=25, joints=True)
DEGREE = np.pi / 180


def with_one_offset(joint: int, rad: float) -> SimulatedCell:
    """A cell whose hand records one joint wrongly: what it says is `rad` less than where it is."""
    made = simulate(ARMS, seed=2)
    samples = []
    for sample in made.recording.samples:
        hand = sample.robots["hand"]
        wrong = hand.joints_rad - rad * np.eye(6)[joint]
        samples.append(replace(sample, robots={**sample.robots, "hand": replace(hand, joints_rad=wrong)}))
    true = Kinematics(made.robots["hand"].chain, {"joint_offsets": rad * np.eye(6)[joint]})
    recording = replace(made.recording, samples=tuple(samples))
    return replace(made, recording=recording, robots={**made.robots, "hand": true})


def test_one_joint_that_is_off_is_named_with_its_offset():
    """Joint 3 of the hand by 0.3 deg: found alone, its offset within four sigmas, and what to write."""
    made = with_one_offset(2, 0.3 * DEGREE)
    choice = choose_robot_model(solve(made.cell, made.recording))
    assert choice is not None
    assert (choice.chosen.kind, choice.chosen.robots, choice.chosen.joint) == ("joint", ("hand",), 2)
    assert choice.better is None  # nothing predicts clearly better than the simplest that is not clearly worse
    found = robot_parameters(choice.solution)["joint_offsets"]["hand"]
    assert abs(found.values[2] - 0.3 * DEGREE) < 4 * found.sigma[2] < 0.1 * DEGREE
    (finding,) = robot_model_findings(choice)
    assert (finding.code, finding.severity, finding.about) == ("robot-model", "warning", ("hand",))
    said = (
        r"freeing joint 3 of hand lowers the cross-validation error from [\d.]+ to [\d.]+ mm rms: "
        r"its offset is 0\.\d\d \+/- [\d.]+"
    )
    assert re.match(said, finding.message)
    # As wide as what was found: 0.3 deg are 0.0052 rad, rounded up.
    assert "joint_offsets: {status: prior, sigma_rad: 0.006}" in finding.message


def test_calibrate_tells_it_and_applies_nothing():
    """The calibration is doubtful for the robot's sake, and its transforms are those of the robots as stated."""
    made = with_one_offset(2, 0.3 * DEGREE)
    calibration = calibrate(made.cell, made.recording, Settings(robot_noise="stated"))
    assert calibration.verdict == "doubtful"
    assert "robot-model" in {f.code for f in calibration.findings}
    assert calibration.robot_parameters == {}
    as_stated = solve(made.cell, made.recording)
    np.testing.assert_allclose(
        calibration["eye_base_from_hand_base"].mean.matrix,
        as_stated.transforms["eye_base_from_hand_base"].mean.matrix,
        atol=1e-9,
    )


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
@pytest.mark.parametrize(
    ("kind", "errors"),
    [("none", {}), ("offsets", {"joint_offset_rad": 0.2 * DEGREE}), ("links", {"link_error": (5e-4, 1e-3)})],
)
def test_the_model_that_is_true_is_chosen(kind, errors, seed):
    """Robots as stated, offsets, link errors; the benchmark has 200 cells."""
    made = simulate(replace(ARMS, samples=60, **errors), seed)
    choice = choose_robot_model(solve(made.cell, made.recording))
    assert (choice.chosen.kind if choice else "none") == kind


@pytest.mark.parametrize(("stated", "offset_deg", "kinds"), [(True, 0.2, {"offsets"}), (False, 0.0, {"none"})])
def test_an_arm_that_stands_still_while_the_other_moves_misleads_nobody(stated, offset_deg, kinds):
    """Half the samples share one stop of the hand, the others one of the eye, with errors of 0.1 mm and 0.1 mrad.

    Stated, the errors do not hide offsets; not stated, they are not taken for offsets.
    """
    scenario = replace(ARMS, samples=60, arms="halves", robot_noise=(1e-4, 1e-4), state_robot_noise=stated)
    made = simulate(replace(scenario, joint_offset_rad=offset_deg * DEGREE), 1)
    choice = choose_robot_model(solve(made.cell, made.recording))
    assert (choice.chosen.kind if choice else "none") in kinds


def test_there_is_nothing_to_choose_where_poses_are_recorded_or_offsets_estimated():
    """Neither has a model to compare with."""
    posed = simulate(Scenario(samples=20), 0)
    asked = simulate(replace(ARMS, joint_offset_rad=0.2 * DEGREE, joint_offsets="prior"), 0)
    few = simulate(replace(ARMS, samples=12, joint_offset_rad=0.2 * DEGREE), 0)
    for made in (posed, asked, few):
        assert choose_robot_model(solve(made.cell, made.recording)) is None


@pytest.mark.parametrize(
    ("offsets_deg", "sigma_rad"), [([], 0.005), ([0.1, -0.2], 0.005), ([1.9, -0.3], 0.04), ([-8.0], 0.2)]
)
def test_a_suggested_sigma_does_not_contradict_what_was_found(offsets_deg: list[float], sigma_rad: float) -> None:
    """It is as wide as the largest offset, and never less than what is usual of arms."""
    assert suggested_sigma(DEGREE * np.array(offsets_deg)) == sigma_rad
