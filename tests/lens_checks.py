"""Checks that hold for every lens: derivatives, the inverse, its domain, and agreement with OpenCV."""

from __future__ import annotations

import numpy as np

from derivatives import check_derivative

FOCAL = (700.0, 900.0)


def points_before(rng, count=30, widest=0.6):
    """Points in a cone in front of a camera, (count, 3) [m]; the first is on the axis."""
    z = rng.uniform(0.3, 3.0, count)
    slopes = rng.uniform(-widest, widest, (count, 2))
    slopes[0] = 0.0
    return np.column_stack([slopes * z[:, None], z])


def check_projection(lens, distortion, points, opencv_project):
    """Check projections against OpenCV, and derivatives to points and terms against differences."""
    u, v, d_points, d_terms = lens.project_with_derivatives(points, FOCAL, distortion, True)
    images = np.stack(lens.project(points, distortion), -1)
    np.testing.assert_allclose(np.stack([u, v], -1), images, rtol=0, atol=1e-15)
    expected, _ = opencv_project(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), np.eye(3), np.array(distortion))
    np.testing.assert_allclose(images, expected[:, 0], rtol=0, atol=1e-12)

    def pixels(shifted, terms):
        return np.stack(lens.project(shifted, terms), -1) * FOCAL

    check_derivative(lambda d: pixels(points + d, distortion), d_points, step=3e-3, tolerance=1e-8)
    check_derivative(lambda d: pixels(points, [*(np.array(distortion) + d)]), d_terms)
    np.testing.assert_allclose(lens.project_with_derivatives(points, FOCAL, distortion, False)[2], d_points, atol=1e-9)
    assert lens.project_with_derivatives(points, FOCAL, distortion, False)[3] is None


def check_inverse(lens, distortion, points):
    """Check that directions from images are those of the points, where the lens is one to one."""
    assert np.all(lens.domain_mask(points, distortion))
    directions, valid = lens.unproject(*lens.project(points, distortion), distortion)
    assert np.all(valid)
    unit = directions / np.linalg.norm(directions, axis=-1)[:, None]
    np.testing.assert_allclose(unit, points / np.linalg.norm(points, axis=-1)[:, None], rtol=0, atol=1e-11)
