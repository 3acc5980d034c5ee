"""Tests of building a problem from a recording: joints as poses, stops, and reports of missing data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, problem_of, views

from basecal.cell import (
    CandidateObservation,
    PixelObservation,
    PointObservation,
    Recording,
    Robot,
    RobotState,
    Sample,
)
from basecal.effects import joint_offsets, link_parameters
from basecal.errors import InputError
from basecal.estimation.problem.build import (
    build_problem,
    canonical_order,
    free_ends,
    recorded_by_joints,
    recorded_joints,
    repeated_views,
    view_content,
)
from basecal.estimation.problem.correspondence import half_turn
from basecal.estimation.problem.problem import Problem
from basecal.geometry import SE3
from basecal.kinematics import read_chain
from basecal.simulation import Scenario, simulate

URDF = Path(__file__).parents[2] / "data" / "urdf" / "six_axis.urdf"


def test_joints_give_poses_by_forward_kinematics():
    """A hand recorded by joints equals the hand recorded by the forward kinematics of these joints."""
    chain = read_chain(URDF, "base_link", "tool0")
    s = simulate(Scenario(samples=6), seed=0)
    joints = np.random.default_rng(0).uniform(-1, 1, (6, chain.n))
    poses = chain.forward(joints)
    by_joints, by_poses = (
        Recording(tuple(_with_hand(x, state(k)) for k, x in enumerate(s.recording.samples)))
        for state in (lambda k: RobotState(joints_rad=joints[k]), lambda k: RobotState(poses[k]))
    )
    cell = replace(s.cell, robots={**s.cell.robots, "hand": Robot("hand", chain=chain)})
    (first,), (second,) = (build_problem(cell, recording)[0].groups for recording in (by_joints, by_poses))
    np.testing.assert_allclose(first.hand.base_from_flange.matrix, second.hand.base_from_flange.matrix, atol=1e-12)


def _with_hand(sample: Sample, state: RobotState) -> Sample:
    return replace(sample, robots={**sample.robots, "hand": state})


def _problem_of_places(order: list[int], jitter_m: float = 0.0) -> Problem:
    """Three places of the eye in an order, with readback jitter and a new view at each, and a still hand."""
    s = simulate(Scenario(samples=len(order), robot_noise=(5e-5, 5e-5), target="led", arms="hand_still"), seed=0)
    rng = np.random.default_rng(0)
    samples = []
    for sample, place in zip(s.recording.samples, order, strict=True):
        pose = s.recording.samples[place].robots["eye"].base_from_flange
        assert pose is not None
        read = SE3(pose.rotation, pose.translation + jitter_m * rng.uniform(-1, 1, 3))
        samples.append(replace(sample, robots={**sample.robots, "eye": RobotState(read)}))
    return build_problem(s.cell, Recording(tuple(samples)))[0]


@pytest.mark.parametrize("jitter_m", [0.0, 5e-5])
def test_poses_within_readback_noise_are_one_stop(jitter_m):
    """Poses that agree within readback noise are one stop, whenever they were recorded."""
    (group,) = _problem_of_places([0, 0, 1, 1, 0, 2], jitter_m).groups
    assert (group.eye.stop - group.eye.stop[0]).tolist() == [0, 0, 1, 1, 0, 2]
    assert len(set(group.hand.stop.tolist())) == 1
    assert set(group.eye.stop.tolist()).isdisjoint(group.hand.stop.tolist())


def test_copied_rows_count_once():
    """A view equal to an earlier one in the same place is left out and reported. One with other noise is not."""
    s = simulate(Scenario(samples=6), seed=0)
    first, second = s.recording.samples[:2]
    again = replace(second, sample=7, robots=first.robots)
    copies = (*s.recording.samples, replace(first, sample=6), again)
    problem, findings = build_problem(s.cell, Recording(copies))
    assert sorted(problem.groups[0].sample.tolist()) == [0, 1, 2, 3, 4, 5, 7]
    assert [(f.code, f.about) for f in findings] == [("duplicate-samples", ("6",))]


def test_view_without_a_robot_pose_is_reported():
    """The view is left out with its sample named, and the others are used."""
    s = simulate(Scenario(samples=5), seed=0)
    without = replace(s.recording.samples[2], robots={"eye": s.recording.samples[2].robots["eye"]})
    samples = (*s.recording.samples[:2], without, *s.recording.samples[3:])
    problem, (finding,) = build_problem(s.cell, Recording(samples))
    assert problem.groups[0].sample.tolist() == [0, 1, 3, 4]
    assert finding.code == "dropped-sample"
    assert finding.about == ("2",)
    assert "no pose of hand" in finding.message


def test_samples_are_ordered_by_time_and_duplicates_removed():
    """Time stamps order samples if all have one, else numbers do.

    The first of two samples with equal numbers is kept.
    """
    timed = tuple(Sample(k, stamp_s=t) for k, t in ((0, 3.0), (1, 1.0), (2, 2.0)))
    assert [x.sample for x in canonical_order(timed)] == [1, 2, 0]
    assert [x.sample for x in canonical_order((Sample(2), Sample(1, stamp_s=9.0), Sample(0)))] == [0, 1, 2]
    first, second = Sample(4, stamp_s=None), Sample(4, images={"a": "b"})
    assert canonical_order((first, second)) == (first,)
    early, middle, late = Sample(5, stamp_s=0.0), Sample(6, stamp_s=1.0), Sample(5, stamp_s=2.0)
    assert canonical_order((late, early, middle)) == (early, middle)


def test_camera_may_see_pixels_and_points_of_one_target():
    """Measurement types of the same pair are separate groups with the same unknowns."""
    s = simulate(Scenario(samples=4), seed=0)
    seen = s.recording.samples[0].observations[0]
    assert isinstance(seen, PixelObservation)
    in_camera = PointObservation(seen.camera, seen.target, seen.ids[:4], np.ones((4, 3)))
    mixed = replace(s.recording.samples[0], observations=(in_camera,))
    problem, _ = build_problem(s.cell, Recording((mixed, *s.recording.samples[1:])))
    assert [len(g) for g in problem.groups] == [3, 1]
    assert {g.eye.mount for g in problem.groups} == {"eye_flange_from_wrist"}


def _record_some_joints(made, has_joints, noise=None):
    """The hand recorded by joints in some samples and by its pose in the others, in a cell with its chain."""
    chain = read_chain(URDF, "base_link", "tool0")
    joints = np.random.default_rng(3).uniform(-1, 1, (len(has_joints), chain.n))
    samples = tuple(
        _with_hand(sample, RobotState(joints_rad=joints[k])) if has_joints[k] else sample
        for k, sample in enumerate(made.recording.samples)
    )
    cell = replace(made.cell, robots={**made.cell.robots, "hand": Robot("hand", chain=chain, noise=noise)})
    return cell, Recording(samples), chain.forward(joints)


def test_samples_may_mix_joints_and_poses():
    """Each flange is given by its own sample, and joints are known only if all samples have them."""
    made = simulate(Scenario(samples=5), seed=0)
    has_joints = [True, False, True, True, False]
    cell, recording, forward = _record_some_joints(made, has_joints)
    problem, findings = build_problem(cell, recording)
    (group,) = problem.groups
    assert findings == []
    for k, sample in enumerate(made.recording.samples):
        expected = forward[k] if has_joints[k] else sample.robots["hand"].base_from_flange
        np.testing.assert_allclose(group.hand.base_from_flange[k].matrix, expected.matrix, atol=1e-12)
    assert (group.eye.joints, group.hand.joints) == (None, None)
    assert not recorded_by_joints(problem, "hand")
    whole, _ = build_problem(*_record_some_joints(made, [True] * 5)[:2])
    assert recorded_by_joints(whole, "hand")
    assert not recorded_by_joints(whole, "eye")
    assert whole.groups[0].hand.joints.shape == (5, 6)


def test_recorded_pose_has_priority_over_joints():
    """The pose of the robot's controller is used before its kinematics."""
    made = simulate(Scenario(samples=4), seed=0)
    cell, recording, _ = _record_some_joints(made, [True] * 4)
    poses = [sample.robots["hand"].base_from_flange for sample in made.recording.samples]
    both = [
        _with_hand(sample, replace(sample.robots["hand"], base_from_flange=pose))
        for sample, pose in zip(recording.samples, poses, strict=True)
    ]
    (group,) = build_problem(cell, Recording(tuple(both)))[0].groups
    np.testing.assert_array_equal(group.hand.base_from_flange.matrix, SE3.stack(poses).matrix)
    assert group.hand.joints.shape == (4, 6)


def test_joints_without_kinematics_are_refused():
    """The error about joints without a URDF names the robot."""
    made = simulate(Scenario(samples=4), seed=0)
    _, recording, _ = _record_some_joints(made, [False, False, True, False])
    with pytest.raises(InputError, match="robot 'hand' is recorded by joints and has no urdf"):
        build_problem(made.cell, recording)


def test_parameters_need_kinematics_and_all_joints():
    """The error names both requested parameters. A fixed parameter, or a robot without views, needs nothing."""
    made = simulate(Scenario(samples=4), seed=0)
    asked = {
        "joint_offsets": joint_offsets.Stated(status="prior", sigma_rad=0.01),
        "link_parameters": link_parameters.Stated(status="free"),
    }
    wanted = "robot 'hand': to estimate joint_offsets and link_parameters, its urdf and joints_rad in every sample"
    for has_joints, chain in (([True, True, False, True], True), ([False] * 4, False)):
        cell, recording, _ = _record_some_joints(made, has_joints)
        hand = replace(cell.robots["hand"], parameters=asked)
        hand = hand if chain else replace(hand, chain=None)
        with pytest.raises(InputError, match=wanted):
            build_problem(replace(cell, robots={**cell.robots, "hand": hand}), recording)
        still = replace(hand, parameters={"joint_offsets": joint_offsets.Stated(status="fixed")})
        idle = replace(hand, name="idle")
        problem, _ = build_problem(replace(cell, robots={**cell.robots, "hand": still, "idle": idle}), recording)
        assert problem.models == {}
    cell, recording, _ = _record_some_joints(made, [True] * 4)
    one = {**asked, "link_parameters": link_parameters.Stated(status="fixed")}
    hand = replace(cell.robots["hand"], parameters=one)
    problem, _ = build_problem(replace(cell, robots={**cell.robots, "hand": hand}), recording)
    assert list(problem.models) == ["hand"]
    assert list(problem.models["hand"].columns) == ["joint_offsets"]


@pytest.mark.parametrize(("lacking", "shown"), [(10, ", 8, 9"), (11, ", 8, 9, ...")])
def test_first_ten_excluded_samples_are_named(lacking, shown):
    """The message shows that there are more, and the finding lists all of them."""
    made = simulate(Scenario(samples=14), seed=0)
    samples = [
        replace(sample, robots={"eye": sample.robots["eye"]}) if k < lacking else sample
        for k, sample in enumerate(made.recording.samples)
    ]
    _, (finding,) = build_problem(made.cell, Recording(tuple(samples)))
    expected = (
        f"{lacking} views are not used, of sample 0, 1, 2, 3, 4, 5, 6, 7{shown}: no pose of hand in the same sample."
    )
    assert finding.message == expected
    assert finding.about == tuple(str(k) for k in range(lacking))


@pytest.mark.parametrize("shape", ["board", "none"])
def test_candidates_for_several_leds_are_left_out(shape):
    """Spots cannot be assigned to points of a target with several points, nor to one without a kind."""
    made = simulate(Scenario(samples=5, target="points" if shape == "board" else "pose"), seed=0)
    (board,) = made.cell.targets.values()
    spots = CandidateObservation("wrist", board.name, np.array([[100.0, 200.0], [300.0, 50.0]]))
    first = replace(made.recording.samples[0], observations=(spots,))
    problem, (finding,) = build_problem(made.cell, Recording((first, *made.recording.samples[1:])))
    assert [len(group) for group in problem.groups] == [4]
    assert finding.about == ("0",)
    assert finding.message.startswith("1 view is not used, of sample 0: candidates for several LEDs")


def test_only_robots_with_noise_have_stops():
    """Zero sigmas count as none. Stops are numbered across robots, with the sigmas of each."""
    made = simulate(Scenario(samples=3, robot_noise=(1e-3, 2e-3)), seed=0)
    eye, hand = made.cell.robots["eye"], made.cell.robots["hand"]
    for first, second, stops in (
        (eye, hand, ([0, 1, 2], [3, 4, 5])),
        (replace(eye, noise=np.zeros(6)), hand, ([-1] * 3, [0, 1, 2])),
        (eye, replace(hand, noise=None), ([0, 1, 2], [-1] * 3)),
    ):
        hand_noise = None if second.noise is None else 3 * second.noise
        robots = {"eye": first, "hand": replace(second, noise=hand_noise)}
        problem, _ = build_problem(replace(made.cell, robots=robots), made.recording)
        (group,) = problem.groups
        assert (sorted(group.eye.stop), sorted(group.hand.stop)) == stops
        expected = [robots[name].noise for name in problem.stops.robot]
        np.testing.assert_array_equal(problem.stops.sigma, np.reshape(expected, (-1, 6)))
        assert problem.unstated == ({"hand"} if hand_noise is None else set())
        assert problem.stop_counts == {"eye": 3, "hand": 3}
        assert sorted(group.eye.stop_number) == sorted(group.hand.stop_number) == [0, 1, 2]


def test_columns_are_consecutive():
    """A transform that is not fixed has six, an LED's mount three, and a lens four plus its terms."""
    made = simulate(Scenario(samples=4, target="led", intrinsics="free", camera_mount="fixed"), seed=0)
    problem, _ = build_problem(made.cell, made.recording)
    widths = {name: where.stop - where.start for name, where in problem.columns.items()}
    assert widths == {"eye_base_from_hand_base": 6, "hand_flange_from_board": 3, "wrist": 9}
    assert [where.start for where in problem.columns.values()] == [0, *np.cumsum([*widths.values()])[:-1]]
    still = simulate(Scenario(samples=4, base="fixed", target="pose", intrinsics="free"), seed=0)
    problem, _ = build_problem(still.cell, still.recording)
    assert problem.columns == {"eye_flange_from_wrist": slice(0, 6), "hand_flange_from_board": slice(6, 12)}
    assert problem.lenses == {}


def test_world_fixed_target_has_no_robot():
    """The flange of a board on the world is the world, without stops, joints or a base."""
    made = simulate(Scenario(samples=4, layout="eye_in_hand", robot_noise=(1e-3, 1e-3)), seed=0)
    (group,) = build_problem(made.cell, made.recording)[0].groups
    assert (group.eye.robot, group.hand.robot, group.eye.base, group.hand.base, group.hand.joints) == (
        "arm",
        *[None] * 4,
    )
    np.testing.assert_array_equal(group.hand.base_from_flange.matrix, np.broadcast_to(np.eye(4), (4, 4, 4)))
    assert group.hand.stop.tolist() == group.hand.stop_number.tolist() == [-1] * 4
    assert sorted(group.eye.stop) == sorted(group.eye.stop_number) == [0, 1, 2, 3]


def test_recorded_joints_are_unique():
    """Recorded joints are from all groups in which the robot carries something, without those of other robots."""
    first, second = np.array([[0.1, 0.2], [0.1, 0.2], [0.3, 0.2]]), np.array([[0.3, 0.2], [0.0, 1.0]])
    groups = views(end("a", joints=first), end("b", joints=first + 9)), views(end("c"), end("a", joints=second))
    np.testing.assert_array_equal(recorded_joints(problem_of(*groups), "a"), [[0.0, 1.0], [0.1, 0.2], [0.3, 0.2]])


@pytest.mark.parametrize(("held", "robot", "ends"), [
    ([], "a", (True, True)), ([], "b", (True, True)), ([], "c", (True, True)),
    (["B"], "a", (False, True)), (["B"], "b", (False, True)), (["B"], "c", (True, True)),
    (["xa"], "a", (True, False)), (["xa"], "b", (True, True)),
    (["zb"], "a", (True, True)), (["zb"], "b", (True, False)), (["zb"], "c", (True, True)),
    (["xw"], "a", (False, True)), (["xw"], "b", (True, True)), (["xw"], "c", (True, True)),
])  # fmt: skip
def test_free_ends_depend_on_connected_transforms(held, robot, ends):
    """Robots b and c are seen by the camera of a, the reference, and b by one on the world.

    Some transforms are known.
    """
    groups = [
        views(end(eye, mount=camera), end(hand, mount=target, base=base))
        for eye, hand, base, camera, target in (
            ("a", "b", "B", "xa", "zb"), ("a", "c", "C", "xa", "zc"), (None, "b", "B", "xw", "zb"),
        )
    ]  # fmt: skip
    unknowns = {k: SimpleNamespace(status="prior" if k in held else "free") for k in ("B", "C", "xa", "xw", "zb", "zc")}
    assert free_ends(problem_of(*groups, unknowns=unknowns), robot) == ends


def test_unrecorded_robot_has_no_stop():
    """An unrecorded robot has no stop with or without stated noise, and only robots with kinematics have a chain."""
    made = simulate(Scenario(samples=3), seed=0)
    cell, recording, _ = _record_some_joints(made, [True] * 3)
    for noise in (None, np.full(6, 1e-3)):
        robots = {**cell.robots, "idle": Robot("idle", noise=noise)}
        problem, _ = build_problem(replace(cell, robots=robots), recording)
        assert problem.stop_counts == {"eye": 3, "hand": 3, "idle": 0}
        assert set(problem.chains) == {"hand"}
        assert "idle" not in problem.stops.robot


@pytest.mark.parametrize("seen_as", ["chessboard", "pose"])
def test_chessboard_views_have_a_half_turn(seen_as):
    """Chessboards measured as poses have none, because they have only one reading."""
    board = simulate(Scenario(samples=3, target="chessboard"), 0).cell.targets["board"].target
    made = simulate(Scenario(samples=3, target=seen_as), 0)
    targets = {"board": replace(made.cell.targets["board"], target=board)}
    (group,) = build_problem(replace(made.cell, targets=targets), made.recording)[0].groups
    if seen_as == "pose":
        assert group.half_turn is None
        assert group.readings == ()
    else:
        np.testing.assert_array_equal(group.half_turn.matrix, half_turn(board).matrix)


@pytest.mark.parametrize("target", ["charuco", "points3d", "pose"])
def test_view_contents_are_equal_for_copies_only(target):
    """Another view, another stop, or a difference in the last bit is another content."""
    made = simulate(Scenario(samples=3, target=target), 0)
    first, second = (s.observations[0] for s in made.recording.samples[:2])
    assert view_content(first, (0, 1)) == view_content(replace(first), (0, 1))
    assert view_content(first, (0, 1)) != view_content(second, (0, 1))
    assert view_content(first, (0, 1)) != view_content(first, (0, 2))
    if target == "charuco":
        nearly = replace(first, pixels=np.nextafter(first.pixels, np.inf))
        assert view_content(first, (0, 1)) != view_content(nearly, (0, 1))


def test_many_copies_are_listed_up_to_ten():
    """The full count is reported, and there is no finding without copies."""
    assert repeated_views([]) == []
    (finding,) = repeated_views(list(range(12)))
    assert finding.code == "duplicate-samples"
    assert finding.message.startswith("12 views, of sample 0")
    (single,) = repeated_views([4])
    assert single.message.startswith("The view of sample 4 repeats that of an earlier sample")
    assert "remove them" in single.message
    assert "8, 9, ..." in finding.message
    assert "10, ..." not in finding.message
    (ten,) = repeated_views(list(range(10)))
    assert "..." not in ten.message
    assert ten.about == tuple("0123456789")


def test_view_contents_include_ids():
    """The same pixels with other ids, without ids, or of another target are another content."""
    pixels = np.array([[1.0, 2.0], [3.0, 4.0]])
    seen = PixelObservation("eye", "board", np.array([0, 1]), pixels)
    others = [
        PixelObservation("eye", "board", np.array([1, 0]), pixels),
        CandidateObservation("eye", "board", pixels),
        PixelObservation("eye", "other", np.array([0, 1]), pixels),
        PixelObservation("ear", "board", np.array([0, 1]), pixels),
    ]
    assert len({view_content(each, (0, 1)) for each in (seen, *others)}) == 5
    points = np.ones((2, 3))
    one, two = (PointObservation("eye", "board", np.array(ids), points) for ids in ([0, 1], [1, 0]))
    assert view_content(one, (0,)) != view_content(two, (0,))
    assert view_content(CandidateObservation("eye", "board", pixels), ()) == view_content(others[1], ())
