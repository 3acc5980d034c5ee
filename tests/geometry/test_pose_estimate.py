import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry import SE3, PoseEstimate

DRAWS = 20000


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def random_estimate(rng, size=1e-3):
    root = rng.normal(size=(6, 6)) * size
    return PoseEstimate(SE3.exp(rng.normal(size=6)), root @ root.T)


def draw_poses(rng, estimate):
    return estimate.mean @ SE3.exp(rng.multivariate_normal(np.zeros(6), estimate.covariance, DRAWS))


def assert_covers(covariance, tangents):
    """Assert that the whitened tangents have unit covariance within five of its standard errors."""
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), tangents.T)
    np.testing.assert_allclose(whitened @ whitened.T / DRAWS, np.eye(6), rtol=0, atol=5 * np.sqrt(2 / DRAWS))


def test_inverse_covariance_equals_sample_covariance(rng):
    """The covariance of the inverse is that of inverted draws, in the axes of a."""
    estimate = random_estimate(rng)
    inverse = estimate.inverse()
    assert_covers(inverse.covariance, (inverse.mean.inverse() @ draw_poses(rng, estimate).inverse()).log())


def test_product_covariance_equals_sample_covariance(rng):
    """The covariance of a product is that of composed independent draws."""
    a, b = random_estimate(rng), random_estimate(rng)
    product = a @ b
    assert_covers(product.covariance, (product.mean.inverse() @ draw_poses(rng, a) @ draw_poses(rng, b)).log())


def test_left_covariance_equals_sample_covariance(rng):
    """The left covariance is that of the same draws as perturbations before the mean."""
    estimate = random_estimate(rng)
    assert_covers(estimate.left_covariance(), (draw_poses(rng, estimate) @ estimate.mean.inverse()).log())


def test_right_covariance_is_independent_of_the_lever_arm():
    """Far from a, a covariance in the axes of b is unchanged. In the axes of a it grows with the lever arm."""
    sigma = np.diag([1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]) ** 2
    far = PoseEstimate(SE3.from_rotvec([0, 0, 0], [10.0, 0, 0]), sigma)
    np.testing.assert_allclose((PoseEstimate.exact(far.mean) @ PoseEstimate(SE3.identity(), sigma)).covariance, sigma)
    np.testing.assert_allclose(
        np.sqrt(np.diag(far.left_covariance())[:3]), [1e-3, 1e-3 * np.sqrt(101), 1e-3 * np.sqrt(101)]
    )


def test_covariances_satisfy_group_axioms(rng):
    """Inverting twice gives the same covariance, and products are associative."""
    a, b, c = (random_estimate(rng) for _ in range(3))
    np.testing.assert_allclose(a.inverse().inverse().covariance, a.covariance, rtol=1e-10, atol=1e-18)
    np.testing.assert_allclose(((a @ b) @ c).covariance, (a @ (b @ c)).covariance, rtol=1e-10, atol=1e-18)
    np.testing.assert_allclose(
        (a @ b).inverse().covariance, (b.inverse() @ a.inverse()).covariance, rtol=1e-10, atol=1e-18
    )


def test_exact_transform_keeps_the_covariance(rng):
    """The product of an exact transform and an estimate has the estimate's covariance."""
    a = random_estimate(rng)
    known = PoseEstimate.exact(SE3.exp(rng.normal(size=6)))
    np.testing.assert_array_equal((known @ a).covariance, a.covariance)
    np.testing.assert_array_equal(known.covariance, 0.0)


def test_sigmas_are_roots_of_the_diagonal():
    """The sigmas are of translation first, then of rotation."""
    estimate = PoseEstimate(SE3.identity(), np.diag([1.0, 4, 9, 16, 25, 36]))
    np.testing.assert_array_equal(estimate.sigma_t, [1, 2, 3])
    np.testing.assert_array_equal(estimate.sigma_r, [4, 5, 6])


@pytest.mark.parametrize(
    ("mean", "covariance", "message"),
    [
        (SE3.identity(), np.zeros((3, 3)), "covariance has shape"),
        (SE3.identity((2,)), np.eye(6), r"^\(2,\) transforms and \(\) covariances, expected one of each"),
        (SE3.identity(), np.stack([np.eye(6)] * 2), "expected one of each"),
        (np.eye(4), np.eye(6), "^mean is of type ndarray, expected SE3$"),
    ],
)
def test_invalid_estimates_are_refused(mean, covariance, message):
    """Another shape, a batch, or a matrix instead of a transform raises InputError."""
    with pytest.raises(InputError, match=message):
        PoseEstimate(mean, covariance)


def test_covariance_is_read_only():
    """The covariance array of an estimate cannot be written."""
    with pytest.raises(ValueError, match="read-only"):
        PoseEstimate.exact(SE3.identity()).covariance[0, 0] = 1.0


def test_exact_transforms_compose_with_estimates(rng):
    """A transform is composed on either side as an estimate without covariance; other operands raise TypeError."""
    a, known = random_estimate(rng), SE3.exp(rng.normal(size=6))
    for found, expected in ((known @ a, PoseEstimate.exact(known) @ a), (a @ known, a @ PoseEstimate.exact(known))):
        np.testing.assert_array_equal(found.covariance, expected.covariance)
        np.testing.assert_array_equal(found.mean.matrix, expected.mean.matrix)
    for pair in ((a, None), (np.eye(4), a)):
        with pytest.raises(TypeError, match="operand"):
            pair[0] @ pair[1]


def test_product_with_an_array_is_refused():
    """The error suggests SE3: an estimate composes with poses, and a tool point is a pose without rotation."""
    estimate = PoseEstimate(SE3.from_rotvec([0, 0, 0.3], [1, 0, 0]), 1e-6 * np.eye(6))
    point = np.array([0.0, 0.0, 0.2])
    for given in (point, [0.0, 0.0, 0.2], np.eye(4)):
        with pytest.raises(InputError, match=r"write estimate @ SE3\(np\.eye\(3\), point\)"):
            estimate @ given
    at_point = estimate @ SE3(np.eye(3), point)
    np.testing.assert_allclose(at_point.mean.translation, estimate.mean @ point)
    np.testing.assert_allclose(at_point.covariance[0, 0], 1e-6 * (1 + 0.2**2))


def test_repr_of_an_estimate_has_its_sigmas():
    """The line has millimetres and degrees per axis. The norms of sigmas are roots of the traces."""
    sigmas = np.array([1e-3, 2e-3, 2e-3, *np.radians([0.3, 0.4, 0.0])])
    estimate = PoseEstimate(SE3.from_rotvec([0, 0, np.pi / 2], [0.1, 0.0, -1.0]), np.diag(sigmas**2))
    assert repr(estimate) == "PoseEstimate([100, 0, -1000] ± [1, 2, 2] mm, [0, 0, 90] ± [0.3, 0.4, 0] deg)"
    assert estimate.sigma_norms == pytest.approx((3e-3, np.radians(0.5)))
