"""Tests of clearances between arms and boxes, against Coal's distances and Pinocchio's kinematics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Cell, CellCamera, KeepOut, Robot, RobotState, Sample, Unknown
from basecal.geometry import SE3
from basecal.kinematics import read_chain
from basecal.planning.clearance import (
    _arms_gap,
    _bounding_spheres,
    _box_gap,
    clearances,
    path_m_per_rad,
    robot_capsules,
)
from basecal.planning.sketch import Sketch
from planar_arm import planar
from shared.bodies import arm_with_bodies

pin = pytest.importorskip("pinocchio")
coal = pytest.importorskip("coal")

APART = SE3.from_rotvec([0, 0, 2.5], [1.1, 0.2, 0.05])


def two_arms(path, **keep_out):
    """A sketch of two arms of one URDF, a camera on the first."""
    chain = read_chain(path, "base_link", "tool0")
    robots = {name: Robot(name, None, chain, {}, "arm.urdf", "base_link", "tool0") for name in ("one", "two")}
    cell = Cell("one", robots, cameras={"wrist": CellCamera("wrist", "one", Unknown(), "pinhole")}, keep_out=keep_out)
    transforms = {"one_base_from_two_base": APART, "one_flange_from_wrist": SE3.identity()}
    return Sketch(cell, transforms, ("wrist", "board"))


def at(one, two, number=0):
    """A sample with both arms at joints."""
    return Sample(number, robots={"one": RobotState(joints_rad=one), "two": RobotState(joints_rad=two)})


def coal_bodies(path, joints, bases):
    """Coal's bodies of each arm in the world, as shapes and poses by Pinocchio."""
    model = pin.buildModelFromUrdf(str(path))
    bodies = pin.buildGeomFromUrdf(model, str(path), pin.COLLISION, package_dirs=[str(path.parents[1])])
    root = model.frames[model.getFrameId("base_link")]
    found = []
    for q, base in zip(joints, bases, strict=True):
        data, places = model.createData(), pin.GeometryData(bodies)
        whole = np.zeros(model.nq)
        whole[: len(q)] = q
        pin.updateGeometryPlacements(model, data, bodies, places, whole)
        to_world = pin.SE3(np.array(base.rotation), np.array(base.translation)) * root.placement.inverse()
        arm = [to_world * pose for pose in places.oMg]
        shapes = [each.geometry for each in bodies.geometryObjects]
        found.append(
            [(shape, in_coal(pose.rotation, pose.translation)) for shape, pose in zip(shapes, arm, strict=True)]
        )
    return found


def true_gap(one, other):
    """Smallest distance of two lists of bodies, by Coal."""
    return min(coal.distance(*a, *b, coal.DistanceRequest(), coal.DistanceResult()) for a in one for b in other)


def in_coal(rotation, translation):
    """Convert a pose to Coal's type."""
    return coal.Transform3s(np.array(rotation), np.array(translation))


def random_joints(rng, chain):
    return rng.uniform(np.maximum(chain.lower, -2.5), np.minimum(chain.upper, 2.5))


def capsule(ends, radius):
    """Capsule in Coal, whose axis is z."""
    along = ends[1] - ends[0]
    length = np.linalg.norm(along)
    turned = pin.Quaternion.FromTwoVectors(np.array([0, 0, 1.0]), along if length else np.array([0, 0, 1.0])).matrix()
    return coal.Capsule(radius, length), in_coal(turned, ends.mean(0))


def coal_capsules(sketch, robot, joints, first=0):
    """Capsules of a robot at joints in Coal, beginning with a frame."""
    chain, (body, _) = sketch.cell.robots[robot].chain, robot_capsules(sketch, robot)
    frames = [SE3.identity(), *chain.joint_frames(joints), chain.forward(joints)]
    return [
        capsule(sketch.world_from_base(robot) @ frames[k] @ ends, radius)
        for k, ends, radius in zip(body.frame, body.ends, body.radius + body.padding, strict=True)
        if k >= first
    ]


def test_capsule_distances_match_coal(tmp_path):
    """The clearance of still arms is the smallest distance of their capsules by Coal.

    That of a box excludes the base and the first joint.
    """
    box = KeepOut("post", SE3.from_rotvec([0.3, 0.2, 1.0], [0.5, 0.5, 0.6]), np.array([0.1, 0.2, 0.3]))
    rng, sketch = np.random.default_rng(0), two_arms(arm_with_bodies(tmp_path), post=box)
    shape = [(coal.Box(*box.size_m), in_coal(box.world_from_box.rotation, box.world_from_box.translation))]
    for _ in range(10):
        joints = [random_joints(rng, sketch.cell.robots["one"].chain) for _ in range(2)]
        arms, post = clearances(sketch, at(*joints), at(*joints), ["one"])
        want = true_gap(*(coal_capsules(sketch, *each) for each in zip(("one", "two"), joints, strict=True)))
        if want > 0:  # inside of a capsule Coal gives the depth
            assert arms.gap_m == pytest.approx(want, abs=1e-6)
        from_box = true_gap(coal_capsules(sketch, "one", joints[0], first=2), shape)
        if from_box > 0:
            assert from_box - 0.006 <= post.gap_m <= from_box + 1e-6


@pytest.mark.journey
def test_clearances_bound_true_distances_from_below(tmp_path):
    """Clearances are never larger than the true distances of the bodies, nor much smaller.

    Meshes, boxes, cylinders and spheres are compared at random postures by Pinocchio and Coal.
    """
    path = arm_with_bodies(tmp_path)
    rng, sketch = np.random.default_rng(1), two_arms(path)
    short = []
    for _ in range(40):
        joints = [random_joints(rng, sketch.cell.robots["one"].chain) for _ in range(2)]
        (found,) = clearances(sketch, at(*joints), at(*joints), ["two"])
        short.append(true_gap(*coal_bodies(path, joints, [SE3.identity(), APART])) - found.gap_m)
    assert min(short) > -1e-6
    assert np.median(short) < 0.06


@pytest.mark.journey
def test_path_clearance_bounds_poses_on_the_path(tmp_path):
    """At a hundred random postures on each path, no clearance is below that of the path by more than the margin."""
    box = KeepOut("post", SE3(np.eye(3), np.array([0.4, 0.4, 0.5])), np.full(3, 0.1))
    rng, sketch = np.random.default_rng(2), two_arms(arm_with_bodies(tmp_path), post=box)
    for _ in range(3):
        ends = [[random_joints(rng, sketch.cell.robots["one"].chain) for _ in range(2)] for _ in range(2)]
        whole = {each.other: each for each in clearances(sketch, at(*ends[0]), at(*ends[1]), ["one"])}
        for share, other in rng.uniform(0, 1, (100, 2)):  # each at its own speed
            here = at(*(a + s * (b - a) for a, b, s in zip(*ends, (share, other), strict=True)))
            for each in clearances(sketch, here, here, ["one"]):
                assert each.gap_m > whole[each.other].gap_m - each.needed_m


def test_only_moving_robots_are_checked(tmp_path):
    """Boxes are checked against robots with goals, and a pair of robots only if at least one of them has a goal."""
    box = KeepOut("post", SE3(np.eye(3), np.array([0.4, 0.4, 0.5])), np.full(3, 0.1))
    sketch, zeros = two_arms(arm_with_bodies(tmp_path), post=box), np.zeros(6)
    pairs = {
        name: [(each.robot, each.other) for each in clearances(sketch, at(zeros, zeros), at(zeros, zeros), sent)]
        for name, sent in (("both", ("one", "two")), ("two", ("two",)), ("none", ()))
    }
    assert pairs["both"] == [("one", "two"), ("one", "post"), ("two", "post")]
    assert pairs["two"] == [("one", "two"), ("two", "post")]
    assert pairs["none"] == []


def test_unreadable_mesh_is_replaced_by_a_line(tmp_path):
    """The unreadable mesh is named, and its link becomes a line of the link's length with a radius of 60 mm.

    Other links keep their bodies.
    """
    path = arm_with_bodies(tmp_path)
    whole, _ = robot_capsules(two_arms(path), "two")
    (path.parent / "meshes/upper.stl").unlink()
    sketch = two_arms(path)
    body, problems = robot_capsules(sketch, "two")
    assert problems == [
        "link 'upper_arm': mesh 'package://arm_description/meshes/upper.stl' is not in the cell's folder; copy it there"
    ]
    (line,) = body.ends[body.frame == 2]
    np.testing.assert_allclose(line, [np.zeros(3), sketch.cell.robots["two"].chain.origins.translation[2]])
    assert (body.radius + body.padding)[body.frame == 2] == [0.06]
    np.testing.assert_array_equal(body.ends[body.frame == 3], whole.ends[whole.frame == 3])


def test_camera_moves_with_its_flange(tmp_path):
    """A camera is a ball of 60 mm about its centre, in the frame behind the last joint.

    An arm without camera has no such ball.
    """
    sketch = two_arms(arm_with_bodies(tmp_path))
    mount = SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
    sketch = replace(sketch, transforms={**sketch.transforms, "one_flange_from_wrist": mount})
    body, _ = robot_capsules(sketch, "one")
    carried = body.frame == 7
    np.testing.assert_allclose(body.ends[carried], [[mount.translation] * 2])
    assert (body.radius + body.padding)[carried].tolist() == [0.06]
    assert 7 not in robot_capsules(sketch, "two")[0].frame


def test_path_length_of_still_robot_is_zero(tmp_path):
    """A still robot has a path length of zero. It is unknown for a robot without joints, or one that a sample lacks."""
    sketch, zeros = two_arms(arm_with_bodies(tmp_path)), np.zeros(6)
    assert path_m_per_rad(sketch, at(zeros, zeros), at(zeros, zeros), "one") == 0.0
    poses = Sample(0, robots={"one": RobotState(SE3.identity())})
    for start, end in ((poses, at(zeros, zeros)), (at(zeros, zeros), poses), (Sample(0), at(zeros, zeros))):
        assert path_m_per_rad(sketch, start, end, "one") is None


@pytest.mark.journey
def test_path_length_bounds_body_points(tmp_path):
    """The path length bounds the motion of all points of bodies on random paths.

    Shapes and poses of the bodies are Pinocchio's.
    """
    path = arm_with_bodies(tmp_path, {"wrist_3": '<box size="0.3 0.02 0.02"/>', "forearm": '<sphere radius="0.2"/>'})
    rng, sketch = np.random.default_rng(4), two_arms(path)
    ends_of = 0.5 * np.array([0.4 * np.eye(3)[:2], [[0.3, 0.02, 0.02], [-0.3, -0.02, 0.02]]])  # in the tree's order
    fastest = []
    for _ in range(6):
        start, end = (random_joints(rng, sketch.cell.robots["two"].chain) for _ in range(2))
        most = path_m_per_rad(sketch, at(start, start), at(end, end), "two")
        places = []
        for share in np.linspace(0, 1, 100):
            poses = [pose for _, pose in coal_bodies(path, [start + share * (end - start)], [APART])[0]]
            places.append(
                [p @ pose.getRotation().T + pose.getTranslation() for p, pose in zip(ends_of, poses, strict=True)]
            )
        steps = np.linalg.norm(np.diff(np.array(places), axis=0), axis=-1).max()
        fastest.append(99 * steps / np.abs(end - start).max() / most)
    assert 0.7 < max(fastest) < 1


def test_spinning_sphere_moves_by_its_radius(tmp_path):
    """The path length is the radius plus the motion of the centre.

    The centre is 20 and 30 mm off the last joint's axis, and 2 % are added for the arc.
    """
    sketch = two_arms(arm_with_bodies(tmp_path, {"wrist_3": '<sphere radius="0.2"/>'}))
    begin, end = np.zeros(6), np.append(np.zeros(5), 0.3)
    assert path_m_per_rad(sketch, at(begin, begin), at(begin, end), "two") == pytest.approx(
        (0.2 + np.hypot(0.02, 0.03)) * 1.02, rel=1e-3
    )


def rods(*ends_and_radius):
    """Capsules, (n, 7), from their ends and radii."""
    return np.array(ends_and_radius, dtype=float)


def test_arms_gap_is_that_of_nearest_capsules(monkeypatch):
    """The gap is right for crossed, collinear and parallel capsules and for points.

    It is the same if capsules are processed in parts.
    """
    cross = rods([-1, 0, 0, 1, 0, 0, 0.1]), rods([0, -1, 0.5, 0, 1, 0.5, 0.2])
    line = rods([0, 0, 0, 1, 0, 0, 0.1]), rods([1.5, 0, 0, 3, 0, 0, 0.0])
    beside = rods([0, 0, 0, 1, 0, 0, 0.1]), rods([0.5, 0.7, 0, 9, 0.7, 0, 0.1])
    points = rods([0, 0, 0, 0, 0, 0, 0.1]), rods([3, 4, 0, 3, 4, 0, 0.2])
    for (one, other), gap in ((cross, 0.2), (line, 0.4), (beside, 0.5), (points, 4.7)):
        for pair in ((one, other), (other, one)):
            assert _arms_gap(*pair) == pytest.approx(gap)
    far = rods(*([9 + k, 9, 9, 9 + k, 9, 20, 0.5] for k in range(5)))
    assert _arms_gap(np.concatenate([far, cross[0]]), np.concatenate([far + 50, cross[1], far - 70])) == pytest.approx(
        0.2
    )
    middles, reach = _bounding_spheres(np.concatenate([cross[0], points[1], beside[1]]))
    np.testing.assert_allclose(middles, [[0, 0, 0], [3, 4, 0], [4.75, 0.7, 0]])
    np.testing.assert_allclose(reach, [1.1, 0.2, 4.35])


def test_box_gap_is_that_of_nearest_point():
    """The gap is at most a hundredth of the capsule's length too small.

    A capsule through the box is inside by its radius.
    """
    box = KeepOut("post", SE3(np.eye(3), np.array([0.0, 0.0, 1.0])), np.array([0.2, 0.4, 2.0]))
    beside, across = rods([1.1, -5, 0, 1.1, 5, 1, 0.25]), rods([-5, 0, 0.5, 5, 0, 0.5, 0.25])
    gap = _box_gap(np.concatenate([beside, rods([9, 9, 9, 9, 9, 9, 1])]), box)
    assert 0.75 - 0.1 < gap <= 0.75
    assert -0.25 - 0.1 < _box_gap(across, box) <= -0.25
    assert _box_gap(rods([0.6, 0, 1, 0.6, 0, 1, 0.1]), box) == pytest.approx(0.4)


def planar_arms(lengths):
    """Sketch of two planar arms whose links are lines, with bases three metres apart."""
    robots = {name: Robot(name, None, planar(*lengths)) for name in ("one", "two")}
    aside = SE3(np.eye(3), np.array([3.0, 0.0, 0.0]))
    return Sketch(Cell("one", robots), {"one_base_from_two_base": aside}, ("wrist", "board"))


@pytest.mark.parametrize("turn", [0.01, -0.3, 2.0])
def test_path_length_is_that_of_the_tip(turn):
    """The tip moves by the arm's length per radian of its base, and by a link's length per radian of the elbow.

    A fiftieth is added for the arc.
    """
    sketch, zeros = planar_arms((0.5, 0.4)), np.zeros(2)
    for joints, longest in (([turn, 0.0], 0.9), ([0.0, turn], 0.4), ([0.5 * turn, turn], 0.85)):
        found = path_m_per_rad(sketch, at(zeros, zeros), at(np.array(joints), zeros), "one")
        assert longest * 0.98 < found / 1.02 <= longest + 1e-9
    assert path_m_per_rad(sketch, at(zeros, zeros), at(np.array([turn, 0.0]), zeros), "two") == 0.0


def test_clearance_of_collinear_arms():
    """The gap is the distance less both arms and two radii of 60 mm for links without a body.

    Two margins are needed between arms, one from a box.
    """
    sketch, zeros = planar_arms((0.5, 0.4)), np.zeros(2)
    half = np.array([np.pi, 0.0])
    (apart,) = clearances(sketch, at(zeros, half), at(zeros, half), ["one"])
    assert (apart.robot, apart.other, apart.needed_m) == ("one", "two", 0.04)
    assert apart.gap_m == pytest.approx(3 - 0.9 - 0.9 - 0.12)
    (moved,) = clearances(sketch, at(np.array([1.0, 0.0]), half), at(zeros, half), ["one"])
    assert moved.gap_m == pytest.approx(apart.gap_m)
    box = KeepOut("post", SE3(np.eye(3), np.array([1.5, 0.0, 0.0])), np.full(3, 0.2))
    sketch = replace(sketch, cell=replace(sketch.cell, keep_out={"post": box}))
    _, post = clearances(sketch, at(zeros, half), at(zeros, half), ["one"])
    assert (post.other, post.needed_m) == ("post", 0.02)
    assert post.gap_m == pytest.approx(1.4 - 0.9 - 0.06, abs=0.005)
    assert replace(post, gap_m=0.02).is_enough
    assert not replace(post, gap_m=0.0199).is_enough
