"""Tests of rotation matrices: half turns, cross products, projections. Exponentials are tested with SE(3)'s."""

from math import factorial

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry.rotation import (
    check_rotation,
    cross,
    cross_matrix,
    exp_coefficients,
    lengths,
    nearest_rotation,
    project_rotation,
    quaternion_from_rotation,
    rotation_exp,
    rotation_log,
)


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.mark.parametrize("axis", [*np.eye(3), np.array([0.6, 0.8, 0.0]), np.array([-0.48, 0.6, 0.64])])
def test_log_of_half_turns(axis):
    """At exactly pi the log is a rotation by pi about the axis, with either sign."""
    rotation = 2 * np.outer(axis, axis) - np.eye(3)
    w = rotation_log(rotation)
    np.testing.assert_allclose(np.linalg.norm(w), np.pi, atol=1e-15)
    np.testing.assert_allclose(abs(w @ axis), np.pi, atol=1e-14)
    np.testing.assert_allclose(rotation_exp(w), rotation, atol=1e-14)


def test_cross_matrix_equals_the_cross_product(rng):
    """`cross_matrix(w) @ v` is `cross(w, v)`."""
    w, v = rng.normal(size=(2, 6, 3))
    np.testing.assert_allclose((cross_matrix(w) @ v[..., None])[..., 0], np.cross(w, v), atol=1e-15)


def test_nearest_rotation_is_nearest(rng):
    """No rotation in any direction is nearer than the result, even if the matrix is nearer to a reflection."""
    matrices = rotation_exp(rng.normal(size=(20, 3))) + 0.3 * rng.normal(size=(20, 3, 3))
    matrices[:5, :, 0] *= -1
    nearest = nearest_rotation(matrices)
    np.testing.assert_allclose(
        nearest @ np.swapaxes(nearest, -1, -2), np.broadcast_to(np.eye(3), (20, 3, 3)), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(nearest), 1.0, atol=1e-14)
    distance = np.linalg.norm(nearest - matrices, axis=(-2, -1))
    for turn in rotation_exp(rng.normal(size=(200, 1, 3))):
        assert np.all(np.linalg.norm(nearest @ turn - matrices, axis=(-2, -1)) >= distance - 1e-12)


def test_rounded_rotation_is_projected():
    """A rotation with four digits is accepted and projected. One with a larger error is refused."""
    rotation = rotation_exp(np.array([0.3, -0.5, 0.8]))
    projected = project_rotation(np.round(rotation, 4))
    np.testing.assert_allclose(projected @ projected.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(projected, rotation, atol=1e-4)
    with pytest.raises(InputError, match="not a rotation"):
        project_rotation(np.round(rotation, 2))


def test_the_wrong_rotation_of_a_batch_is_named():
    """By its place; a reflection is named as such."""
    rotations = rotation_exp(np.arange(12.0).reshape(4, 3))
    for change, words in ((1.01 * np.eye(3), "at most 0.001 is projected"), (np.diag([1, 1, -1.0]), "left-handed")):
        wrong = rotations.copy()
        wrong[2] = wrong[2] @ change
        with pytest.raises(InputError, match=f"R is not a rotation in entry 2, counted from 0: off by .*{words}"):
            project_rotation(wrong, "R")


def test_series_terms_suffice_for_small_angles():
    """Coefficients of a small angle are the same beside a larger one, which needs more terms."""
    small = np.array([0.0, 1e-9, 1e-3, 0.0299])
    beside = exp_coefficients(np.append(small, 0.4), 5)[:, :-1]
    np.testing.assert_allclose(exp_coefficients(small, 5), beside, rtol=3e-16, atol=0)


def test_lengths_are_euclidean(rng):
    """Lengths over the last axis equal NumPy's."""
    vectors = rng.normal(size=(4, 2, 3))
    np.testing.assert_allclose(lengths(vectors), np.linalg.norm(vectors, axis=-1), rtol=1e-15)


def test_cross_equals_numpy(rng):
    """Cross products of broadcast batches equal NumPy's."""
    left, right = rng.normal(size=(4, 1, 3)), rng.normal(size=(2, 3))
    np.testing.assert_array_equal(cross(left, right), np.cross(left, right))


def test_quaternion_sign_of_half_turns():
    """If w is zero, the largest entry is positive; otherwise w is positive."""
    half = np.array([2 * np.outer(axis, axis) - np.eye(3) for axis in np.eye(3)])
    np.testing.assert_array_equal(quaternion_from_rotation(half), np.eye(4)[:3])
    nearly = rotation_exp(np.array([[0.0, 0.0, -3.0], [0.0, 0.0, 3.0]]))
    np.testing.assert_allclose(quaternion_from_rotation(nearly)[:, 2], np.sin([-1.5, 1.5]), atol=1e-15)
    assert np.all(quaternion_from_rotation(nearly)[:, 3] > 0)


@pytest.mark.parametrize("angle", [0.0, 0.02, 0.031, 0.3, 0.499, 0.501, 1.0, 2.0, np.pi])
@pytest.mark.parametrize("count", [1, 3, 5])
def test_exp_coefficients_equal_their_series(angle, count):
    """Coefficients are correct on both sides of the limits between series and closed forms.

    They are so alone and beside other angles.
    """
    wanted = [
        sum((-1) ** k * angle ** (2 * k) / factorial(2 * k + first) for k in range(20)) for first in range(1, count + 1)
    ]
    found = exp_coefficients(np.array(angle), count)
    assert found.shape == (count,)
    np.testing.assert_allclose(found, wanted, rtol=2e-13, atol=1e-15)
    np.testing.assert_allclose(
        exp_coefficients(np.array([0.1, angle, 3.0]), count)[:, 1], wanted, rtol=2e-13, atol=1e-15
    )


@pytest.mark.parametrize("shape", [(), (2,)])
def test_rotation_tolerance_is_a_thousandth(shape):
    """R'R may differ from the identity by twice 1e-3, which is 1e-3 for the projection.

    Sheared, scaled or left-handed matrices are refused.
    """
    rotation = np.broadcast_to(rotation_exp(np.array([0.3, -0.5, 0.8])), (*shape, 3, 3))
    for factor, taken in ((1.00098, True), (0.9991, True), (1.0011, False), (0.9988, False)):
        if taken:
            check_rotation(factor * rotation)
        else:
            with pytest.raises(InputError, match=r"R is not a rotation: R. R is off the identity by 0\.002"):
                check_rotation(factor * rotation, "R")
    with pytest.raises(InputError, match="rotation is a reflection"):
        check_rotation(rotation @ np.diag([1.0, 1.0, -1.0]))
    check_rotation(rotation[:0] if shape else rotation)
    for off, taken in ((0.9e-3, True), (1.1e-3, False)):
        scaled = np.broadcast_to((1 + off) * np.eye(3), (*shape, 3, 3))
        if taken:
            np.testing.assert_allclose(project_rotation(scaled), np.broadcast_to(np.eye(3), (*shape, 3, 3)), atol=1e-15)
        else:
            with pytest.raises(InputError, match=r"off by 0\.0011, at most 0\.001"):
                project_rotation(scaled)
