"""Tests of the wording of `length-scale`, `clock-offset`, `base-moved`, `drift` and `deflection`."""

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


def make_effect(code, size, sigma, about="hand", unit="", since=None, kind=None):
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


STEP = make_effect("base-moved", [2e-3, 0, 0, 0, 0, 0], 1e-4, "eye_base", since=4)
BOARD = make_effect("length-scale", [-1e-2], 1e-3, "board", kind="target")
WORDS = {
    "short": (make_effect("length-scale", [1e-3], 1e-4), "Poses of hand are 0.100 ± 0.010 % too short"),
    "long": (make_effect("length-scale", [-2.5e-3], 2e-3), "Poses of hand are 0.25 ± 0.20 % too long"),
    "short, or a target": (
        replace(make_effect("length-scale", [1e-2], 1e-3), alternatives=(BOARD,)),
        "Poses of hand are 1.00 ± 0.10 % too short, or board is 1.00 ± 0.10 % smaller than stated.",
    ),
    "larger": (make_effect("length-scale", [0.02], 1e-3, "board", kind="target"), "board is 2.00 ± 0.10 % larger"),
    "smaller": (make_effect("length-scale", [-0.02], 1e-3, "board", kind="target"), "board is 2.00 ± 0.10 % smaller"),
    "late": (
        make_effect("clock-offset", [-0.021], 1e-3, "wrist", "s", kind="camera"),
        "Images of wrist lag behind the other devices by 21.0 ± 1.0 ms",
    ),
    "early": (
        make_effect("clock-offset", [0.021], 1e-3, "wrist", "s", kind="camera"),
        "Images of wrist run ahead of the other devices by 21.0 ± 1.0 ms",
    ),
    "robot late": (
        make_effect("clock-offset", [0.5], 0.1, "eye", "samples"),
        "Poses of eye lag behind the other devices by 0.50 ± 0.10 samples",
    ),
    "camera drifts": (
        make_effect("clock-drift", [-0.021], 1e-3, "wrist", "s", kind="camera"),
        "The clock of wrist drifts: its images fall behind the other devices by 21.0 ± 1.0 ms from first to last",
    ),
    "robot drifts": (
        make_effect("clock-drift", [-0.021], 1e-3, "eye", "s"),
        "The clock of eye drifts: its poses run ahead of the other devices by 21.0 ± 1.0 ms from first to last",
    ),
    "step": (
        make_effect("base-moved", [3e-3, 4e-3, 0, 0, 0, np.radians(0.5)], 1e-3, "hand_base", since=12),
        "hand_base moved by 5.0 ± 1.0 mm and 0.500 ± 0.057 deg at about sample 12",
    ),
    "drift": (
        make_effect("drift", [0, 0, -2e-3, 0, np.radians(-0.1), 0], 1e-3, "hand_base"),
        "hand_base drifts by 2.0 ± 1.0 mm and 0.100 ± 0.057 deg from the first sample to the last",
    ),
    "yield": (
        make_effect("deflection", [3e-5, 4e-5, 0, 0], 2e-6, unit="rad/Nm"),
        "Joints of hand yield by 25.0 ± 1.0 urad per Nm of the torque",
    ),
    "bend": (make_effect("deflection", [0, 0, -2e-3], 1e-4), "hand bends by 2.00 ± 0.10 mrad per metre of reach"),
}


@pytest.mark.parametrize("kind", WORDS)
def test_wording_of_effects(evidence, monkeypatch, kind):
    """Each effect is a warning about its device, with its size, its sigma in the same unit, and its direction."""
    error, words = WORDS[kind]
    monkeypatch.setattr("basecal.accuracy.findings.systematic_error.describe_gravity", lambda *_: "gravity pulls")
    (finding,) = systematic_error(evidence(systematic_error=error))
    code = {"clock-drift": "clock-offset"}.get(error.code, error.code)
    about = (error.about, *(each.about for each in error.alternatives))
    assert (finding.code, finding.severity, finding.about) == (code, "warning", about)
    assert words in finding.message
    assert ("gravity pulls" in finding.message) == (error.unit == "rad/Nm")


def test_single_joint_offset_is_reported_once(evidence, monkeypatch):
    """A single joint offset is reported with its entry, unless the robot-model finding names its robot."""
    error = replace(make_effect("joint-offset", [np.radians(0.25)], np.radians(0.01)), joint=2)
    (finding,) = systematic_error(evidence(systematic_error=error))
    assert (finding.code, finding.severity, finding.about) == ("robot-model", "warning", ("hand",))
    assert "Joint 3 of hand is off by 0.250 ± 0.010 deg" in finding.message
    monkeypatch.setattr("basecal.accuracy.findings.systematic_error.robot_model", lambda of: [finding])
    assert systematic_error(evidence(systematic_error=error)) == []
    bent, _ = WORDS["bend"]
    assert len(systematic_error(evidence(systematic_error=bent))) == 1


def test_several_joint_offsets_are_reported_once(evidence, monkeypatch):
    """Several joint offsets name the clearest in sigmas and a prior wide enough for the largest.

    They are reported once.
    """
    error = make_effect("joint-offsets", np.radians([0.1, -0.3, 0.7]), np.radians([0.01, 0.02, 0.3]))
    (finding,) = systematic_error(evidence(systematic_error=error))
    assert (finding.code, finding.severity, finding.about) == ("robot-model", "warning", ("hand",))
    assert "Several joints of hand are off; the clearest is joint 2, by -0.300 ± 0.020 deg" in finding.message
    assert "sigma_rad: 0.02}" in finding.message
    monkeypatch.setattr("basecal.accuracy.findings.systematic_error.robot_model", lambda of: [finding])
    assert systematic_error(evidence(systematic_error=error)) == []


def test_covariance_of_large_joint_offsets_is_not_promised(evidence):
    """The covariance of bases covers joints 1 deg off, but is not promised for 2 deg."""
    for size, words in ((0.017, "its covariance is wider"), (0.035, "Its covariance may be too small")):
        effect = make_effect("joint-offsets", [1e-3, -size], 1e-3, unit="rad")
        (finding,) = systematic_error(evidence(systematic_error=effect))
        assert words in finding.why


def test_missing_effect_gives_no_finding(evidence):
    """Without an effect there is no finding."""
    assert systematic_error(evidence()) == []


def test_uncertain_effect_is_info(evidence):
    """An effect that may be chance is an info with its probability.

    It is not stated as a fact, the covariance contains it, and the verdict stays.
    """
    error, words = WORDS["short"]
    (finding,) = systematic_error(evidence(systematic_error=replace(error, is_certain=False, probability=0.855)))
    assert (finding.code, finding.severity) == ("length-scale", "info")
    assert finding.what.startswith(f"Perhaps chance: {words}")
    assert finding.why == (
        "It is real with a probability of 86 % at most. The covariance and the expected errors contain it."
    )
    (certain,) = systematic_error(evidence(systematic_error=error))
    assert certain.what.startswith(words)


def test_indistinguishable_effects_are_all_named(evidence):
    """Effects that the data do not distinguish are all named, each with its device and its advice once."""
    drift = replace(
        make_effect("drift", [0, 0, -2e-3, 0, np.radians(-0.1), 0], 1e-3, "hand_base"), alternatives=(STEP,)
    )
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
def test_late_device_follows_from_sign(evidence, code, kind, size, late):
    """The sign alone determines who is late: images to be stamped earlier, and poses to be read later, are late."""
    error = make_effect(code, [size], 1e-5, "device", "s", kind=kind)
    (finding,) = systematic_error(evidence(systematic_error=error))
    way = {"clock-offset": "lag behind", "clock-drift": "fall behind"}[code] if late else "run ahead of"
    assert ("images" if kind == "camera" else "poses") in finding.message.lower()
    assert f" {way} the other devices by 0.300 ± 0.010 ms" in finding.message


def test_fractions_are_in_percent(evidence):
    """Fractions and their sigmas are stated in percent, to the last digit shown."""
    (finding,) = systematic_error(evidence(systematic_error=make_effect("length-scale", [0.08], 9.46e-3)))
    assert "8.00 ± 0.95 %" in finding.message


def test_joint_with_zero_sigma_is_not_clearest(evidence):
    """A joint that the data do not determine has a sigma of zero and is not the clearest.

    The others are compared by their sigmas, on either side.
    """
    error = make_effect("joint-offsets", np.radians([0.5, 0.1, -0.2]), np.radians([0.0, 0.01, 0.01]))
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
def test_size_found_by_both_tests_is_reported_once(found):
    """A size found by both tests is reported once, with its sigma and the entry to write.

    The test with robot noise counts. Other findings stay.
    """
    kept = deduplicate_size_findings(CELL, [SIZE, OTHER, LENGTH], found)
    assert [f.code for f in kept] == ["board-size", "poor-fit"]
    assert "board is 1.136 ± 0.013 times as large as stated" in kept[0].message
    assert f"square_m would be {1.13636 * CELL.targets['board'].target.options['square_m']:.5g}" in kept[0].message
    assert ("which the data do not determine" in kept[0].message) == bool(found.alternatives)


def test_robot_length_scale_replaces_target_size():
    """A robot's length scale replaces the target size that absorbed it."""
    assert deduplicate_size_findings(CELL, [SIZE, LENGTH, OTHER], OF_ROBOT) == [LENGTH, OTHER]


@pytest.mark.parametrize(
    "found",
    [None, replace(OF_TARGET, is_certain=False), replace(OF_TARGET, code="drift")],
    ids=["none", "doubt", "drift"],
)
def test_size_without_better_test_stays(found):
    """A size finding stays if no certain length scale explains it."""
    assert deduplicate_size_findings(CELL, [SIZE, OTHER], found) == [SIZE, OTHER]


def test_length_scale_without_size_finding_stays():
    """A length scale without a suspected size stays unchanged."""
    assert deduplicate_size_findings(CELL, [LENGTH], replace(OF_ROBOT, alternatives=(OF_TARGET,))) == [LENGTH]


@pytest.mark.journey
def test_board_stated_too_large_is_reported_smaller():
    """A board stated 3 % too large, with noise of two arms, is reported as smaller than stated."""
    made = simulate(Scenario(samples=12, robot_noise=(5e-4, 1e-3), state_robot_noise=False), 0)
    found = calibrate(resized(made.cell, {"board": 1.03}), made.recording)
    (finding,) = [f for f in found.findings if f.code in ("length-scale", "board-size")]
    assert finding.about == ("board",)
    assert "% smaller than stated" in finding.message


def test_answer_contains_linear_errors():
    """The answer contains errors of an expected size and excludes others.

    Joints more than 30 mrad off are not linear; other errors of any size are.
    """
    error = make_effect("joint-offset", [0.029], 1e-3, unit="rad")
    for effect, size, words in (
        (next(iter(CONTAINED)), 5.0, "contains it, and"),
        ("step", 5.0, "excludes it, and"),
        ("joint_offsets", 0.029, "its covariance is wider"),
        ("joint_offsets", -0.031, "Its covariance may be too small"),
    ):
        assert words in _answer_sentence(replace(error, effect=effect, size=np.array([size])))
