"""Tests of `compare`: two calibrations side by side."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from basecal.accuracy.compare import compare
from basecal.cell import Calibration, HeldGauge
from basecal.errors import InputError
from basecal.geometry import SE3, PoseEstimate

NAME = "eye_base_from_hand_base"
COVARIANCE = np.diag([1e-4, 2e-4, 3e-4, 1e-3, 1e-3, 1e-3]) ** 2


def calibration(tangent=(0, 0, 0, 0, 0, 0), covariance=COVARIANCE, **changed) -> Calibration:
    mean = SE3.exp(np.array([0.5, 0.2, 0.1, 0.3, -0.2, 1.0])) @ SE3.exp(np.asarray(tangent, dtype=float))
    return Calibration("good", transforms={NAME: PoseEstimate(mean, covariance)}, **changed)


def test_equal_calibrations_agree() -> None:
    """Equal calibrations agree, without a shift or different inputs and settings."""
    found = compare(calibration(), calibration())
    assert found.agree is True
    assert found.transforms[NAME].shift_m == pytest.approx(0.0, abs=1e-12)
    assert found.inputs == ()
    assert found.settings == {}


def test_difference_uses_both_covariances() -> None:
    """Two sigmas of the summed covariance along one axis give a squared distance of 4 with six freedoms."""
    step = 2 * np.sqrt(2) * 1e-4
    found = compare(calibration(), calibration((step, 0, 0, 0, 0, 0))).transforms[NAME]
    assert found.shift_m == pytest.approx(step)
    assert found.sigmas == pytest.approx(np.sqrt(4 / 6), rel=1e-6)
    assert found.chance == pytest.approx(0.6767, abs=1e-3)


def test_distant_calibrations_disagree() -> None:
    """A translation of 2 mm or a rotation of 20 mrad disagrees."""
    assert compare(calibration(), calibration((2e-3, 0, 0, 0, 0, 0))).agree is False
    assert compare(calibration(), calibration((0, 0, 0, 0, 0, 0.02))).agree is False


@pytest.mark.parametrize("axis", [3, 4, 5])
@pytest.mark.parametrize("of_both", [True, False])
def test_rotation_of_point_is_ignored(axis, of_both) -> None:
    """A rotation is ignored if the transform is a point in either calibration.

    Else the angle is stated, about any axis.
    """
    tangent = 0.5 * np.eye(6)[axis]
    point = frozenset({NAME})
    turned = calibration(tangent, points=point)
    for found in (compare(calibration(points=point if of_both else frozenset()), turned),
                  compare(turned, calibration(points=point if of_both else frozenset()))):  # fmt: skip
        assert found.agree is True
        assert found.transforms[NAME].shift_rad == 0.0
    whole = compare(calibration(), calibration(tangent))
    assert whole.agree is False
    assert whole.transforms[NAME].shift_rad == pytest.approx(0.5)
    assert whole.transforms[NAME].shift_m == pytest.approx(0.0, abs=1e-9)


def test_input_or_setting_of_one_side_differs() -> None:
    """A file or setting that only one calibration has counts as different."""
    one = calibration(inputs={"cell.yaml": "a"}, settings={"start": "closed"})
    for found in (compare(one, calibration()), compare(calibration(), one)):
        assert found.inputs == ("cell.yaml",)
        assert set(found.settings) == {"start"}
    assert compare(one, calibration()).settings == {"start": ("closed", None)}


def test_exact_transforms_must_be_equal() -> None:
    """Transforms without uncertainty agree only if they are equal."""
    exact = np.zeros((6, 6))
    assert compare(calibration(covariance=exact), calibration(covariance=exact)).agree is True
    assert compare(calibration(covariance=exact), calibration((1e-3, 0, 0, 0, 0, 0), exact)).agree is False


def test_different_inputs_settings_and_transforms_are_listed() -> None:
    """Different inputs and settings, and transforms that only one calibration has, are listed."""
    first = calibration(inputs={"cell.yaml": "a", "recording/samples.jsonl": "b"}, settings={"start": "closed"})
    other = replace(first, inputs={"cell.yaml": "a", "recording/samples.jsonl": "c"}, settings={"start": "thorough"})
    other = replace(other, transforms={**other.transforms, "eye_flange_from_wrist": other[NAME]})
    found = compare(first, other)
    assert found.inputs == ("recording/samples.jsonl",)
    assert found.settings == {"start": ("closed", "thorough")}
    assert found.only == {"eye_flange_from_wrist": 1}
    assert compare(other, first).only == {"eye_flange_from_wrist": 0}


def test_calibrations_without_shared_transforms_are_undecided() -> None:
    """Without shared transforms the agreement is None."""
    assert compare(Calibration("refused"), calibration()).agree is None


def _apart(tangent, names=(NAME,), other=()):
    """Two calibrations of some transforms, of which the named ones are off by a tangent."""
    one = calibration().transforms[NAME]
    off = calibration(tangent).transforms[NAME]
    first = Calibration("good", transforms=dict.fromkeys((*names, *other), one))
    return compare(first, Calibration("good", transforms={**dict.fromkeys(names, off), **dict.fromkeys(other, one)}))


@pytest.mark.parametrize(("level", "agree"), [(0.006, True), (0.004, False)])
def test_agreement_level_is_one_in_two_hundred(level, agree):
    """Calibrations agree up to a chance of one in two hundred for one transform, of three up to a third of it."""
    sigma = np.sqrt(2) * 1e-4
    assert _apart((sigma * np.sqrt(chi2.isf(level, 6)), 0, 0, 0, 0, 0)).agree == agree
    off = (sigma * np.sqrt(chi2.isf(level / 3, 6)), 0, 0, 0, 0, 0)
    assert _apart(off, other=("a_from_b", "c_from_d")).agree == agree


def test_infinite_covariance_is_compared_to_rounding():
    """Without a finite covariance no sigmas or chance are given, and equality to rounding agrees."""
    vague = (HeldGauge("eye", ("joint_offsets",), np.full((6, 6), np.nan)),)
    for held in ({}, {"gauges": vague, "order": (NAME,)}):
        for off, agree in ((0.9e-12, True), (3e-12, False)):
            for tangent in ((off, 0, 0, 0, 0, 0), (0, 0, 0, off, 0, 0)):
                first, second = (
                    Calibration("good", {NAME: PoseEstimate.exact(SE3.exp(np.array(xi)))}, **held)
                    for xi in (np.zeros(6), tangent)
                )
                found = compare(first, second)
                assert found.agree == agree
                assert (found.transforms[NAME].sigmas, found.transforms[NAME].chance) == (None, None)


def test_gauge_covariance_is_compared_to_rounding():
    """If the covariance is that of gauges alone, the transforms are compared to rounding.

    The difference of both covariances may be negative by rounding.
    """
    gauges = (HeldGauge("eye", ("joint_offsets",), 1e-6 * np.eye(6)),)
    estimate = PoseEstimate(SE3.identity(), (1e-6 - 1e-21) * np.eye(6))
    found = compare(*[Calibration("good", {NAME: estimate}, gauges=gauges, order=(NAME,))] * 2)
    assert (found.transforms[NAME].sigmas, found.transforms[NAME].chance, found.agree) == (None, None, True)


def test_other_types_are_refused() -> None:
    """An argument that is no Calibration raises an InputError."""
    with pytest.raises(InputError, match=r"^second is of type NoneType, expected Calibration$"):
        compare(calibration(), None)  # type: ignore[arg-type]
