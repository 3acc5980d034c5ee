"""Tests of errors shared by the stops of a robot."""

from __future__ import annotations

import numpy as np

from basecal.effects.faces.shared_errors import SharedErrors
from basecal.geometry import SE3


def test_modes_repeat_in_every_coordinate():
    """Each mode moves each coordinate separately: shifts have the first sigma, rotations the second."""
    modes = np.array([[1.0, 0.0], [0.6, 0.8]])
    errors = SharedErrors.repeat_coordinates(modes)
    size = np.where(errors.is_turn, 3.0, 2.0)
    covariance = (errors.by_stop[0] * size) @ (errors.by_stop[1] * size).T
    np.testing.assert_allclose(covariance, 0.6 * np.diag([4, 4, 4, 9, 9, 9]))
    np.testing.assert_allclose(errors.flange_sigmas(np.array([2.0, 3.0])), [2, 2, 2, 3, 3, 3])


def test_remove_frames_absorbs_base_and_mount():
    """Tangents of base and mount, transferred to each flange, are removed completely.

    Only part of other errors remains.
    """
    rng = np.random.default_rng(0)
    poses = SE3.exp(0.5 * rng.standard_normal((9, 6)))
    by_base, bent = poses.inverse().adjoint()[..., :3], rng.standard_normal((9, 6, 1))
    by_mount = np.broadcast_to(np.eye(6)[:, 2:4], (9, 6, 2))
    errors = SharedErrors(np.concatenate([by_base, by_mount, bent], axis=-1), np.ones(6, dtype=bool))
    left = errors.remove_frames(poses)
    np.testing.assert_allclose(left.by_stop[..., :5], 0.0, atol=1e-12)
    np.testing.assert_allclose(left.remove_frames(poses).by_stop, left.by_stop, atol=1e-12)
    assert np.sum(left.by_stop**2) > 0.5 * np.sum(bent**2)


def test_flange_sigmas_are_rms_over_stops():
    """An error that moves one coordinate by 3 and by 4 at two stops gives the root mean square."""
    by_stop = np.zeros((2, 6, 1))
    by_stop[:, 1, 0] = 3.0, 4.0
    np.testing.assert_allclose(
        SharedErrors(by_stop, np.array([True])).flange_sigmas(np.array([7.0, 2.0])), [0, np.sqrt(50), 0, 0, 0, 0]
    )


def test_remove_frames_weights_half_metre_as_radian():
    """The remainder is smallest in these units: it is orthogonal to the motion of any base or mount."""
    rng = np.random.default_rng(1)
    poses = SE3.exp(0.5 * rng.standard_normal((7, 6)))
    errors = SharedErrors(rng.standard_normal((7, 6, 3)), np.array([False, True, True]))
    left = errors.remove_frames(poses)
    units = np.repeat([1.0, 0.5], 3)[:, None]
    for frames in (poses.inverse().adjoint(), np.broadcast_to(np.eye(6), (7, 6, 6))):
        product = np.einsum("nij,nik->jk", units * frames, units * left.by_stop)
        np.testing.assert_allclose(product, 0.0, atol=1e-10)
    assert left.is_turn.tolist() == [False, True, True]


def test_base_axis_errors_are_rotated_into_flange():
    """A unit shift along x of the base, and a rotation about z of other axes, are expressed in the flange."""
    poses = SE3.exp(0.8 * np.random.default_rng(2).standard_normal((4, 6)))
    errors = SharedErrors(np.broadcast_to(np.eye(6)[:, [0, 5]], (4, 6, 2)), np.array([False, True]))
    found = errors.rotate_to(poses)
    along_x = np.tile(np.eye(3)[:, :1], (4, 1, 1))
    np.testing.assert_allclose(poses.rotation @ found.by_stop[:, :3, :1], along_x, atol=1e-12)
    axes = SE3.exp(np.random.default_rng(3).standard_normal((4, 6))).rotation
    turned = errors.rotate_to(poses, axes)
    np.testing.assert_allclose(poses.rotation @ turned.by_stop[:, 3:, 1:], axes[:, :, 2:], atol=1e-12)
    np.testing.assert_allclose(turned.by_stop[:, 3:, 0], 0, atol=1e-12)
