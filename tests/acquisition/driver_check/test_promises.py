"""Promises of drivers."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.acquisition.driver_check.measuring import Arrivals
from basecal.acquisition.driver_check.promises import _guarantee_promise, _stream_promises


def test_each_fault_of_a_stream_breaks_its_own_promise():
    """A sound stream keeps all; a slow one, a fast clock and stamps that go back break one promise each."""
    at_s = np.arange(501) * 0.01

    def broken(at_s, stamps_s):
        return [each.promise for each in _stream_promises(Arrivals(at_s, stamps_s), 10.0) if not each.holds]

    assert broken(at_s, at_s) == []
    assert broken(20 * at_s, 20 * at_s) == ["at least 10 in a second"]
    assert broken(at_s, 1.02 * at_s) == ["clock within 1% of this machine's"]
    back = at_s.copy()
    back[250] -= 0.05
    assert broken(at_s, back) == ["stamps do not go back"]
    assert "no gap longer than 0.45 s" in broken(np.append(at_s, 6.0), np.append(at_s, 6.0))


@pytest.mark.parametrize(("guarantee", "words"), [
    ("none", "the arm finishes its move if this computer is silent"),
    ("watchdog", "declared by the driver, not measured"),
    ("short-horizon", "declared by the driver, not measured"),
])  # fmt: skip
def test_what_a_driver_does_not_guarantee_is_said(guarantee, words):
    """And what it declares is not taken for measured."""
    found = _guarantee_promise("arm", object(), guarantee, is_motion_allowed=True)
    assert (found.measured, found.holds) == (words, None)
