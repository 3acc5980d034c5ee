from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.kinematics import Masses, SerialChain
from basecal.kinematics.chain import LARGEST_JOINT_RAD, LIMIT_EXCESS_RAD
from derivatives import check_derivative
from planar_arm import planar


@pytest.fixture
def joints(chain):
    return np.random.default_rng(3).uniform(-2.0, 2.0, (20, chain.n))


class Pinocchio:
    """The same arm in Pinocchio, which represents a joint without limits by cosine and sine."""

    def __init__(self, arm, names):
        self.pin = pytest.importorskip("pinocchio")
        path, base, flange = arm
        self.model = self.pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.base, self.flange = self.model.getFrameId(base), self.model.getFrameId(flange)
        self.joints = [self.model.joints[self.model.getJointId(name)] for name in names]

    def __call__(self, joints):
        q = self.pin.neutral(self.model)
        for joint, value in zip(self.joints, joints, strict=True):
            q[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        self.pin.computeJointJacobians(self.model, self.data, q)
        self.pin.updateFramePlacements(self.model, self.data)
        frames = self.data.oMf
        jacobian = self.pin.getFrameJacobian(self.model, self.data, self.flange, self.pin.LOCAL)
        base_from_flange = frames[self.base].inverse() * frames[self.flange]
        return base_from_flange.homogeneous, jacobian[:, [joint.idx_v for joint in self.joints]]


def test_forward_and_jacobian_equal_pinocchio(arm, chain, joints):
    """Flange pose and Jacobian of six and seven axes agree with Pinocchio to rounding."""
    oracle = Pinocchio(arm, chain.joint_names)
    poses, jacobians = zip(*(oracle(q) for q in joints), strict=True)
    np.testing.assert_allclose(chain.forward(joints).matrix, poses, rtol=0, atol=1e-12)
    np.testing.assert_allclose(chain.jacobian(joints), jacobians, rtol=0, atol=1e-12)


def test_jacobian_equals_finite_differences(chain, joints):
    """The Jacobian is the right tangent of the flange per joint, in flange axes."""
    flange_from_base = chain.forward(joints).inverse()
    check_derivative(lambda d: (flange_from_base @ chain.forward(joints + d)).log(), chain.jacobian(joints))


def test_link_jacobian_equals_finite_differences(chain, joints):
    """The link Jacobian is the right tangent of the flange per right tangent of each origin and of the tip."""
    flange_from_base = chain.forward(joints).inverse()

    def moved(d):
        return (flange_from_base @ chain.perturb_links(d.reshape(-1, 6)).forward(joints)).log()

    check_derivative(moved, chain.posture(joints).link_derivative)


def test_joint_offset_is_a_link_parameter(chain, joints):
    """Rotating a joint's origin about its axis is an offset of that joint."""
    tangents = np.zeros((chain.n + 1, 6))
    offsets = np.linspace(-0.1, 0.1, chain.n)
    tangents[:-1, 3:] = offsets[:, None] * chain.axes
    np.testing.assert_allclose(
        chain.perturb_links(tangents).forward(joints).matrix, chain.forward(joints + offsets).matrix, atol=1e-13
    )


def test_planar_arm_equals_closed_form():
    """Two links in a plane satisfy the textbook formulas of an elbow."""
    chain = planar(0.5, 0.3)
    a, b = 0.4, -1.1
    flange = chain.forward(np.array([a, b]))
    x, y = 0.5 * np.cos(a) + 0.3 * np.cos(a + b), 0.5 * np.sin(a) + 0.3 * np.sin(a + b)
    np.testing.assert_allclose(flange.translation, [x, y, 0], atol=1e-15)
    np.testing.assert_allclose(flange.rotvec, [0, 0, a + b], atol=1e-15)
    np.testing.assert_allclose(chain.jacobian(np.array([a, b]))[:, 1], [0, 0.3, 0, 0, 0, 1], atol=1e-15)


@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 3)])
def test_leading_axes_are_a_batch(chain, shape):
    """Joints of any leading shape give poses and Jacobians of that shape, equal entry by entry."""
    joints = np.random.default_rng(4).uniform(-2, 2, (*shape, chain.n))
    assert chain.forward(joints).matrix.shape == (*shape, 4, 4)
    assert chain.jacobian(joints).shape == (*shape, 6, chain.n)
    assert chain.posture(joints).link_derivative.shape == (*shape, 6, 6 * (chain.n + 1))
    one_by_one = [chain.forward(q).matrix for q in joints.reshape(-1, chain.n)]
    np.testing.assert_allclose(
        chain.forward(joints).matrix.reshape(-1, 4, 4), np.reshape(one_by_one, (-1, 4, 4)), atol=1e-15
    )


def test_perturb_links_leaves_the_chain_unchanged(chain, joints):
    """A perturbed chain is a new one with the same joints and limits, and the opposite perturbation undoes it."""
    before = chain.forward(joints).matrix
    tangents = np.random.default_rng(5).normal(size=(chain.n + 1, 6)) * 0.01
    moved = chain.perturb_links(tangents)
    assert moved.joint_names == chain.joint_names
    np.testing.assert_array_equal(moved.upper, chain.upper)
    np.testing.assert_array_equal(chain.forward(joints).matrix, before)
    assert np.abs(moved.forward(joints).matrix - before).max() > 1e-3
    np.testing.assert_allclose(moved.perturb_links(-tangents).forward(joints).matrix, before, atol=1e-13)


def test_wrong_shapes_are_refused(chain):
    """Joints of another arm and tangents of another shape raise InputError with the expected joints."""
    with pytest.raises(InputError, match=chain.joint_names[0]):
        chain.forward(np.zeros(chain.n + 1))
    with pytest.raises(InputError, match="expected"):
        chain.jacobian(np.float64(0.0))
    with pytest.raises(InputError, match="expected"):
        chain.posture(np.zeros((chain.n, 1)))
    with pytest.raises(InputError, match="link_tangents"):
        chain.perturb_links(np.zeros((chain.n, 6)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": np.array([[0, 0, 2.0], [0, 0, 1.0]])}, "unit vectors"),
        ({"axes": np.zeros((2, 2))}, "axes has shape"),
        ({"lower": np.zeros(3)}, "lower has shape"),
        ({"origins": SE3.identity((3,))}, "origins"),
        ({"joint_names": ()}, "at least one joint"),
        ({"tip": SE3.identity((1,))}, "one tip"),
    ],
)
def test_inconsistent_chains_are_refused(change, message):
    """A chain whose parts do not fit together raises InputError."""
    chain = planar(0.5, 0.3)
    with pytest.raises(InputError, match=message):
        SerialChain(**({name: getattr(chain, name) for name in chain.__dataclass_fields__} | change))


def test_batch_of_arms_equals_separate_arms(chain, joints):
    """Flange and both Jacobians of arms with different links equal those of each arm, at separate or shared joints."""
    tangents = 0.05 * np.random.default_rng(0).standard_normal((3, chain.n + 1, 6))
    arms = chain.perturb_links(tangents)
    assert (arms.batch, chain.batch) == ((3,), ())
    own = np.stack([joints + 0.1 * k for k in range(3)])
    for k in range(3):
        alone = chain.perturb_links(tangents[k])
        for taken, mine in ((own, own[k]), (joints, joints)):
            at = arms.posture(taken)
            np.testing.assert_allclose(at.base_from_flange.matrix[k], alone.forward(mine).matrix, atol=1e-14)
            np.testing.assert_allclose(at.joint_derivative[k], alone.jacobian(mine), atol=1e-14)
            np.testing.assert_allclose(at.link_derivative[k], alone.posture(mine).link_derivative, atol=1e-14)


def test_origins_and_tip_need_equal_batches(chain):
    """Three sets of origins with one tip are refused."""
    arms = chain.perturb_links(np.zeros((3, chain.n + 1, 6)))
    with pytest.raises(InputError, match="origins and one tip"):
        SerialChain(chain.joint_names, arms.origins, chain.axes, chain.tip, chain.lower, chain.upper)


def test_masses_are_read_only_copies():
    """Masses and their centres are read-only copies, and a joint may carry no mass."""
    kg = np.array([2.0, 0.0])
    masses = Masses(kg, np.ones((2, 3)))
    kg[0] = 5.0
    assert masses.kg.tolist() == [2.0, 0.0]
    assert not masses.centres.flags.writeable


@pytest.mark.parametrize(
    ("kg", "centres", "message"),
    [
        ([1.0, -1e-9], np.zeros((2, 3)), "not negative"),
        ([1.0, 1.0], np.zeros((3, 3)), r"centres has shape \(3, 3\), expected \(..., 2, 3\)"),
        ([1.0, 1.0], np.zeros((2, 2)), "centres has shape"),
        (np.ones(()), np.zeros((1, 3)), "kg has shape"),
    ],
)
def test_invalid_masses_are_refused(kg, centres, message):
    """Negative masses, and masses without a matching centre, raise InputError."""
    with pytest.raises(InputError, match=message):
        Masses(kg, centres)


def test_gravity_direction_is_normalised():
    """A direction of any length is accepted, the default is -z, and a zero vector is refused."""
    one = np.ones(1), np.zeros((1, 3))
    assert Masses(*one).down.tolist() == [0.0, 0.0, -1.0]
    np.testing.assert_allclose(Masses(*one, np.array([3.0, 0.0, 4.0])).down, [0.6, 0.0, 0.8])
    with pytest.raises(InputError, match="direction of gravity"):
        Masses(*one, np.zeros(3))


@pytest.mark.parametrize(
    ("length", "taken"), [(1 + 0.9e-9, True), (1 - 0.9e-9, True), (1 + 1.2e-9, False), (0.9, False)]
)
def test_axes_are_unit_vectors_to_rounding(length, taken):
    """An axis longer or shorter than a unit vector by 1e-9 is accepted, more is refused."""
    chain = planar(0.5, 0.3)
    parts = {name: getattr(chain, name) for name in chain.__dataclass_fields__}
    parts["axes"] = np.array([[0, 0, 1.0], [0, 0, length]])
    if taken:
        assert SerialChain(**parts).n == 2
    else:
        with pytest.raises(InputError, match="unit vectors"):
            SerialChain(**parts)


def test_joint_limits_exceed_a_revolution_slightly():
    """Larger angles come from a wrist without end or are in degrees."""
    assert 2 * np.pi < LARGEST_JOINT_RAD < 3 * np.pi
    assert 0.02 < LIMIT_EXCESS_RAD < 0.2
