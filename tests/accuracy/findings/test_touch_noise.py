"""Tests of the finding `touch-noise`: touches that scatter more than stated."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tests.touch_cells import MARKS, recorded, touch_cell, touch_lines

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings.touch_noise import _sigma_with_arm, _stated_sigma, is_touch_noise, touch_noise
from basecal.accuracy.stated_sigmas import ContradictedSigma
from basecal.estimation.view.points import TouchMeasurement
from basecal.geometry import SE3


@pytest.mark.journey
@pytest.mark.parametrize(("scatter_m", "codes", "verdict"), [(3e-4, {"touch-noise"}, "good"), (1e-4, set(), "good")])
def test_too_small_touch_sigma_is_named(scatter_m, codes, verdict):
    """A too small stated sigma is named and is no poor fit.

    The answer is good, and the message has the noise of the touches.
    """
    lines = touch_lines(np.random.default_rng(0), 24, scatter_m, MARKS, True)
    for line in lines:
        line["observations"][0]["sigma_m"] = 1e-4
    found = calibrate(touch_cell(), recorded(touch_cell(), lines))
    assert found.verdict == verdict
    assert {each.code for each in found.findings} == codes
    assert {each.about for each in found.findings} <= {("eye_tip",), ("hand_tip",)}
    assert all("0.1 mm is stated" in each.what and "sigma_m: 0.000" in each.do[0] for each in found.findings)


@pytest.mark.journey
def test_too_small_touch_sigma_beside_unknown_robot_noise():
    """A too small touch sigma is named with the tip even if unknown robot noise compensates it.

    The answer is good, and no convention is doubted.
    """
    lines = touch_lines(np.random.default_rng(0), 36, 2e-4, MARKS, True)
    for line in lines:
        line["observations"][0]["sigma_m"] = 2e-5
    cell = touch_cell(robots={"eye": {}, "hand": {}})
    found = calibrate(cell, recorded(cell, lines))
    named = [each for each in found.findings if each.code == "touch-noise"]
    assert found.verdict == "good"
    assert {each.about for each in named} == {("eye_tip",), ("hand_tip",)}
    assert all("of the touches or of the arm" in each.why for each in named)
    assert "poor-fit" not in {each.code for each in found.findings}


@pytest.mark.journey
def test_scatter_above_three_millimetres_is_poor_fit():
    """Scatter above 3 mm has another cause and is a poor fit."""
    lines = touch_lines(np.random.default_rng(0), 24, 6e-3, MARKS, True)
    for line in lines:
        line["observations"][0]["sigma_m"] = 1e-3
    found = calibrate(touch_cell(), recorded(touch_cell(), lines))
    assert "poor-fit" in {each.code for each in found.findings}
    assert found.verdict == "doubtful"


TIP_M = np.array([0.0, 0.3, 0.0])


def arm_evidence(arm_m: float, arm_rad: float, sigma_m: float = 1e-4, stated: bool = True, robot: str = "arm"):
    """Touches by a tip 0.3 m from the flange of an arm with this noise, with 200 freedoms."""
    inverse = np.full((9, 1), 1 / sigma_m)
    touches = TouchMeasurement(np.zeros((1, 3)), np.zeros((9, 1, 3)), inverse > 0, inverse * stated, inverse)
    group = SimpleNamespace(camera="tip", measurement=touches)
    solution = SimpleNamespace(
        noise=SimpleNamespace(robots={robot: np.repeat([arm_m, arm_rad], 3)}),
        state=SimpleNamespace(transforms={"mount": SE3.from_rotvec([0, 0, 0], TIP_M)}),
        dof=200,
    )
    cell = SimpleNamespace(cameras={"tip": SimpleNamespace(on="arm")}, mount_name=lambda name: "mount")
    return SimpleNamespace(
        solution=solution,
        cell=cell,
        recorded=SimpleNamespace(groups=[group]),
        robot_model=None,
        systematic_error=None,
        contradicted_sigmas=(),
    )


@pytest.mark.parametrize(("arm_m", "arm_rad"), [(2e-4, 0.0), (0.0, 1e-3), (2e-4, 1e-3)])
def test_robot_noise_adds_to_touches(arm_m, arm_rad):
    """Robot noise adds to touches; rotations act at the lever of the tip, along two of three axes."""
    found = _sigma_with_arm("tip", arm_evidence(arm_m, arm_rad))
    error_m2 = arm_m**2 + 2 / 3 * (0.3 * arm_rad) ** 2
    assert found.ratio == pytest.approx(np.sqrt(1 + error_m2 / 1e-8))
    assert (found.about, found.of_robot) == ("tip", False)


def test_quiet_robot_contradicts_no_touch_sigma():
    """A robot as quiet as its touches gives no finding.

    Nor does one of unknown noise, touches without a stated sigma, or errors of millimetres.
    """
    assert _sigma_with_arm("tip", arm_evidence(2e-5, 1e-5)) is None
    assert _sigma_with_arm("tip", arm_evidence(2e-4, 1e-3, robot="other")) is None
    assert _sigma_with_arm("tip", arm_evidence(4e-3, 0.0)) is None
    (info,) = touch_noise(arm_evidence(2e-4, 0.0))
    assert info.what == "Touches by tip scatter by 0.22 mm per axis, 0.1 mm is stated."
    assert info.do == ("State `sigma_m: 0.00022` of these touches, or state none.",)
    assert info.why == "The noise is that of the touches or of the arm. The covariance is that of the larger noise."


def test_stated_touch_sigma_is_mean_of_groups():
    """The stated sigma is the mean over the tip's groups of touches; other cameras and measurements do not count."""
    of = arm_evidence(0.0, 0.0, 1e-4)
    coarse = arm_evidence(0.0, 0.0, 3e-4).recorded.groups[0]
    other = SimpleNamespace(camera="other", measurement=coarse.measurement)
    frames = SimpleNamespace(camera="tip", measurement=None)
    groups = [*of.recorded.groups, coarse, other, frames]
    assert _stated_sigma("tip", SimpleNamespace(recorded=SimpleNamespace(groups=groups))) == pytest.approx(2e-4)


@pytest.mark.parametrize(
    ("change", "is_noise"),
    [
        ({}, True),
        ({"robot_model": SimpleNamespace(chosen=SimpleNamespace(kind="none"))}, True),
        ({"robot_model": SimpleNamespace(chosen=SimpleNamespace(kind="joints"))}, False),
        ({"systematic_error": SimpleNamespace(is_certain=False)}, True),
        ({"systematic_error": SimpleNamespace(is_certain=True)}, False),
    ],
)
def test_unexplained_touch_scatter_is_noise(change, is_noise):
    """Touch scatter up to 3 mm of a tip with too small a sigma is noise if nothing else explains it."""
    of = SimpleNamespace(**{**arm_evidence(0.0, 0.0).__dict__, **change})
    assert is_touch_noise(ContradictedSigma("tip", False, 20.0, 1e-9), of) == is_noise
    assert is_touch_noise(ContradictedSigma("tip", False, 29.9, 1e-9), of) == is_noise
    for other in (
        ContradictedSigma("tip", False, 30.1, 1e-9),
        ContradictedSigma("tip", True, 20.0, 1e-9),
        ContradictedSigma("tip", False, 0.2, 1e-9),
        ContradictedSigma("camera", False, 20.0, 1e-9),
    ):
        assert not is_touch_noise(other, of)
