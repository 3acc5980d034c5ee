"""A number with its sigma."""

import pytest

from basecal.accuracy.phrases.rounded import rounded


@pytest.mark.parametrize(
    ("value", "sigma", "words"),
    [(1.13636, 0.0129, "1.136 +/- 0.013"), (21.3, 12.0, "21 +/- 12"), (5.0, 123.0, "5 +/- 123")],
)
def test_a_sigma_has_two_digits(value, sigma, words):
    """The value has as many as it; whole numbers keep theirs."""
    assert rounded(value, sigma) == words
