"""Tests of the right Jacobian of SE(3): against mpmath at difficult points, and as a derivative."""

import mpmath
import numpy as np
import pytest

from basecal.geometry import SE3
from basecal.geometry.se3_jacobians import right_jacobian, right_jacobian_inverse
from derivatives import check_derivative
from exact_se3 import CASES, DIGITS, IDS, TOLERANCE, as_array, exact_right_jacobian, tangent


@pytest.fixture(params=CASES, ids=IDS)
def xi(request):
    return tangent(*request.param)


@pytest.fixture
def rng():
    return np.random.default_rng(11)


def test_right_jacobian_at_difficult_points(xi):
    """`right_jacobian` equals the power series of the small adjoint, near zero rotation with translation, too."""
    np.testing.assert_allclose(right_jacobian(xi), as_array(exact_right_jacobian(tuple(xi))), rtol=0, atol=TOLERANCE)


def test_right_jacobian_inverse_at_difficult_points(xi):
    """`right_jacobian_inverse` is the inverse of that series."""
    with mpmath.workdps(DIGITS):
        want = as_array(exact_right_jacobian(tuple(xi)) ** -1)
    np.testing.assert_allclose(right_jacobian_inverse(xi), want, rtol=0, atol=TOLERANCE)


def test_right_jacobian_equals_finite_differences(rng):
    """The Jacobians are the derivatives of `log` for a step before or after `exp`."""
    xi = rng.normal(size=(5, 6)) * 0.8
    at = SE3.exp(xi)
    check_derivative(lambda d: (at.inverse() @ SE3.exp(xi + d)).log(), right_jacobian(xi))
    check_derivative(lambda d: (at @ SE3.exp(d)).log(), right_jacobian_inverse(xi))
