"""Tests of `calibrate`: refused calibrations have a verdict and a reason, and no transform."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from basecal.accuracy.calibrate import Stage, _run_stages, calibrate
from basecal.accuracy.stages.case import Case
from basecal.cell import Recording, RobotState, Unknown
from basecal.cell.files import cell_from_dict
from basecal.cell.format.yaml_text import parse_yaml
from basecal.errors import FrameNotFound, InputError
from basecal.estimation.settings import Settings
from basecal.estimation.stages import Stages
from basecal.exchange.controller_poses import PoseStream
from basecal.exchange.importing.template import cell_text
from basecal.exchange.streams import recording_from_streams
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def codes(calibration) -> set[str]:
    return {f.code for f in calibration.findings}


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_samples_are_refused(count):
    """A recording without samples, or with one, is refused and gives no transform."""
    s = simulate(Scenario(), seed=0)
    calibration = calibrate(s.cell, Recording(s.recording.samples[:count]))
    assert calibration.verdict == "refused"
    assert codes(calibration) == {"too-few-samples"}
    assert not calibration.transforms


def test_findings_are_logged(caplog):
    """The verdict and each finding are logged, with the level of their severity."""
    s = simulate(Scenario(), seed=0)
    with caplog.at_level("INFO", logger="basecal"):
        calibrate(s.cell, Recording(()))
    levels = {record.getMessage().partition(":")[0]: record.levelname for record in caplog.records}
    assert levels["verdict"] == "INFO"
    assert levels["too-few-samples"] == "ERROR"


@pytest.mark.parametrize("count", [2, 3])
def test_two_or_three_samples_do_not_determine_free_mounts(count):
    """Two or three samples leave no redundant view for three free mounts, so no transform is given."""
    s = simulate(Scenario(), seed=0)
    calibration = calibrate(s.cell, Recording(s.recording.samples[:count]))
    assert calibration.verdict == "refused"
    assert codes(calibration) == {"too-few-samples"}
    with pytest.raises(FrameNotFound):
        calibration["eye_base_from_hand_base"]


def test_equal_samples_are_refused():
    """Twenty copies of one sample are one sample and are refused."""
    s = simulate(Scenario(), seed=0)
    alike = tuple(replace(s.recording.samples[0], sample=i) for i in range(20))
    calibration = calibrate(s.cell, Recording(alike))
    assert calibration.verdict == "refused"
    assert "too-few-samples" in codes(calibration)


@pytest.mark.journey
def test_still_eye_leaves_mount_and_base_unobservable():
    """With the eye at rest and its mount free, mount and base compensate each other; the target's mount is given."""
    s = simulate(Scenario(arms="eye_still"), seed=0)
    calibration = calibrate(s.cell, s.recording)
    assert calibration.verdict == "refused"
    (unseen,) = [f for f in calibration.findings if f.code == "unobservable-direction"]
    assert len(calibration.unobservable) == 2
    assert set(unseen.about) == {"eye_base_from_hand_base", "eye_flange_from_wrist"}
    assert list(calibration.transforms) == ["hand_flange_from_board"]


@pytest.mark.journey
def test_still_hand_with_known_base_leaves_mounts_observable():
    """With the base fixed, one moving arm shows both mounts; the convention of the still hand's pose stays open."""
    s = simulate(Scenario(arms="hand_still", base="fixed"), seed=0)
    calibration = calibrate(s.cell, s.recording)
    assert set(calibration.transforms) == set(s.truth)
    assert codes(calibration) == {"ambiguous-convention", "noise-not-identifiable"}


@pytest.mark.journey
def test_clean_cell_is_good_with_diagnostics():
    """A well-posed cell is good, with residuals, pose consistency errors and condition."""
    s = simulate(Scenario(), seed=0)
    calibration = calibrate(s.cell, s.recording)
    assert calibration.verdict == "good"
    assert calibration.residuals.rms_px == pytest.approx(0.2, rel=0.1)
    assert calibration.residuals.loop_rms_m is not None
    assert calibration.residuals.loop_rms_m < 5e-3
    assert len(calibration.residuals.per_sample) == 30
    assert np.isfinite(calibration.condition)
    assert calibration.joint_covariance.shape == (18, 18)


@pytest.mark.journey
def test_wrong_board_size_is_named():
    """Squares half as large as stated do not fit moving arms: refused, and the size is named."""
    s = simulate(Scenario(), seed=0)
    board = s.cell.targets["board"]
    wrong = replace(board, target=replace(board.target, points=2 * board.target.points))
    calibration = calibrate(replace(s.cell, targets={"board": wrong}), s.recording)
    assert calibration.verdict == "refused"
    assert codes(calibration) == {"board-size"}
    assert not calibration.transforms


@pytest.mark.journey
@pytest.mark.parametrize("arms", ["both", "stations"])
def test_fixed_cell_is_checked_as_stated(arms):
    """A cell with all transforms fixed is checked without an error: there is nothing to solve for."""
    settled = {"base": "fixed", "camera_mount": "fixed", "target_mount": "fixed"}
    s = simulate(Scenario(**settled, arms=arms, robot_noise=(1e-4, 2e-4)), seed=2)
    calibration = calibrate(s.cell, s.recording)
    assert calibration.verdict == "good"
    assert 0.1 < calibration.residuals.rms_px < 0.3


@pytest.mark.journey
def test_bumped_arm_is_named():
    """One pose of thirty 20 mm and 20 mrad off, with 0.1 mm of stated noise, is doubtful and its sample named."""
    s = simulate(Scenario(robot_noise=(1e-4, 2e-4)), seed=0)
    samples = list(s.recording.samples)
    eye = samples[12].robots["eye"].base_from_flange
    bumped = RobotState(eye @ SE3.exp([0.02, 0, 0, 0, 0.02, 0]))
    samples[12] = replace(samples[12], robots={**samples[12].robots, "eye": bumped})
    calibration = calibrate(s.cell, Recording(tuple(samples)))
    assert calibration.verdict == "doubtful"
    (finding,) = [f for f in calibration.findings if f.code == "outlier-samples"]
    assert "12" in finding.about


@pytest.mark.journey
def test_contradicted_sigmas_are_reported():
    """Pixels four times noisier than stated are a poor fit and doubtful, with sigmas of the true noise."""
    s = simulate(Scenario(pixel_px=0.8, samples=15), seed=0)
    wrong = calibrate(replace(s.cell, pixel_px=0.2), s.recording)
    true = calibrate(s.cell, s.recording)
    assert wrong.verdict == "doubtful"
    name = "eye_base_from_hand_base"
    assert "poor-fit" in codes(wrong)
    assert np.all(wrong[name].sigma_t > 0.8 * true[name].sigma_t)


@pytest.mark.journey
def test_loop_errors_use_recorded_poses():
    """Robots off by 0.3 mm per axis leave loop errors of about 0.3 sqrt(6) mm, though pixels fit to the noise."""
    s = simulate(Scenario(robot_noise=(3e-4, 0.0), samples=60), seed=0)
    fit = calibrate(s.cell, s.recording).residuals
    assert fit.rms_px == pytest.approx(0.2, rel=0.1)
    assert fit.loop_rms_m == pytest.approx(3e-4 * np.sqrt(6), rel=0.25)


@pytest.mark.slow
def test_unstated_robot_noise_is_estimated():
    """Unstated robot noise of 0.3 mm and 0.5 mrad is estimated, and the answer good.

    With robots assumed exact it is doubtful and scaled.
    """
    s = simulate(Scenario(robot_noise=(3e-4, 5e-4), state_robot_noise=False, samples=25), seed=0)
    found = calibrate(s.cell, s.recording)
    assert found.verdict == "good"
    for robot in ("eye", "hand"):
        # About 20 % sigma each (test_noise_model.py): five sigmas.
        np.testing.assert_allclose(found.noise["robots"][robot]["sigma_t_m"], [3e-4] * 3, rtol=0.9)
        np.testing.assert_allclose(found.noise["robots"][robot]["sigma_r_rad"], [5e-4] * 3, rtol=0.9)
    plain = calibrate(s.cell, s.recording, Settings(robot_noise="stated"))
    assert plain.verdict == "doubtful"
    assert "poor-fit" in codes(plain)
    base = found["eye_base_from_hand_base"]
    off = (base.mean.inverse() @ s.truth["eye_base_from_hand_base"]).log()
    assert (
        off @ np.linalg.solve(base.covariance, off) < 50
    )  # chi-square with 6 freedoms, exceeded with a chance of 5e-9


@pytest.mark.slow
def test_implausible_robot_noise_is_poor_fit():
    """Arms that stop anywhere within a centimetre need errors of millimetres: a poor fit, not explained by noise."""
    s = simulate(Scenario(samples=20, robot_noise=(8e-3, 2e-3), state_robot_noise=False), seed=0)
    calibration = calibrate(s.cell, s.recording)
    assert calibration.verdict != "good"
    assert "poor-fit" in codes(calibration)


@pytest.mark.journey
def test_few_stops_noise_is_partly_assumed():
    """With eleven stops the robots are not assumed exact, and a finding reports that their noise is partly a guess."""
    s = simulate(Scenario(robot_noise=(3e-4, 5e-4), state_robot_noise=False, samples=11), seed=0)
    found = calibrate(s.cell, s.recording)
    assert set(found.noise["robots"]) == {"eye", "hand"}
    (finding,) = [f for f in found.findings if f.code == "noise-not-identifiable"]
    assert finding.about == ("eye", "hand")
    assert "11 stops of eye" in finding.message


@pytest.mark.journey
def test_exact_rotations_are_good():
    """Rotations by quarter turns, with residuals of exactly zero, and translations off by a millimetre are good."""
    turns = [SE3.from_rpy(np.pi / 2 * np.array(n), np.zeros(3)).rotation.round() for n in product(range(4), repeat=3)]
    rng = np.random.default_rng(0)
    eye, hand = (SE3(np.array(turns)[rng.integers(64, size=80)], rng.normal(size=(80, 3))) for _ in range(2))
    eye_flange_from_camera = SE3(turns[5], np.array([0.1, 0.2, 0.05]))
    hand_flange_from_target = SE3(turns[7], np.array([0.0, 0.1, 0.05]))
    eye_base_from_hand_base = SE3(turns[11], np.array([1.2, -0.3, 0.1]))
    camera_from_target = (
        (eye @ eye_flange_from_camera).inverse() @ eye_base_from_hand_base @ hand @ hand_flange_from_target
    )
    off = camera_from_target.translation + 1e-3 * rng.normal(size=(80, 3))
    streams = [PoseStream(name, poses) for name, poses in (("eye", eye), ("hand", hand))]
    seen = PoseStream("seen", SE3(camera_from_target.rotation, off))
    recording = recording_from_streams({each.path: each for each in streams}, "camera", "target", seen)
    calibration = calibrate(cell_from_dict(parse_yaml(cell_text(2, "pose"), "cell.yaml").data), recording)
    assert calibration.verdict == "good"
    error = (calibration["eye_base_from_hand_base"].mean.inverse() @ eye_base_from_hand_base).log()
    assert np.linalg.norm(error[:3]) < 1e-3
    assert np.linalg.norm(error[3:]) < 1e-5


@pytest.mark.journey
def test_misleading_guesses_are_not_used():
    """Guesses rotated by 3 rad explain nothing, so the answer is that without them, and a finding reports it."""
    made = simulate(Scenario(samples=12), 3)
    away = SE3.from_rpy((0, 0, 0), (0, 0, 3.0))

    def far(name):
        return Unknown("free", made.truth[name] @ away)

    cell = replace(
        made.cell,
        bases={"hand": far("eye_base_from_hand_base")},
        cameras={"wrist": replace(made.cell.cameras["wrist"], mount=far("eye_flange_from_wrist"))},
        targets={"board": replace(made.cell.targets["board"], mount=far("hand_flange_from_board"))},
    )
    found = calibrate(cell, made.recording, Settings(start="guess"))
    assert found.verdict == "good"
    assert [finding.code for finding in found.findings] == ["better-optimum"]
    away_m = (found["eye_base_from_hand_base"].mean.inverse() @ made.truth["eye_base_from_hand_base"]).translation
    assert np.linalg.norm(away_m) < 4 * found["eye_base_from_hand_base"].sigma_t.max() + 1e-4


def test_misleading_guess_is_no_outlier():
    """A guess of the base alone that leads nowhere is reported as such; no sample is left out in its favour."""
    made = simulate(Scenario(samples=8, robot_noise=(1e-4, 2e-4)), 37)
    guesses = {name: Unknown("free", made.truth[name]) for name in made.cell.transforms}
    guesses["eye_base_from_hand_base"] = Unknown(
        "free", made.truth["eye_base_from_hand_base"] @ SE3.from_rotvec([0, 3, 0], [0, 0, 0])
    )
    cell = made.cell
    for name, guess in guesses.items():
        cell = cell.with_transform(name, guess)
    found = calibrate(cell, made.recording, Settings(start="guess"))
    assert found.verdict == "good"
    assert [finding.code for finding in found.findings] == ["better-optimum"]
    assert found.outliers == ()


def test_stages_run_in_order_until_end():
    """Stages run in order up to the one that ends the case; their time is counted by name."""
    made, seen = simulate(Scenario(samples=3), seed=0), []

    def stage(name, is_ended=False):
        def run(case):
            seen.append(name)
            return replace(case, is_ended=is_ended)

        return Stage(name, run)

    stages = Stages()
    case = Case(made.cell, made.recording, Settings(stages=stages))
    assert _run_stages([stage("first"), stage(""), stage("last", is_ended=True), stage("never")], case).is_ended
    assert seen == ["first", "", "last"]
    assert list(stages.seconds) == ["first", "last"]


def test_swapped_arguments_are_refused():
    """The error names the argument, its type and the expected one."""
    made = simulate(Scenario(samples=3), 0)
    with pytest.raises(InputError, match=r"^cell is of type Recording, expected Cell$"):
        calibrate(made.recording, made.cell)
    with pytest.raises(InputError, match=r"^settings is of type NoneType, expected Settings$"):
        calibrate(made.cell, made.recording, None)
