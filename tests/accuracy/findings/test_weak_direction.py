"""Tests of the finding `weak-direction`: observable, but poorly known."""

import numpy as np
import pytest

from basecal.accuracy.findings import weak_direction
from basecal.accuracy.findings.weak_direction import weak_directions


@pytest.fixture(autouse=True)
def cause(monkeypatch):
    """Replaces the wording about motions, which has tests of its own."""
    monkeypatch.setattr(weak_direction, "advise_observability", lambda *_: (("Do.",), "The cause."))
    monkeypatch.setattr(weak_direction, "motions", lambda _: [])


@pytest.mark.parametrize(
    ("k", "sigma", "length_m", "found"),
    [
        (0, 0.29, 2.0, False),
        (2, 0.31, 2.0, True),
        (3, 0.149, 0.5, False),
        (3, 0.151, 2.0, True),
        (5, 0.149, 0.5, False),
        (5, 0.151, 2.0, True),
    ],
)
def test_sigma_above_0_15_is_weak(evidence, k, sigma, length_m, found):
    """Sigmas above 0.15 rad, or 0.15 of the viewing distance, are weak; the worst axis of each is stated."""
    covariance = 1e-8 * np.eye(6)
    covariance[k, k] = sigma**2
    made = evidence({"joint_transform_covariance": lambda names: covariance})
    made.solution.observability.length_m = length_m
    weak = weak_directions(made)
    assert [f.about for f in weak] == ([("base",)] if found else [])
    if found:
        metres, radians = (sigma, 1e-4) if k < 3 else (1e-4, sigma)
        assert (
            f"{1e3 * metres:.0f} mm and {np.degrees(radians):.1f} deg along an axis. The cause. Do." in weak[0].message
        )


def test_transforms_without_estimate_are_not_weak(evidence):
    """Unobservable or fixed transforms, and failed solutions, have findings of their own."""
    weak = {"joint_transform_covariance": lambda names: np.eye(6)}
    assert len(weak_directions(evidence(weak))) == 1
    assert weak_directions(evidence({**weak, "converged": False})) == []
    unobservable, fixed = evidence(weak), evidence(weak)
    unobservable.solution.observability.unobservable = {"base"}
    fixed.solution.problem.columns = {}
    assert weak_directions(unobservable) == weak_directions(fixed) == []
