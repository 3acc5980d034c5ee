"""Two calibrations side by side."""

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


@pytest.mark.parametrize("axis", [3, 4, 5])
@pytest.mark.parametrize("of_both", [True, False])
def test_the_rotation_of_a_point_does_not_count(axis, of_both) -> None:
    """Where it is a point to either; of others the angle is told, about whichever axis."""
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


def test_what_only_one_has_differs() -> None:
    """A file, or something asked for, that the other does not know."""
    one = calibration(inputs={"cell.yaml": "a"}, settings={"start": "closed"})
    for found in (compare(one, calibration()), compare(calibration(), one)):
        assert found.inputs == ("cell.yaml",)
        assert set(found.settings) == {"start"}
    assert compare(one, calibration()).settings == {"start": ("closed", None)}


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


def _apart(tangent, names=(NAME,), other=()):
    """Two calibrations of some transforms, those of one of them off by a tangent."""
    one = calibration().transforms[NAME]
    off = calibration(tangent).transforms[NAME]
    first = Calibration("good", transforms=dict.fromkeys((*names, *other), one))
    return compare(first, Calibration("good", transforms={**dict.fromkeys(names, off), **dict.fromkeys(other, one)}))


@pytest.mark.parametrize(("level", "agree"), [(0.006, True), (0.004, False)])
def test_they_agree_up_to_a_chance_of_one_in_two_hundred(level, agree):
    """Of one transform; of three, one of which is off, up to a third of that."""
    sigma = np.sqrt(2) * 1e-4
    assert _apart((sigma * np.sqrt(chi2.isf(level, 6)), 0, 0, 0, 0, 0)).agree == agree
    off = (sigma * np.sqrt(chi2.isf(level / 3, 6)), 0, 0, 0, 0, 0)
    assert _apart(off, other=("a_from_b", "c_from_d")).agree == agree


def test_what_has_no_finite_covariance_is_compared_to_rounding():
    """Neither sigmas nor a chance are told; what is as far apart as numbers are written agrees."""
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


def test_a_covariance_of_gauges_alone_is_compared_to_rounding():
    """The difference of the transform's covariance and that of its gauges may be negative by rounding."""
    gauges = (HeldGauge("eye", ("joint_offsets",), 1e-6 * np.eye(6)),)
    estimate = PoseEstimate(SE3.identity(), (1e-6 - 1e-21) * np.eye(6))
    found = compare(*[Calibration("good", {NAME: estimate}, gauges=gauges, order=(NAME,))] * 2)
    assert (found.transforms[NAME].sigmas, found.transforms[NAME].chance, found.agree) == (None, None, True)


def test_what_is_no_calibration_is_refused() -> None:
    with pytest.raises(InputError, match=r"^second is of type NoneType, expected Calibration$"):
        compare(calibration(), None)  # type: ignore[arg-type]
