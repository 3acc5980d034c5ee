"""The paper's simulated cell."""

from __future__ import annotations

import numpy as np

from basecal.studies.cells import simulate_cell
from basecal.studies.paper import paper_study
from basecal.studies.paper_cell import paper_cell, paper_numbers, printed_pose


def test_a_pose_is_as_printed():
    """A rounded rotation stays rounded: the paper's base, whose columns are off by 1e-4."""
    rotation = printed_pose(paper_numbers()["testbed"]["eye_base_from_hand_base_true"]).rotation
    assert 1e-6 < np.abs(rotation.T @ rotation - np.eye(3)).max() < 1e-3


def test_the_closed_form_is_near_without_noise():
    """The base's light is found within the depth that the closed form neglects, a millimetre in 3.6 m."""
    bed = paper_cell(paper_numbers())
    found = bed.closed_form(bed.image(bed.camera_from_led, bed.shift_m), bed.shift_m).camera_from_led
    assert np.abs(found.translation - bed.camera_from_led.translation).max() < 2e-3


def test_a_study_has_the_same_cell():
    """Its recording sees the light where the paper's cell has it, but for the printed rotation's rounding."""
    bed = paper_cell(paper_numbers())
    made = simulate_cell(paper_study().points[0].settings, 0)
    seen = np.concatenate([sample.observations[0].pixels for sample in made.recording.samples])
    np.testing.assert_allclose(seen, bed.image(bed.camera_from_led, bed.shift_m), atol=0.05)
