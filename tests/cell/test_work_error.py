"""Tests of the error at the task, and of tolerances."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import Calibration, ErrorMap, LocalFit, MeetingError, Tolerance
from basecal.cell.results.calibration_dict import calibration_from_dict, calibration_to_dict


def test_meeting_variance_is_per_axis():
    """The mean square of the distance is three times the variance along one axis."""
    assert MeetingError(5e-4, "task point", 2e-4).variance_m2 == pytest.approx(12e-8)


@pytest.mark.parametrize(("expected_m", "is_within"), [(4e-4, True), (5e-4, True), (5.1e-4, False), (None, False)])
def test_tolerance_compares_expected_error(expected_m, is_within):
    """An expected error up to and including the tolerance is within it, whatever the verdict; an unknown one is not."""
    assert Tolerance(5e-4, expected_m, False).is_within is is_within


@pytest.mark.parametrize(("is_better", "word"), [(True, "local"), (False, "global")])
def test_local_fit_round_trip_with_recommendation(is_better, word):
    """A part of the workspace recommends `local` if its own fit is better, in millimetres, and is read back."""
    part = LocalFit(np.array([0.5, 0.0, 0.3]), (1, 2), 2e-3, 1e-3, 0.01, is_better, {})
    (written,) = calibration_to_dict(Calibration("good", local=(part,)))["local"]
    assert (written["recommended"], written["global_mm"], written["local_mm"]) == (word, 2.0, 1.0)
    (found,) = calibration_from_dict(calibration_to_dict(Calibration("good", local=(part,)))).local
    assert found.is_better is is_better


def test_worst_place_has_longest_error():
    """The worst place of an error map has the largest translation error, whatever its angle."""
    assert ErrorMap(np.zeros((3, 3)), np.array([1e-3, 3e-3, 2e-3]), np.array([0.3, 0.1, 0.2])).worst == 1
