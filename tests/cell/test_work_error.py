"""The error at the work, and tolerances."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import Calibration, ErrorMap, LocalFit, MeetingError, Tolerance
from basecal.cell.results.calibration_dict import calibration_from_dict, calibration_to_dict


def test_a_meeting_is_off_along_three_axes():
    """The mean square of the distance is three times that along an axis."""
    assert MeetingError(5e-4, "task point", 2e-4).variance_m2 == pytest.approx(12e-8)


@pytest.mark.parametrize(("expected_m", "is_within"), [(4e-4, True), (5e-4, True), (5.1e-4, False), (None, False)])
def test_a_tolerance_is_about_the_expected_error(expected_m, is_within):
    """Within it up to its own size, whatever the verdict; nothing is within that is not known."""
    assert Tolerance(5e-4, expected_m, False).is_within is is_within


@pytest.mark.parametrize(("is_better", "word"), [(True, "local"), (False, "global")])
def test_a_part_of_the_workspace_is_written_with_what_is_recommended(is_better, word):
    """`local` if its own fit is, in millimetres, and read back."""
    part = LocalFit(np.array([0.5, 0.0, 0.3]), (1, 2), 2e-3, 1e-3, 0.01, is_better, {})
    (written,) = calibration_to_dict(Calibration("good", local=(part,)))["local"]
    assert (written["recommended"], written["global_mm"], written["local_mm"]) == (word, 2.0, 1.0)
    (found,) = calibration_from_dict(calibration_to_dict(Calibration("good", local=(part,)))).local
    assert found.is_better is is_better


def test_the_worst_place_has_the_longest_error():
    """Whatever its angle is."""
    assert ErrorMap(np.zeros((3, 3)), np.array([1e-3, 3e-3, 2e-3]), np.array([0.3, 0.1, 0.2])).worst == 1
