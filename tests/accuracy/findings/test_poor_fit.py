"""`poor-fit`: residuals that nothing explains."""

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.findings.poor_fit import poor_fit


@pytest.mark.parametrize(("ratio", "found"), [(1.49, False), (1.51, True)])
def test_residuals_beyond_stated_sigmas(evidence, ratio, found):
    """From 1.5 times the stated sigmas on, with the ratio by which sigmas are scaled."""
    made = poor_fit(evidence({"cost": 40 * ratio**2}))
    assert [f.severity for f in made] == (["warning"] if found else [])
    assert not found or "residuals are 1.5 times what the stated sigmas explain" in made[0].message


@pytest.mark.parametrize(("rms", "found"), [(2.9, False), (3.1, True), (None, False)])
def test_residuals_beyond_any_detector(evidence, rms, found):
    """Where pixels' noise is estimated, from 3 px rms on; a cost of any size says nothing then."""
    noise = SimpleNamespace(estimated=("pixel_px",), robots={})
    made = poor_fit(evidence({"noise": noise, "cost": 1e6}, residuals=SimpleNamespace(rms_px=rms)))
    assert len(made) == found
    assert not found or "3.1 px rms" in made[0].message
    poses = SimpleNamespace(estimated=("pose_m",), robots={})
    assert poor_fit(evidence({"noise": poses}, residuals=SimpleNamespace(rms_px=rms))) == []


@pytest.mark.parametrize(
    ("metres", "radians", "found"), [(2.9e-3, 9e-3, False), (3.1e-3, 1e-4, True), (1e-4, 1.1e-2, True)]
)
def test_noise_beyond_any_arm(evidence, metres, radians, found):
    """Estimated noise of a robot above 3 mm or 10 mrad is no arm's: the worst of each is told."""
    robots = {"eye": np.full(6, 1e-5), "hand": np.array([1e-5, metres, 1e-5, 1e-5, 1e-5, radians])}
    made = poor_fit(evidence({"noise": SimpleNamespace(estimated=("pixel_px",), robots=robots)}))
    assert len(made) == found
    if found:
        assert f"{1e3 * metres:.1f} mm and {np.degrees(radians):.2f} deg" in made[0].message
