"""Tests of score tests, compared with solving for the tested effect."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, f
from tests.pose_problem import pose_problem

from basecal.accuracy.systematic_errors.score_tests import (
    Linearised,
    Score,
    Sums,
    linearise_views,
    log_chance_of_gain,
    score,
    score_from_sums,
    view_sums,
    weigh_views,
)
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Unknown
from basecal.effects.faces.candidates import Candidates
from basecal.estimation.least_squares.normal_equations import prior_residuals
from basecal.estimation.problem.build import build_problem
from basecal.estimation.solve import solve_from, solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

MOUNT = "eye_flange_from_wrist"
NOISE = (1e-4, 1e-4)


def solve_cells(scenario, seed=0, off=None):
    """A cell whose camera mount is fixed, off by a tangent."""
    made = simulate(scenario, seed)
    camera = made.cell.cameras["wrist"]
    mount = Unknown("fixed", made.truth[MOUNT] @ SE3.exp(np.zeros(6) if off is None else off))
    cell = replace(made.cell, cameras={"wrist": replace(camera, mount=mount)})
    free = replace(made.cell, cameras={"wrist": replace(camera, mount=Unknown("free"))})
    problem = build_problem(cell, made.recording)[0]
    solution = solve_problem(problem, cell)
    freed = solve_from(build_problem(free, made.recording)[0], solution.state)
    return Situation(solution.problem, solution.state, problem, {}), solution, freed


def mount_freed(of):
    return Candidates(
        "", (MOUNT,), (None,), "", tuple(of.frame_jacobian(k, MOUNT)[:, None] for k in range(len(of.links)))
    )


def test_bounded_score_limits_poorly_seen_sizes():
    """The bound limits a poorly seen size to a tenth of the largest; the other is well seen and shown by the data."""
    model = SimpleNamespace(step=np.zeros(1), inverse=np.eye(1))
    sums = Sums(np.array([[-2e6, -3.0]]), np.zeros((1, 2, 1)), np.diag([1e6, 1.0])[None])
    plain, bounded = score_from_sums(model, sums), score_from_sums(model, sums, 0.1)
    np.testing.assert_allclose(plain.size, [[2.0, 3.0]])
    np.testing.assert_allclose(bounded.size, [[2e6 / (1e6 + 100), 3 / 101]])
    assert plain.statistic[0] == pytest.approx(4e6 + 9)
    assert bounded.statistic[0] == pytest.approx(4e12 / (1e6 + 100) + 9 / 101)
    assert bounded.freedoms[0] == plain.freedoms[0] == 2


@pytest.mark.parametrize("arms", ["both", "stations"])
def test_statistic_equals_cost_decrease_of_solve(arms):
    """Statistic and size equal the cost decrease and movement of a freed mount, with private and shared stops."""
    off = np.array([1e-4, -2e-4, 1e-4, 2e-4, 1e-4, -1e-4])
    of, solution, freed = solve_cells(Scenario(samples=16, arms=arms, robot_noise=NOISE), off=off)
    found = score(linearise_views(of.problem, of.state), mount_freed(of))
    assert found.freedoms.tolist() == [6]
    assert found.statistic[0] == pytest.approx(solution.cost - freed.cost, rel=0.02)
    moved = (of.state.transforms[MOUNT].inverse() @ freed.state.transforms[MOUNT]).log()
    np.testing.assert_allclose(found.size[0], moved, atol=0.05 * float(np.abs(moved).max()))
    sigma = np.sqrt(np.diag(np.linalg.inv(found.information[0])))
    np.testing.assert_allclose(sigma, np.sqrt(np.diag(freed.joint_transform_covariance([MOUNT]))), rtol=0.02)


def test_effect_absorbed_by_unknown_has_no_freedoms():
    """An effect that moves views as a free mount does has no freedoms and zero size."""
    of, _, freed = solve_cells(Scenario(samples=12))
    of = Situation(freed.problem, freed.state, freed.problem, {})
    found = score(linearise_views(of.problem, of.state), mount_freed(of))
    assert found.freedoms.tolist() == [0]
    assert found.statistic.tolist() == [0.0]
    assert found.log_chance.tolist() == [0.0]


def test_batch_scores_equal_separate_scores():
    """Scores of several effects in one batch equal those of each alone."""
    of, _, _ = solve_cells(Scenario(samples=12, arms="stations", robot_noise=NOISE))
    one = mount_freed(of)
    moves = tuple(np.concatenate([m, 2 * m[::-1]], 1) for m in one.moves)
    two = Candidates("", (MOUNT, MOUNT), (None, None), "", moves)
    about = linearise_views(of.problem, of.state)
    both, first, second = score(about, two), score(about, two.single(0)), score(about, two.single(1))
    np.testing.assert_allclose(both.statistic, [first.statistic[0], second.statistic[0]], rtol=1e-9)
    np.testing.assert_allclose(both.size[1], second.size[0], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("arms", ["both", "stations"])
def test_views_of_zero_weight_do_not_count(arms):
    """Views of weight zero count as absent, and views of weight one as unweighted."""
    of, _, _ = solve_cells(Scenario(samples=12, arms=arms, robot_noise=NOISE, target_mount="prior"))
    about, keep = linearise_views(of.problem, of.state), np.arange(12) % 3 > 0
    fewer = replace(of, problem=of.problem.with_groups(g.take(np.flatnonzero(keep)) for g in of.problem.groups))
    for weights, same in ((np.ones(12), of), (1.0 * keep, fewer)):
        some, alone = weigh_views(about, [weights]), linearise_views(same.problem, same.state)
        np.testing.assert_allclose(some.hessian, alone.hessian, rtol=1e-8, atol=1e-8 * np.abs(alone.hessian).max())
        np.testing.assert_allclose(some.gradient, alone.gradient, atol=1e-8 * np.abs(alone.gradient).max())
        np.testing.assert_allclose(
            score(some, mount_freed(of)).statistic, score(alone, mount_freed(same)).statistic, rtol=1e-6
        )


def test_log_chance_has_no_lower_limit():
    """Log chances decrease steadily even if the chances themselves underflow."""
    of, _, _ = solve_cells(Scenario(samples=12))
    found = score(linearise_views(of.problem, of.state), mount_freed(of))
    far = (10.0, 1000.0, 1300.0, 1500.0, 5000.0)
    logs = [float(replace(found, statistic=np.array([s])).log_chance[0]) for s in far]
    assert logs[0] == pytest.approx(-2.08, abs=0.01)
    assert np.all(np.diff(logs) < -90)


@pytest.mark.parametrize("hidden", [False, True])
def test_score_eliminates_unknowns(hidden):
    """Scores of random sums equal the Schur complement and the best sizes of the joint minimum.

    An effect fully absorbed by the unknowns has zero size and no freedom.
    """
    rng = np.random.default_rng(5)
    root = rng.standard_normal((9, 12))
    if hidden:
        root[8] = root[0] - 2 * root[3]  # the last error is a combination of two unknowns
    joint, pull = root @ root.T, root @ rng.standard_normal(12)
    about = Linearised(None, None, (), pull[:6], joint[:6, :6], None)
    twice = np.array([1.0, 3.0])[:, None]  # the same errors in other units
    among = np.broadcast_to(joint[6:, 6:], (2, 3, 3))
    known = Sums(twice * pull[6:], twice[..., None] * joint[6:, :6], (twice**2)[..., None] * among)
    found = score_from_sums(about, known)
    rest = slice(0, 8) if hidden else slice(0, 9)
    best = -np.linalg.solve(joint[rest, rest], pull[rest])[6:]
    gains = [pull[part] @ np.linalg.solve(joint[part, part], pull[part]) for part in (rest, slice(0, 6))]
    gain = gains[0] - gains[1]
    left = joint[6:, 6:] - joint[6:, :6] @ np.linalg.solve(joint[:6, :6], joint[:6, 6:])
    np.testing.assert_allclose(found.statistic, [gain, gain], rtol=1e-8)
    assert found.freedoms.tolist() == [len(best)] * 2
    np.testing.assert_allclose(found.information, [left, 9 * left], rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(found.size[:, : len(best)], [best, best / 3], rtol=1e-8)
    np.testing.assert_allclose(found.size[:, len(best) :], 0.0, atol=1e-8)
    np.testing.assert_allclose(found.gradient[1], 3 * found.gradient[0], atol=1e-12)


def test_sums_add_views_of_all_groups():
    """Sums of each effect add the views of all groups; groups that it does not move are omitted."""
    rng = np.random.default_rng(1)
    one, state = pose_problem(1e-3 * rng.standard_normal((4, 6)), np.array([1e-3, 2e-3, 1e-3, 3e-3, 1e-3, 1e-3]))
    (group,) = one.groups
    problem = one.with_groups([group, group.take(np.array([0, 2])), group.take(np.array([1]))])
    about = linearise_views(problem, state)
    moves = rng.standard_normal((4, 3, 6, 2)), None, rng.standard_normal((1, 3, 6, 2))
    found = view_sums(about, Candidates("", ("a", "b", "c"), (None,) * 3, "", moves))
    for b in range(3):
        wanted = [np.zeros(2), np.zeros((2, 6)), np.zeros((2, 2))]
        for views, each in zip(about.views, moves, strict=True):
            for k in range(0 if each is None else len(each)):
                wanted[0] += each[k, b].T @ views.gradient[k]
                wanted[1] += each[k, b].T @ views.information[k] @ views.by_unknowns[k]
                wanted[2] += each[k, b].T @ views.information[k] @ each[k, b]
        for got, want in zip(found, wanted, strict=True):
            np.testing.assert_allclose(got[b], want, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("arms", ["halves", "eye_still"])
def test_groups_that_are_not_moved_equal_zero_moves(arms):
    """Stops that only other groups have add nothing to the sums, with stops of one robot shared, or of both."""
    made = simulate(Scenario(layout="two_cameras", samples=12, arms=arms, robot_noise=NOISE), 1)
    solution = solve_problem(build_problem(made.cell, made.recording)[0], made.cell)
    about = linearise_views(solution.problem, solution.state)
    assert about.system is not None
    first, second = (np.random.default_rng(3).standard_normal((len(g), 1, 6, 2)) for g in solution.problem.groups)
    some, all_of_them = (
        view_sums(about, Candidates("", ("a",), (None,), "", (first, other))) for other in (None, 0 * second)
    )
    for got, want in zip(some, all_of_them, strict=True):
        np.testing.assert_allclose(got, want, rtol=1e-9, atol=1e-9)


def test_sums_of_unknowns_include_weights_and_priors():
    """Sums of the unknowns weigh each view, and include priors in full."""
    rng = np.random.default_rng(1)
    prior = Unknown("prior", SE3.exp(np.full(6, 2e-3)), np.full(6, 1e-2))
    problem, state = pose_problem(1e-3 * rng.standard_normal((4, 6)), np.full(6, 1e-3), prior)
    about, weights = linearise_views(problem, state), np.array([1.0, 0.25, 0.0, 2.0])
    (views,) = about.views
    found = weigh_views(about, [weights])
    ((residual, jacobian, where),) = prior_residuals(problem, state)
    assert where == slice(0, 6)
    by = views.by_unknowns
    hessian = jacobian.T @ jacobian + np.einsum("n,nki,nkl,nlj->ij", weights, by, views.information, by)
    gradient = jacobian.T @ residual + np.einsum("n,nki,nk->i", weights, by, views.gradient)
    np.testing.assert_allclose(found.hessian, hessian, rtol=1e-9)
    np.testing.assert_allclose(found.gradient, gradient, rtol=1e-9)
    np.testing.assert_allclose(found.inverse, np.linalg.inv(hessian), rtol=1e-6, atol=1e-15)
    np.testing.assert_allclose(found.step, np.linalg.solve(hessian, gradient), rtol=1e-6)


def test_each_score_has_own_chance():
    """Each score has the chance of its own freedoms."""
    score = Score(np.zeros((2, 1)), np.zeros((2, 1, 1)), np.array([3.0, 20.0]), np.array([1, 4]), np.zeros((2, 1)))
    np.testing.assert_allclose(score.log_chance, [chi2.logsf(3.0, 1), chi2.logsf(20.0, 4)])


@pytest.mark.parametrize(("share", "freedoms"), [(0.9e-4, 0), (1.1e-4, 1)])
def test_effect_with_ten_thousandth_left_is_testable(share, freedoms):
    """An effect of which one ten-thousandth is left is testable. Below that it equals the unknowns, in any units."""
    for unit in (1.0, 1e-3):
        across = unit * np.sqrt(1 - share)
        known = Sums(np.full((1, 1), unit), np.array([[[across]]]), np.array([[[unit**2]]]))
        found = score_from_sums(Linearised(None, None, (), np.zeros(1), np.eye(1), None), known)
        assert found.freedoms.tolist() == [freedoms]
        assert found.statistic[0] == pytest.approx(freedoms / share)


@pytest.mark.parametrize(("sizes", "residuals"), [(1, 6.0), (2, 20.0), (6, 300.5)])
def test_chance_of_gain_follows_variance_ratio(sizes, residuals):
    """The chance of a gain is that of the variance ratio.

    Of normal residuals, twice the log likelihood gains n log(1 + q F / (n - q)), with Fisher's ratio F of q sizes.
    """
    left = residuals - sizes
    for ratio in (0.1, 1.0, 30.0):
        gain = residuals * np.log1p(sizes * ratio / left)
        found = log_chance_of_gain(gain, sizes, residuals)
        assert found == pytest.approx(f.logsf(ratio, sizes, left), rel=1e-9)


def test_chance_of_gain_has_bounds():
    """A loss is certain, and so is any gain without residual freedoms; a large gain keeps a finite log chance."""
    assert log_chance_of_gain(-3.0, 1, 20.0) == 0.0
    assert log_chance_of_gain(50.0, 3, 3.0) == log_chance_of_gain(50.0, 0, 20.0) == 0.0
    near, far = log_chance_of_gain(1300.0, 2, 50.0), log_chance_of_gain(1500.0, 2, 50.0)
    assert far - near == pytest.approx(-200 * 48 / 100, rel=1e-3)


@pytest.mark.parametrize(("sigma", "held"), [(1e-9, 6), (1e6, 0)])
def test_unknown_held_by_prior_uses_no_residual_freedom(sigma, held):
    """The residual freedoms are the equations of four poses, less the unknowns that views determine."""
    prior = Unknown("prior", SE3.exp(np.full(6, 2e-3)), np.full(6, sigma))
    problem, state = pose_problem(1e-3 * np.random.default_rng(1).standard_normal((4, 6)), np.full(6, 1e-3), prior)
    assert linearise_views(problem, state).residual_freedoms == pytest.approx(24 - problem.width + held, abs=1e-3)


def test_candidates_move_poses_not_lenses():
    """Candidates move only the pose if the lens is estimated; groups that do not move are omitted."""
    rng = np.random.default_rng(4)
    root = rng.standard_normal((5, 8, 8))
    view = SimpleNamespace(
        information=root @ root.mT,
        gradient=rng.standard_normal((5, 8)),
        by_unknowns=rng.standard_normal((5, 8, 3)),
        columns=np.array([0, 2, 3]),
        shared=(),
    )
    moves = rng.standard_normal((5, 2, 6, 4))
    about = Linearised(None, None, (view, None), np.zeros(4), np.eye(4), None)
    found = view_sums(about, Candidates("", ("a", "b"), (None, None), "", (moves, None)))
    np.testing.assert_allclose(found.gradient, np.einsum("ni,nbiq->bq", view.gradient[:, :6], moves))
    own = view.information[:, :6, :6]
    np.testing.assert_allclose(found.information, np.einsum("nbiq,nij,nbjr->bqr", moves, own, moves))
    pull = (view.information @ view.by_unknowns)[:, :6]
    np.testing.assert_allclose(found.across[..., view.columns], np.einsum("nbiq,nic->bqc", moves, pull))
    np.testing.assert_array_equal(found.across[..., 1], 0)
