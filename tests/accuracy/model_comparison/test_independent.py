"""Two independent estimates of a place."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.model_comparison.independent import compare_contradiction, compare_places


@pytest.mark.parametrize(("sigma_m", "is_taken"), [(0.001, True), (0.02, True), (0.15, False), (2.0, False)])
def test_coarse_evidence_of_all_axes_excludes_a_copy(sigma_m: float, is_taken: bool) -> None:
    """Two centimetres do, 15 cm do not."""
    assert compare_places(np.full(3, 0.5 * sigma_m), sigma_m**2 * np.eye(3)).is_taken is is_taken


def test_a_distance_alone_has_to_be_exact() -> None:
    """Along one axis 2 mm exclude a copy, 5 mm do not."""
    for sigma_m, is_taken in ((0.002, True), (0.005, False)):
        assert compare_places(np.zeros(3), np.diag([sigma_m, 10.0, 10.0]) ** 2).is_taken is is_taken


def test_copies_that_are_seldom_near_are_seldom_taken_for_one_place() -> None:
    """Of deceived estimates anywhere in a room of a cubic metre at most one in 150 passes, whatever the sigma."""
    rng = np.random.default_rng(0)
    for sigma_m in (0.01, 0.05, 0.1):
        apart = rng.uniform(-0.5, 0.5, (4000, 3))
        passed = [compare_places(each, sigma_m**2 * np.eye(3)).is_taken for each in apart]
        assert np.mean(passed) < 1 / 150


def test_what_is_far_apart_contradicts() -> None:
    """Ten sigmas do, two do not."""
    assert compare_contradiction(np.array([0.1, 0, 0]), 1e-4 * np.eye(3)).is_taken
    assert not compare_contradiction(np.array([0.02, 0, 0]), 1e-4 * np.eye(3)).is_taken
