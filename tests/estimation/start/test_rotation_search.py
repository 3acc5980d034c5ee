"""Rotations by a grid and alternating means, loops side by side."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.start.closed_form import Loop
from basecal.estimation.start.rotation_grid import icosahedral_rotations
from basecal.estimation.start.rotation_search import (
    _sum_of_singular_values,
    angle_between,
    pose_starts,
    search_rotations,
    settled_rotations,
)
from basecal.geometry import SE3
from basecal.geometry.rotation import rotation_exp, rotation_log


def loop(truth, unknown, n, seed, noise=0.0):
    """A loop of n samples with B in noise [rad], of which some of X, Y and Z are unknown."""
    rng = np.random.default_rng(seed)
    a, c = SE3.exp(rng.standard_normal((n, 6))), SE3.exp(rng.standard_normal((n, 6)))
    b = (a @ truth["x"]).inverse() @ truth["y"] @ c @ truth["z"] @ SE3.exp(noise * rng.standard_normal((n, 6)))
    known = {name: None if name in unknown else value for name, value in truth.items()}
    return Loop(a, b, c, known["x"], known["y"], known["z"], rng.uniform(0.2, 1, n))


@pytest.mark.parametrize("unknown", ["x", "y", "z", "xy", "xz", "yz", "xyz"])
def test_the_truth_is_first_where_it_lies_on_the_grid(unknown):
    """Of exact data with rotations of the grid, the best start is the truth, whatever is unknown."""
    rng = np.random.default_rng(6)
    grid = icosahedral_rotations()
    truth = {name: SE3(grid[k], rng.standard_normal(3)) for name, k in zip("xyz", (7, 31, 52), strict=True)}
    starts = pose_starts([loop(truth, unknown, 15, 6)], 5)[0]
    for name, rotation in zip("xyz", starts[0], strict=True):
        np.testing.assert_allclose(rotation, truth[name].rotation, atol=1e-9)


def drawn(seed):
    rng = np.random.default_rng(seed)
    return {name: SE3.exp(rng.standard_normal(6) * (1, 1, 1, 2, 2, 2)) for name in "xyz"}


@pytest.mark.parametrize("unknown", ["xy", "xz", "yz", "xyz"])
def test_exact_loops_are_closed(unknown):
    """Eight loops of 12 to 19 samples, each with its own truth: every one is found to a tenth of a milliradian."""
    truths = [drawn(k) for k in range(8)]
    found = search_rotations([loop(truth, unknown, 12 + k, k) for k, truth in enumerate(truths)])
    off = [
        angle_between(getattr(rotations, k), truth[k].rotation)
        for rotations, truth in zip(found, truths, strict=True)
        for k in "xyz"
    ]
    assert max(off) < 1e-4


@pytest.mark.parametrize("unknown", ["y", "xz", "xyz"])
def test_rotations_settle_where_samples_lead(unknown):
    """From a third of a radian off, rounds leave a tenth of it or less, each loop by itself."""
    truths = [drawn(k) for k in range(5)]
    rng = np.random.default_rng(1)
    turns = [{k: rotation_exp(0.2 * rng.standard_normal(3)) for k in unknown} for _ in truths]
    near = [
        tuple(truth[k].rotation @ turn.get(k, np.eye(3)) for k in "xyz")
        for truth, turn in zip(truths, turns, strict=True)
    ]
    found = settled_rotations([loop(truth, unknown, 20, k) for k, truth in enumerate(truths)], near)
    for at, begun, truth in zip(found, near, truths, strict=True):
        off = max(angle_between(getattr(at, k), truth[k].rotation) for k in "xyz")
        assert off < max(angle_between(begun["xyz".index(k)], truth[k].rotation) for k in "xyz") / 10


def test_loops_do_not_know_of_one_another():
    """Noisy loops of different lengths, one of them hopeless: side by side they end where each ends alone."""
    loops = [loop(drawn(k), "xyz", 10 + k, k, noise=0.05) for k in range(4)]
    wild = loop(drawn(4), "xyz", 12, 4, noise=2.0)
    together = search_rotations([*loops, wild])
    for each, found in zip([*loops, wild], together, strict=True):
        (alone,) = search_rotations([each])
        for name in "xyz":
            np.testing.assert_allclose(getattr(found, name), getattr(alone, name), atol=1e-9)


def test_a_fifth_of_wrong_samples_does_not_choose_the_end():
    """Five of 24 samples anywhere: the rotations are those of the others within 0.3 rad."""
    for seed in range(6):
        truth = drawn(seed)
        clean = loop(truth, "xyz", 24, seed)
        wrong = np.arange(24) < 5
        turned = np.where(
            wrong[:, None, None], rotation_exp(np.random.default_rng(seed).standard_normal((24, 3))), np.eye(3)
        )
        (found,) = search_rotations([clean._replace(b=SE3(clean.b.rotation @ turned, clean.b.translation))])
        assert max(angle_between(getattr(found, k), truth[k].rotation) for k in "xyz") < 0.3


def test_sums_of_singular_values():
    """Those of 3 x 3 matrices, of any rank and determinant, to a millionth of the sum."""
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((200, 3, 3)) * rng.uniform(0, 1, (200, 1, 3)) ** 4
    matrix[:20, :, 0] = 0.0
    matrix[:10, :, 1] = 0.0
    matrix[20:30] = rotation_exp(rng.standard_normal((10, 3)))
    true = np.linalg.svd(matrix, compute_uv=False).sum(-1)
    np.testing.assert_allclose(_sum_of_singular_values(matrix), true, rtol=1e-6)


def test_angles_between_rotations():
    """From a nanoradian to half a turn they are the length of the rotation vector between the two."""
    angle = np.array([0.0, 1e-9, 1e-4, 0.3, 2.0, 3.1])
    axis = np.array([0.6, 0.0, 0.8])
    first = rotation_exp(np.array([0.4, -1.0, 0.2]))
    second = first @ rotation_exp(angle[:, None] * axis)
    np.testing.assert_allclose(angle_between(first, second), angle, atol=1e-12, rtol=1e-6)
    axes = np.random.default_rng(0).standard_normal((500, 3))
    half = first @ rotation_exp(np.pi * axes / np.linalg.norm(axes, axis=-1, keepdims=True))
    np.testing.assert_allclose(angle_between(first, half), np.pi, atol=1e-7)
    np.testing.assert_allclose(
        angle_between(first, second), np.linalg.norm(rotation_log(first.T @ second), axis=-1), atol=1e-8
    )
