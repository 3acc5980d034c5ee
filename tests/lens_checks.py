"""What holds of every lens: its derivatives, its inverse, where it ends, and that OpenCV agrees."""

from __future__ import annotations

import numpy as np

from derivatives import check_derivative

FOCAL = (700.0, 900.0)


def points_before(rng, count=30, widest=0.6):
    """Points before a camera within a cone, (count, 3) [m], the axis among them."""
    z = rng.uniform(0.3, 3.0, count)
    ab = rng.uniform(-widest, widest, (count, 2))
    ab[0] = 0.0
    return np.column_stack([ab * z[:, None], z])


def check_projection(lens, distortion, points, opencv):
    """Images are OpenCV's, and their derivatives those of differences, to points and to every term."""
    u, v, d_points, d_terms = lens.project_with_derivatives(points, FOCAL, distortion, True)
    plain = np.stack(lens.project(points, distortion), -1)
    np.testing.assert_allclose(np.stack([u, v], -1), plain, rtol=0, atol=1e-15)
    seen, _ = opencv(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), np.eye(3), np.array(distortion))
    np.testing.assert_allclose(plain, seen[:, 0], rtol=0, atol=1e-12)

    def pixels(moved, terms):
        return np.stack(lens.project(moved, terms), -1) * FOCAL

    check_derivative(lambda d: pixels(points + d, distortion), d_points, step=3e-3, tolerance=1e-8)
    check_derivative(lambda d: pixels(points, [*(np.array(distortion) + d)]), d_terms)
    np.testing.assert_allclose(lens.project_with_derivatives(points, FOCAL, distortion, False)[2], d_points, atol=1e-9)
    assert lens.project_with_derivatives(points, FOCAL, distortion, False)[3] is None


def check_inverse(lens, distortion, points):
    """Where the lens is one to one, the direction of an image is the point's."""
    assert np.all(lens.domain_mask(points, distortion))
    directions, valid = lens.unproject(*lens.project(points, distortion), distortion)
    assert np.all(valid)
    unit = directions / np.linalg.norm(directions, axis=-1)[:, None]
    np.testing.assert_allclose(unit, points / np.linalg.norm(points, axis=-1)[:, None], rtol=0, atol=1e-11)
