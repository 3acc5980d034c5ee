"""The grid of rotations."""

from __future__ import annotations

import numpy as np

from basecal.estimation.start.rotation_grid import icosahedral_rotations
from basecal.geometry import SE3


def test_every_rotation_is_within_45_degrees_of_the_grid():
    """On 2,000 drawn ones; and the grid is a group of sixty."""
    grid = icosahedral_rotations()
    assert len(grid) == 60
    drawn = SE3.from_quaternion(*_unit_quaternions(2000)).rotation
    trace = np.einsum("mij,kij->mk", drawn, grid).max(-1)
    assert np.degrees(np.arccos((trace - 1) / 2)).max() < 45
    products = np.einsum("kij,mjl->kmil", grid, grid).reshape(-1, 9)
    assert np.abs(products[:, None] - grid.reshape(-1, 9)).max(-1).min(-1).max() < 1e-12


def _unit_quaternions(n: int) -> tuple[np.ndarray, np.ndarray]:
    q = np.random.default_rng(0).standard_normal((n, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True), np.zeros((n, 3))
