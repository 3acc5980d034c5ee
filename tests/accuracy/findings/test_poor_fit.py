"""Tests of the finding `poor-fit`: unexplained residuals."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.evidence import evidence_of

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings.poor_fit import poor_fit
from basecal.accuracy.stated_sigmas import ContradictedSigma, contradicted_sigmas
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate


@pytest.mark.parametrize(("ratio", "severity"), [(0.5, "info"), (1.09, "info"), (1.11, "warning")])
def test_contradicted_sigmas_are_reported(evidence, ratio, severity):
    """A contradicted sigma is reported with its owner and factor.

    It is an info if too large or off by less than a tenth, else a warning.
    """
    of = ContradictedSigma("wrist", False, ratio, 1e-20)
    (finding,) = poor_fit(evidence(contradicted_sigmas=(of,)))
    assert (finding.severity, finding.about) == (severity, ("wrist",))
    assert f"{ratio:.2g}" in finding.message or f"{ratio:.2f}" in finding.message
    robot = ContradictedSigma("eye", True, 2.0, 1e-9)
    assert "poses of eye" in poor_fit(evidence(contradicted_sigmas=(robot, of)))[0].message
    assert poor_fit(evidence()) == []


@pytest.mark.parametrize(("rms", "found"), [(2.9, False), (3.1, True), (None, False)])
def test_residuals_beyond_detectors_are_poor_fit(evidence, rms, found):
    """With estimated pixel noise, residuals above 3 px rms are a poor fit; the cost has no effect then."""
    noise = SimpleNamespace(estimated=("pixel_px",), robots={})
    made = poor_fit(evidence({"noise": noise, "cost": 1e6}, residuals=SimpleNamespace(rms_px=rms)))
    assert len(made) == found
    assert not found or "3.1 px rms" in made[0].message
    poses = SimpleNamespace(estimated=("pose_m",), robots={})
    assert poor_fit(evidence({"noise": poses}, residuals=SimpleNamespace(rms_px=rms))) == []


@pytest.mark.parametrize(
    ("metres", "radians", "found"), [(2.9e-3, 9e-3, False), (3.1e-3, 1e-4, True), (1e-4, 1.1e-2, True)]
)
@pytest.mark.parametrize("axis", range(3))
def test_noise_beyond_robots_is_poor_fit(evidence, axis, metres, radians, found):
    """Estimated robot noise above 3 mm or 10 mrad is a poor fit; the worst of each is stated."""
    robots = {"eye": np.full(6, 1e-5), "hand": np.full(6, 1e-5)}
    robots["hand"][[axis, 3 + axis]] = metres, radians
    made = poor_fit(evidence({"noise": SimpleNamespace(estimated=("pixel_px",), robots=robots)}))
    assert len(made) == found
    if found:
        assert f"{1e3 * metres:.1f} mm and {np.degrees(radians):.2f} deg" in made[0].message


def test_overall_contradiction_has_no_owner(evidence):
    """A sigma contradicted as a whole concerns all data and names no device; too large sigmas likewise."""
    for ratio, severity in ((1.5, "warning"), (0.5, "info")):
        (finding,) = poor_fit(evidence(contradicted_sigmas=(ContradictedSigma("", False, ratio, 1e-9),)))
        assert (finding.severity, finding.about) == (severity, ())
        assert "of all data" in finding.message


def test_too_large_sigmas_follow_other_causes(evidence):
    """Too large sigmas are listed after other causes; too small sigmas are the only cause listed."""
    noise = SimpleNamespace(estimated=("pixel_px",), robots={})
    large, small = (ContradictedSigma("wrist", False, ratio, 1e-9) for ratio in (0.5, 2.0))
    of = {"noise": noise}, {"residuals": SimpleNamespace(rms_px=4.0)}
    found = poor_fit(evidence(of[0], **of[1], contradicted_sigmas=(large,)))
    assert [(f.severity, f.about) for f in found] == [("warning", ()), ("info", ("wrist",))]
    assert "Residuals are 4.0 px rms" in found[0].message
    found = poor_fit(evidence(of[0], **of[1], contradicted_sigmas=(small, large)))
    assert [f.severity for f in found] == ["warning", "info"]
    assert "times what the stated sigmas explain" in found[0].message


@pytest.mark.journey
def test_sigma_in_wrong_unit_is_named():
    """A sigma stated in metres instead of millimetres is named with the value that the data show.

    Its noise hides directions until it is estimated.
    """
    made = simulate(Scenario(samples=12, layout="eye_in_hand", robot_noise=(1e-4, 2e-4)), 1301)
    arm = made.cell.robots["arm"]
    robots = {"arm": replace(arm, noise=1e3 * arm.noise)}
    found = calibrate(replace(made.cell, robots=robots), made.recording)
    (finding,) = (each for each in found.findings if each.severity != "info")
    assert (finding.code, finding.about, found.verdict) == ("poor-fit", ("arm",), "doubtful")
    assert finding.what.startswith("The stated noise of arm is 100 mm and 200 mrad; the data show 0.")
    assert found.unobservable == ()


def test_robots_in_same_views_are_named_together():
    """Robots in the same views are named together.

    Noise of one, stated a hundred times too small, is absorbed by the other.
    """
    made = simulate(Scenario(samples=20, robot_noise=(2e-4, 4e-4)), 0)
    eye = made.cell.robots["eye"]
    cell = replace(made.cell, robots={**made.cell.robots, "eye": replace(eye, noise=eye.noise / 100)})
    solution = solve(cell, made.recording)
    found = poor_fit(replace(evidence_of(cell, solution), contradicted_sigmas=contradicted_sigmas(solution)))
    (finding,) = (each for each in found if each.about != ("wrist",))
    assert finding.about == ("hand", "eye")
    assert "Residuals of poses of hand or eye are 1." in finding.what
