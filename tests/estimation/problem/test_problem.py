"""Tests of a problem as arrays: selecting views, columns, states and the chain equation."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from tests.ends import end, with_eye, with_hand

from basecal.effects import joint_offsets, link_parameters
from basecal.errors import InputError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import (
    State,
    Stops,
    chain,
    check_carriers,
    stop_tangents,
)
from basecal.estimation.problem.robot_parameters import Kinematics, robot_model
from basecal.estimation.view.measurement import Noise
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from basecal.simulation.arms import six_axis

ARMS = Scenario(samples=5, target="chessboard", joints=True, robot_noise=(1e-3, 2e-3), intrinsics="free")


@pytest.fixture(scope="module")
def made():
    return simulate(ARMS, 1)


@pytest.fixture(scope="module")
def problem(made):
    return build_problem(made.cell, made.recording)[0]


@pytest.fixture(scope="module")
def state(made, problem):
    errors = np.random.default_rng(0).standard_normal((len(problem.stops), 6))
    return State(made.truth, made.cameras, errors)


def arrays_per_view(group):
    """All arrays of a group with one row for each view, by name."""
    found = {}
    for f in fields(group):
        value = getattr(group, f.name)
        if isinstance(value, np.ndarray):
            found[f.name] = value
    for k, of in enumerate(group.ends):
        found |= {f"{k} poses": of.base_from_flange.matrix, f"{k} stop": of.stop, f"{k} stand": of.stop_number}
        found[f"{k} joints"] = of.joints
    found |= {f"reading {k}": r.pixels for k, r in enumerate(group.readings)}
    return found | {"pixels": group.measurement.pixels, "weight": group.measurement.weight}


def test_take_selects_all_data_of_views(problem):
    """Poses, stops, joints, pixels and readings are in the requested order, and data of the pair are unchanged."""
    (group,) = problem.groups
    taken = group.take(np.array([3, 0]))
    before, after = arrays_per_view(group), arrays_per_view(taken)
    assert before.keys() == after.keys() >= {"0 joints", "1 joints", "reading 0", "reading 1"}
    for name, value in before.items():
        np.testing.assert_array_equal(after[name], value[[3, 0]])
    assert (len(group), len(taken)) == (5, 2)
    assert (taken.camera, taken.eye.base, taken.half_turn) == (group.camera, group.eye.base, group.half_turn)
    poses_only = with_hand(with_eye(group, joints=None), joints=None).take(np.array([1]))
    assert (poses_only.eye.joints, poses_only.hand.joints) == (None, None)


def test_take_batch_selects_the_views_of_each_entry(problem):
    """Views shared by all entries are unchanged, and separate views are selected by row."""
    (group,) = problem.groups
    assert len(group.take_batch(np.array([1])).sample) == 5
    both = group.take(np.array([[0, 1, 2], [4, 3, 2]]))
    assert len(both) == 3
    np.testing.assert_array_equal(both.take_batch(np.array([1])).sample, group.sample[None, [4, 3, 2]])
    np.testing.assert_array_equal(
        problem.with_groups([both]).take_batch(np.array([0])).groups[0].measurement.pixels,
        group.measurement.pixels[None, [0, 1, 2]],
    )


def test_views_are_selected_by_group(problem):
    """Groups without selected views are removed. Each sample and each equation of the other views counts once."""
    (group,) = problem.groups
    both = problem.with_groups([group, group.take(np.array([1, 3])), group])
    few = both.take_views([np.array([4, 3, 0]), np.array([1]), np.zeros(0, dtype=np.int64)])
    assert [g.sample.tolist() for g in few.groups] == [group.sample[[4, 3, 0]].tolist(), [group.sample[3]]]
    assert few.samples.tolist() == sorted(group.sample[[0, 3, 4]].tolist())
    assert few.equation_count == 4 * 6
    empty = problem.with_groups([])
    assert (len(empty.samples), empty.equation_count) == (0, 0)


def test_stops_of_robots_are_masked():
    """The mask covers the stops of all given robots; it is empty without stops."""
    stops = Stops(np.ones((4, 6)), ("a", "b", "a", "c"))
    assert stops.robot_mask(["a", "c"]).tolist() == [True, False, True, True]
    assert stops.robot_mask([]).tolist() == [False] * 4
    assert Stops(np.zeros((0, 6))).robot_mask("a").shape == (0,)


def test_noise_is_applied_to_every_reading_unless_held(problem):
    """Unstated noise is given to the measurement and its readings. Held noise is unchanged."""
    silent = problem.with_groups(
        replace(g, measurement=replace(g.measurement, stated=0.0 * g.measurement.stated),
                readings=tuple(replace(r, stated=0.0 * r.stated) for r in g.readings))
        for g in problem.groups
    )  # fmt: skip
    (group,) = silent.with_noise(Noise(pixel_px=0.5)).groups
    for measurement in (group.measurement, *group.readings):
        np.testing.assert_array_equal(measurement.weight, 2.0 * measurement.seen)
    held = replace(silent, held=True)
    assert held.with_noise(Noise(pixel_px=0.5)) is held


def test_width_is_the_end_of_the_columns(problem):
    """Three transforms and a lens of nine parameters give 27, and no columns give zero."""
    assert problem.width == 3 * 6 + 9
    assert replace(problem, columns={}).width == 0
    assert replace(problem, columns={"b": slice(6, 9), "a": slice(0, 6)}).width == 9


def test_robot_columns_follow_all_others(problem, joints):
    """Columns of earlier models are replaced, and the others keep theirs.

    A robot has a model only if it has columns.
    """
    offsets = {"joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.01)}
    links = {"link_parameters": link_parameters.Stated(status="free")}
    model = robot_model("hand", six_axis(), offsets | links, joints, (True, True))
    assert problem.robot_model("hand") is None
    within = problem.with_models({"hand": model})
    assert within.columns["hand_joint_offsets"] == slice(27, 33)
    assert within.columns["hand_link_parameters"] == slice(33, 33 + model.widths["hand_link_parameters"])
    assert within.robot_model("hand") is model
    assert within.robot_model("eye") is None
    assert within.robot_model(None) is None
    fewer = robot_model("hand", six_axis(), offsets, joints)
    again = within.with_models({"hand": fewer})
    assert again.width == 33
    assert replace(problem, columns={}).with_models({"hand": fewer}).columns == {"hand_joint_offsets": slice(0, 6)}
    assert again.columns.keys() == {*problem.columns, "hand_joint_offsets"}
    assert within.with_models({}).columns == problem.columns
    assert replace(within, columns=problem.columns).robot_model("hand") is None


def explicit_product(group, state, stops):
    """The product of all factors, view by view, with stop errors."""
    found = []
    for k in range(len(group)):
        eye, hand = group.eye.base_from_flange[k], group.hand.base_from_flange[k]
        if group.eye.stop[k] >= 0:
            eye = eye @ SE3.exp(state.stop_errors[group.eye.stop[k]] * stops.sigma[group.eye.stop[k]])
        if group.hand.stop[k] >= 0:
            hand = hand @ SE3.exp(state.stop_errors[group.hand.stop[k]] * stops.sigma[group.hand.stop[k]])
        one = SE3.identity()
        relation = (state.transforms[group.eye.base] if group.eye.base else one).inverse() @ (
            state.transforms[group.hand.base] if group.hand.base else one
        )
        camera = (eye @ state.transforms[group.eye.mount]).inverse()
        found.append(camera @ relation @ hand @ state.transforms[group.hand.mount])
    return SE3.stack(found)


@pytest.mark.parametrize(
    "scenario",
    [
        Scenario(samples=4, robot_noise=(1e-2, 2e-2)),
        Scenario(samples=4, layout="eye_to_hand", robot_noise=(1e-2, 2e-2)),
        Scenario(samples=4, layout="eye_in_hand", robot_noise=(1e-2, 2e-2)),
        Scenario(samples=6, layout="chain"),
    ],
    ids=lambda s: s.layout,
)
def test_chain_equals_the_product_of_all_factors(scenario):
    """The pose of the target in the camera and each link of the chain are correct."""
    made = simulate(scenario, 2)
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.random.default_rng(1).standard_normal((len(problem.stops), 6)))
    for group in problem.groups:
        links, wanted = chain(group, state, problem.stops), explicit_product(group, state, problem.stops)
        np.testing.assert_allclose(links.camera_from_target.matrix, wanted.matrix, atol=1e-12)
        np.testing.assert_allclose(state.camera_from_target(group, problem.stops).matrix, wanted.matrix, atol=1e-12)
        flange = links.target_from_camera @ state.transforms[group.eye.mount].inverse()
        np.testing.assert_allclose(links.ends[0].target_from_flange.matrix, flange.matrix, atol=1e-12)
        mount = state.transforms[group.hand.mount].inverse()
        np.testing.assert_allclose(links.ends[1].target_from_flange.matrix, mount.matrix, atol=1e-12)


@pytest.mark.parametrize("noise", [True, False])
@pytest.mark.parametrize("robot", ["eye", "hand"])
def test_changed_kinematics_move_the_flange(problem, state, made, robot, noise):
    """A joint offset of 0.1 rad gives the views of a recording with joints off by that."""
    stated = made.cell.robots[robot].chain
    off = np.array([0, 0.1, 0, 0, 0, 0])
    moved = replace(state, robots={robot: Kinematics(stated, {"joint_offsets": off})})
    (group,) = problem.groups
    group = group if noise else with_hand(with_eye(group, stop=np.full(5, -1)), stop=np.full(5, -1))
    poses = stated.forward(group.robot_end(robot).joints + off)
    wanted = (with_eye if robot == "eye" else with_hand)(group, base_from_flange=poses)
    np.testing.assert_allclose(
        moved.camera_from_target(group, problem.stops).matrix,
        state.camera_from_target(wanted, problem.stops).matrix,
        atol=1e-12,
    )
    model = robot_model(robot, stated, {}, np.zeros((1, 6)))
    np.testing.assert_array_equal(moved.kinematics(model).kind_values("joint_offsets"), off)
    np.testing.assert_array_equal(state.kinematics(model).kind_values("joint_offsets"), np.zeros(6))


def test_repeat_of_a_state(problem, state):
    """Estimated transforms, errors and lenses get a batch axis, and known ones are shared."""
    many = state.repeat(problem, 3)
    assert (state.batch, many.batch) == ((), (3,))
    for name, transform in many.transforms.items():
        np.testing.assert_array_equal(transform.matrix, np.stack([state.transforms[name].matrix] * 3))
        assert many.view_transform(name).shape == (3, 1)
        assert state.view_transform(name).shape == ()
    np.testing.assert_array_equal(many.stop_errors, np.stack([state.stop_errors] * 3))
    assert many.cameras["wrist"].parameters.shape == (3, 9)
    known = replace(problem, columns={n: c for n, c in problem.columns.items() if n != "wrist"})
    assert state.repeat(known, 3).cameras["wrist"] is state.cameras["wrist"]


def test_repeat_of_a_state_includes_estimated_kinematics(problem, state, joints):
    """Estimated kinematics are the stated ones if unchanged.

    A robot without columns has kinematics only if they were changed.
    """
    offsets = {"joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.01)}
    modelled = problem.with_models({"hand": robot_model("hand", six_axis(), offsets, joints)})
    assert set(state.repeat(modelled, 2).robots) == {"hand"}
    np.testing.assert_array_equal(state.repeat(modelled, 2).robots["hand"].values["joint_offsets"], np.zeros((2, 6)))
    assert state.repeat(replace(modelled, columns=problem.columns), 2).robots == {}
    moved = replace(state, robots={"eye": Kinematics(six_axis(), {"joint_offsets": np.arange(6.0)})})
    spread = moved.repeat(modelled, 2).robots
    assert set(spread) == {"eye", "hand"}
    np.testing.assert_array_equal(spread["eye"].values["joint_offsets"], [np.arange(6.0)] * 2)


def test_has_noise_needs_a_stop_number():
    """A robot without noise has stop number -1, and an end without views has no noise."""
    assert [end(stop=stops).has_noise for stops in ([0, 0, 1], [0], [-1, -1], [])] == [True, True, False, False]


def test_camera_and_target_need_different_carriers(made):
    """On one body, a robot does not move one relative to the other."""
    check_carriers(made.cell, "wrist", "board")
    together = replace(made.cell, cameras={"wrist": replace(made.cell.cameras["wrist"], on="hand")})
    with pytest.raises(InputError, match="both on 'hand'"):
        check_carriers(together, "wrist", "board")


def test_shared_stops_are_numbered_in_order(problem):
    """Stops with several views are numbered over robots and groups, and the others are -1.

    Without noise there are none.
    """
    (group,) = problem.groups
    again = problem.with_groups([group.take(np.array([0, 1, 1, 2, 3, 3, 4]))])
    several = np.unique(np.concatenate([group.eye.stop[[1, 3]], group.hand.stop[[1, 3]]]))
    assert again.shared_stops[several].tolist() == [0, 1, 2, 3]
    assert set(np.delete(again.shared_stops, several).tolist()) == {-1}
    twice = problem.with_groups([group.take(np.array([0])), group.take(np.array([0]))])
    assert np.count_nonzero(twice.shared_stops >= 0) == 2
    assert replace(problem, stops=Stops(np.zeros((0, 6)))).shared_stops.tolist() == []


def test_stop_tangents_of_both_ends(problem, state):
    """Tangents of stop errors are the eye's and then the hand's, in metres and radians.

    A robot without noise has none.
    """
    (group,) = problem.groups
    physical = state.stop_errors * problem.stops.sigma
    both = stop_tangents(group, state, problem.stops)
    np.testing.assert_array_equal(both, physical[np.concatenate([group.eye.stop, group.hand.stop])])
    still = with_eye(group, stop=np.full(5, -1))
    np.testing.assert_array_equal(stop_tangents(still, state, problem.stops), physical[group.hand.stop])
    assert not any(of.has_noise for of in with_hand(still, stop=np.full(5, -1)).ends)


@pytest.mark.parametrize(("idle", "hint"), [((), ""), (("third",), r" \(on: third\?\)"), (("third", "fourth"), "")])
def test_error_on_a_shared_carrier_suggests_the_idle_robot(made, idle, hint):
    """If exactly one robot carries nothing, it is suggested."""
    wrist = replace(made.cell.cameras["wrist"], on="hand")
    robots = {name: replace(made.cell.robots["hand"], name=name) for name in ("hand", *idle)}
    cell = replace(made.cell, reference="hand", robots=robots, cameras={"wrist": wrist})
    with pytest.raises(InputError, match=f"'wrist' and target 'board' are both on 'hand'.*what carries it{hint}$"):
        check_carriers(cell, "wrist", "board")
    check_carriers(made.cell, "wrist", "board")
    busy = {**cell.cameras, **{name: replace(wrist, name=name, on=name) for name in idle}}
    with pytest.raises(InputError, match=r"to what carries it$"):
        check_carriers(replace(cell, cameras=busy), "wrist", "board")


def test_stops_with_several_views_are_numbered(problem):
    """Shared stops are counted for either robot, over all groups. Stops with one view, or none, have no number."""
    (group,) = problem.groups
    eye, hand = np.array([0, 0, 1, 2, 3]), np.array([4, 5, 5, 6, 7])
    one = with_hand(with_eye(group, stop=eye), stop=hand)
    assert problem.with_groups([one]).shared_stops.tolist() == [0, -1, -1, -1, -1, 1, -1, -1, -1, -1]
    two = [one.take(np.array([0, 1, 2])), one.take(np.array([3, 4, 4]))]
    assert problem.with_groups(two).shared_stops.tolist() == [0, -1, -1, 1, -1, 2, -1, 3, -1, -1]
    still = with_hand(with_eye(group, stop=np.full(5, -1)), stop=hand)
    assert problem.with_groups([still]).shared_stops.tolist() == [-1] * 5 + [0] + [-1] * 4


def test_column_indices_follow_the_names(problem):
    """Indices do not follow the order of the columns, and no names give no indices."""
    some = replace(problem, columns={"b": slice(2, 5), "other": slice(0, 2), "a": slice(5, 11)})
    assert some.column_indices(["a", "b"]).tolist() == [5, 6, 7, 8, 9, 10, 2, 3, 4]
    assert some.column_indices([]).tolist() == []


def test_jitter_motion_of_moving_views(problem):
    """The jitter motion is in metres and radians. Without jitter, or for still views, there is none."""
    (group,) = problem.groups
    motion = np.arange(30.0).reshape(5, 6)
    moving = replace(group, motion=motion)
    np.testing.assert_array_equal(replace(problem, jitter_s={"wrist": 2e-3}).jitter_motion(moving), 2e-3 * motion)
    np.testing.assert_array_equal(moving.take(np.array([3, 1])).motion, motion[[3, 1]])
    assert replace(problem, jitter_s={"wrist": 2e-3}).jitter_motion(group) is None
    assert replace(problem, jitter_s={"wrist": 0.0}).jitter_motion(moving) is None
    assert replace(problem, jitter_s={"other": 2e-3}).jitter_motion(moving) is None
