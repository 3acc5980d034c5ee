"""Tests of the paper's simulated cell."""

from __future__ import annotations

import numpy as np

from basecal.studies.cells import simulate_cell
from basecal.studies.paper import paper_study
from basecal.studies.paper_cell import paper_cell, paper_numbers, printed_pose


def test_printed_rotation_is_not_orthonormalised():
    """A rounded rotation stays rounded: the columns of the paper's base are off by 1e-4."""
    rotation = printed_pose(paper_numbers()["testbed"]["eye_base_from_hand_base_true"]).rotation
    assert 1e-6 < np.abs(rotation.T @ rotation - np.eye(3)).max() < 1e-3


def test_noiseless_closed_form_is_accurate():
    """The error is that of the depth that the closed form neglects, a millimetre in 3.6 m."""
    bed = paper_cell(paper_numbers())
    found = bed.closed_form(bed.image(bed.camera_from_led, bed.shift_m), bed.shift_m).camera_from_led
    assert np.abs(found.translation - bed.camera_from_led.translation).max() < 2e-3


def test_study_uses_the_cell_of_the_paper():
    """The recording has the pixels of the paper's cell, except for the rounding of the printed rotation."""
    bed = paper_cell(paper_numbers())
    made = simulate_cell(paper_study().points[0].settings, 0)
    seen = np.concatenate([sample.observations[0].pixels for sample in made.recording.samples])
    np.testing.assert_allclose(seen, bed.image(bed.camera_from_led, bed.shift_m), atol=0.05)
