"""Tests of `Reading`: it changes the problem as packing the rewritten recording would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.shared import rewriting
from tests.shared.declared import declared

from basecal.accuracy.readings.reading import Track
from basecal.cell import Unknown
from basecal.estimation.problem.build import build_problem
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

NOISY = {"robot_noise": (1e-4, 2e-4), "state_robot_noise": True}
MADE = {
    "board": simulate(Scenario(samples=12), 1),
    "noise": simulate(Scenario(samples=12, arms="halves", **NOISY), 1),
    "poses": simulate(Scenario(samples=12, target="pose"), 1),
    "points": simulate(Scenario(samples=12, target="points3d"), 1),
    "joints": simulate(Scenario(samples=12, joints=True), 1),
    "one arm": simulate(Scenario(samples=12, layout="eye_in_hand"), 1),
}


def drop_states(recording):
    """The recording with a sample without a view, and one without the hand and a view."""
    samples = list(recording.samples)
    without = {name: state for name, state in samples[3].robots.items() if name != "hand"}
    samples[3] = replace(samples[3], robots=without, observations=())
    samples[8] = replace(samples[8], observations=())
    return replace(recording, samples=tuple(samples))


def observed_values(group):
    of = group.measurement
    if isinstance(of, PixelMeasurement):
        return of.pixels, of.points_in_target
    return (of.points_in_camera, of.points_in_target) if isinstance(of, PointMeasurement) else (
        of.measured_camera_from_target.matrix,
    )  # fmt: skip


def stop_equality(stands):
    """Matrix of the samples that share a stop, independent of its number."""
    return np.equal.outer(stands, stands)


def assert_same(reading, cell, recording):
    """Asserts that the changed problem equals the newly packed one."""
    packed, _ = build_problem(cell, recording)
    moved = reading.problem
    assert len(moved.groups) == len(packed.groups)
    for one, other in zip(moved.groups, packed.groups, strict=True):
        order = np.argsort(one.sample, kind="stable")
        one = one.take(order)
        other = other.take(np.argsort(other.sample, kind="stable"))
        np.testing.assert_array_equal(one.sample, other.sample)
        for mine, theirs in zip(one.ends, other.ends, strict=True):
            np.testing.assert_allclose(mine.base_from_flange.matrix, theirs.base_from_flange.matrix, atol=1e-12)
            np.testing.assert_array_equal(stop_equality(mine.stop_number), stop_equality(theirs.stop_number))
            np.testing.assert_array_equal(stop_equality(mine.stop), stop_equality(theirs.stop))
            np.testing.assert_array_equal(np.minimum(mine.stop, 0), np.minimum(theirs.stop, 0))
            np.testing.assert_array_equal(np.minimum(mine.stop_number, 0), np.minimum(theirs.stop_number, 0))
            sigmas = [of.stops.sigma[end.stop[end.stop >= 0]] for of, end in ((moved, mine), (packed, theirs))]
            np.testing.assert_array_equal(*sigmas)
            assert (mine.robot, mine.base, mine.mount) == (theirs.robot, theirs.base, theirs.mount)
            assert (mine.joints is None) == (theirs.joints is None)
            if mine.joints is not None:
                np.testing.assert_array_equal(mine.joints, theirs.joints)
        for mine, theirs in zip(observed_values(one), observed_values(other), strict=True):
            np.testing.assert_allclose(mine, theirs, atol=1e-12)
    assert moved.columns == packed.columns


@pytest.mark.parametrize("kind", ["board", "noise", "poses", "joints"])
@pytest.mark.parametrize("stream", [None, "eye", "hand"])
@pytest.mark.parametrize("whole", [True, False])
def test_streams_are_paired_again(kind, stream, whole):
    """Streams are shifted in both directions, from the first sample and a later one, and reversed."""
    made = MADE[kind]
    recording = made.recording if whole else drop_states(made.recording)
    given = declared(made.cell, recording)
    for by in (1, -1, 2, -3):
        for start in (0, 5):
            shifted = rewriting.shifted(recording, stream, by, start)
            reading = given.shift(stream, by, start)
            assert_same(reading, made.cell, shifted)
            assert reading.order.tolist() == [sample.sample for sample in shifted.samples]
    assert_same(
        given.pair_stream(stream, np.arange(len(given.order))[::-1]),
        made.cell,
        rewriting.turned_round(recording, stream),
    )


@pytest.mark.parametrize("kind", ["board", "noise", "poses"])
def test_robot_poses_are_mapped_and_exchanged(kind):
    """Poses of one robot or both are mapped, and exchanged with the noise of the name."""
    made = MADE[kind]
    for recording in (made.recording, drop_states(made.recording)):
        given = declared(made.cell, recording)
        for robots in (("eye",), ("eye", "hand")):
            wrong = rewriting.with_robots(recording, dict.fromkeys(robots, rewriting.inverted))
            assert_same(given.with_poses(robots, SE3.inverse), made.cell, wrong)
        assert_same(given.exchange("eye", "hand"), made.cell, rewriting.exchanged(recording, "eye", "hand"))


def test_states_of_some_samples_are_exchanged():
    """States are exchanged in half of the samples, and at the poses of rest in the other half."""
    made = MADE["noise"]
    given, samples = declared(made.cell, made.recording), made.recording.samples
    first, second = given.order[:6], given.order[6:]
    swapped = rewriting.exchanged(made.recording, "eye", "hand").samples
    wrong = replace(made.recording, samples=(*samples[:6], *swapped[6:]))
    assert_same(given.exchange_states({"eye": second, "hand": second}), made.cell, wrong)
    still = (
        ("eye", "hand") if given.tracks["eye"].stop_number[0] == given.tracks["eye"].stop_number[5] else ("hand", "eye")
    )
    places = {still[0]: samples[0].robots[still[0]], still[1]: samples[6].robots[still[1]]}
    moved = [
        replace(each, robots={**each.robots, still[k // 6]: places[still[1 - k // 6]]})
        for k, each in enumerate(samples)
    ]
    wrong = replace(made.recording, samples=tuple(moved))
    assert_same(given.exchange_states({still[0]: first, still[1]: second}), made.cell, wrong)


def test_joints_are_scaled_and_exchanged():
    """Scaled and exchanged joints change the poses by the kinematics of the named robot."""
    made = MADE["joints"]
    given = declared(made.cell, made.recording)
    assert_same(given.with_joints(("hand",), 0.5), made.cell, rewriting.with_joints(made.recording, "hand", 0.5))
    assert_same(given.exchange("eye", "hand"), made.cell, rewriting.exchanged(made.recording, "eye", "hand"))
    assert (given.pose_robots, given.joint_robots) == ([], ["eye", "hand"])


def test_observations_are_mapped_by_kind():
    """Poses, points in space and pixels are each mapped; other kinds are unchanged."""
    for kind, made in MADE.items():
        given = declared(made.cell, made.recording)
        poses = rewriting.with_targets(made.recording, rewriting.inverted) if kind == "poses" else made.recording
        assert_same(given.with_target_poses(SE3.inverse), made.cell, poses)
        assert_same(given.with_target_poses(SE3.inverse, "another"), made.cell, made.recording)
        assert_same(given.with_points(-2.0), made.cell, rewriting.with_points(made.recording, -2.0))
        swapped = rewriting.with_pixels(made.recording, lambda pixels: pixels[:, ::-1])
        assert_same(given.with_pixels_exchanged(), made.cell, swapped)


@pytest.mark.parametrize("kind", ["board", "points"])
def test_targets_are_resized(kind):
    """A target is resized in the cell and in the observations."""
    made = MADE[kind]
    reading = declared(made.cell, made.recording).resize({"board": 3.0})
    cell = rewriting.resized(made.cell, {"board": 3.0})
    np.testing.assert_array_equal(reading.cell.targets["board"].target.points, cell.targets["board"].target.points)
    assert_same(reading, cell, made.recording)


def test_resized_grid_rotates_about_its_centre():
    """A resized grid has its half turn and all its views in the new size."""
    made = simulate(Scenario(samples=4, target="chessboard"), 1)
    reading = declared(made.cell, made.recording).resize({"board": 3.0})
    (group,) = reading.problem.groups
    (other,) = build_problem(rewriting.resized(made.cell, {"board": 3.0}), made.recording)[0].groups
    np.testing.assert_allclose(group.half_turn.matrix, other.half_turn.matrix)
    for one, two in zip(group.readings, other.readings, strict=True):
        np.testing.assert_array_equal(one.points_in_target, two.points_in_target)


@pytest.mark.parametrize("kind", ["board", "noise", "joints", "one arm"])
@pytest.mark.parametrize("most", [5, 12, 40])
def test_samples_are_thinned_evenly(kind, most):
    """Samples are thinned evenly to the given number, with the first and the last."""
    made = MADE[kind]
    reading = declared(made.cell, made.recording).thin(most)
    rows = np.unique(np.linspace(0, 11, min(most, 12)).round().astype(int))
    few = replace(made.recording, samples=tuple(made.recording.samples[k] for k in rows))
    assert reading.order.tolist() == rows.tolist()
    assert_same(reading, made.cell, few)
    for robot, track in reading.tracks.items():
        assert reading.problem.stop_counts[robot] == len(np.unique(track.stop_number))


def test_samples_are_sorted_by_time():
    """Samples are sorted by time, whatever their numbers."""
    made = MADE["board"]
    samples = tuple(replace(s, stamp_s=100.0 - s.sample) for s in made.recording.samples)
    assert declared(made.cell, replace(made.recording, samples=samples)).order.tolist() == list(range(11, -1, -1))


def test_other_statuses_have_other_columns():
    """A cell with other statuses changes the columns as packing it would."""
    known = simulate(Scenario(samples=6, base="fixed", camera_mount="fixed"), 1)
    free = simulate(Scenario(samples=6), 1).cell
    reading = declared(known.cell, known.recording).restate(free)
    assert reading.cell is free
    assert_same(reading, free, known.recording)
    assert reading.problem.columns.keys() > declared(known.cell, known.recording).problem.columns.keys()


def test_moving_robots_have_several_stops():
    """Robots with more than one stop move; with a single sample none does."""
    still = simulate(Scenario(samples=4, arms="eye_still"), 0)
    assert {n: t.moves for n, t in declared(still.cell, still.recording).tracks.items()} == {
        "eye": False, "hand": True,
    }  # fmt: skip
    given = declared(MADE["board"].cell, MADE["board"].recording)
    assert not any(track.moves for track in given.take(np.array([4])).tracks.values())


def track(stand, joints=None):
    """States at these stops; -1 for none. Each pose is as far along x as its sample number."""
    stand = np.array(stand)
    at = np.zeros((len(stand), 3))
    at[:, 0] = np.arange(len(stand))
    return Track(stand >= 0, SE3(np.tile(np.eye(3), (len(stand), 1, 1)), at), joints, stand, joints is None)


def test_track_rows_are_states():
    """Rows of a track are its states; row -1 is a sample without a state."""
    joints = np.arange(8.0).reshape(4, 2)
    found = track([0, 0, -1, 1], joints).take(np.array([3, -1, 2, 0]))
    assert found.seen.tolist() == [True, False, False, True]
    assert found.stop_number.tolist() == [1, -1, -1, 0]
    np.testing.assert_array_equal(found.pose.translation[[0, 3], 0], [3, 0])
    np.testing.assert_array_equal(found.joints[[0, 3]], joints[[3, 0]])
    assert (found.joint_count, track([0]).joint_count) == (2, 0)


def test_states_of_other_track_have_own_stops():
    """States of another track have their own stops and are repeated if fewer; joints are kept if both have them."""
    joints = np.arange(8.0).reshape(4, 2)
    own, other = track([0, 1, 1, 2], joints), track([-1, 0, 0, 1], 10 + joints)
    found = own.with_states(np.array([0, 2, 3]), other, np.array([1, 0]))
    assert found.seen.tolist() == [True, True, False, True]
    assert found.stop_number.tolist() == [3, 1, -1, 3]
    np.testing.assert_array_equal(found.pose.translation[:, 0], [1, 1, 0, 1])
    np.testing.assert_array_equal(found.joints, [[12, 13], [2, 3], [10, 11], [12, 13]])
    assert found.has_only_poses is own.has_only_poses
    assert own.with_states(np.array([0]), track([0]), np.array([0])).joints is None
    assert track([0]).with_states(np.array([0]), other, np.array([1])).joints is None


@pytest.mark.parametrize("carrier", ["world", "hand"])
def test_target_on_other_carrier_has_free_mount(carrier):
    """A target on another carrier has a free mount, whatever its former mount was."""
    made = simulate(Scenario(samples=4, target_mount="fixed", **NOISY), 1)
    given = declared(made.cell, made.recording)
    cell = replace(made.cell, targets={"board": replace(made.cell.targets["board"], on=carrier, mount=Unknown())})
    assert_same(given.with_carrier("board", carrier), cell, made.recording)


def test_robot_without_states_has_no_stops():
    """A robot without states has no stops, no kind, and does not move."""
    made = MADE["one arm"]
    (arm,) = made.cell.robots
    cell = replace(made.cell, robots={**made.cell.robots, "idle": replace(made.cell.robots[arm], name="idle")})
    reading = declared(cell, made.recording)
    idle = reading.tracks["idle"]
    assert not idle.seen.any()
    assert (idle.stop_number == -1).all()
    assert not idle.moves
    assert (reading.pose_robots, reading.joint_robots) == ([arm], [])
    hand = declared(MADE["board"].cell, drop_states(MADE["board"].recording)).tracks["hand"]
    assert hand.seen.tolist() == [k != 3 for k in range(12)]
    assert np.flatnonzero(hand.stop_number == -1).tolist() == [3]


@pytest.mark.parametrize("whole", [True, False])
def test_noise_stops_are_recorded_stops(whole):
    """Each robot has as many stops with noise as recorded stops, in the order of the robots."""
    made = MADE["noise"]
    recording = made.recording if whole else drop_states(made.recording)
    reading = declared(made.cell, recording)
    moved, packed = reading.exchange("eye", "hand"), build_problem(made.cell, recording)[0]
    assert sorted(reading.with_poses(("eye",), SE3.inverse).problem.stops.robot) == sorted(packed.stops.robot)
    counts = {name: len(np.unique(each.stop_number[each.seen])) for name, each in moved.tracks.items()}
    assert {name: moved.problem.stops.robot.count(name) for name in counts} == counts
