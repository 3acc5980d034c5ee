"""Tests of starting a target with single visible points by its most visible point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.problem.build import build_problem
from basecal.estimation.start.closed_form import Loop
from basecal.estimation.start.led_search import led_search, led_starts
from basecal.estimation.start.pair_views import pair_views
from basecal.estimation.start.refinement import Refinement, refine_jointly
from basecal.estimation.start.rotation_search import icosahedral_rotations
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def partial_views():
    """Two views of a board's third point and ten of its second, and what is known of its loop."""
    made = simulate(Scenario(samples=12, camera_mount="fixed"), 1)
    (group,) = build_problem(made.cell, made.recording)[0].groups
    seen = np.zeros_like(group.measurement.seen)
    seen[:2, 2], seen[2:, 1] = True, True
    weight = np.where(seen, group.measurement.weight, 0.0)
    group = replace(group, measurement=replace(group.measurement, seen=seen, weight=weight))
    pair = pair_views(group, made.cameras["wrist"], 100, 1000)
    truth = [made.truth[name] for name in (group.eye.mount, group.hand.base, group.hand.mount)]
    return pair, pair.loop(truth[0], None, truth[2], np.zeros(len(pair.group), dtype=int)), truth


def test_led_is_the_point_with_most_views():
    """Views without it are left out, and if its mount is known, the LED is at the point."""
    pair, loop, truth = partial_views()
    one, light, starts = led_search(pair, loop, 3)
    assert one.group.measurement.points_in_target.shape == (1, 3)
    assert (len(one.group), len(pair.group)) == (10, 12)
    point = pair.group.measurement.points_in_target[1]
    np.testing.assert_allclose(light.z.translation, truth[2] @ point)
    assert 1 <= len(starts) <= 3


def test_best_refined_start_is_the_truth():
    """With camera and LED known, the starts of the grid lead to the base, to a milliradian."""
    pair, loop, truth = partial_views()
    (found,) = refine_jointly([Refinement(*led_search(pair, loop, 3), is_point=True)])
    assert np.linalg.norm((found[1].inverse() @ truth[1]).rotvec) < 1e-3


def test_views_count_with_any_weight():
    """Views count with any positive weight, and only points without weight are unseen."""
    pair, loop, _ = partial_views()
    faint = replace(pair.group.measurement, weight=1e-9 * pair.group.measurement.weight)
    one, _, _ = led_search(replace(pair, group=replace(pair.group, measurement=faint)), loop, 1)
    assert len(one.group) == 10


def test_rotations_are_within_45_degrees_of_the_grid():
    """The bound holds for 2,000 random rotations, and the grid is a group of sixty."""
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
    """A loop that closes exactly on an LED, its bearings, and X, Y and Z, whose rotations may be given."""
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
def test_led_is_placed_with_rotations_of_the_grid(known):
    """Known transforms are unchanged. The best starts come first, and one of them is within 60 degrees of the truth."""
    loop, bearings, true = _light(12, known)
    starts = led_starts(loop, bearings, 6)
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


def test_known_rotations_give_an_exact_led():
    """The translations are those for which every view meets its point."""
    loop, bearings, true = _light(12, "xy")
    ((x, y, z),) = led_starts(loop, bearings, 3)
    np.testing.assert_allclose(z.translation, true["z"].translation, atol=1e-6)
    assert (x, y) == (loop.x, loop.y)


@pytest.mark.parametrize(("views", "step"), [(40, 1), (41, 2), (80, 2), (81, 3)])
def test_evenly_spread_views_rank_the_grid(views, step):
    """At most forty views are used, as if the others did not exist."""
    loop, bearings, _ = _light(views, "x")
    fewer = loop._replace(a=loop.a[::step], c=loop.c[::step])
    for found, same in zip(led_starts(loop, bearings, 2), led_starts(fewer, bearings[::step], 2), strict=True):
        for one, other in zip(found, same, strict=True):
            np.testing.assert_array_equal(one.matrix, other.matrix)


def test_grid_rotations_are_symmetries_of_an_icosahedron():
    """The grid maps the vertices (0, 1, golden ratio), with either sign, and with cyclic coordinates, to each other."""
    golden = (1 + np.sqrt(5)) / 2
    vertices = np.array([np.roll([0, s, t * golden], k) for k in range(3) for s in (1, -1) for t in (1, -1)])
    carried = np.einsum("kij,vj->kvi", icosahedral_rotations(), vertices)
    assert np.abs(carried[:, :, None] - vertices).max(-1).min(-1).max() < 1e-12


@pytest.mark.parametrize(("known", "count"), [("x", 8), ("y", 20), ("xz", 8), ("yz", 20)])
def test_led_with_grid_rotations_comes_first(known, count):
    """An LED with rotations of the grid is found at its exact position.

    Only directions count, so the distance from the camera does not matter. For one rotation of X eight starts remain.
    """
    loop, bearings, true = _light(9, known, icosahedral_rotations()[[13, 42]])
    starts = led_starts(loop, bearings, 20)
    assert len(starts) == count
    for name, found in zip("xyz", starts[0], strict=True):
        np.testing.assert_allclose(found.matrix, true[name].matrix, atol=1e-4)
