"""Tests of motions of a recording: their types, and the directions that they leave unobservable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.ends import with_eye, with_hand
from tests.motion_cells import (
    AXIS,
    GENERAL,
    ONE_AXIS,
    PLANAR,
    SCARA,
    SHIFTS,
    Move,
    recorded,
    recorded_arm,
    still,
    turned,
    wobbling,
)
from tests.pose_problem import MOUNT, TARGET, pose_problem, two_arm_problem

from basecal.cell import Unknown
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.observability.motions import (
    STILL_RAD,
    _indistinct_twists,
    _least_motion,
    gauge_partners,
    motions,
    null_directions,
)
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.gauges import LEAST_RMS_RAD, MOVE_SCALE
from basecal.estimation.problem.problem import State, Stops
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

# Unobservable twists of each type of motion: about one line, the shift along it and the rotation about it.
FEW = Scenario(samples=15)
LEFT_OPEN = {"general": 0, "one line": 2, "planar": 1, "one axis": 1, "shifts": 3, "still": 6}
MOVES: dict[str, Move] = {
    "general": GENERAL,
    "one line": ONE_AXIS,
    "planar": PLANAR,
    "one axis": SCARA,
    "shifts": SHIFTS,
    "still": still,
}


def problem_of_move(hand: Move, scenario: Scenario = FEW):
    made = recorded(scenario, 1, hand=hand)
    problem, _ = build_problem(made.cell, made.recording)
    return problem, State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)))


@pytest.mark.parametrize("kind", MOVES)
def test_unobservable_twists_of_each_motion(kind):
    """Each type leaves as many twists as geometry predicts, and a thousandth of wobble is not enough to change that."""
    for move in (MOVES[kind], wobbling(MOVES[kind], 5e-4)):
        problem, _ = problem_of_move(move)
        assert len(motions(problem)["hand"].twists_in_base) == LEFT_OPEN[kind]


def test_axis_and_extent_of_motions():
    """The axis is the rotation axis in the base, with zero rotation about others.

    Still and translating arms are distinguished.
    """
    hand = {kind: motions(problem_of_move(move)[0])["hand"] for kind, move in MOVES.items()}
    assert abs(hand["planar"].axes_in_base[:, 0] @ AXIS) == pytest.approx(1.0, abs=1e-9)
    assert hand["planar"].turn_rad[0] > 0.5
    assert hand["planar"].turn_rad[1] < 1e-9
    assert [kind for kind in MOVES if hand[kind].is_still] == ["still"]
    assert [kind for kind in MOVES if hand[kind].is_translation_only] == ["shifts", "still"]
    assert [kind for kind in MOVES if hand[kind].turn_rad[1] < STILL_RAD < hand[kind].turn_rad[0]] == [
        "one line",
        "planar",
        "one axis",
    ]
    assert (hand["still"].orientations, hand["general"].orientations) == (1, 3)


@pytest.mark.parametrize("robot", ["eye", "hand"])
@pytest.mark.parametrize("target", ["charuco", "led"])
@pytest.mark.parametrize("kind", ["one line", "planar", "shifts", "still"])
def test_null_directions_have_no_information(kind, target, robot):
    """Null directions have zero exact information beside a random direction, for eye and hand."""
    scenario = Scenario(samples=15, target=target)
    made = recorded(scenario, 1, **{robot: MOVES[kind]})
    problem, _ = build_problem(made.cell, made.recording)
    state = State(made.truth, made.cameras, np.zeros((0, 6)))
    loose = null_directions(problem, state)
    assert loose.shape[1] == LEFT_OPEN[kind]
    hessian = linearise(problem, state).hessian
    along = np.diag(loose.T @ hessian @ loose) / np.sum(loose**2, axis=0)
    assert np.all(along < 1e-9 * np.trace(hessian))


def test_fixed_or_known_transforms_are_not_free():
    """With a fixed target mount a still hand leaves nothing unobservable.

    With a prior it does, but no gauge partner is named.
    """
    for status, count, names in (("fixed", 0, 0), ("prior", 6, 0), ("free", 6, 2)):
        problem, state = problem_of_move(still, Scenario(samples=15, target_mount=status))
        assert null_directions(problem, state).shape[1] == count
        assert len(gauge_partners(problem, motions(problem)["hand"])) == names


def test_motion_within_the_stated_noise_does_not_count():
    """Rotations of 4 mrad about a second axis count for a robot of 0.1 mrad noise, but not for one of 2 mrad."""
    move = turned(0.9, 0.12, [AXIS])
    for noise, count in ((1e-4, 0), (2e-3, 1)):
        made = recorded(Scenario(samples=40), 1, hand=wobbling(move, 4e-3))
        robots = {n: replace(r, noise=np.full(6, noise)) for n, r in made.cell.robots.items()}
        problem, _ = build_problem(replace(made.cell, robots=robots), made.recording)
        assert len(motions(problem)["hand"].twists_in_base) == count


@pytest.mark.parametrize(("axes", "count"), [("zzz", 1), ("yyy", 1), ("zyyy", 0), ("zyyyx", 0), ("zyyz", 0)])
def test_unobservable_twists_of_arms_with_few_joints(axes, count):
    """Parallel joints leave the shift along them. Four or five joints with two axis directions leave nothing."""
    made = recorded_arm(Scenario(samples=15), 0, axes, 0.3)
    problem, _ = build_problem(made.cell, made.recording)
    assert len(motions(problem)["hand"].twists_in_base) == count


@pytest.mark.parametrize("kind", [kind for kind, count in LEFT_OPEN.items() if count])
def test_unobservable_twists_are_constant_in_the_flange(kind):
    """Twists of the base, transformed to the flange by each pose, are equal for all poses."""
    problem, _ = problem_of_move(MOVES[kind])
    (group,) = problem.groups
    for twist in motions(problem)["hand"].twists_in_base:
        carried = group.hand.base_from_flange.inverse().adjoint() @ twist
        np.testing.assert_allclose(carried, np.tile(carried[0], (len(carried), 1)), atol=1e-6)


def test_each_robot_has_its_own_samples_and_poses():
    """For two cameras on a robot each, travel, rotations and samples are those of its own views."""
    made = simulate(Scenario(samples=20, layout="two_cameras"), 1)
    problem, _ = build_problem(made.cell, made.recording)
    found = motions(problem)
    robots = {group.eye.robot for group in problem.groups}
    assert set(found) == robots
    assert len(robots) == 2
    first, second = problem.groups
    fewer = problem.with_groups([first.take(np.arange(7)), second])
    for group, count in zip(fewer.groups, (7, len(second)), strict=True):
        motion, poses = motions(fewer)[group.eye.robot], group.eye.base_from_flange
        assert motion.samples == count
        away = np.linalg.norm(poses.translation - poses[0].translation, axis=-1)
        assert motion.travel_m == pytest.approx(away.max())
        turns = Rotation.from_matrix(poses.rotation @ poses[0].rotation.T).as_rotvec()
        np.testing.assert_allclose(motion.turn_rad, np.abs(turns @ motion.axes_in_base).max(0), atol=1e-9)
        assert list(motion.turn_rad) == sorted(motion.turn_rad, reverse=True)


@pytest.mark.parametrize(("turn_rad", "travel_m", "kind"), [
    (0.0099, 9.9e-4, "still"), (0.0101, 9.9e-4, "turns"), (0.0099, 1.01e-3, "shifts"),
])  # fmt: skip
def test_motion_limits_are_ten_milliradians_and_one_millimetre(turn_rad, travel_m, kind):
    """A motion below 0.01 rad and 1 mm counts as still, and below 0.01 rad alone as pure translation."""
    problem, _ = problem_of_move(still)
    (group,) = problem.groups
    away = np.where((np.arange(len(group)) == 4)[:, None], [travel_m, 0, 0, 0, 0, turn_rad], 0.0)
    at = group.hand.base_from_flange[0]
    poses = SE3.from_rotvec(away[:, 3:], np.zeros((len(group), 3)))
    moved = SE3(poses.rotation @ at.rotation, at.translation + away[:, :3])
    hand = motions(problem.with_groups([with_hand(group, base_from_flange=moved)]))["hand"]
    assert (hand.is_still, hand.is_translation_only) == (kind == "still", kind != "turns")
    assert hand.orientations == (2 if kind == "turns" else 1)


def problem_of_poses(rotvecs, translations, hand_poses=None):
    """A problem with one view for each pose of the eye, and of the hand."""
    poses = SE3.from_rotvec(np.array(rotvecs, dtype=float), np.array(translations, dtype=float))
    problem, _ = two_arm_problem(np.zeros((len(poses), 6)), np.arange(len(poses)), len(poses) + np.arange(len(poses)))
    (group,) = problem.groups
    moved = with_hand(with_eye(group, base_from_flange=poses), base_from_flange=hand_poses or SE3.identity(poses.shape))
    return replace(problem.with_groups([moved]), stops=Stops(np.zeros((0, 6))))


@pytest.mark.parametrize(("travel", "turn"), [(0.9e-3, 9e-3), (1.1e-3, 9e-3), (0.9e-3, 11e-3), (1.1e-3, 11e-3)])
def test_negligible_motion_is_still(travel, turn):
    """A robot is still below 1 mm and 0.01 rad from its first pose. Below the latter it only translates."""
    found = motions(problem_of_poses([[0, 0, 0.3], [0, 0, 0.3 + turn]], [[1, 2, 3], [1, 2 - travel, 3]]))["eye"]
    assert found.travel_m == pytest.approx(travel)
    np.testing.assert_allclose(found.turn_rad, [turn, 0.0, 0.0], atol=1e-9)
    assert found.is_translation_only == (turn < 0.01)
    assert found.is_still == (turn < 0.01 and travel < 1e-3)


def test_rotations_are_about_axes_of_the_base():
    """The largest rotation since the first pose comes first, and travel is to the farthest pose.

    Robots and samples are separate.
    """
    problem = problem_of_poses(
        [[0, 0, 0], [0, 0, 0.02], [0.3, 0, 0], [0, 0.1, 0]], [[0, 0, 0], [0.3, 0.4, 0], [0, 0, 0.1], [0.1, 0, 0]]
    )
    (group,) = problem.groups
    twice = replace(group, sample=np.array([4, 4, 5, 6]))
    alone = with_hand(replace(twice.take(np.array([0])), sample=np.array([9])), robot=None)
    found = motions(problem.with_groups([twice, alone]))
    assert list(found) == ["eye", "hand"]
    eye, hand = found["eye"], found["hand"]
    np.testing.assert_allclose(eye.turn_rad, [0.3, 0.1, 0.02], atol=1e-9)
    np.testing.assert_allclose(np.abs(eye.axes_in_base), np.eye(3)[:, [0, 1, 2]], atol=1e-9)
    assert eye.travel_m == pytest.approx(0.5)
    assert (eye.robot, eye.samples, eye.orientations) == ("eye", 4, 3)
    assert (hand.robot, hand.samples, hand.orientations, hand.is_still) == ("hand", 3, 1, True)
    assert (len(eye.twists_in_base), len(hand.twists_in_base)) == (0, 6)


@pytest.mark.parametrize(
    ("about_z", "count"),
    [([0, 0.009], 1), ([0, 0.011], 2), ([0, 0.2, 0.204, 0.2], 2), ([0, 0.1, 0.2], 3), ([0, 1, 2, 3], 3)],
)
def test_orientations_are_counted_up_to_three(about_z, count):
    """An orientation counts if it is at least 0.01 rad from all counted before."""
    found = motions(problem_of_poses([[0, 0, angle] for angle in about_z], np.zeros((len(about_z), 3))))["eye"]
    assert found.orientations == count


@pytest.mark.parametrize(("over", "alike"), [(0.9, 0), (1.1, 6)])
def test_twists_differ_by_more_than_noise(over, alike):
    """With shifts of +-d, a rotation changes by 2 d per radian at half a metre.

    Six twists remain if that is within noise.
    """
    poses = SE3.from_rotvec(np.zeros((6, 3)), np.outer([1, -1] * 3, [0.01, 0, 0]))
    at_base, at_flange = _indistinct_twists(poses, over * 0.01 / MOVE_SCALE[0])
    assert len(at_base) == len(at_flange) == max(alike, 4)
    np.testing.assert_allclose(at_flange, at_base, atol=1e-12)


def test_motion_counts_from_five_sigmas_of_robot_noise():
    """The limit is five of the largest sigmas, with half a metre as a radian, or three thousandths if that is more."""
    problem, _ = pose_problem(np.zeros((2, 6)), None, stop_sigma=np.ones(6))
    sigma = np.array([[2e-3, 1e-3, 0, 0, 1e-3, 0], [9, 9, 9, 9, 9, 9], [0, 0, 0, 2e-3, 3e-3, 1e-3], [1e-5] * 6])
    noisy = replace(problem, stops=Stops(sigma, ("a", "a", "b", "c")))
    found = _least_motion(noisy)
    assert found == {"a": pytest.approx(5 * 2e-3 / MOVE_SCALE[0]), "b": pytest.approx(5 * 3e-3), "c": LEAST_RMS_RAD}


def test_general_motion_has_no_null_directions():
    """The result has as many rows as unknowns and no column. Transforms with prior knowledge have no gauge partners."""
    problem = problem_of_poses([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0]], np.zeros((4, 3)), SE3.exp(np.eye(6)[:4]))
    state = State({MOUNT: SE3.identity(), TARGET: SE3.identity()}, {}, np.zeros((0, 6)))
    assert null_directions(problem, state).shape == (6, 0)
    still = problem_of_poses(np.zeros((3, 3)), np.zeros((3, 3)))
    free = replace(still, unknowns={MOUNT: Unknown(), TARGET: Unknown()}, reference="none")
    of_eye = motions(still)["eye"]
    assert gauge_partners(free, of_eye) == (MOUNT,)
    assert gauge_partners(replace(free, unknowns={MOUNT: Unknown("prior", SE3.identity(), np.ones(6))}), of_eye) == ()
    assert gauge_partners(free, motions(problem)["eye"]) == ()
