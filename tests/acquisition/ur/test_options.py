"""Tests of the options of a UR controller."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from basecal.acquisition.ur.options import UrOptions


def test_only_the_host_is_required():
    """By default the arm can be moved, at 125 states a second."""
    options = UrOptions(host="10.0.0.2")
    assert (options.motion, options.rate_hz) == ("move", 125.0)


@pytest.mark.parametrize("wrong", [{}, {"host": ""}, {"host": "a", "rate_hz": 1000}, {"host": "a", "motion": "fly"}])
def test_invalid_options_are_refused(wrong):
    """No host, an impossible rate, and an unknown way of moving are refused."""
    with pytest.raises(ValidationError):
        UrOptions(**wrong)
