"""Tests of the finding `overfit`: held-out samples are predicted much worse than expected."""

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.findings.overfit import overfit


def errors(cost, px=None, metres=None, uncertain=0.0):
    count_px, count_poses = (0 if px is None else 10), (0 if metres is None else 10)
    squares = {"square_px": 10 * (px or 0) ** 2, "square_m": 10 * (metres or 0) ** 2}
    return SimpleNamespace(cost=cost, uncertain=uncertain, count_px=count_px, count_poses=count_poses, **squares)


def make_validation(used, predicted, summary=True):
    return SimpleNamespace(summary=summary, fitted=used, predicted=predicted)


@pytest.mark.parametrize(("ratio", "found"), [(1.0, False), (3.8, False), (4.0, True), (np.inf, True)])
def test_ratio_of_four_is_overfit(evidence, ratio, found):
    """A held-out error about four times the expected one is overfit, beyond a chance of one in ten thousand.

    Both errors are stated.
    """
    validated = make_validation(errors(1.0, px=0.25), errors(ratio**2, px=1.0))
    made = overfit(evidence(cross_validation=validated))
    assert [f.severity for f in made] == (["warning"] if found else [])
    assert not found or f"is {ratio:.1f} times" in made[0].message
    assert not found or "(1.0 px against 0.25 px)" in made[0].message


def test_errors_without_pixels_are_in_millimetres(evidence):
    """Without pixels, both errors are stated in millimetres."""
    (made,) = overfit(evidence(cross_validation=make_validation(errors(1.0, metres=1e-3), errors(25.0, metres=5e-3))))
    assert "(5.0 mm against 1.0 mm)" in made.message


def test_rounding_errors_are_no_overfit(evidence):
    """A cell that fits to rounding is not overfit; one that fits exactly and predicts badly is."""
    assert overfit(evidence(cross_validation=make_validation(errors(0.0, px=0.0), errors(9e-12, px=0.0)))) == []
    assert len(overfit(evidence(cross_validation=make_validation(errors(0.0, px=0.0), errors(1.1e-11, px=0.0))))) == 1


def test_missing_cross_validation_gives_no_finding(evidence):
    """Without cross-validation, or if no sample could be held out, there is no finding."""
    assert overfit(evidence()) == []
    assert overfit(evidence(cross_validation=make_validation(errors(1.0), errors(100.0), summary=None))) == []


@pytest.mark.parametrize(("used", "predicted"), [
    ((1.0,), (25.0, 1.0)), ((1.0, 0.2), (25.0,)), ((1.0,), (25.0,)), ((1.0, None, 1e-3), (25.0,)),
])  # fmt: skip
def test_incomparable_errors_state_ratio_only(evidence, used, predicted):
    """If fitted and held-out errors have no shared unit, the message states only their ratio."""
    (made,) = overfit(evidence(cross_validation=make_validation(errors(*used), errors(*predicted))))
    assert "is 5.0 times its expected value. The covariance" in made.message


def test_ratio_uses_both_costs(evidence):
    """The ratio uses both costs: of equal held-out errors, the one with the smaller fitted cost is overfit."""
    assert overfit(evidence(cross_validation=make_validation(errors(4.0), errors(60.0)))) == []
    (made,) = overfit(evidence(cross_validation=make_validation(errors(0.25), errors(60.0))))
    assert "is 15.5 times its expected value" in made.message


def test_expected_uncertainty_is_no_overfit(evidence):
    """Held-out errors that the covariance expects are no overfit, e.g. of views that few others predict."""
    assert overfit(evidence(cross_validation=make_validation(errors(1.0), errors(100.0, uncertain=20.0)))) == []
    (made,) = overfit(evidence(cross_validation=make_validation(errors(1.0), errors(100.0, uncertain=3.0))))
    assert "is 5.0 times" in made.message
