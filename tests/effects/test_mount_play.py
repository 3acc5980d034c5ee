"""Tests of a mount with play: it shifts by T g in its flange."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.effect import FoundEffect
from basecal.effects.mount_play import candidates, flange_tangents, slide, words
from basecal.simulation import Scenario
from made_views import views_of

DOWN = np.array([[0.6, 0.0, -0.8], [0.0, 1.0, 0.0]])


def test_play_covers_linear_shifts_except_along_gravity():
    """Eight matrices without a trace cover rotated gravity and a slide along an axis.

    None shifts along gravity itself.
    """
    by = flange_tangents(DOWN)
    assert not by[:, 3:].any()
    rows = np.concatenate([flange_tangents(np.eye(3))[:, :3], np.eye(3)[..., None]], -1).reshape(9, 9)
    assert np.linalg.matrix_rank(rows) == 9
    np.testing.assert_allclose(rows.T @ rows, np.diag([2.0] * 8 + [3.0]), atol=1e-12)


def test_each_robot_mount_has_play_candidate():
    """The camera's and the target's mount on a robot are candidates."""
    found = list(candidates(views_of(Scenario(samples=12))))
    assert [each.about for each in found] == [("eye_flange_from_wrist",), ("hand_flange_from_board",)]


def test_simulated_play_slides_along_x():
    """The shift is proportional to the component of gravity along x."""
    np.testing.assert_allclose(slide(1e-3, DOWN[0]), [6e-4, 0, 0, 0, 0, 0])


def test_mount_play_message_has_mean_shift():
    """Gravity rotated by c gives a mean shift of c times the root of two thirds over all directions."""
    size = np.array([0.0, 0.0, 3e-4, *np.zeros(5)])
    found = FoundEffect("mount_play", "mount-play", "m", False, False, None, "m", size, 1e-10 * np.eye(8), np.zeros(1))
    assert words(found).what == "m shifts by 0.2449 ± 0.0082 mm under gravity."


def test_play_matrices_are_orthogonal_basis():
    """The matrices have equal norms and no trace; rotations of gravity come first, then springs, then stretches."""
    along = flange_tangents(np.eye(3))
    matrices = np.moveaxis(along[:, :3], 0, 1)  # each column is the shift by gravity along one axis
    assert along.shape == (3, 6, 8)
    assert not along[:, 3:].any()
    np.testing.assert_allclose(np.einsum("ijk,ijl->kl", matrices, matrices), 2 * np.eye(8), atol=1e-15)
    np.testing.assert_allclose(np.trace(matrices), 0, atol=1e-15)
    turned, even = matrices[..., :3], matrices[..., 3:]
    np.testing.assert_array_equal(turned, -np.swapaxes(turned, 0, 1))
    np.testing.assert_array_equal(even, np.swapaxes(even, 0, 1))
