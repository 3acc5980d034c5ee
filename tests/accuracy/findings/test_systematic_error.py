"""`length-scale`, `clock-offset`, `base-moved`, `drift`, `deflection` in words."""

from dataclasses import replace

import numpy as np
import pytest
from tests.shared.rewriting import resized

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings.systematic_error import _answer_sentence, deduplicate_size_findings, systematic_error
from basecal.cell import Finding
from basecal.effects.faces.effect import FoundEffect
from basecal.effects.registry import CONTAINED
from basecal.simulation import Scenario, simulate

EFFECT = {
    "length-scale": "length_scale",
    "clock-offset": "clock_offset",
    "clock-drift": "clock_drift",
    "base-moved": "step",
    "drift": "drift",
    "joint-offset": "joint_offsets",
    "joint-offsets": "joint_offsets",
}


def found(code, size, sigma, about="hand", unit="", since=None, kind=None):
    effect = {"rad/Nm": "deflection", "": "bending"}[unit] if code == "deflection" else EFFECT[code]
    effect = "target_size" if kind == "target" else effect
    covariance = np.diag(np.broadcast_to(sigma, (len(size),)) ** 2.0)
    return FoundEffect(
        effect,
        code,
        about,
        kind == "camera",
        kind == "target",
        since,
        unit,
        np.array(size, dtype=float),
        covariance,
        np.zeros(6),
    )


STEP = found("base-moved", [2e-3, 0, 0, 0, 0, 0], 1e-4, "eye_base", since=4)
BOARD = found("length-scale", [-1e-2], 1e-3, "board", kind="target")
WORDS = {
    "short": (found("length-scale", [1e-3], 1e-4), "Poses of hand are 0.100 ± 0.010 % too short"),
    "long": (found("length-scale", [-2.5e-3], 2e-3), "Poses of hand are 0.25 ± 0.20 % too long"),
    "short, or a target": (
        replace(found("length-scale", [1e-2], 1e-3), alternatives=(BOARD,)),
        "Poses of hand are 1.00 ± 0.10 % too short, or board is 1.00 ± 0.10 % smaller than stated.",
    ),
    "larger": (found("length-scale", [0.02], 1e-3, "board", kind="target"), "board is 2.00 ± 0.10 % larger"),
    "smaller": (found("length-scale", [-0.02], 1e-3, "board", kind="target"), "board is 2.00 ± 0.10 % smaller"),
    "late": (
        found("clock-offset", [-0.021], 1e-3, "wrist", "s", kind="camera"),
        "Images of wrist lag behind the other devices by 21.0 ± 1.0 ms",
    ),
    "early": (
        found("clock-offset", [0.021], 1e-3, "wrist", "s", kind="camera"),
        "Images of wrist run ahead of the other devices by 21.0 ± 1.0 ms",
    ),
    "robot late": (
        found("clock-offset", [0.5], 0.1, "eye", "samples"),
        "Poses of eye lag behind the other devices by 0.50 ± 0.10 samples",
    ),
    "camera drifts": (
        found("clock-drift", [-0.021], 1e-3, "wrist", "s", kind="camera"),
        "The clock of wrist drifts: its images fall behind the other devices by 21.0 ± 1.0 ms from first to last",
    ),
    "robot drifts": (
        found("clock-drift", [-0.021], 1e-3, "eye", "s"),
        "The clock of eye drifts: its poses run ahead of the other devices by 21.0 ± 1.0 ms from first to last",
    ),
    "step": (
        found("base-moved", [3e-3, 4e-3, 0, 0, 0, np.radians(0.5)], 1e-3, "hand_base", since=12),
        "hand_base moved by 5.0 ± 1.0 mm and 0.500 ± 0.057 deg at about sample 12",
    ),
    "drift": (
        found("drift", [0, 0, -2e-3, 0, np.radians(-0.1), 0], 1e-3, "hand_base"),
        "hand_base drifts by 2.0 ± 1.0 mm and 0.100 ± 0.057 deg from the first sample to the last",
    ),
    "yield": (
        found("deflection", [3e-5, 4e-5, 0, 0], 2e-6, unit="rad/Nm"),
        "Joints of hand yield by 25.0 ± 1.0 urad per Nm of the torque",
    ),
    "bend": (found("deflection", [0, 0, -2e-3], 1e-4), "hand bends by 2.00 ± 0.10 mrad per metre of reach"),
}


@pytest.mark.parametrize("kind", WORDS)
def test_words(evidence, monkeypatch, kind):
    """Each is a warning about whom it concerns, with its size, its sigma in the same unit, and its direction."""
    error, words = WORDS[kind]
    monkeypatch.setattr("basecal.accuracy.findings.systematic_error.describe_gravity", lambda *_: "gravity pulls")
    (finding,) = systematic_error(evidence(systematic_error=error))
    code = {"clock-drift": "clock-offset"}.get(error.code, error.code)
    about = (error.about, *(each.about for each in error.alternatives))
    assert (finding.code, finding.severity, finding.about) == (code, "warning", about)
    assert words in finding.message
    assert ("gravity pulls" in finding.message) == (error.unit == "rad/Nm")


def test_a_joint_that_is_off_is_said_once(evidence, monkeypatch):
    """Its offset and what to write; nothing where the choice of robot models names its robots already."""
    error = replace(found("joint-offset", [np.radians(0.25)], np.radians(0.01)), joint=2)
    (finding,) = systematic_error(evidence(systematic_error=error))
    assert (finding.code, finding.severity, finding.about) == ("robot-model", "warning", ("hand",))
    assert "Joint 3 of hand is off by 0.250 ± 0.010 deg" in finding.message
    monkeypatch.setattr("basecal.accuracy.findings.systematic_error.robot_model", lambda of: [finding])
    assert systematic_error(evidence(systematic_error=error)) == []
    bent, _ = WORDS["bend"]
    assert len(systematic_error(evidence(systematic_error=bent))) == 1


def test_several_joints_that_are_off(evidence, monkeypatch):
    """The one that stands out most from its sigma, and a prior that the largest does not contradict; said once."""
    error = found("joint-offsets", np.radians([0.1, -0.3, 0.7]), np.radians([0.01, 0.02, 0.3]))
    (finding,) = systematic_error(evidence(systematic_error=error))
    assert (finding.code, finding.severity, finding.about) == ("robot-model", "warning", ("hand",))
    assert "Several joints of hand are off; the clearest is joint 2, by -0.300 ± 0.020 deg" in finding.message
    assert "sigma_rad: 0.02}" in finding.message
    monkeypatch.setattr("basecal.accuracy.findings.systematic_error.robot_model", lambda of: [finding])
    assert systematic_error(evidence(systematic_error=error)) == []


def test_the_covariance_of_joints_that_are_degrees_off_is_not_promised(evidence):
    """Bases of arms whose joints are 1 deg off are within it, those of 2 deg are not."""
    for size, words in ((0.017, "its covariance is wider"), (0.035, "Its covariance may be too small")):
        effect = found("joint-offsets", [1e-3, -size], 1e-3, unit="rad")
        (finding,) = systematic_error(evidence(systematic_error=effect))
        assert words in finding.why


def test_nothing_found_is_silent(evidence):
    """Without an error there is no finding."""
    assert systematic_error(evidence()) == []


def test_what_may_be_chance_is_an_info(evidence):
    """It is not stated as a fact: its probability is given, the covariance contains it, and the verdict stays."""
    error, words = WORDS["short"]
    (finding,) = systematic_error(evidence(systematic_error=replace(error, is_certain=False, probability=0.855)))
    assert (finding.code, finding.severity) == ("length-scale", "info")
    assert finding.what.startswith(f"Perhaps chance: {words}")
    assert finding.why == (
        "It is real with a probability of 86 % at most. The covariance and the expected errors contain it."
    )
    (certain,) = systematic_error(evidence(systematic_error=error))
    assert certain.what.startswith(words)


def test_effects_that_the_data_do_not_tell_apart_are_all_named(evidence):
    """Each with what to do, once, and whom it is about."""
    drift = replace(found("drift", [0, 0, -2e-3, 0, np.radians(-0.1), 0], 1e-3, "hand_base"), alternatives=(STEP,))
    (finding,) = systematic_error(evidence(systematic_error=drift))
    assert (finding.code, finding.about) == ("drift", ("hand_base", "eye_base"))
    assert "from the first sample to the last, or eye_base moved by 2.00" in finding.message
    assert "The data do not distinguish these." in finding.message
    for do in ("Let robots and camera warm up.", "Check what was bumped", "Calibrate again when it is fixed."):
        assert finding.message.count(do) == 1


@pytest.mark.parametrize("code", ["clock-offset", "clock-drift"])
@pytest.mark.parametrize(("kind", "size", "late"), [
    ("camera", -3e-4, True), ("camera", 3e-4, False), ("robot", 3e-4, True), ("robot", -3e-4, False),
])  # fmt: skip
def test_who_is_late_goes_by_the_sign_alone(evidence, code, kind, size, late):
    """Images to be stamped earlier and poses to be read later are late, by however little."""
    error = found(code, [size], 1e-5, "device", "s", kind=kind)
    (finding,) = systematic_error(evidence(systematic_error=error))
    way = {"clock-offset": "lag behind", "clock-drift": "fall behind"}[code] if late else "run ahead of"
    assert ("images" if kind == "camera" else "poses") in finding.message.lower()
    assert f" {way} the other devices by 0.300 ± 0.010 ms" in finding.message


def test_fractions_are_given_in_percent(evidence):
    """Both the size and its sigma, to the last digit shown."""
    (finding,) = systematic_error(evidence(systematic_error=found("length-scale", [0.08], 9.46e-3)))
    assert "8.00 ± 0.95 %" in finding.message


def test_a_joint_of_which_nothing_is_known_is_not_the_clearest(evidence):
    """One that the data do not tell has a sigma of zero; the others are compared by their sigmas, on either side."""
    error = found("joint-offsets", np.radians([0.5, 0.1, -0.2]), np.radians([0.0, 0.01, 0.01]))
    (finding,) = systematic_error(evidence(systematic_error=error))
    assert "the clearest is joint 3, by -0.200 ± 0.010 deg" in finding.message


CELL = simulate(Scenario(samples=1), 0).cell
SIZE = Finding("board-size", "warning", ("board",), "board is 1.1 times as large as stated")
LENGTH = Finding("length-scale", "warning", ("hand",), "poses of hand are too long")
OTHER = Finding("poor-fit", "warning", ("hand",), "residuals are large")
OF_ROBOT = FoundEffect(
    "length_scale", "length-scale", "hand", False, False, None, "", np.array([-0.12]), np.array([[1e-4]]), np.zeros(6)
)
OF_TARGET = replace(OF_ROBOT, about="board", is_target=True, size=np.array([0.12]))


@pytest.mark.parametrize("found", [OF_TARGET, replace(OF_ROBOT, alternatives=(OF_TARGET,))])
def test_a_size_that_both_tests_find_is_told_once(found):
    """By the test that knows the arms' noise, with its sigma and what to write; other findings stay."""
    told = deduplicate_size_findings(CELL, [SIZE, OTHER, LENGTH], found)
    assert [f.code for f in told] == ["board-size", "poor-fit"]
    assert "board is 1.136 ± 0.013 times as large as stated" in told[0].message
    assert f"square_m would be {1.13636 * CELL.targets['board'].target.options['square_m']:.5g}" in told[0].message
    assert ("which the data do not determine" in told[0].message) == bool(found.alternatives)


def test_of_two_robots_the_one_whose_lengths_are_off_is_told():
    """A target's size that took up a robot's lengths is not suspected any more."""
    assert deduplicate_size_findings(CELL, [SIZE, LENGTH, OTHER], OF_ROBOT) == [LENGTH, OTHER]


@pytest.mark.parametrize(
    "found",
    [None, replace(OF_TARGET, is_certain=False), replace(OF_TARGET, code="drift")],
    ids=["none", "doubt", "drift"],
)
def test_a_size_that_nothing_else_finds_stays(found):
    """Nothing better is known of it."""
    assert deduplicate_size_findings(CELL, [SIZE, OTHER], found) == [SIZE, OTHER]


def test_a_length_without_a_suspected_size_stays():
    """There is nothing to tell once."""
    assert deduplicate_size_findings(CELL, [LENGTH], replace(OF_ROBOT, alternatives=(OF_TARGET,))) == [LENGTH]


def test_a_board_stated_too_large_is_told_as_smaller():
    """Two arms with noise, the stated board 3 % larger than the true one: it is smaller than stated."""
    made = simulate(Scenario(samples=12, robot_noise=(5e-4, 1e-3), state_robot_noise=False), 0)
    found = calibrate(resized(made.cell, {"board": 1.03}), made.recording)
    (said,) = [f for f in found.findings if f.code in ("length-scale", "board-size")]
    assert said.about == ("board",)
    assert "% smaller than stated" in said.message


def test_an_answer_contains_errors_of_an_expected_size():
    """It excludes the others; joints that are more than 30 mrad off are not linear, other errors of any size are."""
    error = found("joint-offset", [0.029], 1e-3, unit="rad")
    for effect, size, words in (
        (next(iter(CONTAINED)), 5.0, "contains it, and"),
        ("step", 5.0, "excludes it, and"),
        ("joint_offsets", 0.029, "its covariance is wider"),
        ("joint_offsets", -0.031, "Its covariance may be too small"),
    ):
        assert words in _answer_sentence(replace(error, effect=effect, size=np.array([size])))
