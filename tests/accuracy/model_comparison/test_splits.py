"""Two means, of which nobody says which items have which."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.model_comparison.splits import compare_split


@pytest.mark.parametrize(
    ("count", "ratio", "is_taken"), [(12, 0.1, True), (12, 0.5, False), (60, 0.4, True), (60, 0.7, False)]
)
def test_two_means_are_taken_by_what_they_leave(count: int, ratio: float, is_taken: bool) -> None:
    """Beyond the number of ways to split; the best split of one normal leaves about four fifths of three numbers."""
    assert compare_split("mount", ratio, count, 3).is_taken == is_taken


def test_the_best_split_of_one_mean_is_not_taken() -> None:
    """200 sets of ten items, each split where it leaves least along an axis."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        items = rng.standard_normal((10, 3))
        items = items[np.argsort(items[:, 0])]
        left = min(
            sum(float(np.sum((side - side.mean(0)) ** 2)) for side in (items[:k], items[k:])) for k in range(3, 8)
        )
        found = compare_split("mount", left / float(np.sum((items - items.mean(0)) ** 2)), 10, 3)
        assert not found.is_taken
        assert found.log_chance > np.log(1e-3)


def test_two_means_that_leave_nothing_are_certain() -> None:
    """And no chance is below what is a number."""
    assert compare_split("mount", 0.0, 8, 3).is_taken
