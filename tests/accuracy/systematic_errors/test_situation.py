"""Tests of `Situation`: derivatives, paths, times and null models of a solved problem."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, problem_of, views, with_eye, with_hand
from tests.pose_problem import pose_problem

from basecal.accuracy.systematic_errors import situation as module
from basecal.accuracy.systematic_errors.score_tests import linearise_views, score, weigh_views, with_random_effects
from basecal.accuracy.systematic_errors.situation import Situation, _independent_moves
from basecal.cell import Recording
from basecal.effects.faces.candidates import Candidates
from basecal.estimation.least_squares.jacobians import unknown_jacobian
from basecal.estimation.outliers.noise_and_outliers import with_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Chain, Link
from basecal.estimation.settings import Settings
from basecal.estimation.solve import integrate_solution, solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def situation(scenario, seed=0, stamps=None):
    made = simulate(scenario, seed)
    problem, _ = build_problem(made.cell, made.recording)
    solution = solve_problem(problem, made.cell)
    times = {s.sample: float(s.sample) for s in made.recording.samples} if stamps is None else stamps
    return Situation(problem, solution.state, problem, times)


def test_frames_move_views_as_unknowns():
    """Bases and mounts move `camera_from_target` by the same adjoints as the columns of the normal equations."""
    of = situation(Scenario(samples=8))
    (group,) = of.problem.groups
    derivative, columns = unknown_jacobian(of.problem, group, of.links[0], of.state, 6)
    assert len(of.frames) == 3
    for name in of.frames:
        where = np.flatnonzero(np.isin(columns, np.arange(of.problem.width)[of.problem.columns[name]]))
        np.testing.assert_allclose(of.frame_jacobian(0, name), derivative[..., where], atol=1e-12)


@pytest.mark.parametrize("robot", ["eye", "hand"])
def test_flanges_move_views_as_recorded_poses(robot):
    """A small tangent of a recorded pose moves the view as `flange_jacobian` predicts."""
    of = situation(Scenario(samples=8))
    (group,) = of.problem.groups
    tangent = np.array([1e-6, -2e-6, 3e-6, 2e-6, 1e-6, -1e-6])
    poses = group.robot_end(robot).base_from_flange @ SE3.exp(tangent)
    moved = (with_eye if robot == "eye" else with_hand)(group, base_from_flange=poses)
    before, after = (of.state.camera_from_target(g, of.problem.stops) for g in (group, moved))
    np.testing.assert_allclose((before.inverse() @ after).log(), of.flange_jacobian(0, robot) @ tangent, atol=1e-10)


def test_still_robot_has_no_effects():
    """A robot at rest has no observable effects of its own and is excluded."""
    assert situation(Scenario(samples=8, arms="eye_still", camera_mount="fixed")).robots == ("hand",)


def test_times_are_stamps_or_sample_order():
    """Times are seconds if every sample has a stamp, else the order of the samples."""
    of = situation(Scenario(samples=6), stamps={k: 10.0 + 0.5 * k for k in range(6)})
    assert of.has_times
    np.testing.assert_allclose(of.times, 10.0 + 0.5 * np.arange(6))
    of = situation(Scenario(samples=6), stamps={0: 1.0})
    assert not of.has_times
    np.testing.assert_allclose(of.times, np.arange(6))


def test_unordered_poses_have_no_velocity():
    """Poses that are not on a path have no velocity."""
    assert situation(Scenario(samples=20)).velocity("hand") is None


def make_views(samples, arm=None, stands=None, eye=None):
    """Views of these samples, with a target on an arm with these flange poses."""
    world = end(None, SE3.identity((len(samples),)))
    hand = world if arm is None else end("arm", arm, stop_number=samples if stands is None else stands)
    return replace(views(eye or world, hand), sample=np.array(samples))


def make_situation(*groups, stamps=()):
    problem = problem_of(*groups)
    return Situation(problem, None, problem, dict(stamps))


def test_samples_are_sorted_by_time():
    """Samples are sorted by time and unique over groups; if one has no stamp, by their numbers."""
    groups = make_views([7, 3, 5]), make_views([5, 9, 3])
    of = make_situation(*groups, stamps={7: 0.0, 3: 2.0, 5: 1.0, 9: 3.0})
    assert of.samples.tolist() == [7, 5, 3, 9]
    assert of.times.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert [of.sample_indices(group).tolist() for group in groups] == [[0, 2, 1], [1, 3, 2]]
    partly = make_situation(*groups, stamps={7: 0.5, 9: -1.0})
    assert partly.samples.tolist() == [3, 5, 7, 9]
    assert not partly.has_times
    assert not make_situation(*groups, stamps=dict.fromkeys((3, 5, 7, 9), 4.0)).has_times
    assert make_situation(*groups, stamps={3: 4.0, 5: 4.0, 7: 4.0, 9: 4.1}).has_times


def test_moving_robots_have_two_stops():
    """Robots with two stops in one group or several are included; an arm that never moved, and the world, are not."""
    pose = SE3.identity((2,))
    eye = end("still", stop_number=[4, 4])
    assert make_situation(make_views([0, 1], pose, [2, 2], eye)).robots == ()
    assert make_situation(make_views([0, 1], pose, [2, 3], eye)).robots == ("arm",)
    assert make_situation(make_views([0, 1], pose, [2, 2]), make_views([2, 3], pose, [5, 5])).robots == ("arm",)


TWIST = np.array([0.1, -0.05, 0.02, 0.2, 0.1, -0.3])  # per second


def on_the_way(seconds):
    return SE3.from_rotvec([0.3, -0.2, 0.5], [0.4, 0.1, 0.3]) @ SE3.exp(np.asarray(seconds, float)[:, None] * TWIST)


def test_velocity_on_path_is_its_twist():
    """The velocity is the path's twist at its ends and between, at uneven times, in any order of two groups.

    Samples without a view have zero.
    """
    seconds = np.array([0, 0.8, 2, 3, 4.2, 5, 6, 7.1, 8, 9])
    shuffled = np.array([3, 0, 8, 5, 2])
    rest = np.setdiff1d(np.arange(10), shuffled)
    groups = (
        make_views(shuffled, on_the_way(seconds[shuffled])),
        make_views(rest, on_the_way(seconds[rest])),
        make_views([10, 11]),
    )
    stamps = {**dict(enumerate(seconds)), 10: 2.5, 11: 20.0}
    of = make_situation(*groups, stamps=stamps)
    found = of.velocity("arm")
    here = of.samples < 10
    np.testing.assert_allclose(found[here], np.tile(TWIST, (10, 1)), atol=1e-12)
    np.testing.assert_array_equal(found[~here], 0)
    by_order = make_situation(make_views(np.arange(10), on_the_way(2.0 * np.arange(10)))).velocity("arm")
    np.testing.assert_allclose(by_order, np.tile(2 * TWIST, (10, 1)), atol=1e-12)
    assert of.velocity("other") is None


def test_equal_stamps_give_zero_velocity():
    """The velocity is zero if the neighbours of a view have the same stamp."""
    stamps = {k: float(max(k - 2, 0)) for k in range(10)}
    found = make_situation(make_views(np.arange(10), on_the_way(np.arange(10))), stamps=stamps).velocity("arm")
    np.testing.assert_array_equal(found[1], 0)
    np.testing.assert_allclose(found[4], TWIST, atol=1e-12)


@pytest.mark.parametrize(("count", "on_path"), [(7, False), (8, True)])
def test_path_needs_eight_poses(count, on_path):
    """A path needs eight poses."""
    assert (
        make_situation(make_views(np.arange(count), on_the_way(np.arange(count)))).velocity("arm") is not None
    ) == on_path


def to_and_fro(aside, turn, count=9):
    """Along x by a metre each, with alternating side steps and rotations about x."""
    way = np.where(np.arange(count) % 2, 1.0, -1.0)[:, None]
    places = np.arange(count)[:, None] * [1.0, 0, 0] + aside * way * [0, 1.0, 0]
    return SE3.from_rotvec(turn * way * [1.0, 0, 0], places)


@pytest.mark.parametrize(("aside", "turn", "on_path"), [
    (0.24, 0.0, True), (0.26, 0.0, False), (0.0, 0.49, True), (0.0, 0.51, False),
])  # fmt: skip
def test_path_is_smooth(aside, turn, on_path):
    """Poses of a path are off the middle of their neighbours by less than a quarter of their distance.

    Angles count by 0.5 m. Poses between are off by twice as much as to one side, and their neighbours are two metres
    apart.
    """
    of = make_situation(make_views(np.arange(9), to_and_fro(aside, turn)))
    assert (of.velocity("arm") is not None) == on_path


@pytest.mark.parametrize("where", [1, 6])
def test_each_inner_pose_tests_path_smoothness(where):
    """Each pose except the ends tests the smoothness.

    Of eight in a line, the first or last inner one may be off by 1.0 of their distance, not by 1.2.
    """
    for aside, on_path in ((1.0, True), (1.2, False)):
        places = np.arange(8)[:, None] * np.array([1.0, 0, 0])
        places[where, 1] = aside
        of = make_situation(make_views(np.arange(8), SE3(np.tile(np.eye(3), (8, 1, 1)), places)))
        assert (of.velocity("arm") is not None) == on_path


def test_frame_jacobians_follow_chain():
    """Views move with negative sign for frames on the camera's side and positive sign on the target's.

    The last frame has the identity, a frame outside the chain zero, and a missing robot the identity pose.
    """
    rng = np.random.default_rng(4)
    camera, eye, hand = (SE3.exp(rng.standard_normal((2, 6))) for _ in range(3))
    at = SE3.identity((2,))
    of = make_situation(views(end(None, at, mount="a", base="b"), end(None, at, mount="d", base="c")))
    vars(of)["links"] = (Chain((Link(-1.0, eye, at, camera), Link(1.0, hand, at, None)), camera),)
    assert of.frames == ("a", "b", "d", "c")
    np.testing.assert_array_equal(of.frame_jacobian(0, "a"), -camera.adjoint())
    np.testing.assert_array_equal(of.frame_jacobian(0, "b"), -eye.adjoint())
    np.testing.assert_array_equal(of.frame_jacobian(0, "c"), hand.adjoint())
    np.testing.assert_array_equal(of.frame_jacobian(0, "d"), np.tile(np.eye(6), (2, 1, 1)))
    np.testing.assert_array_equal(of.frame_jacobian(0, "e"), np.zeros((2, 6, 6)))
    np.testing.assert_array_equal(of.recorded_pose(0, "arm").matrix, np.tile(np.eye(4), (2, 1, 1)))


def test_time_errors_contain_changes_in_time_only():
    """Random errors in time are omitted only for tests of a moved frame.

    Joint effects are never random and unknown at once.
    """
    problem, sigmas = problem_of(make_views([0, 1])), {"arm": np.ones(2)}
    of_kinds = {
        kinds: Situation(problem, None, problem, {}, SimpleNamespace(common=dict.fromkeys(kinds, sigmas)))
        for kinds in (("smooth_in_time", "joint_offsets"), ("smooth_in_time",), ("smooth",))
    }
    both, in_time, by_pose = of_kinds.values()
    assert [of.is_held_in_time("step") for of in (both, in_time, by_pose)] == [True, True, False]
    assert not in_time.is_held_in_time("stretch")
    assert both.random_effect("stretch", "arm") == "smooth_in_time"
    assert both.random_effect("joint_offsets", "arm") == ""
    assert both.random_effect("joint_offsets", "other") == "smooth_in_time"


SETTINGS = Settings(robot_noise="estimated")


def candidate(moves):
    return Candidates("", ("camera",), (None,), "", (moves[:, None],))


def test_score_equals_generalised_least_squares():
    """The score equals generalised least squares with the dense covariance of noise and random effects of all views."""
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
    # The residual of a view follows from its gradient and information.
    residual = np.linalg.solve(views.information, views.gradient[..., None]).reshape(48)
    unknowns, error = views.by_unknowns.reshape(48, -1), by_error.reshape(48, 2)
    free = weight - weight @ unknowns @ np.linalg.inv(unknowns.T @ weight @ unknowns) @ unknowns.T @ weight
    np.testing.assert_allclose(found.information[0], error.T @ free @ error, rtol=1e-6)
    np.testing.assert_allclose(found.gradient[0], error.T @ free @ residual, rtol=1e-6)
    again = weigh_views(model, [np.ones(8)])
    np.testing.assert_allclose(again.hessian, model.hessian, rtol=1e-9, atol=1e-9 * np.abs(model.hessian).max())


def test_invisible_random_effects_are_omitted():
    """Random effects that are multiples of each other are merged and tiny ones omitted; one of three remains."""
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
def test_effect_is_not_unknown_and_random(effect, about, name):
    """Offsets of the hand's joints are tested without them as random effects, other effects beside these."""
    noise = SimpleNamespace(common={"joint_offsets": {"hand": np.ones(2)}})
    of = Situation(None, None, None, {}, noise)
    assert of.random_effect(effect, about) == name
    assert Situation(None, None, None, {}, None).random_effect(effect, about) == ""


@pytest.fixture(scope="module")
def bent_hand():
    """A hand whose recorded poses lack errors smooth in its pose, 0.5 mm and 0.5 mrad, with unstated noise."""
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


def test_stop_errors_keep_length_in_null_model(bent_hand, monkeypatch):
    """Stop errors keep their length in metres and radians in the null model, for any sigmas that scale them."""
    problem, solution = bent_hand
    linearised = []
    linearise = module.linearise_views
    monkeypatch.setattr(module, "linearise_views", lambda *of: linearised.append(of) or linearise(*of))
    held = solution.noise.hold_sigmas(solution.problem)
    assert Situation(held, solution.state, problem, {}, solution.noise).null is not None
    beside, state = linearised[-1]
    assert not np.allclose(beside.stops.sigma, held.stops.sigma, rtol=0.1)
    np.testing.assert_allclose(state.stop_errors * beside.stops.sigma, solution.state.stop_errors * held.stops.sigma)


def test_single_stops_do_not_absorb_shared_errors(bent_hand):
    """In the null model the errors of single stops are smaller, and a drift is better determined."""
    problem, solution = bent_hand
    assert list(solution.noise.common) == ["smooth_by_place"]
    assert np.all(solution.noise.beside_common.robots["hand"] < solution.noise.robots["hand"])
    of = Situation(solution.noise.hold_sigmas(solution.problem), solution.state, problem, {}, solution.noise)
    drift = candidate(of.flange_jacobian(0, "hand")[..., :1] * np.arange(40)[:, None, None] / 40)
    assert score(of.null, drift).information[0, 0, 0] > 2 * score(of.linearisation, drift).information[0, 0, 0]
    views = of.null.views[0]
    shared = candidate(views.by_unknowns[..., :6, views.columns >= problem.width][..., -1:])
    # Beside a random effect, one sigma of it has less than one unit of information.
    assert score(of.null, shared).information[0, 0, 0] < 1


@pytest.mark.parametrize("noise", [None, SimpleNamespace(beside_common=None), SimpleNamespace(beside_common="noise")])
@pytest.mark.parametrize("has_offsets", [False, True])
def test_null_model_includes_shared_errors_and_clocks(monkeypatch, noise, has_offsets):
    """The null model includes shared stop errors and clock offsets if present.

    A clock offset moves views by its sigma.
    """
    monkeypatch.setattr(module, "linearise_views", lambda problem, state: "plain")
    monkeypatch.setattr(module, "null_model", lambda problem, state, noise, jacobian: "shared")
    monkeypatch.setattr(module, "with_random_effects", lambda *given: given)
    offsets = SimpleNamespace(sigma_s=np.array([0.1, 0.5]), moves=(np.ones((3, 6, 2)), None), values="present")
    of = Situation("problem", "state", "recorded", {}, noise, offsets if has_offsets else None)
    model = "plain" if noise is None or noise.beside_common is None else "shared"
    if not has_offsets:
        assert of.null == model
        return
    found, (moved, still), present = of.null
    assert (found, still, present) == (model, None, "present")
    np.testing.assert_array_equal(moved, np.broadcast_to([0.1, 0.5], (3, 6, 2)))
