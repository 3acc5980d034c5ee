"""Tests of the choice of the robots' model on held-out samples."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.cross_validation import robot_model_selection as module
from basecal.accuracy.cross_validation.robot_model_selection import (
    Candidate,
    _is_promising,
    _Trials,
    choose_robot_model,
)
from basecal.accuracy.cross_validation.station_scores import StationScores
from basecal.accuracy.findings.robot_model import robot_model_findings
from basecal.accuracy.model_comparison.nested_models import Comparison, Decision
from basecal.accuracy.robot_parameters import robot_parameters
from basecal.effects import joint_offsets
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, SimulatedCell, simulate

ARMS = Scenario(samples=25, joints=True)
DEGREE = np.pi / 180


def with_one_offset(joint: int, rad: float) -> SimulatedCell:
    """A cell whose hand records one joint too small by `rad`."""
    made = simulate(ARMS, seed=2)
    samples = []
    for sample in made.recording.samples:
        hand = sample.robots["hand"]
        wrong = hand.joints_rad - rad * np.eye(6)[joint]
        samples.append(replace(sample, robots={**sample.robots, "hand": replace(hand, joints_rad=wrong)}))
    true = Kinematics(made.robots["hand"].chain, {"joint_offsets": rad * np.eye(6)[joint]})
    recording = replace(made.recording, samples=tuple(samples))
    return replace(made, recording=recording, robots={**made.robots, "hand": true})


@pytest.mark.journey
def test_single_joint_offset_is_named():
    """An offset of 0.3 deg of joint 3 is found alone, within four sigmas, with the entry to write."""
    made = with_one_offset(2, 0.3 * DEGREE)
    choice = choose_robot_model(solve(made.cell, made.recording))
    assert choice is not None
    assert (choice.chosen.kind, choice.chosen.robots, choice.chosen.joint) == ("joint", ("hand",), 2)
    assert choice.better is None  # no model predicts clearly better than the chosen one
    found = robot_parameters(choice.solution)["joint_offsets"]["hand"]
    assert abs(found.values[2] - 0.3 * DEGREE) < 4 * found.sigma[2] < 0.1 * DEGREE
    (finding,) = robot_model_findings(choice)
    assert (finding.code, finding.severity, finding.about) == ("robot-model", "warning", ("hand",))
    pattern = (
        r"Freeing the offset of joint 3 of hand lowers the cross-validation error from [\d.]+ to [\d.]+ mm rms\. "
        r"Its offset is 0\.\d\d ± [\d.]+"
    )
    assert re.match(pattern, finding.message)
    # As wide as the found offset: 0.3 deg are 0.0052 rad, rounded up.
    assert "joint_offsets: {status: prior, sigma_rad: 0.006}" in finding.message


@pytest.mark.journey
def test_calibrate_reports_model_without_applying_it():
    """The calibration is doubtful because of the robot, and its base is that of the stated robots within a sigma."""
    made = with_one_offset(2, 0.3 * DEGREE)
    calibration = calibrate(made.cell, made.recording, Settings(robot_noise="stated"))
    assert calibration.verdict == "doubtful"
    assert "robot-model" in {f.code for f in calibration.findings}
    assert calibration.robot_parameters == {}
    as_stated = solve(made.cell, made.recording)
    base, expected = calibration["eye_base_from_hand_base"], as_stated.transforms["eye_base_from_hand_base"]
    off = (base.mean.inverse() @ expected.mean).log()
    assert off @ np.linalg.solve(base.covariance, off) < 1


@pytest.mark.journey
@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
@pytest.mark.parametrize(
    ("kind", "errors"),
    [("none", {}), ("offsets", {"joint_offset_rad": 0.2 * DEGREE}), ("links", {"link_error": (5e-4, 1e-3)})],
)
def test_true_robot_model_is_chosen(kind, errors, seed):
    """The true model is chosen for stated robots, offsets and link errors; the benchmark has 200 cells."""
    made = simulate(replace(ARMS, samples=60, **errors), seed)
    choice = choose_robot_model(solve(made.cell, made.recording))
    assert (choice.chosen.kind if choice else "none") == kind


@pytest.mark.journey
@pytest.mark.parametrize(("stated", "offset_deg", "kinds"), [(True, 0.2, {"offsets"}), (False, 0.0, {"none"})])
def test_alternating_arms_do_not_mislead_choice(stated, offset_deg, kinds):
    """Arms that rest alternately do not mislead the choice, with errors of 0.1 mm and 0.1 mrad.

    Half the samples share one stop of the hand, the others one of the eye. Stated errors do not hide offsets; unstated
    ones are not mistaken for offsets.
    """
    scenario = replace(ARMS, samples=60, arms="halves", robot_noise=(1e-4, 1e-4), state_robot_noise=stated)
    made = simulate(replace(scenario, joint_offset_rad=offset_deg * DEGREE), 1)
    choice = choose_robot_model(solve(made.cell, made.recording))
    assert (choice.chosen.kind if choice else "none") in kinds


@pytest.mark.journey
def test_poses_or_estimated_offsets_leave_no_choice():
    """Robots with poses, with estimated offsets, or with few samples have no model to compare with."""
    posed = simulate(Scenario(samples=20), 0)
    asked = simulate(replace(ARMS, joint_offset_rad=0.2 * DEGREE, joint_offsets="prior"), 0)
    few = simulate(replace(ARMS, samples=12, joint_offset_rad=0.2 * DEGREE), 0)
    for made in (posed, asked, few):
        assert choose_robot_model(solve(made.cell, made.recording)) is None


@pytest.mark.parametrize(
    ("offsets_deg", "sigma_rad"), [([], 0.005), ([0.1, -0.2], 0.005), ([1.9, -0.3], 0.04), ([-8.0], 0.2)]
)
def test_suggested_sigma_covers_found_offset(offsets_deg: list[float], sigma_rad: float) -> None:
    """The suggested sigma is as wide as the largest offset, and at least the usual one of arms."""
    assert joint_offsets.suggested_sigma(DEGREE * np.array(offsets_deg)) == sigma_rad


@pytest.mark.parametrize(("gain", "is_promising"), [(2 * (8 + 23.9), False), (2 * (8 + 24.1), True)])
def test_promising_model_gains_six_sigmas(gain, is_promising):
    """A promising model gains over six sigmas of chance.

    Eight columns lower a cost by eight times what a freedom leaves, with a sigma of four; here that is two.
    """
    richest = SimpleNamespace(cost=200.0, dof=100)
    assert _is_promising(200.0 + gain, richest, 8) == is_promising
    assert not _is_promising(0.0, SimpleNamespace(cost=0.0, dof=0), 8)
    assert _is_promising(10.0 + 5 * gain, SimpleNamespace(cost=10.0, dof=0), 8) == is_promising  # counts as one freedom


def list_candidates(means, robots=("eye", "hand")):
    """Kinds and robots of the tried candidates, in order, by mean scores; the default is 1."""
    trials = _Trials(None, dict.fromkeys(robots), None, None, 0)
    spread = np.linspace(-0.01, 0.01, 21)  # sums to zero

    def scored(kind, robots, joint=None):
        """As `_Trials.scored`."""
        name = "-".join([kind, *robots, *([] if joint is None else [str(joint)])])
        mean = means.get(name, 1.0)
        return Candidate(kind, robots, joint, mean + (mean != 1.0) * spread, None, 1.0)

    stand_in = SimpleNamespace(chains=trials.chains, score=scored, likeliest_joints=lambda: [("eye", 2), ("hand", 0)])
    return [(c.kind, c.robots, c.joint) for c in _Trials.candidates(stand_in)]


BOTH = ("eye", "hand")


@pytest.fixture(scope="module")
def solution():
    """A solution of as few views as may be enough."""
    made = simulate(replace(ARMS, samples=15), 0)
    return solve(made.cell, made.recording)


@pytest.mark.parametrize("better", ["offsets-eye-hand", "links-eye-hand"])
def test_simpler_models_are_tried_if_richer_help(better):
    """If a richer model helps, single joints and then one robot's offsets are tried, the better first."""
    ends = [("offsets", BOTH, None), ("links", BOTH, None)]
    assert list_candidates({}) == [("none", (), None), *ends]
    found = list_candidates({better: 0.5, "joint-hand-0": 0.6, "offsets-hand": 0.7})
    assert found == [
        ("none", (), None),
        ("joint", ("hand",), 0),
        ("joint", ("eye",), 2),
        ("offsets", ("hand",), None),
        ("offsets", ("eye",), None),
        *ends,
    ]
    assert list_candidates({better: 1.5}) == [("none", (), None), *ends]
    one = list_candidates({better.replace("-hand", ""): 0.5}, ("eye",))
    assert [kind for kind, _, _ in one] == ["none", "joint", "joint", "offsets", "links"]


@pytest.mark.parametrize(("decision", "kept"), [(Decision.KEEP, 3), (Decision.UNDECIDED, 5), (Decision.TAKE, 5)])
def test_simpler_models_are_tried_if_richer_undecided(monkeypatch, decision, kept):
    """Simpler models are tried if the richer one is taken or undecided."""
    monkeypatch.setattr(module, "compare_predicted_gains", lambda gains: Comparison(0.0, 0.0, decision))
    assert len(list_candidates({}, ("eye",))) == kept


@pytest.mark.parametrize(("behind", "chosen", "better"), [
    ("tuk", 1, True), ("uuk", 0, True), ("ukk", 0, True), ("kkk", 0, False), ("ttk", 2, False), ("tkk", 1, False),
])  # fmt: skip
def test_simplest_model_not_clearly_worse_is_chosen(monkeypatch, solution, behind, chosen, better):
    """The simplest model that is not clearly worse is chosen, and the best is named beside it if it may be better."""
    decisions = {"t": Decision.TAKE, "u": Decision.UNDECIDED, "k": Decision.KEEP}
    found = [
        Candidate(kind, ("hand",) if kind != "none" else (), None, np.array([float(score)]), None, 1.0)
        for kind, score in zip(("none", "offsets", "links"), (2, 1, 0), strict=True)
    ]
    monkeypatch.setattr(module, "_is_promising", lambda *given: True)
    monkeypatch.setattr(module, "solve_from", lambda problem, state, settings: solution)
    monkeypatch.setattr(module._Trials, "candidates", lambda trials: found)
    compared = {2.0 - k: Comparison(0.0, 0.0, decisions[each]) for k, each in enumerate(behind)}
    monkeypatch.setattr(module, "compare_predicted_gains", lambda gains: compared[float(gains[0])])
    choice = choose_robot_model(solution)
    assert choice.chosen is found[chosen]
    assert choice.better is (found[2] if better else None)
    assert choice.candidates == tuple(found)


@pytest.mark.parametrize(("distance_m", "error_m"), [([3.0, 4.0], 12.5**0.5), ([3.0, np.nan], None), ([], None)])
def test_candidate_has_held_out_station_errors(monkeypatch, distance_m, error_m):
    """A candidate has the rms of held-out stations, in lengths if every view has one, and each station's score."""
    scores = StationScores(np.array([0.1, 0.2]), 0.25, np.array(distance_m))
    monkeypatch.setattr(module, "_candidate_models", lambda problem, chains, candidate: candidate.kind)
    monkeypatch.setattr(module, "score_stations", lambda modelled, state, split, steps: scores if steps == 7 else None)
    trials = _Trials(SimpleNamespace(with_models=lambda models: models), {}, None, None, 7)
    found = trials.score("joint", ("hand",), 2)
    assert (found.kind, found.robots, found.joint, found.rms) == ("joint", ("hand",), 2, 0.5)
    assert found.scores is scores.scores
    assert found.error_m == (None if error_m is None else pytest.approx(error_m))


def test_promise_counts_additional_columns(monkeypatch, solution):
    """The richest model is compared with the fit of the model in use, by its additional columns."""
    given = []
    monkeypatch.setattr(module, "_is_promising", lambda *words: given.append(words) or False)
    assert choose_robot_model(solution) is None
    ((cost, richest, columns),) = given
    assert columns == richest.problem.width - solution.problem.width > 12
    assert richest.cost < cost
