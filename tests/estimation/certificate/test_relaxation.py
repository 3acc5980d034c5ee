"""The least value of a form on products of unit quaternions, and its proof."""

from __future__ import annotations

from itertools import combinations_with_replacement, product

import numpy as np
import pytest

from basecal.estimation.certificate.relaxation import Bound, bound, local_minimum, product_of


def units(rng: np.random.Generator, count: int) -> tuple[np.ndarray, ...]:
    q = rng.standard_normal((count, 4))
    return tuple(q / np.linalg.norm(q, axis=-1, keepdims=True))


def random_form(rng: np.random.Generator, count: int, rank: int) -> np.ndarray:
    rows = rng.standard_normal((rank, 4**count))
    return rows.T @ rows / (rank * 4**count)


def brute_force(form: np.ndarray, count: int, starts: int, seed: int) -> tuple[tuple[np.ndarray, ...], float]:
    rng = np.random.default_rng(seed)
    return min((local_minimum(form, units(rng, count)) for _ in range(starts)), key=lambda end: end[1])


def near_a_product(rng: np.random.Generator, count: int, noise: float) -> np.ndarray:
    """A form that is nearly zero on one product, as data with little noise give."""
    best = product_of(units(rng, count))
    rows = rng.standard_normal((3 * 4**count, 4**count))
    rows -= np.outer(rows @ best, best) * (1 - noise)
    return rows.T @ rows / (3 * 16**count)


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("rank", [3, 20, 200])
def test_no_product_lies_below_the_bound(count, rank):
    """On random forms, tight or not, neither 2,000 random products nor 20 descents find less than the bound."""
    rng = np.random.default_rng([count, rank])
    form = random_form(rng, count, rank)
    factors, least = brute_force(form, count, 20, 1)
    found = bound(form, factors)
    vectors = np.stack([product_of(units(rng, count)) for _ in range(2000)])
    assert found.lower <= min(least, float(np.einsum("ni,ij,nj->n", vectors, form, vectors).min())) + 1e-12


@pytest.mark.parametrize("count", [1, 2, 3])
def test_growth_holds_on_every_product(count):
    """The form is nowhere below lower + growth (1 - (v' best)^2), near the best product and far from it."""
    rng = np.random.default_rng(count)
    form = near_a_product(rng, count, 0.05)
    found = bound(form, brute_force(form, count, 10, 2)[0])
    best = product_of(found.factors)
    for size in (0.01, 0.1, 1.0, 10.0):
        for _ in range(200):
            near = [f + size * rng.standard_normal(4) for f in found.factors]
            v = product_of([f / np.linalg.norm(f) for f in near])
            assert v @ form @ v >= found.lower + found.growth * (1 - (v @ best) ** 2) - 1e-12


@pytest.mark.parametrize("count", [1, 2, 3])
def test_proof_is_tight_where_one_product_stands_out(count):
    """With one product much better than others the bound is its value to 1e-9 of the form."""
    rng = np.random.default_rng(count)
    for _ in range(5):
        form = near_a_product(rng, count, 0.05)
        found = bound(form, brute_force(form, count, 10, 3)[0])
        assert found.value - found.lower < 1e-9 * np.linalg.eigvalsh(form)[-1]
        assert found.growth > 1e-3 * np.linalg.eigvalsh(form)[-1]


def test_a_local_minimum_is_not_proven():
    """Of two minima, 1 and 0.9 deep at products that are orthogonal in both factors, only the deeper one is proven."""
    axes = np.eye(4)
    deep, shallow = (axes[0], axes[1]), (axes[2], axes[3])
    form = np.eye(16) - sum(
        depth * np.outer(product_of(of), product_of(of)) for depth, of in ((1, deep), (0.9, shallow))
    )
    kept, value = local_minimum(form, shallow)
    assert value == pytest.approx(0.1)
    assert bound(form, kept).lower <= 1e-12
    assert bound(form, deep).lower == pytest.approx(0.0, abs=1e-9)


def test_a_continuum_of_minima_has_no_growth():
    """A form that no turn of one factor changes has a tight bound and no growth."""
    rng = np.random.default_rng(6)
    rows = rng.standard_normal((40, 4))
    form = np.kron(np.eye(4), rows.T @ rows / 40)
    found = bound(form, brute_force(form, 2, 3, 1)[0])
    assert found.value - found.lower < 1e-9
    assert found.growth < 1e-6


def by_clarabel(form: np.ndarray, count: int) -> float:
    """The least of <form, T> over semidefinite T of trace one that exchanges of indices leave as they are."""
    clarabel = pytest.importorskip("clarabel", reason="clarabel, the other solver of this test, is not installed")
    from scipy import sparse

    size = 4**count
    place = {(i, j): k for k, (i, j) in enumerate((i, j) for j in range(size) for i in range(j + 1))}
    pairs = list(combinations_with_replacement(range(4), 2))
    entries, values, trace = [], [], []
    for column, chosen in enumerate(product(pairs, repeat=count)):
        orders = {tuple(zip(*order, strict=True)) for order in product(*[{(a, b), (b, a)} for a, b in chosen])}
        at = {tuple(int(np.ravel_multi_index(index, (4,) * count)) for index in order) for order in orders}
        values.append(sum(form[i, j] for i, j in at))
        trace.append(float(sum(i == j for i, j in at)))
        entries += [(1 + place[i, j], column, -(1.0 if i == j else 2**0.5)) for i, j in at if i <= j]
    rows, columns, numbers = zip(*entries, strict=True)
    matrix = sparse.coo_matrix((numbers, (rows, columns)), (1 + len(place), len(values))).tolil()
    matrix[0] = trace
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.ZeroConeT(1), clarabel.PSDTriangleConeT(size)]
    right = np.eye(1 + len(place))[0]
    quadratic = sparse.csc_matrix((len(values), len(values)))
    solver = clarabel.DefaultSolver(quadratic, np.array(values), matrix.tocsc(), right, cones, settings)
    return float(solver.solve().obj_val)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("noise", [0.02, 0.2])
def test_bound_is_that_of_another_solver(seed, noise):
    """An interior-point solver for semidefinite programs finds the same bound, to 1e-6 of the form."""
    form = near_a_product(np.random.default_rng([seed, 9]), 2, noise)
    found: Bound = bound(form, brute_force(form, 2, 10, 1)[0])
    assert found.lower == pytest.approx(by_clarabel(form, 2), abs=1e-6 * np.linalg.eigvalsh(form)[-1])


@pytest.mark.slow
def test_bound_of_three_factors_is_that_of_another_solver():
    """As above with three factors, where that solver takes seconds."""
    form = near_a_product(np.random.default_rng(9), 3, 0.1)
    found = bound(form, brute_force(form, 3, 10, 1)[0])
    assert found.lower == pytest.approx(by_clarabel(form, 3), abs=1e-6 * np.linalg.eigvalsh(form)[-1])
