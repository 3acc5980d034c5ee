"""Tests of `residuals` and `loops`: pixels, pose consistency errors, and single-view poses."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.ends import end
from tests.ends import views as group_of
from tests.pose_problem import pose_problem

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.residuals import fit as module
from basecal.accuracy.residuals.fit import _close_loop, _Relation, loops, residuals, single_view_pose
from basecal.cell import Recording, RobotState, SampleResidual, Unknown
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve, solve_from
from basecal.geometry import SE3
from basecal.reporting.text import text_report
from basecal.simulation import Scenario, simulate


def fixed_at_truth(scenario, change=None, seed=0):
    """A solution of a fixed cell, of a recording whose group may be changed."""
    known = {"base": "fixed", "camera_mount": "fixed", "target_mount": "fixed"}
    made = simulate(replace(scenario, **known), seed)
    problem, _ = build_problem(made.cell, made.recording)
    if change is not None:
        problem = problem.with_groups(map(change, problem.groups))
    return solve_from(problem, State(made.truth, made.cameras, np.zeros((len(problem.stops), 6))))


def with_pixels(change):
    def of(group):
        pixels, seen = group.measurement.pixels.copy(), group.measurement.seen.copy()
        change(pixels, seen)
        weight = np.where(seen, group.measurement.weight, 0.0)
        measurement = replace(group.measurement, pixels=pixels, seen=seen, weight=weight, stated=weight)
        return replace(group, measurement=measurement)

    return of


EXACT = Scenario(samples=4, pixel_px=1e-6)


def test_pixel_rms_is_per_coordinate():
    """One view 3 px right and 4 px down has an rms of 5 / sqrt(2) px, half of that over four views.

    The median is zero.
    """

    def change(pixels, seen):
        pixels[1] += (3.0, 4.0)

    found = residuals(fixed_at_truth(EXACT, with_pixels(change)))
    by_sample = {r.sample: r.rms_px for r in found.per_sample}
    assert by_sample[1] == pytest.approx(5 / np.sqrt(2), rel=1e-4)
    assert by_sample[0] == pytest.approx(0.0, abs=1e-4)
    assert found.rms_px == pytest.approx(5 / np.sqrt(8), rel=1e-4)
    assert found.median_px == pytest.approx(0.0, abs=1e-4)


def test_unseen_points_do_not_count():
    """An unseen corner a thousand pixels off changes no residual."""

    def change(pixels, seen):
        pixels[2, 3] += 1e3
        seen[2, 3] = False

    assert residuals(fixed_at_truth(EXACT, with_pixels(change))).rms_px == pytest.approx(0.0, abs=1e-4)


def test_loop_errors_use_recorded_poses():
    """With 1 mm of robot noise, pixels fit with stop errors removed, and loops have the robot errors."""
    solution = fixed_at_truth(Scenario(samples=40, robot_noise=(1e-3, 0.0), pixel_px=0.01))
    found = residuals(solution)
    assert found.rms_px < 0.02
    assert found.loop_rms_m == pytest.approx(1e-3 * np.sqrt(6), rel=0.2)
    lengths = np.array([r.loop_m for r in found.per_sample])
    assert found.loop_rms_m == pytest.approx(np.sqrt(np.mean(lengths**2)))
    angles = np.array([r.loop_rad for r in found.per_sample])
    assert found.loop_rms_rad == pytest.approx(np.sqrt(np.mean(angles**2)))


def test_measured_poses_have_loop_errors():
    """Measured poses off by half a metre and 0.3 rad have these loop errors and no pixels."""
    problem, state = pose_problem(np.array([[0.5, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0.3, 0]]), np.ones(6))
    found = residuals(solve_from(replace(problem, columns={}), state))
    assert [(r.loop_m, r.rms_px) for r in found.per_sample] == [(pytest.approx(0.5), None), (pytest.approx(0), None)]
    assert found.per_sample[1].loop_rad == pytest.approx(0.3)
    assert found.loop_rms_m == pytest.approx(0.5 / np.sqrt(2))
    assert (found.rms_px, found.median_px) == (None, None)


def test_led_has_no_loop_error():
    """An LED view has no pose, hence no loop error."""
    found = residuals(fixed_at_truth(Scenario(samples=5, target="led")))
    assert (found.loop_rms_m, found.loop_rms_rad) == (None, None)
    assert all(r.loop_m is None and r.loop_rad is None and r.rms_px > 0 for r in found.per_sample)


def test_left_out_samples_are_listed_without_mean():
    """Left-out views are listed by sample with their own residuals, and excluded from every mean."""

    def change(pixels, seen):
        pixels[[1, 3]] += (30.0, 40.0)

    solution = fixed_at_truth(EXACT, with_pixels(change))
    whole = solution.problem
    kept, rest = (whole.with_groups(g.take(np.array(rows)) for g in whole.groups) for rows in ([2, 0], [3, 1]))
    found = residuals(replace(solution, problem=kept), rest)
    assert [r.sample for r in found.per_sample] == [0, 1, 2, 3]
    assert found.rms_px == pytest.approx(0.0, abs=1e-4)
    assert found.per_sample[3].rms_px == pytest.approx(50 / np.sqrt(2), rel=1e-4)


def alone(target, seen_points, samples=3):
    """Single-view poses of views of which the second saw so many points; the true poses, and which views give one."""
    made = simulate(Scenario(samples=samples, target=target, pixel_px=1e-4, point_m=1e-6), 1)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    seen = group.measurement.seen.copy()
    seen[1, [k for k in range(seen.shape[1]) if k not in seen_points]] = False
    weight = np.where(seen, group.measurement.weight, 0.0)
    few = replace(group, measurement=replace(group.measurement, seen=seen, weight=weight, stated=weight))
    state = State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))
    true = state.camera_from_target(group, problem.stops)
    near = true @ SE3.exp(np.full((samples, 6), 0.01))
    return single_view_pose(state, few, near), true


@pytest.mark.parametrize(("target", "points", "enough"), [
    ("charuco", (0, 5, 30, 35), True), ("charuco", (0, 5, 30), False),
    ("points3d", (0, 1, 4), True), ("points3d", (0, 1), False),
])  # fmt: skip
def test_single_view_pose_needs_enough_points(target, points, enough):
    """A single view gives its true pose from four points in pixels or three in 3-D, from any start."""
    (poses, given), true = alone(target, points)
    assert given.tolist() == [True, enough, True]
    off = np.abs((poses.inverse() @ true).log()).max(-1)
    assert np.all(off[given] < 1e-3)


def test_single_point_gives_no_pose():
    """An LED gives no pose; the prediction is returned unchanged."""
    (poses, given), true = alone("led", (0,))
    assert not given.any()
    np.testing.assert_allclose((true.inverse() @ poses).log(), 0.01, atol=1e-12)


def test_space_points_are_weighted_by_variance():
    """The pose of a single view is that of Kabsch with points weighted by one over their variances."""
    made = simulate(Scenario(samples=2, target="points3d", point_m=5e-3), 1)
    problem, _ = build_problem(made.cell, made.recording)
    (group,) = problem.groups
    of = group.measurement
    weight = np.random.default_rng(0).uniform(0.1, 3.0, of.weight.shape)
    group = replace(group, measurement=replace(of, weight=weight))
    (found, given) = single_view_pose(State(made.truth, made.cameras, np.zeros((0, 6))), group, None)
    assert given.all()
    for k in range(2):
        share = weight[k] ** 2 / np.sum(weight[k] ** 2)
        here, there = share @ of.points_in_target, share @ of.points_in_camera[k]
        turn, _ = Rotation.align_vectors(of.points_in_camera[k] - there, of.points_in_target - here, weights=share)
        np.testing.assert_allclose(found.rotation[k], turn.as_matrix(), atol=1e-6)
        np.testing.assert_allclose(found.translation[k], there - turn.apply(here), atol=1e-6)


RING = Scenario(layout="chain", samples=30, camera_mount="fixed", target_mount="fixed")
AROUND = ("r1_base", "camera1", "board2", "r2_base", "camera2", "board3", "r3_base", "camera3", "board1", "r1_base")
EXACT_LOOPS = Settings(robot_noise="stated")


def shift_base(recording: Recording, robot: str, first: int, by: SE3) -> Recording:
    """The recording as if that robot's base had moved before sample `first`."""
    samples = []
    for sample in recording.samples:
        pose = sample.robots[robot].base_from_flange
        assert pose is not None
        moved = RobotState(by @ pose) if sample.sample >= first else sample.robots[robot]
        samples.append(replace(sample, robots={**sample.robots, robot: moved}))
    return Recording(tuple(samples))


def test_ring_has_pair_loops_and_ring_loop():
    """Three pairs in a ring close four loops. Without noise of robots and mounts only the views' own noise is left."""
    s = simulate(RING, seed=3)
    calibration = calibrate(s.cell, s.recording, EXACT_LOOPS)
    *pairs, ring = calibration.residuals.loops
    assert [loop.path for loop in pairs] == [AROUND[:4], AROUND[3:7], AROUND[6:]]
    assert ring.path == AROUND
    assert ring.views == 30
    sigma = np.sqrt(sum(np.trace(e.covariance[:3, :3]) for n, e in calibration.transforms.items() if "base" in n))
    # `sigma` is that of two bases together; the third relation is as precise as each.
    assert ring.rms_m < 10 * sigma
    assert f"pose consistency error of {' - '.join(AROUND)}" in text_report(s.cell, calibration)


def test_pair_loop_is_rms_over_views():
    """The loop of a single pair is the rms of the whole recording."""
    s = simulate(Scenario(samples=12), seed=0)
    fit = residuals(solve(s.cell, s.recording))
    (loop,) = fit.loops
    assert loop.path == ("eye_base", "wrist", "board", "hand_base")
    assert (loop.views, loop.rms_m, loop.rms_rad) == (12, fit.loop_rms_m, fit.loop_rms_rad)


def test_moved_base_opens_ring():
    """A first robot pushed by 5 mm before the last pair opens the ring by that much."""
    s = simulate(RING, seed=3)
    push = SE3(np.eye(3), np.array([5e-3, 0, 0]))
    *_, ring = residuals(solve(s.cell, shift_base(s.recording, "r1", 20, push))).loops
    # Each pair knows its bases to about 0.3 mm, three of them the ring to 0.5 mm: three sigmas.
    assert ring.rms_m == pytest.approx(5e-3, abs=1.5e-3)


def test_two_cameras_on_arm_close_loop():
    """A second camera that is the first under another name closes a loop with zero error."""
    s = simulate(Scenario(samples=12), seed=0)
    twin = replace(s.cell.cameras["wrist"], name="second")
    cell = replace(s.cell, cameras={**s.cell.cameras, "second": twin})
    samples = [
        replace(x, observations=(*x.observations, *(replace(o, camera="second") for o in x.observations)))
        for x in s.recording.samples
    ]
    *_, ring = residuals(solve(cell, Recording(tuple(samples)))).loops
    assert ring.path == ("eye_base", "wrist", "board", "hand_base", "board", "second", "eye_base")
    assert ring.views == 24
    assert ring.rms_m < 1e-8


def test_path_to_ring_is_no_part_of_loop():
    """The path of two steps to a ring of three is removed: the loop begins and ends on the ring."""

    def step(start: str, end: str, x: float) -> _Relation:
        path = (start, f"camera_{start}", f"board_{end}", end)
        return _Relation(start, end, path, SE3(np.eye(3), np.array([x, 0.0, 0.0])), 10)

    out = [step("a", "b", 5.0), step("b", "c", 7.0)]
    ring = [step("c", "d", 1.0), step("d", "e", 1.0), step("e", "c", -1.5)]
    loop = _close_loop([*out, *ring, *(each.reverse() for each in reversed(out))])
    assert (loop.path[0], loop.path[-1], loop.views) == ("c", "c", 30)
    assert set(loop.path).isdisjoint({"a", "b"})
    assert loop.rms_m == pytest.approx(0.5)


def test_order_of_pairs_has_no_effect_on_ring():
    """Pairs in any order and direction give the same ring and error."""
    s = simulate(replace(RING, samples=18), seed=3)
    solution = solve(s.cell, s.recording)
    groups = solution.problem.groups
    *_, ring = residuals(solution).loops
    for order in ((2, 1, 0), (1, 2, 0), (1, 0, 2)):
        problem = solution.problem.with_groups([groups[k] for k in order])
        *pairs, other = loops(replace(solution, problem=problem), residuals(solution).per_sample)
        assert [pair.path[1] for pair in pairs] == [groups[k].camera for k in order]
        assert other.views == ring.views == 18
        assert set(other.path) == set(ring.path)
        assert other.path[0] == other.path[-1]
        assert other.rms_m == pytest.approx(ring.rms_m, rel=0.1)
        assert other.rms_rad == pytest.approx(ring.rms_rad, rel=1e-3)


def test_views_without_loop_error_do_not_count():
    """The loop of a pair is the rms over views with both length and angle; without any there is no loop."""
    s = simulate(Scenario(samples=8), seed=0)
    solution = solve(s.cell, s.recording)
    sizes = [(3e-3, 1e-3), (4e-3, 7e-3), (None, 5.0), (5.0, None)]
    first = residuals(solution).per_sample[0]
    views = [replace(first, loop_m=length, loop_rad=angle) for length, angle in sizes]
    (loop,) = loops(solution, views)
    assert (loop.path, loop.views) == (("eye_base", "wrist", "board", "hand_base"), 2)
    assert (loop.rms_m, loop.rms_rad) == (pytest.approx(np.sqrt(12.5) * 1e-3), pytest.approx(5e-3))
    assert loops(solution, views[2:]) == ()


def test_loop_of_two_cameras_from_other_end():
    """A loop of two cameras seen from the target's robot begins and ends at its base and closes."""
    s = simulate(Scenario(samples=8), seed=0)
    twin = replace(s.cell.cameras["wrist"], name="second")
    cell = replace(s.cell, reference="hand", bases={"eye": Unknown()}, cameras={**s.cell.cameras, "second": twin})
    samples = [
        replace(x, observations=(*x.observations, *(replace(o, camera="second") for o in x.observations)))
        for x in s.recording.samples
    ]
    *_, ring = residuals(solve(cell, Recording(tuple(samples)))).loops
    assert ring.path == ("hand_base", "board", "second", "eye_base", "wrist", "board", "hand_base")
    assert (ring.views, ring.rms_m < 1e-8) == (16, True)


def views(camera="c", target="t", eye="a", hand="b", eye_base=None, hand_base="a_from_b", count=4):
    """Views of a camera on robot a that sees a target on robot b; a is the reference."""
    at = SE3.identity((count,))
    ends = ((eye, camera, eye_base), (hand, target, hand_base))
    both = (end(robot, at, mount=f"{robot}_from_{of}", base=base) for robot, of, base in ends)
    return group_of(*both, camera=camera, target=target)


def solution_of(*groups, columns=()):
    problem = SimpleNamespace(groups=groups, reference="a", columns=dict.fromkeys(columns))
    return SimpleNamespace(problem=problem)


def test_closed_views_have_length_and_angle():
    """Views with both numbers count for their own pair. Devices on the world count from the base of the reference."""
    sizes = [("c", 3e-3, 1e-3), ("c", 4e-3, 7e-3), ("c", None, 5.0), ("c", 5.0, None), ("d", 1.0, 2.0)]
    residual_list = [SampleResidual(k, camera, "t", None, *size) for k, (camera, *size) in enumerate(sizes)]
    both = solution_of(views(hand=None))
    (loop,) = loops(both, residual_list)
    assert (loop.path, loop.views) == (("a_base", "c", "t", "a_base"), 2)
    assert (loop.rms_m, loop.rms_rad) == (pytest.approx(np.sqrt(12.5) * 1e-3), pytest.approx(5e-3))
    assert loops(both, residual_list[2:]) == ()


def find_relations(monkeypatch, *groups, columns=(), alone=lambda mounts: "state"):
    """Relations of groups, and the mounts that were tried with each base."""
    tried = []

    def fit(solution, group, base, mounts):
        """Records its arguments and returns the given state."""
        tried.append((group.camera, base, list(mounts)))
        fitted = alone(mounts)
        return None if fitted is None else SimpleNamespace(transforms=fitted)

    monkeypatch.setattr(module, "_fit_pair", fit)
    monkeypatch.setattr(ViewGroup, "eye_base_from_hand_base", lambda group, fitted: (fitted, group.camera))
    found = module._relations(solution_of(*groups, columns=columns))
    return [(r.path, r.start_from_end, r.views) for r in found], tried


def test_pairs_relate_their_bases(monkeypatch):
    """Each pair relates its bases by its own views, with the estimated mounts.

    Pairs with one base or without views give no relation.
    """
    other = views("d", "u", eye="b", hand="a", eye_base="a_from_b", hand_base=None, count=7)
    same, nothing = views("e", hand="a", hand_base=None), views("f", count=0)
    nameless = views("g", hand_base=None)
    columns = ("a_from_c", "b_from_d", "a_from_u")
    found, tried = find_relations(monkeypatch, views(), same, nothing, nameless, other, columns=columns)
    assert found == [
        (("a_base", "c", "t", "b_base"), ("state", "c"), 4),
        (("b_base", "d", "u", "a_base"), ("state", "d"), 7),
    ]
    assert tried == [("c", "a_from_b", ["a_from_c"]), ("d", "a_from_b", ["b_from_d", "a_from_u"])]


def test_unobservable_mounts_are_held(monkeypatch):
    """If the views do not show the mounts, these are held; without an observable base there is no relation."""
    found, tried = find_relations(
        monkeypatch, views(), columns=("a_from_c",), alone=lambda mounts: None if mounts else "held"
    )
    assert [start_from_end for _, start_from_end, _ in found] == [("held", "c")]
    assert tried == [("c", "a_from_b", ["a_from_c"]), ("c", "a_from_b", [])]
    assert find_relations(monkeypatch, views(), alone=lambda mounts: None)[0] == []


@pytest.mark.parametrize(
    ("converged", "open_names", "found"),
    [(True, set(), True), (False, set(), False), (True, {"eye_base_from_hand_base"}, False), (True, {"other"}, True)],
)
def test_single_pair_is_fitted_by_base_and_mounts(monkeypatch, converged, open_names, found):
    """The columns of a single pair are its mounts and base; the stated prior of the base is ignored."""
    s = simulate(Scenario(samples=6, base="prior"), seed=0)
    solution = solve(s.cell, s.recording)
    given = []

    def adjust(problem, state, dof, steps):
        """Returns the state unchanged."""
        given.append((problem, dof))
        return SimpleNamespace(state=state, converged=converged, normal=SimpleNamespace(hessian="hessian"))

    monkeypatch.setattr(module, "bundle_adjust", adjust)
    seen = SimpleNamespace(unobservable=open_names)
    monkeypatch.setattr(module, "analyse_observability", lambda problem, state, hessian, factor: seen)
    (group,) = solution.problem.groups
    base, mounts = group.hand.base, [group.hand.mount]
    end = module._fit_pair(solution, group, base, mounts)
    assert (end is not None) == found
    ((problem, dof),) = given
    assert dict(problem.columns) == {group.hand.mount: slice(0, 6), base: slice(6, 12)}
    assert (solution.problem.unknowns[base].status, problem.unknowns[base].status) == ("prior", "free")
    assert dof == 2 * group.measurement.seen.sum() - 12


def ring(monkeypatch, *steps, reference="a"):
    """Loops around rings of relations, given as (start, end, camera, metres)."""
    relations = [
        _Relation(start, end, (start, camera, f"t{camera}", end), SE3(np.eye(3), np.array([x, 0.0, 0.0])), 5)
        for start, end, camera, x in steps
    ]
    monkeypatch.setattr(module, "_relations", lambda solution: relations)
    found = module._ring_loops(SimpleNamespace(problem=SimpleNamespace(groups=steps, reference=reference)))
    return [(" ".join(loop.path), loop.views, round(loop.rms_m, 9)) for loop in found]


def test_rings_are_relations_beyond_spanning_tree(monkeypatch):
    """Rings are the relations that a spanning tree of the bases does not need, in any order and direction.

    Disconnected relations give no ring.
    """
    a, b, c = "a_base", "b_base", "c_base"
    around = ("a_base k tk b_base l tl c_base tm m a_base", 15, 0.5)
    assert ring(monkeypatch, (a, b, "k", 1.0), (b, c, "l", 2.0), (a, c, "m", 2.5)) == [
        ("a_base m tm c_base tl l b_base tk k a_base", 15, 0.5)
    ]
    assert ring(monkeypatch, (a, b, "k", 1.0), (b, c, "l", 2.0), (c, a, "m", -2.5)) != [around]
    assert ring(monkeypatch, (a, b, "k", 1.0), (a, b, "l", 1.25)) == [("a_base l tl b_base tk k a_base", 10, 0.25)]
    assert ring(monkeypatch, (a, b, "k", 1.0), ("x_base", "y_base", "l", 1.0)) == []
    assert ring(monkeypatch, (a, b, "k", 1.0)) == []
    assert ring(monkeypatch, ("x_base", "y_base", "l", 1.0), (b, a, "k", 1.0), (a, b, "m", 1.0)) == [
        ("a_base m tm b_base k tk a_base", 10, 2.0)
    ]
