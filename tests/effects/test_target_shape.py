"""Tests of bowed boards: the distance of their points from the plane."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.targets.chessboard import chessboard_target
from basecal.effects.target_shape import (
    BOW_COEFFICIENTS,
    bow_height_m,
    freedoms,
    has_area,
    is_flat,
    point_shifts_m,
    unit_bow,
    unit_shifts,
    words,
)
from basecal.geometry import SE3

BOARD = chessboard_target((9, 6), 0.04)


def test_bow_moves_points_out_of_plane_only():
    """The shift is the squared position over the half size: 0.3 % of it at the end of the longer side."""
    shape = unit_bow(BOARD.points)
    np.testing.assert_allclose(shape[:, :2, :], 0.0, atol=1e-12)
    assert np.abs(shape[:, 2, :]).max() == pytest.approx(3e-3 * 0.16, rel=1e-6)


def test_bow_height_is_measured_from_fitted_plane():
    """Tilt and shift of the surface do not count: a twist of one sigma lifts the corner (1, 5/8) by its product."""
    assert bow_height_m(BOARD.points, np.array([0.0, 1.0, 0.0])) == pytest.approx(3e-3 * 0.16 * 5 / 8, rel=1e-6)


@pytest.mark.parametrize(
    ("tilt", "u_axis", "normal"),
    [
        ([0, 0, 0], [1, 0, 0], [0, 0, 1]),
        ([0, np.pi / 2, 0], [0, 1, 0], [1, 0, 0]),  # the first axis of the target is across the board
        ([0, 1.1, 0], [np.cos(1.1), 0, -np.sin(1.1)], [np.sin(1.1), 0, np.cos(1.1)]),
        ([0, 1.2, 0], [0, 1, 0], [np.sin(1.2), 0, np.cos(1.2)]),
        ([np.pi, 0, 0], [1, 0, 0], [0, 0, 1]),
    ],
)
def test_bow_coefficients_are_quadratic(tilt, u_axis, normal):
    """Coefficients are the squares and the product of positions over the half size.

    The axes are the target's first axis as far as it lies in the plane, and the one across it. If nine tenths or more
    of the first axis are across the board, the second axis is used.
    """
    points = BOARD.points @ SE3.from_rotvec(np.array(tilt, dtype=float), np.zeros(3)).rotation.T
    u, v = ((points - points.mean(0)) @ np.transpose([u_axis, np.cross(normal, u_axis)]) / 0.16).T
    heights = 3e-3 * 0.16 * np.array([u * u, u * v, v * v]).T
    shape = unit_bow(points + np.array([0.1, -0.2, 0.3]))
    assert shape.shape == (len(points), 3, BOW_COEFFICIENTS)
    np.testing.assert_allclose(shape, np.einsum("pk,i->pik", heights, normal), atol=1e-12)


def test_bowl_height_is_above_mean_of_square():
    """The plane absorbs the mean of u squared, which is 5/12 for u from -1 to 1 in nine steps."""
    assert np.mean(np.linspace(-1, 1, 9) ** 2) == pytest.approx(5 / 12)
    assert bow_height_m(BOARD.points, np.array([1.0, 0.0, 0.0])) == pytest.approx(3e-3 * 0.16 * 7 / 12, rel=1e-6)


@pytest.mark.parametrize("size", [1.0, 0.1])
def test_body_points_shift_by_share_of_size(size):
    """Points shift by some thousandths of the distance to the farthest, along each axis; rigid motion is excluded."""
    points = size * np.random.default_rng(0).uniform(-1, 1, (40, 3))
    shifts = unit_shifts(points).reshape(120, 120)
    share = np.sqrt(np.mean(np.sum(shifts**2, axis=1))) / np.linalg.norm(points - points.mean(0), axis=1).max()
    assert 1e-4 < share < 1e-2
    rigid = np.concatenate([np.tile(np.eye(3), (40, 1)), np.cross(np.eye(3), points[:, None]).reshape(120, 3)], axis=1)
    np.testing.assert_allclose(rigid.T @ shifts, 0, atol=1e-12)


@pytest.mark.parametrize(("sigmas", "severity", "why"), [
    (0.3, None, ""), (1.0, "info", "contains the shape"), (4.0, "warning", "more than the usual bow of printed boards"),
])  # fmt: skip
def test_significant_bow_is_reported(sigmas, severity, why):
    """A bow above a tenth of a millimetre is reported, with a warning if it exceeds that of printed boards."""
    found = words("board", BOARD.points, np.array([sigmas, 0.0, 0.0]))
    if severity is None:
        assert found is None
        return
    assert found.what == f"board is not flat: its points are up to {0.28 * sigmas:.2g} mm from their plane."
    assert (found.severity, why in found.why) == (severity, True)


@pytest.mark.parametrize(("sigmas", "severity"), [(1.0, "info"), (4.0, "warning")])
def test_significant_body_shape_error_is_reported(sigmas, severity):
    """The message has the farthest point's shift.

    Severity depends on the usual size for such a body, without rigid motion.
    """
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (12, 3))
    shape = sigmas * np.linalg.qr(unit_shifts(points).reshape(36, 36))[0][:, 0] * np.sqrt(30)
    found = words("body", points, shape)
    far_mm = 1e3 * point_shifts_m(points, shape).max()
    assert found.what == f"Points of body are up to {far_mm:.2g} mm from their stated positions."
    assert found.severity == severity


@pytest.mark.parametrize(("thickness", "flat"), [(0.0, True), (0.04, True), (0.07, False), (1.0, False)])
def test_thick_targets_are_bodies(thickness, flat):
    """A board is bowed; a body has three coordinates per point, of which six move it as a whole."""
    points = np.random.default_rng(0).uniform(-1, 1, (60, 3)) * [1.0, 1.0, thickness]
    assert is_flat(points) == flat
    assert has_area(points)
    shape = np.zeros(3 if flat else 180)
    assert freedoms(points, shape) == (3 if flat else 174)
    assert unit_shifts(points).shape == (60, 3, len(shape))


def test_collinear_points_have_no_area():
    """Neither a line nor a single point has an area."""
    line = np.linspace(-1, 1, 9)[:, None] * [1.0, 2.0, 3.0]
    assert not has_area(line)
    assert not has_area(line[:1])
    assert has_area(np.vstack([line, [1.0, 0.0, 0.0]]))


@pytest.mark.parametrize(("size_m", "is_reported"), [(0.09e-3, False), (0.11e-3, True)])
def test_reporting_threshold_is_tenth_of_millimetre(size_m, is_reported):
    """A smaller bow is reported only if it exceeds three usual sigmas."""
    of_one = bow_height_m(BOARD.points, np.array([1.0, 0.0, 0.0]))
    assert (words("board", BOARD.points, np.array([size_m / of_one, 0, 0])) is not None) == is_reported
    small = 0.05 * BOARD.points
    assert words("board", small, np.array([3.1, 0, 0])).severity == "warning"
    assert words("board", small, np.array([2.9, 0, 0])) is None
