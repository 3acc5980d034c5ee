"""Tests of `list_samples`."""

import pytest

from basecal.accuracy.phrases.sample_list import list_samples


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ([5], "sample 5"),
        ([5, 6], "samples 5, 6"),
        ([5, 6, 7], "samples 5 to 7"),
        ([1, 4, 5, 6, 7, 9], "samples 1, 4 to 7, 9"),
        ([1, 2, 4, 5], "samples 1, 2, 4, 5"),
        (range(0, 20, 2), "samples 0, 2, 4, 6, 8, 10, 12, 14, 16, 18"),
        (range(0, 22, 2), "samples 0, 2, 4, 6, 8, 10, 12, 14, 16, 18, ..."),
    ],
)
def test_three_consecutive_samples_are_a_range(numbers, words):
    """Three consecutive samples are a range, and ten entries are listed."""
    assert list_samples(numbers) == words
