"""Tests of limits of observability, and of directions without any sigma."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csc_array
from tests.ends import with_eye
from tests.pose_problem import MOUNT, TARGET, pose_problem

from basecal.cell import Intrinsics, Unknown
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.observability import observability as module
from basecal.estimation.observability.motions import null_directions
from basecal.estimation.observability.observability import analyse_observability, sparse_observability, without_priors
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve_problem
from basecal.geometry import SE3, Camera
from basecal.numerics.sparse_hessian import SparseHessian
from basecal.simulation import Scenario, simulate

DISTANCE_M = 2.0
LENS = Camera("pinhole", np.array([800.0, 1200.0, 640.0, 360.0, *[0.0] * 4]), (1280, 720))


def analyse_sigmas(sigmas, factor=1.0, lens=()):
    """The observability of a mount with these sigmas [m, rad] and targets at 2 m, and of a lens."""
    return analyse_information(np.diag(1.0 / np.array([*sigmas, *lens]) ** 2), factor)


def analyse_information(hessian, factor=1.0, prior=(1.0,) * 6):
    """The observability of a mount with a prior, and of a lens if there are columns for it."""
    problem, state = pose_problem(np.zeros((4, 6)), np.ones(6), Unknown("prior", SE3.identity(), np.array(prior)))
    mount = SE3.from_rotvec([0, 0, 0], [0, 0, -DISTANCE_M])
    state = replace(state, transforms={**state.transforms, MOUNT: mount}, cameras={"camera": LENS})
    # The four poses of the arm are rotated about three axes and leave no direction unobservable.
    turned = SE3.from_rotvec(np.concatenate([np.zeros((1, 3)), np.eye(3)]), np.zeros((4, 3)))
    group = with_eye(problem.groups[0], base_from_flange=turned)
    problem = problem.with_groups([group])
    if len(hessian) > 6:
        columns = {**problem.columns, "camera": slice(6, 14)}
        problem = replace(problem, columns=columns, lenses={"camera": Intrinsics("free", LENS)})
    return analyse_observability(problem, state, hessian, factor)


GOOD = np.array([1e-3] * 6)


def test_sparse_and_dense_observability_agree():
    """The condition of three robots is that of the dense matrix.

    There is none if noise makes a direction unobservable.
    """
    made = simulate(Scenario(layout="ring", robots=3, samples=30, robot_noise=(1e-4, 1e-4)), 1)
    problem, _ = build_problem(made.cell, made.recording)
    state = solve_problem(problem, made.cell, Settings(robot_noise="stated")).state
    hessian = linearise(problem, state).hessian
    sparse, dense = SparseHessian(csc_array(hessian)), analyse_observability(problem, state, hessian, 1.0)
    assert sparse_observability(problem, state, sparse, 1e6) is None
    assert analyse_observability(problem, state, hessian, 1e6).unobservable
    found = sparse_observability(problem, state, sparse, 1.0)
    assert found is not None
    assert found.condition == pytest.approx(dense.condition, rel=2e-3)
    np.testing.assert_allclose(found.inverse, dense.inverse, atol=1e-8 * np.abs(dense.inverse).max())


@pytest.mark.parametrize("k", range(6))
def test_direction_is_observable_below_three_tenths(k):
    """A sigma of 0.29 rad, or 0.29 of the distance, is observable. One of 0.31 is not, and keeps its number."""
    unit = unit_of_column(k)
    below, above = GOOD.copy(), GOOD.copy()
    below[k], above[k] = 0.29 * unit, 0.31 * unit
    assert analyse_sigmas(below).unobservable == frozenset()
    assert analyse_sigmas(below).null_space == ()
    found = analyse_sigmas(above)
    assert found.unobservable == {MOUNT}
    assert len(found.null_space) == 1
    assert found.inverse[k, k] == pytest.approx(above[k] ** 2)


def unit_of_column(k):
    return DISTANCE_M if k < 3 else 1.0


@pytest.mark.parametrize("k", [0, 5])
def test_direction_without_information_has_no_sigma(k):
    """Beyond a sigma of 30 it has none: zero in the inverse, and an infinite condition."""
    sigmas = GOOD.copy()
    sigmas[k] = 29 * unit_of_column(k)
    assert analyse_sigmas(sigmas).inverse[k, k] == pytest.approx(sigmas[k] ** 2)
    assert np.isfinite(analyse_sigmas(sigmas).condition)
    sigmas[k] = 31 * unit_of_column(k)
    found = analyse_sigmas(sigmas)
    assert found.inverse[k, k] == 0.0
    assert found.condition == np.inf
    assert found.unobservable == {MOUNT}


@pytest.mark.parametrize("k", [2, 5])
def test_prior_information_is_no_rounding(k):
    """A direction known by its prior alone has the prior's sigma of a metre or a radian.

    The information of views may be much larger elsewhere.
    """
    prior = np.where(np.arange(6) == k, 1.0, 1e3)
    views = np.where(np.arange(6) == k, 0.0, 1e20)
    found = analyse_information(np.diag(views + prior**-2.0), prior=prior)
    assert found.inverse[k, k] == pytest.approx(1.0)
    assert np.isfinite(found.condition)


@pytest.mark.parametrize(("share", "count"), [(0.55, 0), (0.45, 1)])
def test_distortion_dominated_direction_is_not_separated(share, count):
    """The limit is half of its square, in units of a focal length and a distortion of ten."""
    units = np.repeat([DISTANCE_M, 1.0, 1000.0, 10.0], [3, 3, 4, 4])
    along = np.sqrt(1 - share) * np.eye(14)[6] + np.sqrt(share) * np.eye(14)[10]
    scaled = 1e6 * (np.eye(14) - np.outer(along, along)) + np.outer(along, along)
    assert len(analyse_information(scaled / np.outer(units, units)).null_space) == count


def test_noise_factor_reduces_observability():
    """The same information with a noise factor of a hundred is ten times less observable."""
    sigmas = np.full(6, 0.05)
    assert analyse_sigmas(sigmas).unobservable == frozenset()
    assert analyse_sigmas(sigmas, factor=100.0).unobservable == {MOUNT}


def test_condition_is_largest_over_smallest_sigma():
    """The sigmas are in lengths of the scene and radians."""
    assert analyse_sigmas([0.02, 0.02, 0.02, 0.01, 0.01, 0.1]).condition == pytest.approx(10.0)
    assert analyse_sigmas(GOOD).length_m == pytest.approx(DISTANCE_M)


@pytest.mark.parametrize(("k", "gated"), [(0, True), (1, True), (2, True), (3, True), (4, False)])
def test_lens_needs_focal_lengths_and_centre(k, gated):
    """Focal lengths and centre are relative to the mean focal length of 1000 px, and distortion is unrestricted."""
    lens = np.array([1.0] * 4 + [0.01] * 4)
    lens[k] = 290.0 if gated else 5.0
    assert analyse_sigmas(GOOD, lens=lens).unobservable == frozenset()
    lens[k] = 310.0 if gated else 200.0
    found = analyse_sigmas(GOOD, lens=lens)
    assert found.unobservable == ({"camera"} if gated else frozenset())
    assert len(found.null_space) == (1 if gated else 0)


def test_no_unknowns_are_fully_observable():
    """An empty information matrix has a condition of one and no null space."""
    problem, state = pose_problem(np.zeros((4, 6)), np.ones(6))
    found = analyse_observability(replace(problem, columns={}), state, np.zeros((0, 0)), 1.0)
    assert found.condition == 1.0
    assert found.unobservable == frozenset()


def test_without_priors_frees_transforms():
    """A problem without its priors has their transforms free, and fixed ones stay fixed."""
    problem, _ = pose_problem(np.zeros((4, 6)), np.ones(6), Unknown("prior", SE3.identity(), np.ones(6)))
    alone = without_priors(problem)
    assert {name: u.status for name, u in alone.unknowns.items()} == {
        name: "free" if name == MOUNT else "fixed" for name in problem.unknowns
    }


def test_units_are_distance_radian_focal_length_and_large_distortion():
    """Sigmas of a thousandth of 2 m, 1 rad, 1000 px and a term of 10 have a condition of one.

    One that is ten times as large gives a condition of ten.
    """
    sigmas = 1e-3 * np.repeat([DISTANCE_M, 1.0, 1000.0, 10.0], [3, 3, 4, 4])
    assert analyse_sigmas(sigmas[:6], lens=sigmas[6:]).condition == pytest.approx(1.0)
    for k in range(14):
        wider = np.where(np.arange(14) == k, 10.0, 1.0) * sigmas
        assert analyse_sigmas(wider[:6], lens=wider[6:]).condition == pytest.approx(10.0)


def test_problem_without_unknowns_is_observable():
    """A problem without unknowns has no unobservable direction and a condition of one."""
    problem, state = pose_problem(np.zeros((2, 6)), np.ones(6))
    found = analyse_observability(replace(problem, columns={}), state, np.zeros((0, 0)), 1.0)
    assert (found.inverse.shape, found.onto_informative.shape, found.condition) == ((0, 0), (0, 0), 1.0)
    assert (found.null_space, found.unobservable) == ((), frozenset())


@pytest.mark.parametrize(("count", "taken"), [(3, 1), (40, 1), (41, 2), (81, 3)])
def test_target_distance_is_the_median_of_some_views(count, taken):
    """At most forty views of each group are used. The distance is at least a millimetre, and a metre without views."""
    problem, state = pose_problem(np.zeros((count, 6)), np.ones(6))
    distances = 1.0 + np.arange(count) ** 2
    at = SE3.from_rotvec(np.zeros((count, 3)), np.outer(distances, [0.0, 0.6, 0.8]))
    away = problem.with_groups([with_eye(problem.groups[0], base_from_flange=at)])
    assert module._length(away, state) == pytest.approx(np.median(distances[::taken]))
    assert module._length(problem, state) == 1e-3
    assert module._length(problem.with_groups([problem.groups[0].take(np.zeros(0, dtype=int))]), state) == 1.0


def test_column_scales_follow_their_unknowns():
    """Transforms have a length and radians, and lenses a focal length for pixels and ten for distortion."""
    problem, state = pose_problem(np.zeros((2, 6)), np.ones(6))
    columns = {"camera": slice(0, 8), MOUNT: slice(8, 14)}
    lens = replace(problem, columns=columns, lenses={"camera": Intrinsics("free", LENS)})
    found = module.column_scales(lens, replace(state, cameras={"camera": LENS}), 2.5)
    np.testing.assert_array_equal(found, [1000.0] * 4 + [10.0] * 4 + [2.5] * 3 + [1.0] * 3)
    assert [module._required_columns(lens, name) for name in (MOUNT, "camera", "eye_joint_offsets")] == [6, 4, 0]


def test_without_priors_keeps_fixed_transforms():
    """Unknowns with a prior become free, and fixed transforms stay fixed."""
    problem, _ = pose_problem(np.zeros((2, 6)), np.ones(6), Unknown("prior", SE3.identity(), np.ones(6)))
    assert {name: of.status for name, of in without_priors(problem).unknowns.items()} == {
        MOUNT: "free",
        TARGET: "fixed",
    }


@pytest.mark.parametrize(
    ("sigma", "factor", "seen"),
    [(0.29, 1.0, True), (0.31, 1.0, False), (2.9, 0.01, True), (29, 1e-9, True), (31, 1e-9, False)],
)
def test_sparse_information_is_observable_below_three_tenths(sigma, factor, seen):
    """The worst direction decides, down to a hundredth of its sigma with less noise.

    The condition is that of sigmas.
    """
    problem, state = pose_problem(np.zeros((4, 6)), np.ones(6))
    turned = SE3.from_rotvec(np.concatenate([np.zeros((1, 3)), np.eye(3)]), np.zeros((4, 3)))
    problem = problem.with_groups([with_eye(problem.groups[0], base_from_flange=turned)])
    state = replace(state, transforms={**state.transforms, MOUNT: SE3.from_rotvec([0, 0, 0], [0, 0, -2.0])})
    sigmas = np.array([2e-2, 2e-2, 2e-2, 1e-2, 1e-2, sigma])
    hessian = np.diag(sigmas**-2.0)
    found = module.condition_number(problem, state, SparseHessian(csc_array(hessian)), factor)
    assert (found is not None) == seen
    if seen:
        assert found == pytest.approx(sigma / 1e-2, rel=1e-2)


@pytest.mark.parametrize("moves", [True, False])
def test_null_directions_of_motions_are_unobservable(moves):
    """A still arm cannot separate its camera mount from its target. Apparent information is noise and is removed."""
    problem, state = pose_problem(np.zeros((4, 6)), np.full(6, 1e-3))
    axes = np.concatenate([np.zeros((1, 3)), np.eye(3)]) * moves
    group = with_eye(problem.groups[0], base_from_flange=SE3.from_rotvec(axes, axes))
    unknowns = {MOUNT: Unknown(), TARGET: Unknown()}
    columns = {MOUNT: slice(0, 6), TARGET: slice(6, 12)}
    problem = replace(problem.with_groups([group]), unknowns=unknowns, columns=columns)
    sure = 1e6 * np.eye(12)
    found = sparse_observability(problem, state, SparseHessian(csc_array(sure)), 1.0)
    assert (found is not None) == moves
    left = module._without_null_directions(problem, state, sure)
    np.testing.assert_allclose(left, left.T)
    if moves:
        np.testing.assert_array_equal(left, sure)
        np.testing.assert_allclose(found.inverse, 1e-6 * np.eye(12))
        np.testing.assert_array_equal(found.onto_informative, np.eye(12))
        return
    hessian = linearise(problem, state).hessian
    loose = null_directions(problem, state)
    assert loose.shape == (12, 6)
    taken = module._without_null_directions(problem, state, hessian)
    np.testing.assert_allclose(taken @ loose, 0.0, atol=1e-6 * np.abs(hessian).max())
    np.testing.assert_allclose(taken, taken.T)
