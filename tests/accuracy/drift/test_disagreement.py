"""New samples against a calibration, and what explains them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.drift.disagreement import disagreement
from basecal.accuracy.drift.shifts import SIZE_KIND
from basecal.accuracy.model_comparison.nested_models import DISAGREES
from basecal.cell import Recording
from drift_cells import BASE, later

HALF_A_DEGREE = np.radians(0.5)


def test_samples_of_a_cell_that_is_unchanged_agree():
    """Their chance is large, and no cause is looked for."""
    made = later(0)
    found = disagreement(made.cell, made.calibration, made.recording)
    assert found.chance > DISAGREES
    assert found.causes == ()


def test_a_large_shift_is_found_to_second_order():
    """A base that moved by 30 mm and half a degree explains all samples, with the size it has, and alone."""
    made = later(0)
    tangent = np.array([0.03, 0, 0, 0, 0, HALF_A_DEGREE])
    found = disagreement(made.cell, made.calibration, made.with_base_moved(tangent))
    assert found.chance < 1e-6
    assert found.chance_left > 1e-3
    assert [cause.transform for cause in found.causes] == [BASE]
    np.testing.assert_allclose(np.abs(found.causes[0].size), np.abs(tangent), atol=1e-3)


def test_views_of_other_poses_have_no_cause():
    """Views that are paired with the poses of other samples are explained by nothing that moved."""
    made = later(0)
    samples = made.recording.samples
    turned = [*samples[1:], samples[0]]
    mixed = [replace(own, observations=other.observations) for own, other in zip(samples, turned, strict=True)]
    found = disagreement(made.cell, made.calibration, Recording(tuple(mixed)))
    assert found.chance_left < 1e-6


def test_another_board_is_named_by_its_size():
    """A board whose points are 2 % farther apart than stated shows as one that is larger by 2 %."""
    made = later(0)
    name = next(iter(made.cell.targets))
    shape = made.cell.targets[name].target
    smaller = replace(shape, points=shape.points / 1.02)
    cell = replace(made.cell, targets={name: replace(made.cell.targets[name], target=smaller)})
    found = disagreement(cell, made.calibration, made.recording)
    assert (found.causes[0].frame, found.causes[0].transform) == (name, SIZE_KIND)
    np.testing.assert_allclose(found.causes[0].size, 0.02, atol=2e-3)
