"""Tests of `explain_held_out_error`: why held-out errors exceed residuals."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.phrases.held_out_error import explain_held_out_error
from basecal.cell import Calibration, Residuals, Validation
from basecal.fields.digits import two_digits

NOISE = {"robots": {"eye": {"sigma_t_m": [2e-4] * 3, "sigma_r_rad": [4e-4] * 3}}}


def explain(rms_px, held_out_px, noise):
    """The sentence about a calibration with these errors."""
    validation = Validation("k-fold", 5, held_out_px)
    return explain_held_out_error(Calibration("good", residuals=Residuals(rms_px), validation=validation, noise=noise))


def test_sentence_has_errors_and_noise():
    """The sentence has the residual, the held-out error and the sigmas of the robot."""
    sentence = explain(0.12, 1.06, NOISE)
    assert all(part in sentence for part in ("1.1 px", "0.12 px", "eye 0.20 mm and 0.40 mrad"))


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
def test_equal_errors_need_no_explanation(rms_px, held_out_px, noise):
    """Equal errors, robots without noise, and cells without pixels have no sentence."""
    assert explain(rms_px, held_out_px, noise) is None


def test_missing_validation_needs_no_explanation():
    """Without cross-validation there is no second error to explain."""
    assert explain_held_out_error(Calibration("good", residuals=Residuals(0.1), noise=NOISE)) is None


@pytest.mark.parametrize(("length_m", "angle_rad"), [(3e-4, 0.0), (0.0, 5e-4)])
def test_noise_along_single_axis_is_explained(length_m, angle_rad):
    """Robot noise of translation or rotation alone is explained from 1.5 times the residual on.

    Sigmas are stated as their rms.
    """
    arm = {"sigma_t_m": [length_m * np.sqrt(3), 0.0, 0.0], "sigma_r_rad": [0.0, angle_rad * np.sqrt(3), 0.0]}
    noise = {"robots": {"still": {"sigma_t_m": [0.0] * 3, "sigma_r_rad": [0.0] * 3}, "arm": arm, **NOISE["robots"]}}
    assert explain(0.1, 0.149, noise) is None
    arm = f"arm {two_digits(1e3 * length_m)} mm and {two_digits(1e3 * angle_rad)} mrad"
    assert explain(0.1, 0.151, noise) == (
        "Held-out views are off by 0.15 px and residuals are 0.10 px. Each stop in use has its own estimated pose "
        f"error ({arm}; eye 0.20 mm and 0.40 mrad; 1 sigma per "
        "axis). The pose error of a held-out stop is unknown. Expect the larger figure at a new pose."
    )
