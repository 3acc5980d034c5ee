"""Tests of calibration with parts that two arms hold, and with planes and edges that they touch."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import BASE, TRUTH, clamp_cell, clamp_lines, held_poses, recorded, surface_cell, surface_lines

from basecal.accuracy.calibrate import calibrate
from basecal.geometry import SE3


@pytest.mark.journey
@pytest.mark.parametrize("axis", ["fixed", "free"])
def test_part_in_both_grips_determines_base(axis):
    """With unknown grips the answer is good and the base within four sigmas.

    The noise of places and directions is correct.
    """
    cell = clamp_cell(axis)
    poses = held_poses(np.random.default_rng(3), 20, is_hinge=axis == "free")
    found = calibrate(cell, recorded(cell, clamp_lines(poses)))
    off = (found[BASE].mean.inverse() @ TRUTH).log()
    assert found.verdict == "good", found.findings
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(found[BASE].covariance)))
    assert found.noise["touch_m"] == pytest.approx(1e-4, rel=0.5)
    assert found.noise["grip_rad"] == pytest.approx(1e-3, rel=0.5)


@pytest.mark.journey
def test_plane_and_two_marks_determine_base():
    """The plane fixes the rotation about the line of the marks: good, and the base within four sigmas."""
    shapes = {"floor": "plane", "mark_a": "point", "mark_b": "point"}
    cell = surface_cell(shapes)
    found = calibrate(cell, recorded(cell, surface_lines(np.random.default_rng(2), 48, 2e-4, shapes)))
    off = (found[BASE].mean.inverse() @ TRUTH).log()
    assert found.verdict == "good", found.findings
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(found[BASE].covariance)))
    assert found.noise["touch_m"] == pytest.approx(2e-4, rel=0.5)


@pytest.mark.journey
def test_part_without_rotation_is_refused():
    """A part that never rotates is refused, with the missing direction and the motion that fixes it."""
    cell, rng = clamp_cell("fixed"), np.random.default_rng(1)
    first = held_poses(rng, 1)[0]
    moves = [SE3(np.eye(3), rng.uniform(-0.2, 0.2, 3)) for _ in range(12)]
    error = SE3.exp(1e-4 * rng.standard_normal((12, 6)))
    hand = [TRUTH.inverse() @ at @ TRUTH @ first["hand"] @ error[k] for k, at in enumerate(moves)]
    poses = [{"eye": at @ first["eye"], "hand": hand[k]} for k, at in enumerate(moves)]
    found = calibrate(cell, recorded(cell, clamp_lines(poses)))
    assert found.verdict == "refused"
    named = [each for each in found.findings if each.code == "unobservable-direction"]
    assert any("Rotate" in do for each in named for do in each.do)
