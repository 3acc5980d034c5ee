"""The null model of score tests, with the random effects that stops share."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import pose_problem

from basecal.accuracy.systematic_errors.null_model import _independent_moves
from basecal.accuracy.systematic_errors.score_tests import linearise_views, score, weigh_views, with_random_effects
from basecal.accuracy.systematic_errors.situation import Situation
from basecal.cell import Recording
from basecal.effects.faces.candidates import Candidates
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import integrate_solution, solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

SETTINGS = Settings(robot_noise="estimated")


def candidate(moves):
    return Candidates("", ("camera",), (None,), "", (moves[:, None],))


def test_a_score_is_that_of_the_covariance_with_random_effects_in_it():
    """As by generalised least squares with the dense covariance of all views, noise and random effects together."""
    rng = np.random.default_rng(2)
    problem, state = pose_problem(1e-3 * rng.standard_normal((8, 6)), np.full(6, 1e-3))
    by_effects, by_error = 1e-3 * rng.standard_normal((8, 6, 3)), rng.standard_normal((8, 6, 2))
    model = with_random_effects(linearise_views(problem, state), (by_effects,))
    found = score(model, candidate(by_error))
    (views,) = linearise_views(problem, state).views
    noise = np.zeros((48, 48))
    for k in range(8):
        noise[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = np.linalg.inv(views.information[k])
    flat = by_effects.reshape(48, 3)
    weight = np.linalg.inv(noise + flat @ flat.T)
    # A view's residual is what its gradient says of it at its own information.
    residual = np.linalg.solve(views.information, views.gradient[..., None]).reshape(48)
    unknowns, error = views.by_unknowns.reshape(48, -1), by_error.reshape(48, 2)
    free = weight - weight @ unknowns @ np.linalg.inv(unknowns.T @ weight @ unknowns) @ unknowns.T @ weight
    np.testing.assert_allclose(found.information[0], error.T @ free @ error, rtol=1e-6)
    np.testing.assert_allclose(found.gradient[0], error.T @ free @ residual, rtol=1e-6)
    again = weigh_views(model, [np.ones(8)])
    np.testing.assert_allclose(again.hessian, model.hessian, rtol=1e-9, atol=1e-9 * np.abs(model.hessian).max())


def test_random_effects_that_views_do_not_show_are_left_out():
    """Of three, one a multiple of another and one next to nothing, one is left, which moves views as both did."""
    rng = np.random.default_rng(3)
    problem, state = pose_problem(1e-3 * rng.standard_normal((8, 6)), np.full(6, 1e-3))
    model, one = linearise_views(problem, state), 1e-3 * rng.standard_normal((8, 6, 1))
    (left,) = _independent_moves(model, (np.concatenate([one, 2 * one, 1e-6 * one[::-1]], axis=-1),))
    assert left is not None
    assert left.shape == (8, 6, 1)
    np.testing.assert_allclose(left @ left.mT, 5 * one @ one.mT, rtol=1e-4, atol=1e-12)
    assert _independent_moves(model, (None,)) == (None,)


@pytest.mark.parametrize(
    ("effect", "about", "name"),
    [
        ("joint_offsets", "hand", ""),
        ("joint_offsets", "eye", "joint_offsets"),
        ("length_scale", "hand", "joint_offsets"),
        ("step", "eye_base", "joint_offsets"),
    ],
)
def test_an_effect_is_never_unknown_and_random_at_once(effect, about, name):
    """The offsets of the hand's joints are tested against the model without them as random effects, all else beside."""
    noise = SimpleNamespace(common={"joint_offsets": {"hand": np.ones(2)}})
    of = Situation(None, None, None, {}, noise)
    assert of.random_effect(effect, about) == name
    assert Situation(None, None, None, {}, None).random_effect(effect, about) == ""


@pytest.fixture(scope="module")
def bent():
    """A hand whose recorded poses lack errors that are smooth in its pose, 0.5 mm and 0.5 mrad; nothing is stated."""
    made = simulate(Scenario(samples=40, robot_noise=(5e-5, 1e-4), state_robot_noise=False, position_m=0.3), 4)
    weights = np.random.default_rng(4).standard_normal((6, 3)) * np.repeat([2e-3, 2e-3], 3)[:, None]
    samples = []
    for k, sample in enumerate(made.recording.samples):
        hand = sample.robots["hand"]
        pose = hand.base_from_flange
        off = replace(hand, base_from_flange=pose @ SE3.exp(weights @ np.sin(4 * pose.translation)))
        samples.append(replace(sample, stamp_s=float(k), robots={**sample.robots, "hand": off}))
    problem, _ = build_problem(made.cell, Recording(tuple(samples)))
    plain = solve_problem(problem, made.cell, Settings(robot_noise="stated"))
    return problem, integrate_solution(with_noise(plain, SETTINGS))


def test_single_stops_do_not_absorb_what_stops_share(bent):
    """Their errors are smaller in the null model, and a drift is told better."""
    problem, solution = bent
    assert list(solution.noise.common) == ["smooth_by_place"]
    assert np.all(solution.noise.beside_common.robots["hand"] < solution.noise.robots["hand"])
    of = Situation(solution.noise.hold_sigmas(solution.problem), solution.state, problem, {}, solution.noise)
    drift = candidate(of.flange_jacobian(0, "hand")[..., :1] * np.arange(40)[:, None, None] / 40)
    assert score(of.null, drift).information[0, 0, 0] > 2 * score(of.linearisation, drift).information[0, 0, 0]
    views = of.null.views[0]
    shared = candidate(views.by_unknowns[..., :6, views.columns >= problem.width][..., -1:])
    # One sigma of a random effect holds less than one unit of information beside itself.
    assert score(of.null, shared).information[0, 0, 0] < 1
