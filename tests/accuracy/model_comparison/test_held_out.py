"""Tests of model comparison by held-out parts of the recording."""

import numpy as np
import pytest
from scipy.stats import t as student

from basecal.accuracy.model_comparison.held_out import compare_predicted_gains, compare_predictions
from basecal.accuracy.model_comparison.nested_models import Decision


def test_chance_is_students_t():
    """The chance is Student's t of the mean over its standard error, with one freedom less than parts.

    Losses mirror it.
    """
    gains = np.array([1.0, 2.0, 4.0, 1.0, -0.5])
    t = gains.mean() / (gains.std(ddof=1) / np.sqrt(5))
    found = compare_predicted_gains(gains)
    assert found.gain == pytest.approx(7.5)
    assert found.chance == pytest.approx(student.sf(t, 4), rel=1e-9)
    assert compare_predicted_gains(-gains).chance == pytest.approx(student.cdf(t, 4), rel=1e-9)


@pytest.mark.parametrize(("t", "decision"), [
    (4.4, Decision.TAKE), (4.2, Decision.UNDECIDED), (2.45, Decision.UNDECIDED), (2.35, Decision.KEEP),
    (-9.0, Decision.KEEP),
])  # fmt: skip
def test_gains_are_taken_or_undecided_by_chance(t, decision):
    """Gains of ten parts are taken above 4.30 standard errors and undecided above 2.40.

    These are chances of one in a thousand and one in fifty.
    """
    gains = np.tile([1.0, -1.0], 5)
    gains += t * gains.std(ddof=1) / np.sqrt(10)
    assert compare_predicted_gains(gains).decision is decision


@pytest.mark.parametrize("gains", [[3.0], [], [0.0, 0.0, 0.0]])
def test_single_part_or_equal_models_keep_model(gains):
    """A single part, none, or equal predictions keep the model in use."""
    assert compare_predicted_gains(np.array(gains)).decision is Decision.KEEP


SPREAD = 1e-6 * np.random.default_rng(0).uniform(0.5, 1.5, 12)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
@pytest.mark.parametrize(("ratio", "decision"), [
    (3.0, Decision.TAKE), (1.12, Decision.TAKE), (1.05, Decision.UNDECIDED), (0.95, Decision.UNDECIDED),
    (0.85, Decision.KEEP),
])  # fmt: skip
def test_rival_must_predict_a_tenth_better(scale, ratio, decision):
    """A rival is taken if it predicts a tenth better, in any unit.

    One that predicts equally is undecided, a worse one rejected.
    """
    squares, in_use = scale * SPREAD, scale * ratio**2 * SPREAD
    assert compare_predictions(squares, in_use).decision is decision


def test_wider_model_needs_requested_ratio():
    """A wider model is taken from the requested ratio on; below it, it is undecided."""
    assert compare_predictions(SPREAD, 1.3**2 * SPREAD, 1.5).decision is Decision.UNDECIDED
    assert compare_predictions(SPREAD, 1.5**2 * SPREAD, 1.5).is_taken


def test_outlier_parts_do_not_outweigh_rest():
    """Three of twelve parts that neither model predicts have no effect, whichever is farther off."""
    for share in (0.5, 2.0):
        squares, in_use = SPREAD.copy(), 400 * SPREAD
        squares[:3] = 1.0
        in_use[:3] = share
        assert compare_predictions(squares, in_use).is_taken


def test_gain_of_two_parts_is_chance():
    """A rival twice as likely on average, by two of twelve parts alone, is undecided."""
    in_use = SPREAD.copy()
    in_use[:2] *= 1e4
    found = compare_predictions(SPREAD, in_use)
    assert found.decision is Decision.UNDECIDED
    assert found.gain > 12


def test_comparison_without_parts_is_undecided():
    """A comparison without parts is undecided."""
    assert compare_predictions(np.zeros(0), np.zeros(0)).decision is Decision.UNDECIDED


def test_single_part_has_chance_of_half():
    """A single part has no spread and a chance of one half; two parts have a spread."""
    assert compare_predicted_gains(np.array([3.0])).chance == compare_predicted_gains(np.zeros(0)).chance == 0.5
    two = compare_predicted_gains(np.array([3.0, 1.0]))
    assert two.chance == pytest.approx(student.sf(2.0, 1))
    assert compare_predicted_gains(np.array([1.0, -1.0])).chance == 0.5


def test_prediction_gain_uses_cauchy_likelihood():
    """The gain is twice the log Cauchy likelihood, scaled by the mean of the better model's smallest squares.

    Its chance is Student's t.
    """
    squares, in_use = np.array([1.0, 2.0, 3.0, 100.0]), np.array([4.0, 5.0, 9.0, 90.0])
    scale = np.mean(squares[:3])
    gains = np.log1p(in_use / scale) - np.log1p(squares / scale)
    for one, other, sign in ((squares, in_use, 1), (in_use, squares, -1)):
        found = compare_predictions(one, other)
        assert found.gain == pytest.approx(2 * sign * gains.sum())
        t = sign * gains.mean() / (gains.std(ddof=1) / 2)
        assert found.chance == pytest.approx(student.sf(t, 3))
    nothing = compare_predictions(np.zeros(0), np.zeros(0))
    assert (nothing.gain, nothing.chance, nothing.decision) == (0.0, 0.5, Decision.UNDECIDED)
