"""Cells of a study."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.studies.cells import simulate_cell, statuses
from study_example import SMALL, study

LAYOUTS = ["dual", "eye_in_hand", "eye_to_hand", "two_cameras", "two_world_cameras", "chain", "shifts"]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_statuses_are_those_of_the_cell(layout: str) -> None:
    """Names and statuses are known before a cell is made."""
    settings = study(hold=f"layout: {layout}, {SMALL}, camera_mount: prior").points[0].settings
    made = simulate_cell(settings, 3)
    stated = {name: unknown.status for name, unknown in made.cell.transforms.items()}
    assert statuses(settings) == stated
    assert made.truth.keys() == stated.keys()


def test_shifted_light_is_seen_where_it_is() -> None:
    """Without noise the recorded pixels are what the truth predicts, at the distance asked for within a fifth."""
    settings = study(hold="layout: shifts, distance_m: 2.0, pixel_px: 0.0").points[0].settings
    made = simulate_cell(settings, 1)
    base = made.truth["eye_base_from_hand_base"]
    for sample in made.recording.samples:
        eye, hand = (sample.robots[name].base_from_flange for name in ("eye", "hand"))
        seen = (eye.inverse() @ base @ hand).translation
        assert 1.6 < seen[2] < 2.5
        np.testing.assert_allclose(sample.observations[0].pixels[0], made.cameras["camera"].project(seen), atol=1e-9)


def test_one_number_is_one_cell_at_every_noise() -> None:
    """Truth depends on the seed alone."""
    first, other = study(axes="pixel_px: [0.1, 0.5]", hold=SMALL).points
    truths = [simulate_cell(point.settings, 5).truth["eye_base_from_hand_base"].matrix for point in (first, other)]
    assert np.array_equal(*truths)
