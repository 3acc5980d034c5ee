"""Tests of OpenCV's robot-world solver on draws."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.studies.draws import draw, draw_cell
from basecal.studies.solvers.opencv import refusal_reason, solve
from study_example import SMALL, study

LAYOUTS = {
    "eye_in_hand": ("arm_flange_from_wrist", "arm_base_from_board"),
    "eye_to_hand": ("arm_base_from_overhead", "arm_flange_from_board"),
    "dual": ("eye_base_from_hand_base", "hand_flange_from_board"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_exact_pixels_give_the_truth(layout: str) -> None:
    """Both unknowns of each layout are exact to a micrometre and a microradian."""
    settings = (
        study(hold=f"{SMALL}, layout: {layout}, pixel_px: 0.0, camera_mount: {_mount(layout)}").points[0].settings
    )
    for name in LAYOUTS[layout]:
        found = solve(draw(draw_cell(settings, 0, 0, name), settings, (0, 0, 0), 1))
        truth = draw_cell(settings, 0, 0, name).simulated.truth[name]
        assert found.solved.all()
        np.testing.assert_allclose((truth.inverse() @ found.transform[0]).log(), 0, atol=1e-6)


def _mount(layout: str) -> str:
    return "fixed" if layout == "dual" else "free"


def test_unsupported_problems_have_a_reason() -> None:
    """Three unknowns and a free lens are not supported."""
    for hold in ("layout: dual", "layout: eye_in_hand, intrinsics: free"):
        assert "opencv" in refusal_reason(study(hold=hold).points[0].settings)
    assert refusal_reason(study(hold="layout: eye_to_hand").points[0].settings) is None
