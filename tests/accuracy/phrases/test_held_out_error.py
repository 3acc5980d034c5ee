"""Why held-out errors are larger than residuals, where they are."""

from __future__ import annotations

import pytest

from basecal.accuracy.phrases.held_out_error import why_held_out_errors_are_larger
from basecal.cell import Calibration, Residuals, Validation

NOISE = {"robots": {"eye": {"sigma_t_m": [2e-4] * 3, "sigma_r_rad": [4e-4] * 3}}}


def told(rms_px, held_out_px, noise):
    """The sentence about a calibration with these errors."""
    validation = Validation("k-fold", 5, held_out_px)
    return why_held_out_errors_are_larger(
        Calibration("good", residuals=Residuals(rms_px), validation=validation, noise=noise)
    )


def test_both_figures_and_the_noise_that_absorbs_are_named():
    """The sentence has the residual, the held-out error and the sigmas of the robot."""
    sentence = told(0.12, 1.06, NOISE)
    assert all(part in sentence for part in ("1.060 px", "0.120 px", "eye 0.2 mm and 0.4 mrad"))


@pytest.mark.parametrize(
    ("rms_px", "held_out_px", "noise"),
    [
        (0.12, 0.15, NOISE),
        (0.12, 1.06, {}),
        (0.12, 1.06, {"robots": None}),
        (0.12, 1.06, {"robots": {"eye": {"sigma_t_m": [None] * 3, "sigma_r_rad": [0.0] * 3}}}),
        (None, 1.06, NOISE),
        (0.12, None, NOISE),
    ],
)
def test_nothing_is_said_where_there_is_nothing_to_explain(rms_px, held_out_px, noise):
    """Errors that are alike, robots without noise, and cells without pixels."""
    assert told(rms_px, held_out_px, noise) is None


def test_not_validated_is_not_explained():
    """Without cross-validation there is no second figure."""
    assert why_held_out_errors_are_larger(Calibration("good", residuals=Residuals(0.1), noise=NOISE)) is None
