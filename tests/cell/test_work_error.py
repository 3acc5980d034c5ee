"""The error at the work, and tolerances."""

from __future__ import annotations

import pytest

from basecal.cell import MeetingError, Tolerance


def test_a_meeting_is_off_along_three_axes():
    """The mean square of the distance is three times that along an axis."""
    assert MeetingError(5e-4, "task point", 2e-4).variance_m2 == pytest.approx(12e-8)


@pytest.mark.parametrize(("expected_m", "is_within"), [(4e-4, True), (5e-4, True), (5.1e-4, False), (None, False)])
def test_a_tolerance_is_about_the_expected_error(expected_m, is_within):
    """Within it up to its own size, whatever the verdict; nothing is within that is not known."""
    assert Tolerance(5e-4, expected_m, False).is_within is is_within
