from dataclasses import replace

import numpy as np
import pytest

from basecal.errors import InputError, NotConverged
from basecal.geometry import SE3
from basecal.kinematics import inverse, read_chain
from basecal.kinematics.inverse import _Arm
from planar_arm import planar


def remaining_error(chain, joints, pose):
    return (chain.forward(joints).inverse() @ pose).log()


@pytest.mark.journey
def test_inverse_kinematics_round_trip(chain):
    """From starts within 0.3 rad, 30 random poses 0.3 rad inside the limits are all reached to 1e-10."""
    rng = np.random.default_rng(2)
    lower, upper = chain.lower.clip(min=-np.pi) + 0.3, chain.upper.clip(max=np.pi) - 0.3
    for wanted in rng.uniform(lower, upper, (30, chain.n)):
        pose = chain.forward(wanted)
        found = inverse(chain, pose, wanted + rng.uniform(-0.3, 0.3, chain.n))
        assert np.abs(remaining_error(chain, found, pose)).max() <= 1e-10
        assert np.all((found >= chain.lower) & (found <= chain.upper))


def test_nearby_start_finds_the_same_branch(folder):
    """Away from singular poses, the six joints found from nearby are those of the pose."""
    chain = read_chain(folder / "six_axis.urdf", "base_link", "tool0")
    wanted = np.array([0.3, -1.2, 1.4, -0.9, 1.3, 0.4])
    np.testing.assert_allclose(inverse(chain, chain.forward(wanted), wanted + 0.2), wanted, rtol=0, atol=1e-8)


def test_start_at_the_pose_is_returned(chain):
    """A start that already reaches the pose is returned unchanged."""
    start = np.full(chain.n, 0.4)
    np.testing.assert_array_equal(inverse(chain, chain.forward(start), start, iterations=0), start)


def test_pose_at_joint_limits_is_reached(folder):
    """A pose with joints at their limits is reached from a start beyond the limits, without leaving them."""
    chain = read_chain(folder / "six_axis.urdf", "base_link", "tool0")
    wanted = np.array([6.28, -1.2, 2.9, -0.9, 1.3, 0.4])
    found = inverse(chain, chain.forward(wanted), wanted + np.array([0.2, 0.1, 0.3, 0.1, -0.1, 0.1]))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8)
    assert np.all(found <= chain.upper)


def test_pose_beyond_a_limit_is_not_reached(folder):
    """A pose that needs a joint beyond its limit raises NotConverged with the state at the limit."""
    chain = read_chain(folder / "six_axis.urdf", "base_link", "tool0")
    wanted = np.array([0.0, -1.2, 3.0, -0.9, 1.3, 0.4])
    with pytest.raises(NotConverged, match="mm and") as caught:
        inverse(chain, chain.forward(wanted), wanted)
    assert caught.value.state[2] == chain.upper[2]


def test_unreachable_pose_is_approached(chain):
    """A pose out of reach raises NotConverged with a state nearer than the start and inside the limits."""
    start = np.full(chain.n, 0.4)
    pose = SE3.from_rotvec([0, 0, 0], [30.0, 0.0, 0.0])
    with pytest.raises(NotConverged, match="check the reach") as caught:
        inverse(chain, pose, start)
    joints = caught.value.state
    assert np.all((joints >= chain.lower) & (joints <= chain.upper))
    assert np.linalg.norm(remaining_error(chain, joints, pose)) < np.linalg.norm(remaining_error(chain, start, pose))


def test_joint_at_its_limit_does_not_slow_the_others():
    """If one joint of four is at its limit, the other three converge as fast as ever, with steps of full length."""
    arm = replace(planar(0.5, 0.4, 0.3, 0.2), upper=np.array([0.0, 3.0, 3.0, 3.0]))
    pose = arm.forward(np.array([0.0, 0.5, 0.6, 0.4]))
    found = inverse(arm, pose, np.array([0.0, 0.3, 0.9, 0.1]), iterations=10)
    assert np.abs(remaining_error(arm, found, pose)).max() <= 1e-10


def test_any_start_ends_in_an_answer_or_not_converged():
    """With two joints on one axis, a stretched pose or one out of reach ends in an answer or NotConverged."""
    rng = np.random.default_rng(0)
    arm = planar(0.0, 0.5, 0.3)
    poses = SE3.from_rotvec(rng.uniform(-3, 3, (15, 1)) * [0, 0, 1], rng.uniform(-0.9, 0.9, (15, 3)) * [1, 1, 0])
    stretched = SE3.from_rotvec(np.zeros((10, 3)), np.tile([0.8, 0, 0], (10, 1)))
    reached = 0
    for pose in (*poses, *stretched):
        try:
            found = inverse(arm, pose, rng.uniform(-3, 3, 3))
        except NotConverged:
            continue
        assert np.abs(remaining_error(arm, found, pose)).max() <= 1e-10
        reached += 1
    assert reached >= 5


def test_batch_equals_separate_poses(chain):
    """Poses in a batch end at the joints of each alone, and one out of reach raises the error with all states."""
    rng = np.random.default_rng(3)
    lower, upper = chain.lower.clip(min=-np.pi) + 0.3, chain.upper.clip(max=np.pi) - 0.3
    wanted = rng.uniform(lower, upper, (20, chain.n))
    start, poses = wanted + rng.uniform(-0.2, 0.2, wanted.shape), chain.forward(wanted)
    together = inverse(chain, poses, start)
    alone = [inverse(chain, pose, near) for pose, near in zip(poses, start, strict=True)]
    np.testing.assert_allclose(together, alone, rtol=0, atol=1e-6)  # seven joints have a redundant degree of freedom
    far = SE3.stack([poses[0], SE3.from_rotvec([0, 0, 0], [30.0, 0.0, 0.0])])
    with pytest.raises(NotConverged, match="check the reach") as caught:
        inverse(chain, far, start[:2])
    np.testing.assert_allclose(caught.value.state[0], together[0], rtol=0, atol=1e-6)


def test_invalid_starts_are_refused(chain):
    """Starts of another length, of another count than the poses, or not finite raise InputError."""
    pose = chain.forward(np.zeros(chain.n))
    for start in (np.zeros(chain.n - 1), np.full(chain.n, np.nan), np.zeros((1, chain.n))):
        with pytest.raises(InputError, match="start has shape"):
            inverse(chain, pose, start)
    with pytest.raises(InputError, match="start has shape"):
        inverse(chain, chain.forward(np.zeros((2, chain.n))), np.zeros((3, chain.n)))


def test_no_pose_needs_no_joints(chain):
    """An empty batch of poses has an empty answer."""
    nothing = chain.forward(np.zeros((0, chain.n)))
    assert inverse(chain, nothing, np.zeros(chain.n)).shape == (0, chain.n)


def test_error_reports_the_farthest_pose():
    """The error has the remaining distance in millimetres and degrees.

    The other poses keep the state that reaches them.
    """
    arm = planar(0.5, 0.4)
    near = arm.forward(np.array([0.3, 0.4]))
    far = SE3.from_rotvec([0, 0, 0.0], [1.4, 0.0, 0.0])
    with pytest.raises(NotConverged) as caught:
        inverse(arm, SE3.stack([near, far]), np.array([0.2, 0.3]))
    joints = caught.value.state
    np.testing.assert_allclose(joints[0], [0.3, 0.4], atol=1e-8)
    off = remaining_error(arm, joints[1], far)
    message = f"{1e3 * np.linalg.norm(off[:3]):.3g} mm and {np.degrees(np.linalg.norm(off[3:])):.3g} deg away; give a"
    assert message in str(caught.value)
    assert np.linalg.norm(off[:3]) == pytest.approx(0.5, abs=0.1)


def test_gradient_of_the_remaining_error(folder):
    """The gradient is half the finite difference of the squared error.

    It holds far from the pose and for each pose of a batch.
    """
    chain = read_chain(folder / "six_axis.urdf", "base_link", "tool0")
    rng, step = np.random.default_rng(1), 1e-6
    q = rng.uniform(-1.0, 1.0, (3, 6))
    arm = _Arm(chain, chain.forward(q + rng.uniform(-0.6, 0.6, (3, 6))))
    about = arm.linearise(q)
    np.testing.assert_allclose(about.cost, np.sum(arm.remaining_tangent(q) ** 2, axis=1))
    for k in range(6):
        more, less = (np.sum(arm.remaining_tangent(q + way * step * np.eye(6)[k]) ** 2, axis=1) for way in (1, -1))
        np.testing.assert_allclose(about.gradient[:, k], (more - less) / (4 * step), atol=1e-7)


@pytest.mark.parametrize("at", ["lower", "upper"])
def test_joint_is_fixed_at_a_limit_it_would_leave(folder, at):
    """The gradient and the Hessian's row and column of such a joint are zero. Joints that move back inside are free."""
    chain = read_chain(folder / "six_axis.urdf", "base_link", "tool0")
    limit = getattr(chain, at)
    inside = 0.1 if at == "lower" else -0.1
    wanted = limit + inside * np.array([1, -1, 1, -1, 1, -1])
    arm = _Arm(chain, SE3.stack([chain.forward(wanted)]))
    for q in (limit, limit + 0.2 * inside):
        about = arm.linearise(q[None])
        moved = _Arm(replace(chain, lower=chain.lower - 9, upper=chain.upper + 9), arm.base_from_flange).linearise(
            q[None]
        )
        downhill = np.where(at == "lower", moved.gradient < 0, moved.gradient > 0)[0] | (q != limit)
        np.testing.assert_allclose(about.gradient[0], np.where(downhill, moved.gradient[0], 0.0))
        np.testing.assert_allclose(about.hessian[0], np.where(np.outer(downhill, downhill), moved.hessian[0], 0.0))
        assert downhill.all() == (q is not limit)


def test_remaining_distance_of_the_flange_is_reported():
    """The farthest pose of a batch is reported in millimetres and degrees, and the others stay reached."""
    chain = planar(0.5, 0.3)
    there = chain.forward(np.array([0.3, 0.8]))
    raised = SE3(there.rotation, there.translation + np.array([0, 0, 0.04]))
    with pytest.raises(NotConverged, match=r"stays 40 mm and \S+ deg away; give") as caught:
        inverse(chain, SE3.stack([there, raised]), np.array([0.3, 0.8]))
    np.testing.assert_allclose(caught.value.state[0], [0.3, 0.8], atol=1e-9)
    assert caught.value.state.shape == (2, 2)


@pytest.mark.parametrize("largest", [0.5, 1.0, 4.0])
def test_steps_are_limited_to_a_radian(largest):
    """A step is shortened as a whole, and clipped at the limits."""
    chain = planar(0.5, 0.3)
    arm = _Arm(replace(chain, lower=np.array([-9.0, -0.1]), upper=np.array([9.0, 9.0])), SE3.identity((1,)))
    found = arm.retract(np.zeros((1, 2)), None, largest * np.array([[1.0, -0.5]]))
    share = min(1.0, 1 / largest)
    np.testing.assert_allclose(found, [[share * largest, -0.1]])


def test_empty_batch_is_reached():
    """The inverse kinematics of no poses are an empty array of joints."""
    assert inverse(planar(0.5, 0.3), SE3.identity((0,)), np.zeros(2)).shape == (0, 2)


def test_remaining_translation_and_rotation_are_reported():
    """Without any step, the error is the tangent from the start, in millimetres and degrees."""
    chain, start = planar(0.5, 0.3), np.array([0.3, 0.8])
    pose = chain.forward(start) @ SE3.exp(np.array([0, 0, 0.03, np.radians(2), 0, 0]))
    with pytest.raises(NotConverged, match="stays 30 mm and 2 deg away"):
        inverse(chain, pose, start, iterations=0)


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 1.0), (-1.0, 0.0)])
def test_joint_at_a_limit_without_gradient_is_free(lower, upper):
    """At the pose itself no joint is fixed, and its row of the Hessian counts."""
    chain = replace(planar(0.5, 0.3), lower=np.array([lower, -1]), upper=np.array([upper, 1]))
    q = np.zeros((1, 2))
    about = _Arm(chain, chain.forward(q)).linearise(q)
    jacobian = chain.jacobian(q)
    np.testing.assert_array_equal(about.gradient, 0.0)
    np.testing.assert_allclose(about.hessian, jacobian.mT @ jacobian, atol=1e-12)


def test_tolerance_is_a_tenth_of_a_nanometre():
    """A start within the tolerance, by default 1e-10, is returned unchanged, and one farther off is moved."""
    chain, start = planar(0.5, 0.3), np.array([0.3, 0.8])
    for off, kept in ((0.9e-10, True), (1.2e-10, False)):
        pose = chain.forward(start + np.array([0.0, off]))
        assert np.array_equal(inverse(chain, pose, start), start) == kept
        assert np.array_equal(inverse(chain, pose, start, tolerance=1e-9), start)
