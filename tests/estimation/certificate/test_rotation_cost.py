"""Tests of lower bounds of a loop's rotation cost as a form on products of quaternions."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np
import pytest
from tests.ends import with_eye, with_hand

from basecal.cell import Unknown
from basecal.estimation.certificate.rotation_cost import (
    loop_form,
    rotation_factors,
    rotations_from_factors,
    state_rotations,
)
from basecal.estimation.certificate.view_rotation import ViewCosts
from basecal.estimation.problem.problem import Problem, State, Stops
from basecal.estimation.problem.view_group import End, ViewGroup
from basecal.estimation.start.closed_form import Rotations
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3
from basecal.geometry.rotation import rotation_log

X, Y, Z = "eye_flange_from_camera", "eye_base_from_hand_base", "hand_flange_from_target"


def random_poses(rng, shape=()):
    return SE3.exp(rng.normal(size=(*shape, 6)))


def random_loop(rng, fixed=(), eye="eye", hand="hand", n=9, stops=None, eye_stop=None):
    """A problem of one loop with random poses, a random state, and views of random weights."""
    a, b, c = (random_poses(rng, (n,)) for _ in "abc")
    a = SE3.identity((n,)) if eye is None else a
    c = SE3.identity((n,)) if hand is None else c
    rows, none = np.arange(n), np.full(n, -1)
    views = PoseMeasurement(b, np.ones((n, 6)), np.ones((n, 6)))
    stop = none if eye_stop is None else np.array(eye_stop)
    ends = End(eye, X, None, a, stop, rows), End(hand, Z, Y, c, none, rows)
    group = ViewGroup("camera", "target", ends, rows, views)
    unknowns = {name: Unknown("fixed" if name in fixed else "free") for name in (X, Y, Z)}
    stops = Stops(np.zeros((0, 6))) if stops is None else stops
    problem = Problem("eye", (group,), unknowns, frozenset(), {}, stops, {})
    state = State({name: random_poses(rng) for name in (X, Y, Z)}, {}, np.zeros((len(stops), 6)))
    return problem, state, group, ViewCosts(b, np.zeros(n), rng.uniform(1, 5, n), np.full(n, np.inf))


def half_sines(group, costs, x, y, z):
    """sin^2 of half of each loop's angle, (n,)."""
    seen = group.eye.base_from_flange.rotation @ x @ costs.camera_from_target.rotation
    off = np.swapaxes(y @ group.hand.base_from_flange.rotation @ z, -1, -2) @ seen
    return np.sin(np.linalg.norm(rotation_log(off), axis=-1) / 2) ** 2


@pytest.mark.parametrize("fixed", [(), (X,), (Y,), (Z,), (X, Y), (Y, Z), (X, Z)])
def test_form_equals_the_loop_cost(rng, fixed):
    """On the quaternions of any rotations it is the weighted mean of sin^2 of half the loops' angles."""
    problem, state, group, costs = random_loop(rng, fixed)
    found = loop_form(problem, state, group, costs)
    assert found.weight == pytest.approx(costs.weight.sum())
    assert found.merged == ""
    for _ in range(5):
        rotation = {n: state.transforms[n].rotation if n in fixed else random_poses(rng).rotation for n in (X, Y, Z)}
        x, y, z = (rotation[name] for name in (X, Y, Z))
        vector = reduce(np.kron, rotation_factors(found.loop, Rotations(x, y, z)))
        expected = np.average(half_sines(group, costs, x, y, z), weights=costs.weight)
        assert vector @ found.form @ vector == pytest.approx(expected, rel=1e-10)


def test_factors_represent_rotations(rng):
    """Rotations are converted to factors and back, with the known ones beside them."""
    problem, state, group, costs = random_loop(rng, (Y,))
    loop = loop_form(problem, state, group, costs).loop
    x, z = random_poses(rng).rotation, random_poses(rng).rotation
    back = rotations_from_factors(loop, rotation_factors(loop, Rotations(x, np.eye(3), z)))
    np.testing.assert_allclose(back.x, x, atol=1e-14)
    np.testing.assert_allclose(back.y, state.transforms[Y].rotation, atol=1e-14)
    np.testing.assert_allclose(back.z, z, atol=1e-14)
    assert back.clear


@pytest.mark.parametrize(("eye", "hand", "merged"), [(None, "hand", "x"), ("eye", None, "z"), ("eye", "hand", "")])
def test_missing_arm_merges_two_unknowns(rng, eye, hand, merged):
    """Without the eye's arm Y' X is one rotation, without the hand's Y Z. The state's rotations are merged equally."""
    problem, state, group, costs = random_loop(rng, eye=eye, hand=hand)
    found = loop_form(problem, state, group, costs)
    assert found.merged == merged
    assert len(found.loop.unknown) == (3 if merged == "" else 2)
    x, y, z, _ = state_rotations(state, group, merged)
    whole = [state.transforms[name].rotation for name in (X, Y, Z)]
    expected = half_sines(group, costs, *whole)
    np.testing.assert_allclose(half_sines(group, costs, x, y, z), expected, atol=1e-12)
    vector = reduce(np.kron, rotation_factors(found.loop, Rotations(x, y, z)))
    assert vector @ found.form @ vector == pytest.approx(np.average(expected, weights=costs.weight), rel=1e-10)


def test_stop_errors_reduce_view_weights(rng):
    """A view of weight w at a stop of m views and sigma s counts as 1 / (1 / w + m s^2 / 4). The worst axis gives s."""
    stops = Stops(np.array([[1, 1, 1, 0.1, 0.3, 0.2], [1, 1, 1, 0.5, 0.5, 0.5]]), ("eye", "eye"))
    problem, state, group, costs = random_loop(rng, n=4, stops=stops, eye_stop=[0, 0, 1, -1])
    found = loop_form(problem, state, group, costs)
    slack = np.array([2 * 0.09, 2 * 0.09, 0.25, 0.0]) / 4
    np.testing.assert_allclose(found.loop.weight, 1 / (1 / costs.weight + slack))
    assert found.weight == pytest.approx(found.loop.weight.sum())
    blind = costs._replace(weight=np.array([0.0, 1.0, 1.0, 0.4]))
    weights = loop_form(problem, state, group, blind).loop.weight
    assert weights[0] == 0.0
    assert weights[3] == pytest.approx(0.4)
    both = with_hand(with_eye(group, stop=np.array([0, 0, -1, -1])), stop=np.array([1, 1, 1, -1]))
    problem = replace(problem.with_groups([both]), stops=Stops(stops.sigma[:, [0, 1, 2, 4, 3, 5]], ("eye", "hand")))
    slack = np.array([2 * 0.09 + 3 * 0.25, 2 * 0.09 + 3 * 0.25, 3 * 0.25, 0.0]) / 4
    np.testing.assert_allclose(loop_form(problem, state, both, costs).loop.weight, 1 / (1 / costs.weight + slack))


def test_form_of_more_views_than_one_chunk(rng):
    """More views than are summed at once give the form of all."""
    problem, state, group, costs = random_loop(rng, (X, Y), n=2100)
    found = loop_form(problem, state, group, costs)
    z = random_poses(rng).rotation
    x, y = (state.transforms[name].rotation for name in (X, Y))
    (q,) = rotation_factors(found.loop, Rotations(x, y, z))
    assert q @ found.form @ q == pytest.approx(np.average(half_sines(group, costs, x, y, z), weights=costs.weight))
