"""Tests of the closed forms on data without noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from basecal.estimation.start.closed_form import Loop, kron, solve_rotations, solve_translations
from basecal.geometry import SE3

PATTERNS = ["x", "y", "z", "xy", "xz", "yz", "xyz"]


def poses(rng: np.random.Generator, n: int, still: bool = False) -> SE3:
    xi = rng.standard_normal((n, 6))
    return SE3.exp(np.broadcast_to(xi[0], xi.shape) if still else xi)


def make_loop(
    unknown: str, n: int, eye_still: bool = False, hand_still: bool = False, seed: int = 5
) -> tuple[Loop, dict[str, SE3]]:
    rng = np.random.default_rng(seed)
    a, c = poses(rng, n, eye_still), poses(rng, n, hand_still)
    truth = {name: SE3.exp(rng.standard_normal(6)) for name in "xyz"}
    b = (a @ truth["x"]).inverse() @ truth["y"] @ c @ truth["z"]
    known = {name: None if name in unknown else value for name, value in truth.items()}
    return Loop(a, b, c, known["x"], known["y"], known["z"], np.ones(n)), truth


@pytest.mark.parametrize("seed", [5, 2, 0])
@pytest.mark.parametrize("unknown", PATTERNS)
def test_exact_data_give_exact_transforms(unknown, seed):
    """Any unknown combination of X, Y and Z is exact to 1e-9 and determined, for either sign of null vectors."""
    loop, truth = make_loop(unknown, 20, seed=seed)
    found = solve_rotations(loop)
    assert found.clear
    for name, ours in zip("xyz", solve_translations(loop, found), strict=True):
        assert np.abs((ours.inverse() @ truth[name]).log()).max() < 1e-9


@pytest.mark.parametrize("unknown", ["xy", "xyz"])
def test_still_arm_is_not_sufficient(unknown):
    """With a still hand, Y and Z (or all three) cannot be separated, and the result is not clear."""
    loop, _ = make_loop("yz" if unknown == "xy" else unknown, 20, hand_still=True)
    assert not solve_rotations(loop).clear
    mirrored, _ = make_loop(unknown, 20, eye_still=True)
    assert not solve_rotations(mirrored).clear


def test_too_few_samples_are_not_sufficient():
    """Three samples leave all three rotations undetermined."""
    loop, _ = make_loop("xyz", 3)
    assert not solve_rotations(loop).clear


def test_kronecker_products_equal_numpy(rng):
    """Kronecker products over leading axes equal NumPy's, for matrices that are not square."""
    left, right = rng.standard_normal((4, 2, 3)), rng.standard_normal((4, 5, 2))
    expected = [np.kron(a, b) for a, b in zip(left, right, strict=True)]
    np.testing.assert_allclose(kron(left, right), expected, rtol=1e-14)
    np.testing.assert_array_equal(kron(left[0], right[0]), kron(left, right)[0])


def noisy_loop(unknown: str, n: int = 12):
    """Noisy samples with different weights."""
    loop, truth = make_loop(unknown, n)
    rng = np.random.default_rng(8)
    b = loop.b @ SE3.exp(0.05 * rng.standard_normal((n, 6)))
    return loop._replace(b=b, weight=rng.uniform(0.2, 3.0, n)), truth


@pytest.mark.parametrize("unknown", ["x", "y", "z"])
def test_single_rotation_is_the_weighted_mean(unknown):
    """Samples are weighted by the square of their weight, as in SciPy's mean of rotations."""
    loop, truth = noisy_loop(unknown)
    a, b, c = (of.rotation for of in (loop.a, loop.b, loop.c))
    x, y, z = (truth[name].rotation for name in "xyz")
    each = {"x": a.mT @ y @ c @ z @ b.mT, "y": a @ x @ b @ (c @ z).mT, "z": (y @ c).mT @ a @ x @ b}[unknown]
    mean = Rotation.from_matrix(each).mean(weights=loop.weight**2).as_matrix()
    np.testing.assert_allclose(getattr(solve_rotations(loop), unknown), mean, atol=1e-10)


def _nearest(matrix):
    """The rotation nearest to a multiple of a matrix, by singular values."""
    left, _, right = np.linalg.svd(matrix * np.sign(np.linalg.det(matrix)))
    return left @ right


@pytest.mark.parametrize("unknown", ["xy", "xz", "yz"])
def test_two_rotations_are_the_null_vector_of_weighted_rows(unknown):
    """The explicit form is A X B = Y C Z for each sample, as rows of nine equations in two rotations."""
    loop, truth = noisy_loop(unknown)
    known = {name: truth[name].rotation for name in "xyz" if name not in unknown}
    basis, rows = np.eye(9).reshape(9, 3, 3), []
    for a, b, c, w in zip(loop.a.rotation, loop.b.rotation, loop.c.rotation, loop.weight, strict=True):
        if unknown == "xz":
            left, right = (a @ basis @ b), (known["y"] @ c @ basis)
        elif unknown == "xy":
            left, right = (a @ basis @ b), (basis @ c @ known["z"])
        else:  # Y' A X B = C Z, Y' in place of Y
            left, right = (basis @ a @ known["x"] @ b), (c @ basis)
        rows.append(w * np.concatenate([left, -right]).reshape(18, 9).T)
    null = np.linalg.svd(np.concatenate(rows))[2][-1]
    first, second = _nearest(null[:9].reshape(3, 3)), _nearest(null[9:].reshape(3, 3))
    expected = dict(zip(unknown, (first.T if unknown == "yz" else first, second), strict=True)) | known
    found = solve_rotations(loop)
    assert found.clear
    for name in "xyz":
        np.testing.assert_allclose(getattr(found, name), expected[name], atol=1e-9)


@pytest.mark.parametrize("unknown", ["xz", "xyz"])
def test_sample_counts_by_its_squared_weight(unknown):
    """Among noisy samples, one of weight two counts as much as four of weight one."""
    loop, _ = noisy_loop(unknown, 16)
    times = np.resize([4, 1, 1], 16)
    rows = np.repeat(np.arange(16), times)
    once = solve_rotations(loop._replace(weight=np.sqrt(times)))
    often = solve_rotations(loop._replace(a=loop.a[rows], b=loop.b[rows], c=loop.c[rows], weight=np.ones(len(rows))))
    for one, same in zip(once, often, strict=True):
        np.testing.assert_allclose(one, same, atol=1e-7)


def test_samples_of_zero_weight_have_no_effect():
    """With a fifth of them random, the others give exact transforms, with all three unknown."""
    loop, truth = make_loop("xyz", 25)
    anywhere = SE3.exp(np.random.default_rng(4).standard_normal((25, 6)))
    wrong = np.arange(25) % 5 == 2
    spoilt = SE3(
        np.where(wrong[:, None, None], anywhere.rotation, loop.b.rotation),
        np.where(wrong[:, None], anywhere.translation, loop.b.translation),
    )
    loop = loop._replace(b=spoilt, weight=np.where(wrong, 0.0, np.random.default_rng(2).uniform(0.5, 2.0, 25)))
    found = solve_rotations(loop)
    assert found.clear
    for name, ours in zip("xyz", solve_translations(loop, found), strict=True):
        assert np.abs((ours.inverse() @ truth[name]).log()).max() < 1e-8


@pytest.mark.parametrize("unknown", PATTERNS)
def test_translations_minimise_weighted_least_squares(unknown):
    """The sum of weighted squared differences of A X B and Y C Z, as products of poses, is minimal."""
    loop, truth = noisy_loop(unknown)
    found = solve_rotations(loop)
    triple = dict(zip("xyz", solve_translations(loop, found), strict=True))

    def misfit(shifts):
        x, y, z = (
            SE3(getattr(found, name), triple[name].translation + shifts.get(name, 0.0))
            if name in unknown
            else truth[name]
            for name in "xyz"
        )
        apart = (loop.a @ x @ loop.b).translation - (y @ loop.c @ z).translation
        return float(np.sum((loop.weight[:, None] * apart) ** 2))

    least = misfit({})
    for name in unknown:
        for axis in np.eye(3):
            there, back = misfit({name: 1e-4 * axis}), misfit({name: -1e-4 * axis})
            assert there > least < back
            assert abs(there - back) < 1e-6 * least
    for name in set("xyz") - set(unknown):
        np.testing.assert_array_equal(triple[name].matrix, truth[name].matrix)


def test_unknown_letters_are_in_order():
    """The names of unknown transforms are in the order x, y, z."""
    assert [make_loop(unknown, 2)[0].unknown for unknown in ("", *PATTERNS)] == ["", *PATTERNS]
