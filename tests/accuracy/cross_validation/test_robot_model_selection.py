"""The robots' model is chosen on samples left out, and gauges are never called estimated."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from tests.evidence import evidence_of

from basecal.accuracy.cross_validation.robot_model_selection import choose_robot_model
from basecal.accuracy.findings.joint_parameters import unobserved_joint_parameters
from basecal.accuracy.findings.robot_model import robot_model_findings
from basecal.accuracy.robot_parameters import deflection, joint_offsets, link_parameters
from basecal.accuracy.verdict import calibrate
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, SimulatedCell, simulate

ARMS = Scenario(samples=40, joints=True)
DEGREE = np.pi / 180
ENDS = [False, True, True, True, True, False]


def with_one_offset(joint: int, rad: float) -> SimulatedCell:
    """A cell whose hand records one joint wrongly: what it says is `rad` less than where it is."""
    made = simulate(ARMS, seed=2)
    samples = []
    for sample in made.recording.samples:
        hand = sample.robots["hand"]
        wrong = hand.joints_rad - rad * np.eye(6)[joint]
        samples.append(replace(sample, robots={**sample.robots, "hand": replace(hand, joints_rad=wrong)}))
    true = Kinematics(made.robots["hand"].chain, rad * np.eye(6)[joint], np.zeros((7, 6)))
    recording = replace(made.recording, samples=tuple(samples))
    return replace(made, recording=recording, robots={**made.robots, "hand": true})


def test_one_joint_that_is_off_is_named_with_its_offset():
    """Joint 3 of the hand by 0.3 deg: found alone, its offset within four sigmas, and what to write."""
    made = with_one_offset(2, 0.3 * DEGREE)
    choice = choose_robot_model(solve(made.cell, made.recording))
    assert choice is not None
    assert (choice.chosen.kind, choice.chosen.robots, choice.chosen.joint) == ("joint", ("hand",), 2)
    found = joint_offsets(choice.solution)["hand"]
    assert abs(found.rad[2] - 0.3 * DEGREE) < 4 * found.sigma_rad[2] < 0.1 * DEGREE
    (finding,) = robot_model_findings(choice)
    assert (finding.code, finding.severity, finding.about) == ("robot-model", "warning", ("hand",))
    said = (
        r"freeing joint 3 of hand lowers the cross-validation error from [\d.]+ to [\d.]+ mm rms: "
        r"its offset is 0\.\d\d \+/- [\d.]+"
    )
    assert re.match(said, finding.message)
    assert "joint_offsets: {status: prior, sigma_rad: 0.005}" in finding.message


def test_calibrate_tells_it_and_applies_nothing():
    """The calibration is doubtful for the robot's sake, and its transforms are those of the robots as stated."""
    made = with_one_offset(2, 0.3 * DEGREE)
    calibration = calibrate(made.cell, made.recording, Settings(robot_noise="stated"))
    assert calibration.verdict == "doubtful"
    assert "robot-model" in {f.code for f in calibration.findings}
    assert calibration.joint_offsets == {}
    as_stated = solve(made.cell, made.recording)
    np.testing.assert_array_equal(
        calibration["eye_base_from_hand_base"].mean.matrix,
        as_stated.transforms["eye_base_from_hand_base"].mean.matrix,
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


def test_first_and_last_joint_are_known_by_their_prior_alone():
    """Their sigma is the prior's, they are not seen, and a finding names them; the base's sigma holds the first's."""
    made = simulate(replace(ARMS, joint_offset_rad=0.2 * DEGREE, joint_offsets="prior"), 0)
    solution = solve(made.cell, made.recording)
    for offsets in joint_offsets(solution).values():
        assert offsets.seen.tolist() == ENDS
        np.testing.assert_allclose(offsets.sigma_rad[[0, 5]], 0.2 * DEGREE, rtol=1e-6)
        assert np.all(offsets.sigma_rad[1:5] < 0.1 * DEGREE)
    messages = [f.message for f in unobserved_joint_parameters(evidence_of(made.cell, solution))]
    assert all("joints 1 (shoulder_pan) and 6 (wrist_3)" in message for message in messages)
    assert len(messages) == 2
    turn = np.linalg.norm(solution.transforms["eye_base_from_hand_base"].sigma_r)
    as_stated = replace(
        made.cell, robots={n: replace(r, joint_offsets=ARMS_FIXED) for n, r in made.cell.robots.items()}
    )
    alone = np.linalg.norm(solve(as_stated, made.recording).transforms["eye_base_from_hand_base"].sigma_r)
    assert turn > np.sqrt(2) * 0.19 * DEGREE > 3 * alone


ARMS_FIXED = simulate(replace(ARMS, samples=3), 0).cell.robots["eye"].joint_offsets


def test_a_known_mount_shows_the_last_joint():
    """With the camera's mount fixed the eye's last offset is seen; with the base fixed too, its first."""
    fixed = replace(ARMS, joint_offset_rad=0.2 * DEGREE, joint_offsets="prior", camera_mount="fixed")
    made = simulate(fixed, 0)
    assert joint_offsets(solve(made.cell, made.recording))["eye"].seen.tolist() == [False, True, True, True, True, True]
    made = simulate(replace(fixed, base="fixed", target_mount="fixed"), 0)
    assert all(of.seen.all() for of in joint_offsets(solve(made.cell, made.recording)).values())


def test_free_offsets_that_nothing_shows_have_no_number():
    """First and last are NaN with free ends, and a still arm's are all."""
    free = replace(ARMS, joint_offset_rad=0.2 * DEGREE, joint_offsets="free")
    made = simulate(free, 0)
    found = joint_offsets(solve(made.cell, made.recording))
    for offsets in found.values():
        assert np.isfinite(offsets.rad).tolist() == ENDS == np.isfinite(offsets.sigma_rad).tolist()
    still = simulate(replace(free, arms="eye_still", camera_mount="fixed"), 0)
    found = joint_offsets(solve(still.cell, still.recording))
    assert not np.any(np.isfinite(found["eye"].rad))
    assert np.isfinite(found["hand"].rad).tolist() == ENDS


def test_compliances_are_found_where_gravity_shows_them():
    """Of joints 2 and 3 within four sigmas; the upright first axis has none to find, and a finding says so."""
    made = simulate(replace(ARMS, compliance=1e-4, deflection="prior"), 0)
    solution = solve(made.cell, made.recording)
    for robot, found in deflection(solution).items():
        assert found.seen[1:3].all()
        assert not found.seen[0]
        off = np.abs(found.rad_per_nm - made.robots[robot].compliance)
        assert np.all(off[found.seen] < 4 * found.sigma[found.seen])
    (first, _) = unobserved_joint_parameters(evidence_of(made.cell, solution))
    assert (first.code, first.about) == ("prior-dominated", ("eye",))
    assert "compliances known from their prior alone: joints 1 (shoulder_pan)" in first.message


@pytest.mark.slow
@pytest.mark.parametrize("target", ["charuco", "led"])
def test_errors_of_the_base_and_of_seen_offsets_are_as_their_covariance_says(target):
    """Over 60 cells with stops of 0.1 mm and 0.1 mrad: chi-square of the base, and of the hand's seen offsets.

    The bands hold all but one in a million of such sums.
    """
    scenario = replace(ARMS, target=target, robot_noise=(1e-4, 1e-4))
    squares, freedoms = np.zeros(2), np.zeros(2)
    for seed in range(60):
        made = simulate(replace(scenario, joint_offset_rad=0.2 * DEGREE, joint_offsets="prior"), seed)
        solution = solve(made.cell, made.recording)
        base, found = solution.transforms["eye_base_from_hand_base"], joint_offsets(solution)["hand"]
        xi = (base.mean.inverse() @ made.truth["eye_base_from_hand_base"]).log()
        off = (found.rad - made.robots["hand"].offsets)[found.seen]
        spread = found.covariance[np.ix_(found.seen, found.seen)]
        squares += xi @ np.linalg.solve(base.covariance, xi), off @ np.linalg.solve(spread, off)
        freedoms += 6, len(off)
    assert np.all(chi2.ppf(5e-7, freedoms) < squares)
    assert np.all(squares < chi2.isf(5e-7, freedoms))


def test_link_parameters_come_with_sigmas_that_hold_them():
    """By a prior, all 84 of two arms: the chi-square of their errors by their sigmas is near what it should be.

    Each error over its sigma has unit variance; correlated, so that the band of their mean square is wide: the prior's
    own directions alone, two thirds of them, have a standard error of 0.2.
    """
    made = simulate(replace(ARMS, link_error=(5e-4, 1e-3), link_parameters="prior"), 0)
    found = link_parameters(solve(made.cell, made.recording))
    errors = [(found[r].tangents - made.robots[r].links) / found[r].sigma for r in found]
    assert 0.4 < np.mean(np.square(errors)) < 1.8
