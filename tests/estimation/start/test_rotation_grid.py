"""The grid of rotations."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.start.closed_form import Loop
from basecal.estimation.start.rotation_grid import icosahedral_rotations, pose_starts
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


@pytest.mark.parametrize("unknown", ["x", "y", "z", "xy", "xz", "yz", "xyz"])
def test_the_truth_is_first_where_it_lies_on_the_grid(unknown):
    """Of exact data with rotations of the grid, the best start is the truth, whatever is unknown."""
    rng = np.random.default_rng(6)
    grid = icosahedral_rotations()
    truth = {name: SE3(grid[k], rng.standard_normal(3)) for name, k in zip("xyz", (7, 31, 52), strict=True)}
    a, c = SE3.exp(rng.standard_normal((15, 6))), SE3.exp(rng.standard_normal((15, 6)))
    b = (a @ truth["x"]).inverse() @ truth["y"] @ c @ truth["z"]
    known = {name: None if name in unknown else value for name, value in truth.items()}
    starts = pose_starts(Loop(a, b, c, known["x"], known["y"], known["z"], rng.uniform(0.2, 1, 15)), 5)
    for name, rotation in zip("xyz", starts[0], strict=True):
        np.testing.assert_allclose(rotation, truth[name].rotation, atol=1e-9)
