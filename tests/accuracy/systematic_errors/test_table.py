"""The rows of the table move views as the errors they stand for do."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.accuracy.systematic_errors.test_search import on_a_path

from basecal.accuracy.systematic_errors.situation import Situation
from basecal.accuracy.systematic_errors.table import (
    TABLE,
    clock_drifts,
    clock_offsets,
    drifts,
    joint_offsets,
    length_scales,
    sag,
    steps,
    yielding_joints,
)
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def truth(made, problem):
    """The true state: what moves views is told of any."""
    return State(made.truth, made.cameras, np.zeros((len(problem.stops), 6)), made.robots)


@pytest.fixture(scope="module")
def of():
    made = simulate(Scenario(samples=12), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = truth(made, problem)
    return Situation(problem, state, problem, {k: float(k) for k in range(12)})


def moved_by_pose(of, robot, pose):
    """Tangents of the view where a robot's recorded poses are others, (n, 6)."""
    change = (of.recorded_pose(0, robot).inverse() @ pose).log()
    return (of.by_flange(0, robot) @ change[..., None])[..., 0]


def row(of, make, about):
    (found,) = [c for c in make(of) if c.about == (about,)]
    assert found.sizes == (1 if make is length_scales else 6)
    return found.moves[0][:, 0]


@pytest.mark.parametrize("robot", ["eye", "hand"])
def test_longer_poses(of, robot):
    """One unit of a robot's length scale makes its poses twice as long, to first order."""
    pose = of.recorded_pose(0, robot)
    longer = SE3(pose.rotation, (1 + 1e-6) * pose.translation)
    np.testing.assert_allclose(
        1e-6 * row(of, length_scales, robot)[..., 0], moved_by_pose(of, robot, longer), atol=1e-11
    )


def test_a_larger_target_is_seen_nearer(of):
    """One millionth that a target is larger than stated takes one of its distance from the camera; nothing turns."""
    at = of.state.camera_from_target(of.problem.groups[0], of.problem.stops)
    nearer = SE3(at.rotation, (1 - 1e-6) * at.translation)
    np.testing.assert_allclose(
        1e-6 * row(of, length_scales, "board")[..., 0], (at.inverse() @ nearer).log(), atol=1e-12
    )


@pytest.fixture(scope="module")
def of_light():
    made = simulate(Scenario(samples=8, target="led"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    return Situation(problem, truth(made, problem), problem, {k: float(k) for k in range(8)})


def test_a_light_has_no_size(of_light):
    assert {about for c in length_scales(of_light) for about in c.about} == {"eye", "hand"}


def test_joint_offsets():
    """One unit of a joint's offset moves the view as the flange of an arm whose joint stands elsewhere."""
    made = simulate(Scenario(samples=6, joints=True), 0)
    problem, _ = build_problem(made.cell, made.recording)
    of = Situation(problem, truth(made, problem), problem, {k: float(k) for k in range(6)})
    every = list(joint_offsets(of))
    assert [(candidates.code, candidates.about[0]) for candidates in every] == [
        (code, robot) for robot in ("eye", "hand") for code in ("joint-offset", "joint-offsets")
    ]
    found = {candidates.about[0]: candidates for candidates in every[::2]}
    for alone, together in zip(every[::2], every[1::2], strict=True):
        np.testing.assert_array_equal(together.moves[0][:, 0], np.moveaxis(alone.moves[0][..., 0], 1, 2))
    assert found.keys() == {"eye", "hand"}
    (group,) = problem.groups
    for robot, joints in (("eye", group.eye_joints), ("hand", group.hand_joints)):
        assert found[robot].joint == tuple(range(6))
        for joint in range(6):
            moved = problem.chains[robot].forward(joints + 1e-6 * np.eye(6)[joint])
            expected = moved_by_pose(of, robot, moved)
            np.testing.assert_allclose(1e-6 * found[robot].moves[0][:, joint, :, 0], expected, atol=1e-11)


def test_offsets_that_are_estimated_or_have_no_joints_are_not_tested(of):
    """Neither robots given by poses nor those whose offsets are unknowns already."""
    assert list(joint_offsets(of)) == []
    made = simulate(Scenario(samples=12, joints=True, joint_offset_rad=1e-3, joint_offsets="prior"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = truth(made, problem)
    assert list(joint_offsets(Situation(problem, state, problem, {}))) == []


def test_joints_yield_to_their_torques():
    """A unit of each compliance moves the view as a joint that turns by its torque; one for all is their sum."""
    made = simulate(Scenario(samples=6, joints=True), 0)
    problem, _ = build_problem(made.cell, made.recording)
    of = Situation(problem, truth(made, problem), problem, {k: float(k) for k in range(6)})
    alike, each = (c.moves[0][:, 0] for c in yielding_joints(of) if c.about == ("hand",))
    kinematics = Kinematics(problem.chains["hand"], {"deflection": 1e-8 * np.arange(1.0, 7.0)})
    moved = kinematics.forward(problem.groups[0].hand_joints)
    np.testing.assert_allclose(1e-8 * each @ np.arange(1.0, 7.0), moved_by_pose(of, "hand", moved), atol=1e-10)
    np.testing.assert_allclose(alike[..., 0], each.sum(-1))


def test_compliances_that_are_estimated_or_of_no_masses_are_not_tested(of):
    """Nor those of robots given by poses."""
    assert list(yielding_joints(of)) == []
    made = simulate(Scenario(samples=12, joints=True, compliance=1e-5, deflection="prior"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    state = truth(made, problem)
    assert list(yielding_joints(Situation(problem, state, problem, {}))) == []
    light = {name: replace(chain, masses=None) for name, chain in problem.chains.items()}
    light_arms = replace(problem, chains=light, models={})
    assert list(yielding_joints(Situation(light_arms, state, light_arms, {}))) == []


def test_sag_turns_about_the_base(of):
    """One unit down turns the arm about its base by reach x down, along the base's axis or anywhere."""
    pose = of.recorded_pose(0, "hand")
    down = np.array([0.3, -0.2, -1.0])
    turn = np.concatenate([np.zeros((12, 3)), 1e-6 * np.cross(pose.translation, down)], -1)
    along, anywhere = (c.moves[0][:, 0] for c in sag(of) if c.about == ("hand",))
    np.testing.assert_allclose(1e-6 * anywhere @ down, moved_by_pose(of, "hand", SE3.exp(turn) @ pose), atol=1e-10)
    np.testing.assert_array_equal(along, anywhere[..., 2:])


def test_steps_and_drifts_in_time(of):
    """A step moves nothing before its sample and all after; a drift the last sample as a step does, the first not."""
    for name in of.frames:
        frame = of.by_frame(0, name)
        candidates = next(c for c in steps(of) if c.about[0] == name)
        for b, since in enumerate(candidates.since):
            np.testing.assert_allclose(candidates.moves[0][:since, b], 0)
            np.testing.assert_allclose(candidates.moves[0][since:, b], frame[since:])
        np.testing.assert_allclose(row(of, drifts, name)[[0, -1]], frame[[0, -1]] * np.array([0, 1])[:, None, None])


def test_every_row_has_moves_for_all_views(of):
    """Of each kind (n, b, 6, q), as many as are named."""
    for make in TABLE:
        for kind in make(of):
            assert kind.moves[0].shape[:3] == (12, len(kind.about), 6)
            assert len(kind.since) == len(kind.about)


def test_a_clock_that_drifts_is_right_in_the_middle():
    """Half of a clock's offset at the last sample, and less than none at the first; of stamps that say when."""
    made = simulate(Scenario(samples=1, layout="eye_to_hand", target="pose"), 0)
    cell, recording = on_a_path(0.0)
    problem, _ = build_problem(cell, recording)
    of = Situation(
        problem,
        State(made.truth, made.cameras, np.zeros((0, 6))),
        problem,
        {s.sample: s.stamp_s for s in recording.samples},
    )
    (offset,), (drift,) = clock_offsets(of), clock_drifts(of)
    share = np.linspace(-0.5, 0.5, 50)[of.rank(problem.groups[0])]
    np.testing.assert_allclose(drift.moves[0], share[:, None, None, None] * offset.moves[0], atol=1e-12)
    assert not list(clock_drifts(Situation(problem, of.state, problem, {})))


FRAMES = {"eye_base": None, "hand_base": "base", "camera_mount": "camera", "target_mount": "target"}


class Made:
    """Situations of so many samples in a row, whose frames and flanges move views by random matrices."""

    def __init__(self, count, *groups, **changed):
        """Of groups by what differs from a hand's views of a target."""
        rng = np.random.default_rng(0)
        usual = {"camera": "wrist", "target": "board", "eye": None, "hand": "hand", "sample": np.arange(count)} | FRAMES
        self.groups = [SimpleNamespace(**usual | group) for group in groups or ({},)]
        self.problem = SimpleNamespace(groups=self.groups, point_mounts=frozenset(), lenses={}, chains={})
        self.recorded = SimpleNamespace(open_clocks=())
        self.samples, self.times, self.timed = 10 * np.arange(count), np.arange(count, dtype=float), True
        self.robots, self.frames, self.speeds = ("hand",), ("base",), {"hand": rng.standard_normal((count, 6))}
        self.moves = rng.standard_normal((len(self.groups), 2, count, 6, 6))
        vars(self).update(changed)

    def rank(self, group):
        """Where samples stand."""
        return group.sample

    def by_frame(self, k, name):
        """How views go with a frame."""
        return self.moves[k, 0][: len(self.groups[k].sample)]

    def by_flange(self, k, robot):
        """How views go with a flange, the eye's turned round."""
        return (-1 if robot == "eye" else 1) * self.moves[k, 1][: len(self.groups[k].sample)]

    def velocity(self, robot):
        """Of those on a path."""
        return self.speeds.get(robot)


@pytest.mark.parametrize(("count", "since"), [(5, []), (6, [30]), (7, [30, 40]), (10, [30, 40, 50, 60, 70])])
def test_steps_leave_three_samples_on_either_side(count, since):
    """Each is told by the number of its first sample."""
    found = list(steps(Made(count)))
    assert [list(each.since) for each in found] == ([since] if since else [])
    assert all(each.about == ("base",) * len(since) for each in found)


def test_steps_of_long_recordings_are_looked_for_at_thirty_two_places():
    """Evenly over all of them, the first and the last among them; up to 37 samples at each."""
    (long,), (most,) = steps(Made(100)), steps(Made(37))
    assert len(long.since) == 32
    assert (long.since[0], long.since[-1]) == (30, 970)
    assert set(np.diff(long.since)) == {30, 40}
    assert list(most.since) == list(range(30, 350, 10))


def test_steps_and_drifts_are_of_the_views_that_depend_on_them():
    """Others have none; a step moves a view from its sample on, a drift by its share of the time."""
    of = Made(6, {}, {"hand_base": None, "sample": np.arange(3)}, times=np.array([0.0, 1.0, 2.0, 3.0, 4.0, 8.0]))
    (step,), (drift,) = steps(of), drifts(of)
    assert (step.moves[1], drift.moves[1]) == (None, None)
    moved = of.by_frame(0, "base")
    np.testing.assert_array_equal(step.moves[0][:, 0], moved * (np.arange(6) >= 3)[:, None, None])
    share = np.array([0, 0.125, 0.25, 0.375, 0.5, 1.0])
    np.testing.assert_allclose(drift.moves[0][:, 0], share[:, None, None] * moved)
    assert list(drifts(Made(5))) == []


def test_clocks_are_those_of_cameras_and_of_robots_on_paths():
    """A camera is late against all arms that carry it or what it sees, a robot against the others."""
    speeds = {name: np.random.default_rng(1).standard_normal((8, 6)) for name in ("eye", "hand")}
    of = Made(8, {"eye": "eye"}, {"camera": "other"}, robots=("eye", "hand"), speeds=speeds)
    found = {each.about[0]: each for each in clock_offsets(of)}
    eye, hand = (
        [(of.by_flange(k, name) @ speeds[name][..., None])[:, None] for k in range(2)] for name in ("eye", "hand")
    )
    assert list(found) == ["other", "wrist", "eye", "hand"]
    wanted = {"wrist": (eye[0] + hand[0], None), "other": (None, hand[1]), "eye": (eye[0], None), "hand": tuple(hand)}
    for name, moves in wanted.items():
        assert (found[name].code, found[name].unit) == ("clock-offset", "s")
        for one, other in zip(found[name].moves, moves, strict=True):
            assert (one is None) == (other is None)
            assert one is None or np.allclose(one, other, atol=1e-12)
    of.timed = False
    assert {each.unit for each in clock_offsets(of)} == {"samples"}
    of.recorded.open_clocks = ("wrist", "hand")
    assert [each.about[0] for each in clock_offsets(of)] == ["other", "eye"]


def test_a_single_robot_on_a_path_has_no_clock_of_its_own():
    """It is late as much as all cameras are early; without a path there is no clock to tell."""
    of = Made(8, {"eye": "eye"}, {"camera": "still", "hand": None}, robots=("eye", "hand"))
    assert [each.about[0] for each in clock_offsets(of)] == ["wrist"]
    of.speeds = {}
    assert list(clock_offsets(of)) == []


@pytest.mark.parametrize(("count", "timed", "told"), [(6, True, True), (5, True, False), (6, False, False)])
def test_clocks_drift_over_six_samples_and_more(count, timed, told):
    """From half less at the first to half more at the last, by their stamps."""
    of = Made(count, timed=timed)
    found = list(clock_drifts(of))
    assert [(each.code, each.about, each.unit) for each in found] == (
        [("clock-drift", ("wrist",), "s")] if told else []
    )
    if told:
        (offset,) = clock_offsets(of)
        share = np.linspace(-0.5, 0.5, count)[:, None, None, None]
        np.testing.assert_allclose(found[0].moves[0], share * offset.moves[0], atol=1e-12)


@pytest.mark.parametrize(("robots", "points", "told"), [
    (("eye", "hand"), (), ["eye", "hand", "board", "light"]),
    (("eye", "hand"), ("bulb",), ["eye", "hand", "board"]),
    (("hand",), (), ["hand"]),
])  # fmt: skip
def test_targets_have_lengths_beside_those_of_two_robots(robots, points, told):
    """Where they have a size; each moves its own views."""
    still = SE3.identity((4,))
    of = Made(4, {"eye": "eye"}, {"target": "light", "target_mount": "bulb"}, robots=robots)
    of.groups = [type("Views", (SimpleNamespace,), {"__len__": lambda self: 4})(**vars(g)) for g in of.groups]
    of.problem = SimpleNamespace(groups=of.groups, point_mounts=frozenset(points))
    of.recorded_pose = lambda k, robot: still
    of.links = [SimpleNamespace(target_from_camera=SE3(np.eye(3), np.array([0.0, 0.0, k + 1.0]))) for k in range(2)]
    found = {each.about[0]: each.moves for each in length_scales(of)}
    assert list(found) == told
    assert found["hand"][0] is not None
    assert ("eye" in found) <= (found.get("eye", (0, None))[1] is None)
    for k, name in enumerate(("board", "light")):
        if name in found:
            assert found[name][1 - k] is None
            np.testing.assert_array_equal(found[name][k][:, 0, :, 0], np.tile([0, 0, k + 1.0, 0, 0, 0], (4, 1)))
