"""Models of equally many parameters."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.model_comparison.likelihoods import compare_likelihoods


@pytest.mark.parametrize(
    ("ratios", "is_taken"),
    [([5.0], True), ([3.0], False), ([5.0, -50.0, -50.0, -50.0], False), ([6.0, 4.0, -50.0], True), ([], False)],
)
def test_a_rival_is_taken_by_its_mean_ratio(ratios: list[float], is_taken: bool) -> None:
    """Fifty times likelier, on the mean over the values that are open; none is no rival."""
    assert compare_likelihoods("rival", np.array(ratios)).is_taken == is_taken


def test_gain_is_that_of_the_best_value() -> None:
    """Twice the log ratio."""
    assert compare_likelihoods("rival", np.array([1.0, 6.0])).gain == 12.0
