"""What a cell says of a UR controller."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from basecal.acquisition.ur.options import UrOptions


def test_only_the_host_must_be_said():
    """An arm is sent where nothing else is said, 125 states come in a second."""
    options = UrOptions(host="10.0.0.2")
    assert (options.motion, options.rate_hz) == ("move", 125.0)


@pytest.mark.parametrize("wrong", [{}, {"host": ""}, {"host": "a", "rate_hz": 1000}, {"host": "a", "motion": "fly"}])
def test_what_is_wrong_is_refused(wrong):
    """No host, a rate that no controller has, and a way to move that is none."""
    with pytest.raises(ValidationError):
        UrOptions(**wrong)
