"""Tests of a mount that bends: it rotates by l x g in its flange."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.effect import FoundEffect
from basecal.effects.mount_bend import bend, candidates, words
from basecal.simulation import Scenario
from made_views import views_of


def test_mount_bend_rotates_about_flange():
    """The rotation is l x g minus its mean over the poses, which a free mount absorbs."""
    of = views_of(Scenario(samples=12))
    lever, down = np.array([3e-7, -2e-7, 1e-6]), of.down_in_flange(0, "hand")
    np.testing.assert_allclose(
        down,
        of.recorded_pose(0, "hand").rotation.mT
        @ (of.state.transforms["eye_base_from_hand_base"].rotation.T @ [0, 0, -1]),
        atol=1e-12,
    )
    turn = np.cross(lever, down - down.mean(0))
    expected = (of.flange_jacobian(0, "hand") @ np.append(np.zeros((12, 3)), turn, 1)[..., None])[..., 0]
    (moves,) = (c.moves[0][:, 0] for c in candidates(of) if c.about == ("hand_flange_from_board",))
    np.testing.assert_allclose(moves @ lever, expected, atol=1e-15)


def test_fixed_mount_bends_from_stated_pose():
    """A fixed mount was measured without load, so no mean is subtracted."""
    of = views_of(Scenario(samples=12, target_mount="fixed"))
    (moves,) = (c.moves[0][:, 0] for c in candidates(of) if c.about == ("hand_flange_from_board",))
    lever = np.array([0.0, 0.0, 1e-6])
    turn = np.cross(lever, of.down_in_flange(0, "hand"))
    expected = (of.flange_jacobian(0, "hand") @ np.append(np.zeros((12, 3)), turn, 1)[..., None])[..., 0]
    np.testing.assert_allclose(moves @ lever, expected, atol=1e-15)


def test_simulated_bend_is_about_z():
    """The bend has its full size if gravity is perpendicular to z, and is zero along z."""
    np.testing.assert_allclose(bend(1e-3, np.array([1.0, 0.0, 0.0])), [0, 0, 0, 0, 1e-3, 0])
    np.testing.assert_allclose(bend(1e-3, np.array([0.0, 0.0, -1.0])), 0.0)


def test_mount_bend_message_has_size():
    """The message has the name of the mount and the bend with its sigma."""
    size, covariance = np.array([6e-4, 0.0, -8e-4]), 4e-8 * np.eye(3)
    found = FoundEffect("mount_bend", "mount-bent", "m", False, False, None, "rad", size, covariance, np.zeros(1))
    assert words(found).what == "m bends by 1.00 ± 0.20 mrad under gravity."
