"""Tests of SE(3): group axioms, and comparison with mpmath at difficult points."""

import mpmath
import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.geometry.rotation import rotation_from_quaternion
from exact_se3 import CASES, DIGITS, IDS, TOLERANCE, as_array, exact_exp, exact_hat, tangent

SHAPES = [(), (1,), (4,), (2, 3), (0,)]


@pytest.fixture(params=CASES, ids=IDS)
def xi(request):
    return tangent(*request.param)


def random_transform(rng, shape=()):
    return SE3.exp(rng.normal(size=(*shape, 6)) * [1, 1, 1, 1.5, 1.5, 1.5])


def assert_same(a, b, atol=1e-14):
    np.testing.assert_allclose(a.rotation, b.rotation, rtol=0, atol=atol)
    np.testing.assert_allclose(a.translation, b.translation, rtol=0, atol=atol)


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def test_exp_at_difficult_points(xi):
    """`exp` is the matrix exponential at every angle."""
    got, want = SE3.exp(xi).matrix, as_array(exact_exp(tuple(xi)))
    np.testing.assert_allclose(got, want, rtol=0, atol=TOLERANCE)


def test_log_at_difficult_points(xi):
    """`log` recovers the tangent from the exact exponential, rounded to double precision."""
    matrix = as_array(exact_exp(tuple(xi)))
    got = SE3(matrix[:3, :3], matrix[:3, 3]).log()
    np.testing.assert_allclose(got, xi, rtol=0, atol=TOLERANCE)


def test_log_of_tiny_rotations_has_relative_accuracy(xi):
    """A rotation of 1e-12 rad keeps as many digits as one of 1 rad. No value is rounded relative to 1."""
    angle = np.linalg.norm(xi[3:])
    np.testing.assert_allclose(SE3.exp(xi).log()[3:], xi[3:], rtol=0, atol=TOLERANCE * angle)


def test_adjoint_at_difficult_points(xi):
    """Column i of the adjoint is the tangent of `T hat(e_i) T^-1`."""
    with mpmath.workdps(DIGITS):
        matrix = exact_exp(tuple(xi))
        inverse = matrix**-1
        want = np.empty((6, 6))
        for i in range(6):
            generator = mpmath.zeros(4)
            unit = [int(i == j) for j in range(6)]
            generator[0:3, 0:3], generator[0:3, 3] = exact_hat(unit[3:]), mpmath.matrix(unit[:3])
            moved = as_array(matrix * generator * inverse)
            want[:, i] = [*moved[:3, 3], moved[2, 1], moved[0, 2], moved[1, 0]]
    np.testing.assert_allclose(SE3.exp(xi).adjoint(), want, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("shape", SHAPES)
def test_group_axioms(rng, shape):
    """Composition is associative, has an identity and inverses, for every batch shape."""
    a, b, c = (random_transform(rng, shape) for _ in range(3))
    assert_same((a @ b) @ c, a @ (b @ c))
    assert_same(a @ SE3.identity(shape), a)
    assert_same(SE3.identity() @ a, a)
    assert_same(a @ a.inverse(), SE3.identity(shape))
    assert_same(a.inverse() @ a, SE3.identity(shape))
    assert a.matrix.shape == (*shape, 4, 4)
    np.testing.assert_allclose((a @ b).matrix, a.matrix @ b.matrix, atol=1e-14)


@pytest.mark.parametrize("shape", SHAPES)
def test_action_on_points(rng, shape):
    """Transforming points agrees with composition and with the homogeneous matrix."""
    a, b, points = random_transform(rng, shape), random_transform(rng, shape), rng.normal(size=(*shape, 3))
    np.testing.assert_allclose((a @ b) @ points, a @ (b @ points), atol=1e-13)
    homogeneous = np.concatenate([points, np.ones((*shape, 1))], -1)
    np.testing.assert_allclose(a @ points, (a.matrix @ homogeneous[..., None])[..., :3, 0], atol=1e-14)


@pytest.mark.parametrize("shape", SHAPES)
def test_conversions_over_batches(rng, shape):
    """`exp`, `log`, quaternions, angles and adjoints work entry by entry for every batch shape."""
    a, b = random_transform(rng, shape), random_transform(rng, shape)
    assert_same(SE3.exp(a.log()), a)
    assert_same(SE3.from_quaternion(a.quaternion, a.translation), a)
    assert_same(SE3.from_rotvec(a.rotvec, a.translation), a)
    assert_same(SE3.from_rpy(a.rpy, a.translation), a)
    assert_same(SE3.from_matrix(a.matrix), a)
    np.testing.assert_allclose((a @ b).adjoint(), a.adjoint() @ b.adjoint(), atol=1e-13)
    d = rng.normal(size=(*shape, 6))
    assert_same(a @ SE3.exp(d), SE3.exp((a.adjoint() @ d[..., None])[..., 0]) @ a, atol=1e-12)


def test_batches_broadcast_and_index(rng):
    """One transform is broadcast over a batch. Indexing, length and stacking use the leading axis."""
    one, many = random_transform(rng), random_transform(rng, (5,))
    assert_same((one @ many)[3], one @ many[3])
    assert_same((many @ one)[1:3], many[1:3] @ one)
    assert len(many) == 5
    assert_same(SE3.stack([many[i] for i in range(5)]), many)
    assert len(SE3.stack([])) == 0


@pytest.mark.parametrize("left", [(), (1,), (2,), (3, 1), (3, 2)])
@pytest.mark.parametrize("right", [(), (1,), (2,), (1, 2), (3, 1)])
def test_batches_broadcast_like_matrices(rng, left, right):
    """Products and transformed points equal those of 4x4 matrices, entry by entry, whichever way they are computed."""
    a, b, points = random_transform(rng, left), random_transform(rng, right), rng.normal(size=(*right, 3))
    np.testing.assert_allclose((a @ b).matrix, a.matrix @ b.matrix, atol=1e-12)
    with_one = np.concatenate([points, np.ones((*right, 1))], axis=-1)
    np.testing.assert_allclose(a @ points, (a.matrix @ with_one[..., None])[..., :3, 0], atol=1e-12)


def test_transforms_are_read_only(rng):
    """A transform is a value: its arrays are read-only, also adopted ones."""
    made = SE3(np.eye(3), np.zeros(3))
    adopted = SE3.adopt(np.eye(3), np.zeros(3))
    for transform in (random_transform(rng), made, adopted, adopted @ made, made.inverse(), SE3.identity((2,))[0]):
        for array in (transform.rotation, transform.translation):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0.0


def test_transforms_copy_the_callers_arrays():
    """Later changes of the caller's arrays do not change the transform, and the arrays stay writable."""
    rotation, translation, rotvec = np.eye(3), np.zeros(3), np.zeros(3)
    made = SE3(rotation, translation)
    turned, rolled = SE3.from_rotvec(rotvec, translation), SE3.from_rpy(rotvec, translation)
    rotation[0, 0], translation[1], rotvec[2] = 5.0, 7.0, 1.0
    for transform in (made, turned, rolled):
        assert_same(transform, SE3.identity())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SE3(np.eye(4), np.zeros(3)), r"rotation has shape \(4, 4\), expected \(..., 3, 3\)"),
        (lambda: SE3(np.eye(3), np.zeros(4)), r"translation has shape \(4,\)"),
        (lambda: SE3(np.eye(3)[0], np.zeros(3)), r"rotation has shape \(3,\)"),
        (lambda: SE3(np.stack([np.eye(3)] * 2), np.zeros(3)), "same leading axes"),
        (lambda: SE3(np.eye(3), np.zeros((2, 3))), "same leading axes"),
        (lambda: SE3.from_quaternion([[0, 0, 0, 1]], [0, 0, 0]), "same leading axes"),
        (lambda: SE3.from_rotvec([0, 0, 0, 0], [0, 0, 0]), r"rotvec has shape \(4,\)"),
        (lambda: SE3.from_rotvec([0, 0, 0], [0, 0]), r"translation has shape \(2,\)"),
        (lambda: SE3.from_rpy([0, 0], [0, 0, 0]), r"rpy has shape \(2,\)"),
        (lambda: SE3.exp([0, 0, 0]), r"xi has shape \(3,\), expected \(..., 6\)"),
        (lambda: SE3("a", "b"), r"^rotation is not an array of numbers, expected \(..., 3, 3\)$"),
        (lambda: SE3.from_matrix("abc"), r"^matrix is not an array of numbers, expected \(..., 4, 4\)$"),
        (lambda: SE3.from_matrix([[1, 2], [3]]), r"^matrix is not an array of numbers, expected \(..., 4, 4\)$"),
        (lambda: SE3.from_quaternion("abc", [0, 0, 0]), r"^q_xyzw is not an array of numbers$"),
    ],
)
def test_wrong_shapes_are_refused(make, message):
    """Arrays of wrong shapes are refused with their shape and the expected one."""
    with pytest.raises(InputError, match=message):
        make()


def test_single_transform_has_no_entries():
    """One transform cannot be indexed as if it were three."""
    with pytest.raises(TypeError, match="no entries"):
        SE3.identity()[0]
    assert len(SE3.identity()[None]) == 1
    with pytest.raises(TypeError, match="no length"):
        len(SE3.identity())
    with pytest.raises(TypeError, match="no length"):
        iter(SE3.identity())
    assert SE3.identity()
    assert not SE3.identity((0,))


def test_iteration_over_a_batch(rng):
    """Iteration returns the transforms along the first axis."""
    batch = random_transform(rng, (3, 2))
    for k, each in enumerate(batch):
        assert_same(each, batch[k], atol=0)
    assert k == 2


def test_points_may_be_lists(rng):
    """Numbers in lists and tuples are transformed like arrays."""
    pose = random_transform(rng)
    np.testing.assert_array_equal(pose @ [1, 2, 3], pose @ np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(pose @ [(1, 2, 3)], pose @ np.array([[1.0, 2.0, 3.0]]))


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (np.eye(4), r"^points have shape \(4, 4\), expected \(..., 3\) for transforms of shape \(2,\)$"),
        (np.ones(4), r"^points have shape \(4,\), expected"),
        (np.array(1.0), r"^points have shape \(\), expected"),
        (np.ones((5, 3)), r"^points have shape \(5, 3\), expected"),
        ("abc", "^points is not an array of numbers$"),
        (SE3.identity((5,)), r"^batches of \(2,\) and \(5,\) transforms do not match$"),
    ],
)
def test_products_of_wrong_shapes_are_refused(other, message):
    """The error has the shapes of points and of transforms."""
    with pytest.raises(InputError, match=message):
        SE3.identity((2,)) @ other


@pytest.mark.parametrize("pair", [(SE3.identity(), None), (np.eye(4), SE3.identity()), (3, SE3.identity())])
def test_products_with_other_operands_raise_type_error(pair):
    """A matrix has to be converted by `SE3.from_matrix` first."""
    with pytest.raises(TypeError, match=r"^unsupported operand"):
        pair[0] @ pair[1]


def test_quaternion_order_and_sign():
    """A quaternion is (x, y, z, w) with w >= 0, and a quarter turn about z maps x to y."""
    quarter = SE3.from_quaternion([0, 0, np.sqrt(0.5), np.sqrt(0.5)], [0, 0, 0])
    np.testing.assert_allclose(quarter @ np.array([1.0, 0, 0]), [0, 1, 0], atol=1e-15)
    same = SE3.from_quaternion([0, 0, -np.sqrt(0.5), -np.sqrt(0.5)], [0, 0, 0])
    assert_same(quarter, same)
    np.testing.assert_allclose(same.quaternion, [0, 0, np.sqrt(0.5), np.sqrt(0.5)], atol=1e-15)


def test_random_quaternions_round_trip(rng):
    """A quaternion is recovered from its matrix, whichever of its four entries is largest."""
    q = rng.normal(size=(500, 4)) * 10.0 ** rng.integers(-6, 1, size=(500, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    q = np.where(q[:, 3:] < 0, -q, q)
    np.testing.assert_allclose(SE3(rotation_from_quaternion(q), np.zeros((500, 3))).quaternion, q, atol=1e-14)


def test_rpy_rotates_about_fixed_axes():
    """Roll, pitch and yaw rotate about the fixed x, then y, then z, as in a URDF."""
    quarter = np.pi / 2
    turned = SE3.from_rpy([quarter, 0, quarter], [0, 0, 0]) @ np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(turned, [0, 0, 1], atol=1e-15)
    turned = SE3.from_rpy([0, quarter, quarter], [0, 0, 0]) @ np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(turned, [0, 0, -1], atol=1e-15)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-6, -np.pi / 2 + 1e-5, np.pi / 2 - 1e-8])
def test_rpy_at_gimbal_lock(pitch):
    """At and near a pitch of 90 deg the angles reproduce the rotation, with roll 0 at the lock."""
    a = SE3.from_rpy([0.4, pitch, -1.1], [0, 0, 0])
    assert_same(SE3.from_rpy(a.rpy, [0, 0, 0]), a, atol=1e-9)
    if abs(pitch) == np.pi / 2:
        assert a.rpy[0] == 0.0


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.eye(3), r"expected \(..., 4, 4\)"),
        (np.diag([1, 1, np.nan, 1]), "NaN"),
        (np.diag([1, 1, 1, 2]), "last row"),
        (np.diag([1, 1, -1, 1]), "not a rotation"),
        (np.diag([1.1, 1, 1, 1]), "not a rotation"),
        (np.zeros((4, 4)) + np.diag([0, 0, 0, 1]), "not a rotation"),
    ],
)
def test_invalid_matrices_are_refused(matrix, message):
    """A matrix that is no rigid transform raises InputError with its name and the problem."""
    with pytest.raises(InputError, match=message) as caught:
        SE3.from_matrix(matrix, "base_from_flange")
    assert "base_from_flange" in str(caught.value)


def test_transposed_matrix_is_recognised():
    """The error suggests a transposed matrix only if the transpose is a transform."""
    by_columns = SE3.from_quaternion([0.5, 0.5, 0.5, 0.5], [1, 2, 3]).matrix.T
    with pytest.raises(InputError, match="looks transposed"):
        SE3.from_matrix(by_columns)
    with pytest.raises(InputError, match=r"\(0, 0, 0, 1\)$"):
        SE3.from_matrix(by_columns + np.outer(np.eye(4)[0], np.eye(4)[3]))


@pytest.mark.parametrize(
    ("q", "t", "message"),
    [
        ([0, 0, 0, 1.01], [0, 0, 0], "norm 1.01"),
        ([0, 0, 0, 0], [0, 0, 0], "norm 0"),
        ([0, 0, 1], [0, 0, 0], "needs 4"),
        ([0, 0, 0, 1], [0, 0], "needs 4"),
        ([0, 0, np.inf, 1], [0, 0, 0], "infinity"),
        ([0, 0, 0, 1], [0, np.nan, 0], "NaN"),
    ],
)
def test_invalid_quaternions_are_refused(q, t, message):
    """A quaternion with a norm off 1 by more than 1e-3, of a wrong length or not finite raises InputError."""
    with pytest.raises(InputError, match=message):
        SE3.from_quaternion(q, t)


def test_rounded_quaternion_is_normalised():
    """A quaternion with a norm off 1 by less than 1e-3 is normalised."""
    exact, rounded = [0.5, 0.5, 0.5, 0.5], [0.5004, 0.5004, 0.5004, 0.5004]
    assert_same(SE3.from_quaternion(rounded, [1, 2, 3]), SE3.from_quaternion(exact, [1, 2, 3]))


def test_worst_quaternion_of_a_batch_is_reported():
    """The error has the norm that is furthest from one."""
    q = np.eye(4)[[3, 3, 3]] * [[1.0], [0.5], [1.2]]
    with pytest.raises(InputError, match=r"has norm 0\.5, expected 1 within 0\.001"):
        SE3.from_quaternion(q, np.zeros((3, 3)))


@pytest.mark.parametrize(("factor", "message"), [(1.1, "is not a rotation"), (-1.0, "is a reflection")])
def test_invalid_rotations_are_refused(factor, message):
    """A scaled rotation and a reflection raise InputError; a NaN state does not."""
    with pytest.raises(InputError, match=message):
        SE3(factor * SE3.exp([0, 0, 0, 0.3, 0.2, 0.1]).rotation, np.zeros(3))
    assert np.all(np.isnan(SE3(np.full((3, 3), np.nan), np.zeros(3)).rotation))


def test_repr_of_a_transform():
    """The line has translation and rotation vector of one transform, or the number of many."""
    assert repr(SE3.exp([1, 2, 3, 0, 0, 0])) == "SE3(t = [1, 2, 3] m, rotvec = [0, 0, 0] rad)"
    assert repr(SE3.identity((2, 5))) == "SE3(2 x 5 transforms)"


def test_invalid_tangents_and_transforms_are_refused():
    """`exp`, `stack` and `Camera.project` report the expected input in one line, like all others."""
    for values, message in (
        ("x", r"^xi is not an array of numbers, expected \(\.\.\., 6\)$"),
        ([[1, 2], [3]], "^xi is not an array"),
        (np.zeros(5), r"^xi has shape \(5,\), expected"),
    ):
        with pytest.raises(InputError, match=message):
            SE3.exp(values)
    with pytest.raises(InputError, match=r"^each of the transforms is of type int, expected SE3$"):
        SE3.stack([SE3.identity(), 1])
    with pytest.raises(InputError, match=r"^transforms have the shapes \(\), \(2,\), expected equal ones$"):
        SE3.stack([SE3.identity(), SE3.identity((2,))])


def test_add_axis_broadcasts_over_points():
    """Each transform is applied to all points of its row."""
    rng = np.random.default_rng(0)
    poses, points = SE3.exp(rng.standard_normal((4, 6))), rng.standard_normal((4, 5, 3))
    assert poses.add_axis().shape == (4, 1)
    rows = [pose @ row for pose, row in zip(poses, points, strict=True)]
    np.testing.assert_allclose(
        (poses.add_axis() @ SE3(np.broadcast_to(np.eye(3), (4, 5, 3, 3)), points)).translation, rows
    )


def test_repeat_of_a_transform(rng):
    """Each entry is the transform, and an empty batch has none."""
    pose = SE3.exp(rng.normal(size=6))
    many = pose.repeat(3)
    assert (many.shape, pose.repeat(0).shape) == ((3,), (0,))
    np.testing.assert_array_equal(many.matrix, [pose.matrix] * 3)
    np.testing.assert_array_equal((many @ np.ones(3)), [pose @ np.ones(3)] * 3)


def test_last_row_tolerance_is_a_millionth():
    """A larger deviation in the row is refused, and one in the column is too much to look transposed."""
    for off, taken in ((0.9e-6, True), (5e-6, False), (1e-3, False)):
        by_rows = np.eye(4)
        by_rows[3, 0] = off
        if taken:
            np.testing.assert_array_equal(SE3.from_matrix(by_rows).matrix, np.eye(4))
            continue
        with pytest.raises(InputError, match="looks transposed"):
            SE3.from_matrix(by_rows)
        by_rows[0, 3] = off
        with pytest.raises(InputError, match=r"last row is not \(0, 0, 0, 1\)$"):
            SE3.from_matrix(by_rows)


def test_batch_is_true_if_it_has_transforms():
    """A batch of one or more is true. A single transform is always true, and has no length."""
    assert [bool(SE3.identity(shape)) for shape in ((), (0,), (1,), (2,), (1, 0))] == [True, False, True, True, True]
    assert [len(SE3.identity(shape)) for shape in ((0,), (1,), (2, 3))] == [0, 1, 2]
    with pytest.raises(TypeError, match="no length"):
        len(SE3.identity())
