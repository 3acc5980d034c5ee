"""Tests of the minimum of a form on products of unit quaternions, and of its proof."""

from __future__ import annotations

from itertools import combinations_with_replacement, product

import numpy as np
import pytest

from basecal.estimation.certificate import relaxation
from basecal.estimation.certificate.relaxation import Bound, kronecker_product, local_minimum, lower_bound


def random_units(rng: np.random.Generator, count: int) -> tuple[np.ndarray, ...]:
    q = rng.standard_normal((count, 4))
    return tuple(q / np.linalg.norm(q, axis=-1, keepdims=True))


def random_form(rng: np.random.Generator, count: int, rank: int) -> np.ndarray:
    rows = rng.standard_normal((rank, 4**count))
    return rows.T @ rows / (rank * 4**count)


def brute_force(form: np.ndarray, count: int, starts: int, seed: int) -> tuple[tuple[np.ndarray, ...], float]:
    rng = np.random.default_rng(seed)
    return min((local_minimum(form, random_units(rng, count)) for _ in range(starts)), key=lambda end: end[1])


def form_near_a_product(rng: np.random.Generator, count: int, noise: float) -> np.ndarray:
    """A form that is nearly zero on one product, as with low-noise data."""
    best = kronecker_product(random_units(rng, count))
    rows = rng.standard_normal((3 * 4**count, 4**count))
    rows -= np.outer(rows @ best, best) * (1 - noise)
    return rows.T @ rows / (3 * 16**count)


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("rank", [3, 20, 200])
def test_no_product_is_below_the_bound(count, rank):
    """On random forms, tight or not, neither 2,000 random products nor 20 descents find less than the bound."""
    rng = np.random.default_rng([count, rank])
    form = random_form(rng, count, rank)
    factors, least = brute_force(form, count, 20, 1)
    found = lower_bound(form, factors)
    factors_of_all = rng.standard_normal((count, 2000, 4))
    factors_of_all /= np.linalg.norm(factors_of_all, axis=-1, keepdims=True)
    vectors = np.ones((2000, 1))
    for factor in factors_of_all:
        vectors = np.einsum("na,nb->nab", vectors, factor).reshape(2000, -1)
    assert found.lower <= min(least, float(np.vecdot(vectors @ form, vectors).min())) + 1e-12


@pytest.mark.parametrize("count", [1, 2, 3])
def test_growth_holds_for_every_product(count):
    """The form is nowhere below lower + growth (1 - (v' best)^2), near the best product and far from it."""
    rng = np.random.default_rng(count)
    form = form_near_a_product(rng, count, 0.05)
    found = lower_bound(form, brute_force(form, count, 10, 2)[0])
    best = kronecker_product(found.factors)
    for size in (0.01, 0.1, 1.0, 10.0):
        for _ in range(200):
            near = [f + size * rng.standard_normal(4) for f in found.factors]
            v = kronecker_product([f / np.linalg.norm(f) for f in near])
            assert v @ form @ v >= found.lower + found.growth * (1 - (v @ best) ** 2) - 1e-12


@pytest.mark.parametrize("count", [1, 2, 3])
def test_proof_is_tight_for_a_distinct_optimum(count):
    """If one product is much better than others, the bound is its value to 1e-9 of the form."""
    rng = np.random.default_rng(count)
    for _ in range(5):
        form = form_near_a_product(rng, count, 0.05)
        found = lower_bound(form, brute_force(form, count, 10, 3)[0])
        assert found.value - found.lower < 1e-9 * np.linalg.eigvalsh(form)[-1]
        assert found.growth > 1e-3 * np.linalg.eigvalsh(form)[-1]


def test_local_minimum_is_not_proven():
    """Only the deeper of two minima is proven.

    They are 1 and 0.9 deep, at products that are orthogonal in both factors.
    """
    axes = np.eye(4)
    deep, shallow = (axes[0], axes[1]), (axes[2], axes[3])
    form = np.eye(16) - sum(
        depth * np.outer(kronecker_product(of), kronecker_product(of)) for depth, of in ((1, deep), (0.9, shallow))
    )
    kept, value = local_minimum(form, shallow)
    assert value == pytest.approx(0.1)
    assert lower_bound(form, kept).lower <= 1e-12
    assert lower_bound(form, deep).lower == pytest.approx(0.0, abs=1e-9)


def test_continuum_of_minima_has_no_growth():
    """A form that is invariant to rotations of one factor has a tight bound and no growth."""
    rng = np.random.default_rng(6)
    rows = rng.standard_normal((40, 4))
    form = np.kron(np.eye(4), rows.T @ rows / 40)
    found = lower_bound(form, brute_force(form, 2, 3, 1)[0])
    assert found.value - found.lower < 1e-9
    assert found.growth < 1e-6


def bound_by_clarabel(form: np.ndarray, count: int) -> float:
    """The minimum of <form, T> over semidefinite T of trace one that are invariant to exchanges of indices."""
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
def test_bound_equals_an_interior_point_solver(seed, noise):
    """An interior-point solver for semidefinite programs finds the same bound, to 1e-6 of the form."""
    form = form_near_a_product(np.random.default_rng([seed, 9]), 2, noise)
    found: Bound = lower_bound(form, brute_force(form, 2, 10, 1)[0])
    assert found.lower == pytest.approx(bound_by_clarabel(form, 2), abs=1e-6 * np.linalg.eigvalsh(form)[-1])


@pytest.mark.slow
def test_bound_of_three_factors_equals_an_interior_point_solver():
    """With three factors the bounds agree to 1e-6 of the form. The other solver takes seconds."""
    form = form_near_a_product(np.random.default_rng(9), 3, 0.1)
    found = lower_bound(form, brute_force(form, 3, 10, 1)[0])
    assert found.lower == pytest.approx(bound_by_clarabel(form, 3), abs=1e-6 * np.linalg.eigvalsh(form)[-1])


@pytest.mark.parametrize("seed", range(4))
def test_smallest_eigenvalue_is_raised(seed):
    """Terms that vanish on products raise it by a twentieth at least, also if it stays below the former next one."""
    form = random_form(np.random.default_rng([seed, 200]), 2, 200)[1:, 1:]
    raised = relaxation._maximise_dual(form, 2)
    assert np.linalg.eigvalsh(raised)[0] > 1.05 * np.linalg.eigvalsh(form)[0]
    entries = relaxation._classes(2)[1:, 1:].ravel()
    np.testing.assert_allclose(np.bincount(entries, (raised - form).ravel()), 0, atol=1e-12)


def all_exchanges(matrix: np.ndarray, count: int) -> list[np.ndarray]:
    """A matrix with the indices of any of its factors exchanged between row and column, all 2^k."""
    of = matrix.reshape((4,) * (2 * count))
    found = []
    for which in product([False, True], repeat=count):
        order = np.arange(2 * count)
        for j, turn in enumerate(which):
            if turn:
                order[[j, count + j]] = order[[count + j, j]]
        found.append(of.transpose(order).reshape(matrix.shape))
    return found


@pytest.mark.parametrize("count", [1, 2, 3])
def test_exchange_mean_is_the_mean_of_all_exchanges(count, rng):
    """The mean is over all 2^k exchanges of row and column indices of factors."""
    matrix = rng.standard_normal((4**count, 4**count))
    mean = sum(all_exchanges(matrix, count)) / 2**count
    np.testing.assert_allclose(relaxation._exchange_mean(matrix, count), mean, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2])
def test_classes_group_exchanged_entries(count):
    """Two entries are of one class if the sets of each factor's two indices are equal."""
    classes = relaxation._classes(count)
    assert classes.shape == (4**count, 4**count)
    digits = [np.unravel_index(i, (4,) * count) for i in range(4**count)]
    sets = {}
    for i, j in product(range(4**count), repeat=2):
        key = tuple(tuple(sorted(pair)) for pair in zip(digits[i], digits[j], strict=True))
        assert sets.setdefault(key, classes[i, j]) == classes[i, j]
    assert sorted(sets.values()) == list(range(10**count))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_first_row_of_a_form_is_cleared(count, rng):
    """The row is cleared as far as products are unaffected.

    Its entries are spread equally over the others of their classes.
    """
    matrix = random_form(rng, count, 30)
    found = relaxation._clear_first_row(matrix, count)
    np.testing.assert_allclose(
        relaxation._exchange_mean(found, count), relaxation._exchange_mean(matrix, count), atol=1e-12
    )
    np.testing.assert_array_equal(found, found.T)
    assert found[0, 0] == matrix[0, 0]
    several = np.array([sum(digit > 0 for digit in np.unravel_index(j, (4,) * count)) > 1 for j in range(4**count)])
    np.testing.assert_array_equal(found[0], np.where(several, 0.0, matrix[0]))
    added = (found - matrix)[1:, 1:]
    classes = relaxation._classes(count)
    for number in np.unique(classes[0, several]):
        of_class = added[classes[1:, 1:] == number]
        np.testing.assert_allclose(of_class, of_class[0], atol=1e-12)


@pytest.mark.parametrize("count", [2, 3])
def test_vanishing_projection_subtracts_class_means(count, rng):
    """The projection is idempotent and orthogonal, and its result vanishes on products."""
    project, size = relaxation._vanishing_projection(count), 4**count - 1
    root = rng.standard_normal((size, size))
    matrix = root + root.T
    found = project(matrix)
    whole = np.zeros((size + 1, size + 1))
    whole[1:, 1:] = found
    np.testing.assert_allclose(relaxation._exchange_mean(whole, count), 0.0, atol=1e-12)
    np.testing.assert_allclose(project(found), found, atol=1e-12)
    assert np.vdot(found, matrix - found) == pytest.approx(0.0, abs=1e-9)
    inner = relaxation._classes(count)[1:, 1:]
    for number in np.unique(inner)[:20]:
        here = inner == number
        np.testing.assert_allclose(found[here], matrix[here] - matrix[here].mean(), atol=1e-12)


def test_newton_step_is_stationary(rng, monkeypatch):
    """The step is stationary for the barrier to second order.

    This holds in every direction that vanishes on products, and in the level.
    """
    monkeypatch.setattr(relaxation, "_CG_TOLERANCE", 1e-12)
    project, size = relaxation._vanishing_projection(2), 15
    root = rng.standard_normal((size, 40))
    inverse, pull = np.linalg.inv(root @ root.T / 40), 50.0
    step, rise = relaxation._newton(inverse, pull, project)
    np.testing.assert_allclose(project(step), step, atol=1e-9)
    moved = inverse - inverse @ (step - rise * np.eye(size)) @ inverse
    np.testing.assert_allclose(project(moved), 0.0, atol=1e-8 * np.abs(inverse).max() ** 2)
    assert pull - np.trace(moved) == pytest.approx(0.0, abs=1e-8 * np.trace(inverse) ** 2)


def test_conjugate_gradients_end_at_a_hundredth(rng, monkeypatch):
    """The iteration takes as many steps as needed, up to a limit, and its last sums are correct."""
    root = rng.standard_normal((12, 12))
    matrix, right = root @ root.T + np.eye(12), rng.standard_normal(12)
    asked = []

    def operator(along):
        """The product with the matrix, counted."""
        asked.append(along)
        return matrix @ along

    def left(found):
        """The remaining residual relative to the first one."""
        return np.linalg.norm(right - matrix @ found) / np.linalg.norm(right)

    found, steps = relaxation._solve_conjugate_gradients(operator, right), len(asked)
    assert 2 < steps < 12
    assert left(found) <= 1e-2
    monkeypatch.setattr(relaxation, "_MOST_CG_STEPS", steps - 1)
    assert left(relaxation._solve_conjugate_gradients(operator, right)) > 1e-2
    monkeypatch.setattr(relaxation, "_CG_TOLERANCE", 1e-9)
    monkeypatch.setattr(relaxation, "_MOST_CG_STEPS", 50)
    np.testing.assert_allclose(
        relaxation._solve_conjugate_gradients(operator, right), np.linalg.solve(matrix, right), rtol=1e-6
    )
    np.testing.assert_array_equal(relaxation._solve_conjugate_gradients(operator, 0 * right), 0.0)


def test_parts_that_affect_products_lower_the_bound(monkeypatch):
    """If the form is raised by a part that affects products, the bound is not raised."""
    rng = np.random.default_rng(3)
    form = form_near_a_product(rng, 2, 0.05)
    factors, value = brute_force(form, 2, 5, 1)
    honest, raised = lower_bound(form, factors), relaxation._maximise_dual
    monkeypatch.setattr(relaxation, "_maximise_dual", lambda rest, count: raised(rest, count) + 0.1 * np.eye(len(rest)))
    found = lower_bound(form, factors)
    assert found.value == honest.value == pytest.approx(value)
    assert found.lower <= honest.lower + 1e-9
    assert found.lower == pytest.approx(honest.lower - 0.1, abs=1e-6)


@pytest.mark.parametrize("count", [2, 3])
def test_local_minimum_is_lowest_in_each_factor(count, rng):
    """Each factor is optimal with the others fixed.

    For a single factor it is the smallest eigenvalue, found at once and confirmed.
    """
    form = random_form(rng, count, 6)
    factors, value = local_minimum(form, random_units(rng, count))
    best = kronecker_product(factors)
    assert best @ form @ best == pytest.approx(value, rel=1e-9)
    for j in range(count):
        axes = [np.eye(4) if i == j else f[:, None] for i, f in enumerate(factors)]
        along = axes[0]
        for axis in axes[1:]:
            along = np.kron(along, axis)
        values, vectors = np.linalg.eigh(along.T @ form @ along)
        assert values[0] == pytest.approx(value, rel=1e-6)
        assert abs(vectors[:, 0] @ factors[j]) == pytest.approx(1.0, abs=1e-4)


def test_sweeps_end_without_improvement(rng, monkeypatch):
    """With one factor the second sweep gives no improvement. With a limit of one, there is one sweep."""
    form, start = random_form(rng, 1, 6), random_units(rng, 1)
    made, whole = [], relaxation.kronecker_product
    monkeypatch.setattr(relaxation, "kronecker_product", lambda of: made.append(len(of)) or whole(of))
    _, value = local_minimum(form, start)
    assert value == pytest.approx(np.linalg.eigvalsh(form)[0])
    assert made == [0, 0]
    local_minimum(form, start, 1)
    assert made == [0, 0, 0]


def test_dual_maximisation_recovers_the_optimum():
    """A form lowered by a part that vanishes on products is raised back to within a tenth.

    With one factor there is nothing to add.
    """
    rng = np.random.default_rng(5)
    project = relaxation._vanishing_projection(2)
    root = rng.standard_normal((15, 15))
    flat, lowering = np.diag(np.linspace(1.0, 2.0, 15)), project(root + root.T)
    form = flat - 3.0 * lowering / np.abs(np.linalg.eigvalsh(lowering)).max()
    assert np.linalg.eigvalsh(form)[0] < -0.5
    raised = relaxation._maximise_dual(form, 2)
    np.testing.assert_allclose(project(raised - form), raised - form, atol=1e-9)
    assert np.linalg.eigvalsh(raised)[0] > 0.85
    np.testing.assert_array_equal(relaxation._maximise_dual(form[:3, :3], 1), form[:3, :3])


@pytest.mark.parametrize("shift", [-50.0, 50.0])
def test_dual_maximisation_is_independent_of_shifts(shift):
    """Forms that are wholly negative or wholly positive are raised as far as one between."""
    form = random_form(np.random.default_rng([1, 200]), 2, 200)[1:, 1:]
    gain = [
        np.linalg.eigvalsh(relaxation._maximise_dual(form + by * np.eye(15), 2))[0] - np.linalg.eigvalsh(form)[0] - by
        for by in (0.0, shift)
    ]
    assert gain[1] > 0.8 * gain[0] > 0
