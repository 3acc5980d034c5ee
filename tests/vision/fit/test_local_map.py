"""Tests of local maps from a plane to its image."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.geometry import SE3, Array
from basecal.vision.fit.local_map import _second_derivatives, grid_axes, local_axes, local_homographies, orient_grid
from vision_scenes import PLAIN, WIDE

PITCH = 0.03
PLANE = np.stack(np.meshgrid(np.arange(7), np.arange(5)), -1).reshape(-1, 2) * PITCH
POSE = SE3.from_rpy((0.4, -0.3, 0.5), (-0.08, -0.05, 0.5))


def project_plane(plane: Array, camera: object = PLAIN) -> Array:
    points = POSE @ np.column_stack([plane, np.zeros(len(plane))])
    return (WIDE if camera is WIDE else PLAIN).project(points)


def test_axes_are_steps_of_a_pitch() -> None:
    """The axes are the image motion of a pitch along each axis, within a tenth of it in perspective."""
    axes = local_axes(PLANE, PLANE, project_plane(PLANE), PITCH)
    for axis in (0, 1):
        half = np.eye(2)[axis] * PITCH / 2
        step = project_plane(PLANE + half) - project_plane(PLANE - half)
        assert np.linalg.norm(axes[:, axis] - step, axis=1).max() < 0.1 * np.linalg.norm(step, axis=1).min()


def test_axes_of_an_affine_map_are_exact() -> None:
    """Without perspective a pitch is the same everywhere."""
    matrix = np.array([[400.0, 30.0], [-50.0, 380.0]])
    axes = local_axes(PLANE, PLANE, PLANE @ matrix.T + [100, 50], PITCH)
    np.testing.assert_allclose(axes, np.broadcast_to(matrix.T * PITCH, axes.shape), atol=1e-6)


def test_homographies_are_exact_in_perspective() -> None:
    """The map of a pinhole around every point maps any offset to its pixel, without second-order terms."""
    matrix, bent = local_homographies(PLANE, project_plane(PLANE), PITCH)
    offsets = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [-0.5, 1.5, 1.0]])
    for k, place in enumerate(PLANE):
        mapped = offsets @ matrix[k].T
        expected = project_plane(place + offsets[:, :2] * PITCH)
        np.testing.assert_allclose(mapped[:, :2] / mapped[:, 2:], expected, atol=1e-4)
    assert np.abs(bent).max() < 1e-3


def test_second_derivatives_match_the_lens() -> None:
    """Second derivatives beyond perspective are those of the lens, within a third."""
    _, bent = local_homographies(PLANE, project_plane(PLANE, WIDE), PITCH)
    middle = len(PLANE) // 2
    homography, _ = local_homographies(PLANE, project_plane(PLANE, WIDE), PITCH)

    def beyond(offset: Array) -> Array:
        mapped = homography[middle] @ [*offset, 1.0]
        return project_plane((PLANE[middle] + offset * PITCH)[None], WIDE)[0] - mapped[:2] / mapped[2]

    for row, axis in ((0, np.array([1.0, 0.0])), (2, np.array([0.0, 1.0]))):
        numeric = beyond(axis) - 2 * beyond(0 * axis) + beyond(-axis)
        assert np.linalg.norm(bent[middle, row] - numeric) < 0.35 * np.linalg.norm(numeric) + 0.003


@pytest.mark.parametrize("mirrored", [False, True])
def test_mirrored_grid_is_reversed(mirrored: bool) -> None:
    """The rows of a grid read from its back are reversed; one read from its front is unchanged."""
    grid = project_plane(PLANE).reshape(5, 7, 2)
    np.testing.assert_array_equal(orient_grid(grid[::-1] if mirrored else grid), grid)
    axes = grid_axes(grid)
    assert axes.shape == (35, 2, 2)
    np.testing.assert_allclose(axes[10, 0], (grid[1, 4] - grid[1, 2]) / 2)
    np.testing.assert_allclose(axes[10, 1], (grid[2, 3] - grid[0, 3]) / 2)


def test_second_derivatives_of_a_cubic_are_exact() -> None:
    """Second derivatives of each term are exact, at any point of a grid and with any weights."""
    offset = np.stack(np.meshgrid(np.arange(-2.0, 3), np.arange(-2.0, 3)), -1).reshape(1, -1, 2)
    x, y = offset[0].T
    values = 3 + x - 2 * y + 0.7 * x * x / 2 - 0.4 * x * y + 0.9 * y * y / 2
    cubic = values + 0.3 * x**3 - 0.2 * x * x * y + 0.5 * x * y * y - 0.6 * y**3
    weight = np.random.default_rng(0).uniform(0.5, 1.0, (1, 25))
    found = _second_derivatives(offset, weight, np.stack([cubic, -2 * cubic], -1)[None])
    np.testing.assert_allclose(found, [[[0.7, -1.4], [-0.4, 0.8], [0.9, -1.8]]], atol=1e-5)


def test_maps_are_local() -> None:
    """The error of a pixel moves the maps of its neighbours by a tenth or more.

    It has hardly any effect six pitches away.
    """
    pixels = project_plane(PLANE)
    wrong = pixels.copy()
    wrong[0] += [0.0, 1.0]
    (before, _), (after, _) = (local_homographies(PLANE, each, PITCH) for each in (pixels, wrong))
    moved = np.linalg.norm((after - before)[:, :2, 2], axis=1)
    assert moved[[1, 7]].min() > 0.02
    assert moved[-1] < 1e-3
    steps = local_axes(PLANE, PLANE, wrong, PITCH) - local_axes(PLANE, PLANE, pixels, PITCH)
    lengths = np.linalg.norm(steps, axis=(1, 2))
    assert lengths[[0, 1, 7]].min() > 0.1
    assert lengths[-1] < 1e-2


def test_axes_are_weighted_by_distance() -> None:
    """An affine map is fitted to noisy pixels with weights exp(-(distance / pitch)^2 / 2)."""
    rng = np.random.default_rng(0)
    pixels = project_plane(PLANE) + rng.normal(0, 3, PLANE.shape)
    offset = (PLANE - PLANE[16]) / PITCH
    root = np.exp(-0.25 * (offset**2).sum(axis=1))[:, None]
    expected, *_ = np.linalg.lstsq(root * np.column_stack([offset, np.ones(35)]), root * pixels, rcond=None)
    np.testing.assert_allclose(local_axes(PLANE[16:17], PLANE, pixels, PITCH)[0], expected[:2], atol=0.02)


def test_second_derivatives_are_weighted() -> None:
    """The second derivatives minimise weighted squared residuals if no cubic fits."""
    rng = np.random.default_rng(0)
    offset = np.stack(np.meshgrid(np.arange(-2.0, 3), np.arange(-2.0, 3)), -1).reshape(-1, 2)
    weight, values = rng.uniform(0.1, 1.0, 25), rng.normal(size=(25, 2))
    x, y = offset.T
    basis = np.stack([x**0, x, y, x * x / 2, x * y, y * y / 2, x**3, x * x * y, x * y * y, y**3], axis=1)
    expected, *_ = np.linalg.lstsq(weight[:, None] * basis, weight[:, None] * values, rcond=None)
    found = _second_derivatives(offset[None], weight[None], values[None])
    np.testing.assert_allclose(found[0], expected[3:6], atol=1e-4)


def test_grid_orientation_is_decided_by_majority() -> None:
    """The axes of rows of two points are the steps between them."""
    grid = np.array([[[0.0, 0.0], [4.0, 1.0]], [[-1.0, 3.0], [3.0, 5.0]]])
    axes = grid_axes(grid)
    assert axes.tolist() == [[[4, 1], [-1, 3]], [[4, 1], [-1, 4]], [[4, 2], [-1, 3]], [[4, 2], [-1, 4]]]
    np.testing.assert_array_equal(orient_grid(grid), grid)
    np.testing.assert_array_equal(orient_grid(grid[::-1]), grid)
