"""Two calibrations side by side."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.compare import compare
from basecal.cell import Calibration
from basecal.geometry import SE3, PoseEstimate

NAME = "eye_base_from_hand_base"
COVARIANCE = np.diag([1e-4, 2e-4, 3e-4, 1e-3, 1e-3, 1e-3]) ** 2


def calibration(tangent=(0, 0, 0, 0, 0, 0), covariance=COVARIANCE, **changed) -> Calibration:
    mean = SE3.exp(np.array([0.5, 0.2, 0.1, 0.3, -0.2, 1.0])) @ SE3.exp(np.asarray(tangent, dtype=float))
    return Calibration("good", transforms={NAME: PoseEstimate(mean, covariance)}, **changed)


def test_equal_ones_agree() -> None:
    found = compare(calibration(), calibration())
    assert found.agree is True
    assert found.transforms[NAME].shift_m == pytest.approx(0.0, abs=1e-12)
    assert found.inputs == ()
    assert found.settings == {}


def test_a_difference_counts_by_both_covariances() -> None:
    """Two sigmas of the sum along one axis: the squared distance is 4 of six freedoms."""
    step = 2 * np.sqrt(2) * 1e-4
    found = compare(calibration(), calibration((step, 0, 0, 0, 0, 0))).transforms[NAME]
    assert found.shift_m == pytest.approx(step)
    assert found.sigmas == pytest.approx(np.sqrt(4 / 6), rel=1e-6)
    assert found.chance == pytest.approx(0.6767, abs=1e-3)


def test_far_ones_disagree() -> None:
    assert compare(calibration(), calibration((2e-3, 0, 0, 0, 0, 0))).agree is False
    assert compare(calibration(), calibration((0, 0, 0, 0, 0, 0.02))).agree is False


def test_the_rotation_of_a_point_does_not_count() -> None:
    turned = calibration((0, 0, 0, 0, 0, 0.5), points=frozenset({NAME}))
    found = compare(calibration(points=frozenset({NAME})), turned)
    assert found.agree is True
    assert found.transforms[NAME].shift_rad == 0.0


def test_fixed_ones_have_to_be_equal() -> None:
    exact = np.zeros((6, 6))
    assert compare(calibration(covariance=exact), calibration(covariance=exact)).agree is True
    assert compare(calibration(covariance=exact), calibration((1e-3, 0, 0, 0, 0, 0), exact)).agree is False


def test_other_inputs_settings_and_transforms_are_told() -> None:
    first = calibration(inputs={"cell.yaml": "a", "recording/samples.jsonl": "b"}, settings={"start": "closed"})
    other = replace(first, inputs={"cell.yaml": "a", "recording/samples.jsonl": "c"}, settings={"start": "thorough"})
    other = replace(other, transforms={**other.transforms, "eye_flange_from_wrist": other[NAME]})
    found = compare(first, other)
    assert found.inputs == ("recording/samples.jsonl",)
    assert found.settings == {"start": ("closed", "thorough")}
    assert found.only == {"eye_flange_from_wrist": 1}
    assert compare(other, first).only == {"eye_flange_from_wrist": 0}


def test_nothing_in_common_cannot_be_told() -> None:
    assert compare(Calibration("refused"), calibration()).agree is None
