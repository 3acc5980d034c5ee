"""The grid of rotations."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.start.closed_form import Loop
from basecal.estimation.start.rotation_grid import icosahedral_rotations, light_starts
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


def _light(views, known=(), turned=None):
    """A loop that closes exactly on a light, its bearings, and X, Y and Z, whose rotations may be given."""
    rng = np.random.default_rng(3)
    a, c = (SE3.exp(rng.standard_normal((views, 6)) * [0.3, 0.3, 0.3, 0.8, 0.8, 0.8]) for _ in range(2))
    x, y = SE3.exp(0.3 * rng.standard_normal(6)), SE3.exp(np.array([0.9, 0.2, 0.1, 0.4, -0.3, 1.2]))
    z = SE3(np.eye(3), np.array([0.05, -0.02, 0.2]))
    if turned is not None:
        x, y = (SE3(turn, at.translation) for turn, at in zip(turned, (x, y), strict=True))
    light = ((a @ x).inverse() @ y @ c @ z).translation
    true = {"x": x, "y": y, "z": z}
    loop = Loop(
        a, SE3.identity((views,)), c, *(true[name] if name in known else None for name in "xyz"), np.ones(views)
    )
    return loop, light / np.linalg.norm(light, axis=-1, keepdims=True), true


@pytest.mark.parametrize("known", ["x", "y", "xz", "yz"])
def test_with_rotations_of_the_grid_a_light_is_placed(known):
    """What is known stays; of the others the best come first, and one of them is within 60 degrees of the truth."""
    loop, bearings, true = _light(12, known)
    starts = light_starts(loop, bearings, 6)
    assert len(starts) == 6
    for start in starts:
        for name, found in zip("xyz", start, strict=True):
            if name in known:
                np.testing.assert_array_equal(found.matrix, true[name].matrix)
    off = [
        np.linalg.norm([(found.inverse() @ true[n]).rotvec for n, found in zip("xy", s[:2], strict=True)])
        for s in starts
    ]
    assert min(off) < np.radians(60)


def test_where_rotations_are_known_the_light_is_exact():
    """The translations are those by which every view meets its point."""
    loop, bearings, true = _light(12, "xy")
    ((x, y, z),) = light_starts(loop, bearings, 3)
    np.testing.assert_allclose(z.translation, true["z"].translation, atol=1e-6)
    assert (x, y) == (loop.x, loop.y)


@pytest.mark.parametrize(("views", "step"), [(40, 1), (41, 2), (80, 2), (81, 3)])
def test_of_many_views_evenly_spread_ones_rank_the_grid(views, step):
    """Forty at most: as if the others were not there."""
    loop, bearings, _ = _light(views, "x")
    fewer = loop._replace(a=loop.a[::step], c=loop.c[::step])
    for found, same in zip(light_starts(loop, bearings, 2), light_starts(fewer, bearings[::step], 2), strict=True):
        for one, other in zip(found, same, strict=True):
            np.testing.assert_array_equal(one.matrix, other.matrix)


def test_the_grid_carries_an_icosahedron_onto_itself():
    """That of vertices (0, 1, golden ratio), of either signs, and with its coordinates in turn."""
    golden = (1 + np.sqrt(5)) / 2
    vertices = np.array([np.roll([0, s, t * golden], k) for k in range(3) for s in (1, -1) for t in (1, -1)])
    carried = np.einsum("kij,vj->kvi", icosahedral_rotations(), vertices)
    assert np.abs(carried[:, :, None] - vertices).max(-1).min(-1).max() < 1e-12


@pytest.mark.parametrize(("known", "count"), [("x", 8), ("y", 20), ("xz", 8), ("yz", 20)])
def test_a_light_whose_rotations_are_of_the_grid_comes_first(known, count):
    """Exactly where it is, however far from the camera: directions alone count. Of one rotation of X eight go on."""
    loop, bearings, true = _light(9, known, icosahedral_rotations()[[13, 42]])
    starts = light_starts(loop, bearings, 20)
    assert len(starts) == count
    for name, found in zip("xyz", starts[0], strict=True):
        np.testing.assert_allclose(found.matrix, true[name].matrix, atol=1e-4)
