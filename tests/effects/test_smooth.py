"""Tests of smooth errors: a few modes reproduce the kernel."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.effects.smooth import LENGTH_M, Modes, kernel
from basecal.estimation.noise.robot_noise import stop_poses
from basecal.estimation.problem.build import build_problem
from basecal.geometry import SE3
from basecal.geometry.rotation import rotation_log
from basecal.simulation import Scenario, simulate


def test_modes_reproduce_kernel():
    """Products of modes are exp(-d^2 / 2 l^2) of the stops' distances d, up to 8 % in the omitted modes."""
    s = simulate(Scenario(samples=30), 1)
    problem, _ = build_problem(s.cell, s.recording)
    poses, seen = stop_poses(problem, "hand")
    found = Modes.strongest(poses[seen], kernel).values(poses)
    turn = rotation_log(np.swapaxes(poses.rotation, -1, -2)[:, None] @ poses.rotation[None])
    shift = poses.translation[:, None] - poses.translation[None]
    squared = np.sum(shift**2, -1) + np.sum(turn**2, -1)
    np.testing.assert_allclose(found @ found.T, np.exp(-0.5 * squared / LENGTH_M**2), atol=0.08)


def test_smooth_kernel_is_gaussian_of_distance():
    """The length scale is 0.7 m, with a radian counting as a metre.

    Tested for near pairs, pairs half a turn apart, and two lists.
    """
    rng = np.random.default_rng(0)
    first, second = (SE3.exp(rng.uniform(-1.5, 1.5, (n, 6))) for n in (5, 3))
    found = kernel(first, second)
    assert found.shape == (5, 3)
    for i in range(5):
        for j in range(3):
            shift = np.linalg.norm(first[i].translation - second[j].translation)
            turn = Rotation.from_matrix(first[i].rotation.T @ second[j].rotation).magnitude()
            assert found[i, j] == pytest.approx(np.exp(-(shift**2 + turn**2) / (2 * LENGTH_M**2)), rel=1e-9)
    np.testing.assert_allclose(np.diag(kernel(first, first)), 1.0, atol=1e-7)


@pytest.mark.parametrize(("spread_rad", "fewer"), [(0.6, True), (2.5, False)])
def test_at_most_sixteen_strongest_modes_are_kept(spread_rad, fewer):
    """The modes are the kernel's eigenvectors.

    Arms that rotate much have all sixteen, others only those above a hundredth.
    """
    made = simulate(Scenario(samples=40, spread_rad=spread_rad), 1)
    problem, _ = build_problem(made.cell, made.recording)
    poses, seen = stop_poses(problem, "hand")
    values, vectors = np.linalg.eigh(kernel(poses, poses))
    kept = np.flatnonzero(values > 1e-2 * values[-1])[-16:]
    found = Modes.strongest(poses[seen], kernel).values(poses)
    assert found.shape == (40, len(kept))
    assert (len(kept) < 16) == fewer
    expected = (vectors[:, kept] * values[kept]) @ vectors[:, kept].T
    np.testing.assert_allclose(found @ found.T, expected, atol=1e-8)


@pytest.mark.parametrize(("stops", "places", "few"), [(10, 10, 10), (11, 10, 6), (20, 10, 10), (21, 10, 7), (3, 10, 3)])
def test_mode_places_are_limited_and_even(stops, places, few):
    """Places are evenly chosen, and the first is among them."""
    instants = np.arange(float(stops))
    found = Modes.strongest(instants, lambda one, two: np.exp(-np.abs(one[:, None] - two)), places)
    assert len(found.recorded) == few
    assert found.recorded[0] == 0
    assert len(set(np.diff(found.recorded))) == 1


def test_weak_modes_are_dropped():
    """At most the requested number of modes is kept, and none below a share of the largest."""
    alike = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]) / 2
    values = np.array([1.0, 0.5, 0.02, 0.009])
    places = np.arange(4)

    def kernel_of(one, two):
        return (alike * values @ alike.T)[one][:, two]

    assert Modes.strongest(places, kernel_of).weights.shape == (4, 3)
    two = Modes.strongest(places, kernel_of, most_modes=2).values(places)
    np.testing.assert_allclose(two @ two.T, alike * [1, 0.5, 0, 0] @ alike.T, atol=1e-12)
    assert Modes.strongest(places, kernel_of, least_share=0.005).weights.shape == (4, 4)
