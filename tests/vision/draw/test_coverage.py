"""How much of each pixel an outline covers."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.geometry import Array
from basecal.vision.draw.coverage import coverage


def edges(*loops: Array) -> Array:
    return np.concatenate([np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in loops])


def area(loop: Array) -> float:
    x, y = loop.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def polygon(rng: np.random.Generator, middle: tuple[float, float], radius: float) -> Array:
    angle = np.sort(rng.uniform(0, 2 * np.pi, 7))
    return np.array(middle) + radius * np.stack([np.cos(angle), np.sin(angle)], -1)


def test_rectangle_shares() -> None:
    """A rectangle covers of each pixel the product of what it covers along x and along y."""
    loop = np.array([[1.25, 0.5], [3.1, 0.5], [3.1, 2.2], [1.25, 2.2]])
    across, down = np.array([0, 0.25, 1, 0.6, 0]), np.array([0, 1, 0.7, 0])
    np.testing.assert_allclose(coverage(edges(loop), (5, 4)), np.outer([0, *down[1:]], across), atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_area_is_kept(seed: int) -> None:
    """The shares of all pixels add up to the polygon's area."""
    loop = polygon(np.random.default_rng(seed), (15.3, 14.8), 11.0)
    assert coverage(edges(loop), (30, 30)).sum() == pytest.approx(area(loop), rel=1e-12)


def test_against_samples() -> None:
    """Each pixel's share is what a dense grid of samples inside it says, within the grid's resolution."""
    loop = polygon(np.random.default_rng(3), (6.2, 5.7), 5.0)
    fine = 64
    at = (np.arange(12 * fine) + 0.5) / fine - 0.5
    x, y = np.meshgrid(at, at)
    sides = [(b - a)[0] * (y - a[1]) - (b - a)[1] * (x - a[0]) > 0 for a, b in edges(loop)]
    sampled = np.all(sides, axis=0).reshape(12, fine, 12, fine).mean(axis=(1, 3))
    np.testing.assert_allclose(coverage(edges(loop), (12, 12)), sampled, atol=0.01)


def test_beyond_the_image() -> None:
    """What lies left of, above, below and right of an image does not change what is covered inside."""
    loop = polygon(np.random.default_rng(1), (4.0, 5.0), 9.0)
    whole = coverage(edges(loop + 20), (60, 60))[20:28, 20:30]
    np.testing.assert_allclose(coverage(edges(loop), (10, 8)), whole, atol=1e-9)


def test_shared_edges_cancel() -> None:
    """Two outlines that share a slanted edge cover as much as their union."""
    left = np.array([[0.3, 0.1], [3.0, 0.4], [4.2, 7.3], [0.6, 6.6]])
    right = np.array([[3.0, 0.4], [8.1, 0.2], [7.7, 7.1], [4.2, 7.3]])
    union = np.array([[0.3, 0.1], [3.0, 0.4], [8.1, 0.2], [7.7, 7.1], [4.2, 7.3], [0.6, 6.6]])
    np.testing.assert_allclose(coverage(edges(left, right), (10, 9)), coverage(edges(union), (10, 9)), atol=1e-12)
