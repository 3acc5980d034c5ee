"""Tests of searching rotations by a grid and alternating means, for batches of loops."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.estimation.start import rotation_search
from basecal.estimation.start.closed_form import Loop, Rotations, solve_rotations
from basecal.estimation.start.rotation_search import (
    _grid_starts,
    _loops,
    _sum_of_singular_values,
    _trimmed_rms,
    icosahedral_rotations,
    pose_starts,
    refine_rotations,
    rotation_angle,
    search_rotations,
)
from basecal.geometry import SE3
from basecal.geometry.rotation import nearest_rotation, rotation_exp, rotation_log


def make_loop(truth, unknown, n, seed, noise=0.0):
    """A loop of n samples with noise of B [rad] and some unknowns among X, Y and Z."""
    rng = np.random.default_rng(seed)
    a, c = SE3.exp(rng.standard_normal((n, 6))), SE3.exp(rng.standard_normal((n, 6)))
    b = (a @ truth["x"]).inverse() @ truth["y"] @ c @ truth["z"] @ SE3.exp(noise * rng.standard_normal((n, 6)))
    known = {name: None if name in unknown else value for name, value in truth.items()}
    return Loop(a, b, c, known["x"], known["y"], known["z"], rng.uniform(0.2, 1, n))


@pytest.mark.parametrize("unknown", ["x", "y", "z", "xy", "xz", "yz", "xyz"])
def test_truth_on_the_grid_is_found_first(unknown):
    """For exact data with rotations of the grid, the best start is the truth, for any unknowns."""
    rng = np.random.default_rng(6)
    grid = icosahedral_rotations()
    truth = {name: SE3(grid[k], rng.standard_normal(3)) for name, k in zip("xyz", (7, 31, 52), strict=True)}
    starts = pose_starts([make_loop(truth, unknown, 15, 6)], 5)[0]
    for name, rotation in zip("xyz", starts[0][:3], strict=True):
        np.testing.assert_allclose(rotation, truth[name].rotation, atol=1e-9)


def random_truth(seed):
    rng = np.random.default_rng(seed)
    return {name: SE3.exp(rng.standard_normal(6) * (1, 1, 1, 2, 2, 2)) for name in "xyz"}


@pytest.mark.parametrize("unknown", ["xy", "xz", "yz", "xyz"])
def test_exact_loops_are_closed(unknown):
    """Eight loops of 12 to 19 samples, each with its own truth, are all found to a tenth of a milliradian."""
    truths = [random_truth(k) for k in range(8)]
    found = search_rotations([make_loop(truth, unknown, 12 + k, k) for k, truth in enumerate(truths)])
    assert all(rotations.clear for rotations in found)
    off = [
        rotation_angle(getattr(rotations, k), truth[k].rotation)
        for rotations, truth in zip(found, truths, strict=True)
        for k in "xyz"
    ]
    assert max(off) < 1e-4


@pytest.mark.parametrize("unknown", ["y", "xz", "xyz"])
def test_rotations_converge_towards_the_truth(unknown):
    """From a third of a radian off, rounds leave a tenth of it or less, separately for each loop."""
    truths = [random_truth(k) for k in range(5)]
    rng = np.random.default_rng(1)
    turns = [{k: rotation_exp(0.2 * rng.standard_normal(3)) for k in unknown} for _ in truths]
    near = [
        Rotations(*(truth[k].rotation @ turn.get(k, np.eye(3)) for k in "xyz"))
        for truth, turn in zip(truths, turns, strict=True)
    ]
    found = refine_rotations([make_loop(truth, unknown, 20, k) for k, truth in enumerate(truths)], near)
    assert all(rotations.clear for rotations in found)
    for at, begun, truth in zip(found, near, truths, strict=True):
        off = max(rotation_angle(getattr(at, k), truth[k].rotation) for k in "xyz")
        assert off < max(rotation_angle(getattr(begun, k), truth[k].rotation) for k in "xyz") / 10


def test_loops_of_a_batch_are_independent():
    """Noisy loops of different lengths, one of them hopeless, end in a batch where each ends alone."""
    loops = [make_loop(random_truth(k), "xyz", 10 + k, k, noise=0.05) for k in range(4)]
    wild = make_loop(random_truth(4), "xyz", 12, 4, noise=2.0)
    together = search_rotations([*loops, wild])
    for each, found in zip([*loops, wild], together, strict=True):
        (alone,) = search_rotations([each])
        for name in "xyz":
            np.testing.assert_allclose(getattr(found, name), getattr(alone, name), atol=1e-9)


def test_fifth_of_wrong_samples_has_little_effect():
    """With five of 24 samples random, the rotations are those of the others within 0.3 rad."""
    for seed in range(6):
        truth = random_truth(seed)
        clean = make_loop(truth, "xyz", 24, seed)
        wrong = np.arange(24) < 5
        turned = np.where(
            wrong[:, None, None], rotation_exp(np.random.default_rng(seed).standard_normal((24, 3))), np.eye(3)
        )
        (found,) = search_rotations([clean._replace(b=SE3(clean.b.rotation @ turned, clean.b.translation))])
        assert max(rotation_angle(getattr(found, k), truth[k].rotation) for k in "xyz") < 0.3


def test_sums_of_singular_values():
    """Sums are correct for 3 x 3 matrices of any rank, determinant and size, to a millionth of the sum."""
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((200, 3, 3)) * rng.uniform(0, 1, (200, 1, 3)) ** 4
    matrix[:20, :, 0] = 0.0
    matrix[:10, :, 1] = 0.0
    matrix[20:30] = rotation_exp(rng.standard_normal((10, 3)))
    matrix[30:40] *= 1e-4
    matrix[40:50] *= 1e4
    true = np.linalg.svd(matrix, compute_uv=False).sum(-1)
    np.testing.assert_allclose(_sum_of_singular_values(matrix), true, rtol=1e-6)


def test_angles_between_rotations():
    """From a nanoradian to half a turn, the angle is the length of the rotation vector between the two."""
    angle = np.array([0.0, 1e-9, 1e-4, 0.3, 2.0, 3.1])
    axis = np.array([0.6, 0.0, 0.8])
    first = rotation_exp(np.array([0.4, -1.0, 0.2]))
    second = first @ rotation_exp(angle[:, None] * axis)
    np.testing.assert_allclose(rotation_angle(first, second), angle, atol=1e-12, rtol=1e-6)
    axes = np.random.default_rng(0).standard_normal((500, 3))
    half = first @ rotation_exp(np.pi * axes / np.linalg.norm(axes, axis=-1, keepdims=True))
    np.testing.assert_allclose(rotation_angle(first, half), np.pi, atol=1e-7)
    np.testing.assert_allclose(
        rotation_angle(first, second), np.linalg.norm(rotation_log(first.T @ second), axis=-1), atol=1e-8
    )


@pytest.mark.parametrize("unknown", ["x", "y", "z"])
def test_single_rotation_converges_to_the_mean_of_samples(unknown):
    """Samples are weighted by the square of their weight, as in the closed form of one unknown."""
    loops = [make_loop(random_truth(k), unknown, 9 + k, k, noise=0.3) for k in range(2)]
    near = [Rotations(*(np.eye(3) if at is None else at.rotation for at in (of.x, of.y, of.z))) for of in loops]
    for of, found in zip(loops, refine_rotations(loops, near), strict=True):
        np.testing.assert_allclose(getattr(found, unknown), getattr(solve_rotations(of), unknown), atol=1e-9)


@pytest.mark.parametrize("unknown", ["y", "xz"])
def test_converged_rotations_are_not_iterated(monkeypatch, unknown):
    """From the truth of exact samples a round finds no change, and a loop that moved has another round alone."""
    counted, nearest = [], rotation_search.nearest_rotation
    monkeypatch.setattr(rotation_search, "nearest_rotation", lambda of: counted.append(len(of)) or nearest(of))
    truth = random_truth(1)
    exact, right = make_loop(truth, unknown, 20, 1), Rotations(*(truth[k].rotation for k in "xyz"))
    refine_rotations([exact], [right])
    assert counted == [1] * len(unknown)
    counted.clear()
    turned = getattr(right, unknown[0]) @ rotation_exp(np.array([0.0, 0.0, 1e-2]))
    off = right._replace(**{unknown[0]: turned})
    refine_rotations([exact, make_loop(truth, unknown, 12, 2)], [off, right])
    assert counted[: len(unknown) + 1] == [2] * len(unknown) + [1]


def test_distinct_starts_differ_in_any_rotation(monkeypatch):
    """Starts differ by more than 0.15 rad. The first of similar starts is kept, separately for each loop."""
    turn = rotation_exp(np.array([[0.0, 0, 0], [0.14, 0, 0], [0.16, 0, 0], [0, 0.5, 0]]))
    same = np.broadcast_to(np.eye(3), (4, 3, 3))
    ends = {"x": np.stack([same, turn, same]), "y": np.stack([turn, same, same]), "z": np.eye(3)[None, None]}
    monkeypatch.setattr(rotation_search, "_alternate", lambda loops, at, rounds: ends)
    found = pose_starts([make_loop(random_truth(k), "xy", 5, k) for k in range(3)], 4)
    np.testing.assert_array_equal([start[1] for start in found[0]], turn[[0, 2, 3]])
    np.testing.assert_array_equal([start[0] for start in found[1]], turn[[0, 2, 3]])
    np.testing.assert_array_equal([start[:3] for start in found[2]], [np.stack([np.eye(3)] * 3)])


@pytest.mark.parametrize(("most", "unknown"), [(1, "xy"), (5, "xy"), (7, "yz"), (61, "xz")])
def test_best_grid_cells_close_the_loops_best(most, unknown):
    """The best cells are found by comparing all, one by one.

    The score is the sum of singular values of the mean to which the other rotation is nearest.
    """
    grid, given = icosahedral_rotations(), [make_loop(random_truth(k), unknown, 8 + k, k, noise=0.2) for k in range(2)]
    best, averaged = _grid_starts(_loops(given), most), unknown[-1]
    for h, of in enumerate(given):
        a, b, c = (at.rotation for at in (of.a, of.b, of.c))
        x, y, z = (
            grid[:, None] if k == unknown[0] else None if k == averaged else getattr(of, k).rotation for k in "xyz"
        )
        each = c.mT @ y.mT @ a @ x @ b if averaged == "z" else a @ x @ b @ z.mT @ c.mT
        means = np.einsum("mnij,n->mij", each, of.weight**2 / np.sum(of.weight**2))
        order = np.argsort(-np.linalg.svd(means, compute_uv=False).sum(-1), kind="stable")[:most]
        np.testing.assert_array_equal(best[unknown[0]][h], grid[order])
        np.testing.assert_allclose(best[averaged][h], nearest_rotation(means[order]), atol=1e-9)


def test_third_of_the_samples_may_be_wrong():
    """The smallest seven tenths of each loop's own samples, rounded up and at least one, give the root mean square."""
    angle = np.array([[[1.0, 5.0, 2.0, 2.0, 0.1], [3.0, 3.0, 3.0, 9.0, 9.0]], [[4.0, 1.0, 1.0, 1.0, 1.0]] * 2])
    np.testing.assert_allclose(_trimmed_rms(angle, np.array([4, 1])), [[np.sqrt(3.0), 3.0], [4.0, 4.0]])
    np.testing.assert_allclose(
        _trimmed_rms(angle, np.array([5, 2])), [[np.sqrt(9.01 / 4), np.sqrt(27.0)], [np.sqrt(17 / 2)] * 2]
    )
