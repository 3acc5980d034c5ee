"""Tests of the first state: without a guess, the solver ends at the optimum that it reaches from the truth."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end
from tests.ends import views as group_of
from tests.pose_problem import MOUNT, pose_problem
from tests.shared.kinds import KINDS
from tests.shared.start_trial import trial

from basecal.cell import Intrinsics, Robot, Unknown
from basecal.errors import InputError
from basecal.estimation.least_squares.bundle_adjustment import batch_states, bundle_adjust
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.least_squares.studentized_residuals import MahalanobisSquared
from basecal.estimation.problem.build import build_problem
from basecal.estimation.start import first_state as module
from basecal.estimation.start.first_state import (
    _Knowledge,
    _loop,
    _mount_of_points,
    _search,
    _solve_as_led,
    _solve_closed_form,
    _unknown_letters,
    cauchy_irls,
    first_state,
    first_states,
    guessed_state,
    known_transforms,
    led_states,
)
from basecal.estimation.start.pair_views import PairViews, pair_views
from basecal.estimation.view.poses import PoseMeasurement
from basecal.estimation.view.view_pose import view_poses
from basecal.geometry import SE3
from basecal.numerics.batch import choose_entries
from basecal.simulation import Scenario, simulate
from quick import quick


@pytest.mark.parametrize("seed", quick([4000, 4001], [4000]))
@pytest.mark.parametrize("kind", KINDS)
def test_start_reaches_the_optimum_of_the_truth(kind: str, seed: int) -> None:
    """The two descents of a cell of 15 to 30 samples end equally (1e-6 m and rad), and everything is observable."""
    assert trial(kind, seed).verdict == "same"


@pytest.mark.slow
def test_start_reaches_the_optimum_in_nearly_all_cells() -> None:
    """Among eight cells of every type, at least 99.5 % end equally."""
    trials = [trial(kind, seed) for kind in KINDS for seed in range(5000, 5008)]
    same, other = (sum(t.verdict == verdict for t in trials) for verdict in ("same", "other"))
    assert same >= 0.995 * (same + other)
    assert same + other >= 0.95 * len(trials)


@pytest.mark.journey
def test_led_search_finds_the_optimum() -> None:
    """The best clean state ends where the start without a guess ends.

    A board, which has a closed form, has no such states.
    """
    made = simulate(Scenario(samples=25, target="led"), 2)
    problem, _ = build_problem(made.cell, made.recording)
    states = list(led_states(problem, made.cell, 12))
    costs = np.array([linearise(problem, state).cost for state in states])
    first = bundle_adjust(problem, first_state(problem, made.cell, thorough=False), 1).cost
    best = bundle_adjust(problem, states[int(np.argmin(costs))], 1).cost
    assert best == pytest.approx(first, rel=1e-6)
    assert len(states) == 12
    board = simulate(Scenario(samples=10), 0)
    assert list(led_states(build_problem(board.cell, board.recording)[0], board.cell, 12)) == []


@pytest.mark.parametrize("layout", ["dual", "eye_in_hand", "eye_to_hand"])
def test_unknowns_of_a_pair_match_its_loop(layout: str) -> None:
    """The unknowns are correct for any known transforms: mounts by name, and bases if both are known."""
    made = simulate(Scenario(layout=layout, samples=5), 0)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    sight = pair_views(group, made.cameras[group.camera], 5, 5)
    names = sorted(problem.unknowns)
    for count in range(len(names) + 1):
        for chosen in combinations(names, count):
            known = _Knowledge({name: made.truth[name] for name in chosen})
            assert _unknown_letters(sight, known) == _loop(sight, known).unknown


def _partial_views(samples: int, each: int):
    """Views without noise of the first point of a board and some other points each, and X, Y and Z."""
    made = simulate(Scenario(samples=samples, pixel_px=1e-9), 1)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    measurement = group.measurement
    others = len(measurement.points_in_target) - 1
    seen = np.zeros((samples, others + 1), dtype=bool)
    turn = np.arange(samples)[:, None] * (each - 1) + np.arange(each - 1)
    seen[np.arange(samples)[:, None], 1 + turn % others] = seen[:, [0]] = True
    some = replace(measurement, seen=seen, weight=seen * measurement.weight, stated=seen * measurement.stated)
    group = replace(group, measurement=some)
    triple = [made.truth[name] for name in (group.eye.mount, group.hand.base, group.hand.mount)]
    return made, problem.with_groups([group]), pair_views(group, made.cameras["wrist"], 1000, 1000), triple


def test_points_seen_separately_place_the_target():
    """Three points in each view locate each point in the flange, and all of them the target."""
    _, _, sight, (x, y, z) = _partial_views(60, 3)
    assert sight.candidates is None
    nowhere = SE3(np.eye(3), np.array([0.3, -0.2, 0.5]))
    found = _mount_of_points(sight, x, y, nowhere)
    np.testing.assert_allclose(found.matrix, z.matrix, atol=1e-5)


def test_point_with_parallel_rays_keeps_its_known_depth():
    """With one view only the directions are known: each point is on its ray, nearest to the position of the LED."""
    _, _, sight, (x, y, z) = _partial_views(1, 36)
    chords = sight.group.measurement
    flange_from_camera = (
        sight.group.hand.base_from_flange[0].inverse() @ y.inverse() @ sight.group.eye.base_from_flange[0] @ x
    )
    rays = (flange_from_camera.rotation @ chords.bearings_in_camera[0].T).T
    for known in (z.translation, z.translation + 0.1 * rays[0]):
        away = (rays @ (known - flange_from_camera.translation))[:, None]
        feet = flange_from_camera.translation + away * rays
        found = _mount_of_points(sight, x, y, SE3(np.eye(3), known))
        np.testing.assert_allclose(found @ chords.points_in_target.mean(0), feet.mean(0), atol=1e-6)


def test_board_without_four_visible_points_is_started():
    """A descent from its start ends at the truth, though no view has a pose."""
    made, problem, _, _ = _partial_views(60, 3)
    end = bundle_adjust(problem, first_state(problem, made.cell, thorough=False), 1).state
    for name, transform in end.transforms.items():
        np.testing.assert_allclose((transform.inverse() @ made.truth[name]).log(), 0.0, atol=1e-6)


def test_guesses_form_a_state_if_complete():
    """The guesses are used unchanged. If one is missing, there is no state."""
    made = simulate(Scenario(samples=4), 0)
    problem, _ = build_problem(made.cell, made.recording)
    assert guessed_state(problem, made.cell) is None
    guesses = {name: replace(u, mean=made.truth[name]) for name, u in problem.unknowns.items()}
    state = guessed_state(replace(problem, unknowns=guesses), made.cell)
    assert {name: t is made.truth[name] for name, t in state.transforms.items()} == dict.fromkeys(
        problem.unknowns, True
    )
    assert state.stop_errors.shape == (len(problem.stops), 6)
    assert not np.any(state.stop_errors)
    first, *others = problem.unknowns
    assert guessed_state(replace(problem, unknowns={**guesses, first: problem.unknowns[first]}), made.cell) is None
    assert others


@pytest.mark.parametrize(("sigma_rad", "stays"), [(0.29, True), (0.31, False)])
def test_narrow_prior_is_a_start(sigma_rad, stays):
    """A prior is a start up to 0.3 rad about each axis.

    A wider prior, and a guess without a prior, are searched for.
    """
    made = simulate(Scenario(samples=8), 0)
    problem, _ = build_problem(made.cell, made.recording)
    name = "eye_flange_from_wrist"
    mean = made.truth[name] @ SE3.exp(np.full(6, 0.02))
    sigma = np.array([1.0, 1.0, 1.0, 0.1, 0.1, sigma_rad])
    known = replace(problem, unknowns={**problem.unknowns, name: Unknown("prior", mean, sigma)})
    start = first_state(known, made.cell, thorough=False)
    assert np.array_equal(start.transforms[name].matrix, mean.matrix) == stays
    guessed = replace(problem, unknowns={**problem.unknowns, name: Unknown("free", mean)})
    assert not np.array_equal(first_state(guessed, made.cell, thorough=False).transforms[name].matrix, mean.matrix)
    for other, transform in start.transforms.items():
        assert np.abs((transform.inverse() @ made.truth[other]).log()).max() < 0.1


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0), (3, 2, 1), (1, 2, 3)])
def test_bases_are_placed_from_any_start_of_a_chain(order):
    """Some pairs of a ring of four robots remain, and the bases follow along the chain, in either direction."""
    made = simulate(Scenario(layout="chain", robots=4, samples=40, target="pose", pose_noise=(1e-6, 1e-6)), 1)
    problem, _ = build_problem(made.cell, made.recording)
    groups = [problem.groups[k] for k in order]
    start = first_state(problem.with_groups(groups), made.cell, thorough=False)
    placed = {name for g in groups for name in (g.eye.base, g.hand.base) if name is not None}
    assert len(placed) == 3
    for name in placed:
        assert np.abs((start.transforms[name].inverse() @ made.truth[name]).log()).max() < 1e-3


def test_bases_are_placed_once_related_to_the_world(rng):
    """Relations may come in any order and from either end. No base is placed before it is connected to the world."""
    at = {name: SE3.exp(rng.uniform(-1, 1, 6)) for name in "abcd"} | {None: SE3.identity()}
    known = _Knowledge()
    for first, second in (("a", "b"), ("c", "b"), ("d", "c")):
        known.add_relation(first, second, at[first].inverse() @ at[second])
        assert known.transforms == {}
    assert known.relation("b", "a") is known.relation("a", None) is known.base("a") is None
    np.testing.assert_allclose(known.relation("d", "c").matrix, (at["d"].inverse() @ at["c"]).matrix)
    known.add_relation("a", None, at["a"].inverse())
    assert set(known.transforms) == set("abcd")
    for name in "abcd":
        np.testing.assert_allclose(known.base(name).matrix, at[name].matrix, atol=1e-12)
    np.testing.assert_allclose(known.relation("d", "a").matrix, (at["d"].inverse() @ at["a"]).matrix, atol=1e-12)
    np.testing.assert_allclose(known.relation("b", None).matrix, at["b"].inverse().matrix, atol=1e-12)
    np.testing.assert_array_equal(known.base(None).matrix, np.eye(4))
    placed = dict(known.transforms)
    known.add_relation("a", "b", SE3.identity())
    assert known.transforms == placed


def test_bases_without_relation_to_the_reference_are_related():
    """A third robot without views is the reference: both others start with their relation to each other."""
    made = simulate(Scenario(samples=12, pixel_px=0.0), 0)
    robots = {**made.cell.robots, "third": Robot("third")}
    cell = replace(made.cell, robots=robots, reference="third", bases={})
    found = first_state(build_problem(cell, made.recording)[0], cell, thorough=False).transforms
    relation = found["third_base_from_eye_base"].inverse() @ found["third_base_from_hand_base"]
    off = (relation.inverse() @ made.truth["eye_base_from_hand_base"]).log()
    np.testing.assert_allclose(off, 0, atol=1e-5)


def test_known_transforms_are_fixed_or_have_a_narrow_prior():
    """The prior is narrow in all angles. A mean alone, or none, is no start."""
    mean = SE3.identity()
    narrow, wide = np.array([9.0, 9, 9, 0.1, 0.2, 0.29]), np.array([0.0, 0, 0, 0.1, 0.31, 0.1])
    unknowns = {
        "fixed": Unknown("fixed", mean),
        "narrow": Unknown("prior", mean, narrow),
        "wide": Unknown("prior", mean, wide),
        "wide about its first axis": Unknown("prior", mean, np.roll(wide, -1)),
        "guess": Unknown("free", mean),
        "free": Unknown(),
    }
    assert known_transforms(SimpleNamespace(unknowns=unknowns)) == {"fixed": mean, "narrow": mean}


def test_thorough_start_uses_more_views_with_refined_poses(monkeypatch):
    """Other starts use closed forms of few views and points."""
    made, asked = simulate(Scenario(samples=3), 0), []

    def watched(group, camera, views, points, poses_of):
        asked.append((views, points, poses_of))
        raise InputError("seen")

    monkeypatch.setattr(module, "pair_views", watched)
    problem, _ = build_problem(made.cell, made.recording)
    for thorough in (True, False):
        with pytest.raises(InputError, match="seen"):
            first_state(problem, made.cell, thorough)
    (views, points, refined), (few_views, few_points, closed) = asked
    assert views > 10 * few_views
    assert points > 10 * few_points
    assert refined is view_poses
    assert (closed.func, closed.keywords) == (view_poses, {"iterations": 0})


def make_pair(rng, swapped=()):
    """Twenty views of a pair, each with its true pose and one off by half a radian, and X, Y and Z."""
    n = 20
    a, c = SE3.exp(rng.standard_normal((n, 6))), SE3.exp(rng.standard_normal((n, 6)))
    x, y, z = (SE3.exp(rng.standard_normal(6)) for _ in "xyz")
    true = (a @ x).inverse() @ y @ c @ z
    off = true @ SE3.exp([0.0, 0.0, 0.0, 0.3, 0.0, -0.4])
    views = PoseMeasurement(true, np.ones((n, 6)), np.ones((n, 6)))
    group = group_of(end("e", a, mount="x"), end("h", c, mount="z", base="y"), views)
    is_swapped = np.isin(np.arange(n), swapped)
    first, second = choose_entries(is_swapped, off, true), choose_entries(is_swapped, true, off)
    rotation, translation = (
        np.stack([getattr(of, f) for of in (first, second)], 1) for f in ("rotation", "translation")
    )
    return PairViews(group, SE3(rotation, translation), np.ones(n), n), (x, y, z)


@pytest.mark.parametrize("swapped", [(), (3, 8, 13), (0, 1, 2, 3)])
def test_closed_form_chooses_the_better_pose_of_each_view(rng, swapped):
    """The choice is iterated until it is stable, and is exact if a few views had their poses swapped."""
    sight, triple = make_pair(rng, swapped)
    for found, true in zip(_solve_closed_form(sight, _Knowledge()), triple, strict=True):
        np.testing.assert_allclose(found.matrix, true.matrix, atol=1e-7)


def test_searches_run_in_step_with_separate_ends(monkeypatch):
    """All requests at a time are refined together. Each search has its own answers, its own end, and its own error."""
    together = []

    def search(problem, cell, thorough):
        total = 0
        for step in range(problem):
            total += yield (problem, step)
        if problem == 2:
            raise InputError("no start")
        return total

    def refined(wishes):
        together.append(wishes)
        return [10 * problem + step for problem, step in wishes]

    monkeypatch.setattr(module, "_search", search)
    monkeypatch.setattr(module, "refine_jointly", refined)
    first, second, third, fourth = first_states([3, 2, 0, 1], None, False)
    assert (first, third, fourth) == (30 + 31 + 32, 0, 10)
    assert isinstance(second, InputError)
    assert [of for of in together if of] == [[(3, 0), (2, 0), (1, 0)], [(3, 1), (2, 1)], [(3, 2)]]
    with pytest.raises(InputError, match="no start"):
        first_state(2, None, False)


@pytest.mark.parametrize("known", ["", "x", "xy", "z"])
@pytest.mark.parametrize("is_point", [True, False])
def test_led_refinement_has_more_starts_with_more_unknown_rotations(monkeypatch, known, is_point):
    """The mount is at the LED. A target's known mount is unchanged, and an unknown one is placed by its points."""
    sight, (x, y, z) = make_pair(np.random.default_rng(0))
    chords = SimpleNamespace(points_in_target=np.array([[9.0, 9.0, 9.0], [0.1, 0.2, 0.3]]))
    monkeypatch.setattr(module, "led_point", lambda measurement: (chords, 1))
    asked = []
    monkeypatch.setattr(module, "led_search", lambda sight, loop, most: asked.append(most) or (sight, loop, []))
    monkeypatch.setattr(module, "_mount_of_points", lambda sight, x, y, at: "by its points")
    loop = sight.loop(*(of if k in known else None for k, of in zip("xyz", (x, y, z), strict=True)), np.zeros(20, int))
    search = _solve_as_led(sight, loop, is_point)
    wish = next(search)
    assert wish.is_point
    assert asked == [{2: 40, 1: 12, 0: 1}[2 - len(set(known) & {"x", "y"})]]
    with pytest.raises(StopIteration) as ended:
        search.send((x, y, SE3(np.eye(3), np.array([1.0, 2.0, 3.0]))))
    mount = ended.value.value[2]
    assert ended.value.value[:2] == (x, y)
    if is_point:
        np.testing.assert_allclose(mount.translation, [0.9, 1.8, 2.7])
        np.testing.assert_array_equal(mount.rotation, np.eye(3))
    else:
        assert mount is (loop.z if "z" in known else None) or mount == "by its points"
        assert (mount == "by its points") == ("z" not in known)


def test_unstated_lenses_are_estimated_from_their_views(monkeypatch):
    """Only pixel measurements are used, and a stated lens is unchanged."""
    made = simulate(Scenario(samples=3, layout="two_cameras"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    first, second = problem.lenses
    asked = []
    monkeypatch.setattr(module, "lens_from_views", lambda camera, views: asked.append((camera.name, views)) or "a lens")
    free = replace(problem, lenses={**problem.lenses, second: Intrinsics("free")})
    assert module.lenses(free, made.cell) == {first: problem.lenses[first].camera, second: "a lens"}
    own = [group.measurement for group in problem.groups if group.camera == second]
    assert [(name, [view is of for view, of in zip(views, own, strict=True)]) for name, views in asked] == [
        (second, [True] * len(own))
    ]


@pytest.mark.parametrize("is_clear", [True, False])
def test_pairs_with_poses_and_many_views_come_first(monkeypatch, is_clear):
    """Among pairs with as few unknowns, each is tried once before one is forced, and again only if more is known."""
    given = {"light": (None, 50), "few": ("poses", 5), "many": ("poses", 9)}
    ends = end("arm", SE3.identity((1,)), mount="x"), end(mount="z")
    pairs = [group_of(*ends, target=name) for name in given]
    tried = []

    def start(sight, known, problem, thorough, is_forced):
        tried.append((sight.group.target, is_forced))
        return is_clear or is_forced
        yield

    monkeypatch.setattr(module, "_solve_pair", start)
    monkeypatch.setattr(module, "lenses", lambda problem, cell: {})
    monkeypatch.setattr(module, "place_by_pairs", lambda *_: {})
    monkeypatch.setattr(
        module, "pair_views", lambda group, *_: PairViews(group, given[group.target][0], None, given[group.target][1])
    )
    problem = SimpleNamespace(groups=pairs, unknowns={"x": Unknown()}, stops=[])
    with pytest.raises(StopIteration) as ended:
        next(_search(problem, None, False))
    np.testing.assert_array_equal(ended.value.value.transforms["x"].matrix, np.eye(4))
    order = ["many", "few", "light"]
    assert tried == [(name, False) for name in order] + [(name, True) for name in order] * (not is_clear)


SIGMA = np.full(6, 1e-3)


def with_outliers(count, size=0.05):
    """Thirty poses with noise, the first `count` off by `size` in every coordinate."""
    errors = 1e-3 * np.random.default_rng(0).standard_normal((30, 6))
    errors[:count] += size
    return pose_problem(errors, SIGMA)


def mount(states, row=0):
    return states.transforms[MOUNT].log()[row]


def test_three_tenths_of_outliers_have_little_effect():
    """Least squares is off by 15 mm, Cauchy's likelihood by less than a tenth of that.

    The entries of the batch do not mix.
    """
    problem, state = with_outliers(9)
    plain = bundle_adjust(problem, state, 1).state.transforms[MOUNT].log()
    assert np.abs(plain[:3]).min() > 0.014
    robust = cauchy_irls(problem, batch_states(problem, [state, state]))
    assert np.abs(mount(robust)).max() < 1e-3
    np.testing.assert_allclose(mount(robust, 1), mount(robust, 0), atol=1e-9)


def test_irls_ends_at_the_balance_of_weighted_residuals():
    """The weights 1 / (1 + d^2 / s), with s the 0.6 quantile of d^2, leave no gradient at the end."""
    problem, state = with_outliers(3, 0.01)
    at = mount(cauchy_irls(problem, batch_states(problem, [state])))
    errors = problem.groups[0].measurement.measured_camera_from_target.log()
    off = (errors + at) / SIGMA  # the mount moves the target in the camera backwards
    ratio = np.sum(off**2, -1) / 6
    weight = 1 / (1 + ratio / np.quantile(ratio, 0.6))
    step = (weight @ off) / weight.sum()
    assert np.abs(step[:3]).max() < 0.02
    assert np.abs((np.ones(30) @ off) / 30)[:3].max() > 0.5


def test_exact_views_are_no_error():
    """Without noise the scale is zero, and the result is exact."""
    problem, state = pose_problem(np.zeros((10, 6)), SIGMA)
    np.testing.assert_allclose(mount(cauchy_irls(problem, batch_states(problem, [state]))), 0.0, atol=1e-12)


@pytest.mark.parametrize("fails_at", [None, 4])
def test_irls_starts_unweighted_and_then_reweights_each_step(monkeypatch, fails_at):
    """Weights are by squares over freedoms of all groups, with a separate scale for each state.

    If a step fails, the state is unchanged.
    """
    values = np.array([[6.0, 12.0, np.inf], [1.0, 2.0, 3.0]]), np.array([[30.0, 0.0], [4.0, 5.0]])
    freedoms = np.array([[6, 6, 6], [1, 1, 1]]), np.array([[6, 0], [2, 1]])
    steps = []

    def adjusted(problem, states, dof, iterations, weights):
        if len(steps) == fails_at:
            raise np.linalg.LinAlgError
        steps.append((iterations, weights))
        return SimpleNamespace(state=states + 1)

    monkeypatch.setattr(module, "bundle_adjust_batch", adjusted)
    squares = [MahalanobisSquared(*each) for each in zip(values, freedoms, strict=True)]
    monkeypatch.setattr(module, "view_misfits", lambda problem, states: squares)
    assert cauchy_irls(None, 0) == len(steps) == (fails_at or 25)
    assert [iterations for iterations, _ in steps] == [3, *[1] * (len(steps) - 1)]
    assert steps[0][1] is None
    scale = np.array([[3.2], [2.4]])  # 0.6 quantiles of 0, 1, 2, 5 and infinity, and of 1, 2, 2, 3 and 5
    expected = [1 / (1 + np.array(of) / scale) for of in ([[1, 2, np.inf], [1, 2, 3]], [[5, 0], [2, 5]])]
    for _, weights in steps[1:]:
        for found, wanted in zip(weights, expected, strict=True):
            np.testing.assert_allclose(found, wanted, atol=1e-25)
