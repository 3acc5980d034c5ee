import cv2
import mpmath
import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry import Camera
from derivatives import check_derivative

PARAMETERS = [766.5, 765.4, 640.9, 358.8]
LENSES = {
    "pinhole0": ("pinhole", []),
    "pinhole4": ("pinhole", [-0.2, 0.05, 1e-3, -2e-3]),
    "pinhole5": ("pinhole", [-0.35, 0.179, 0.0, 0.0, 0.0]),
    "pinhole5_tangential": ("pinhole", [0.11, -0.23, 1.3e-3, 2e-3, 0.09]),
    "pinhole8": ("pinhole", [0.4, 0.1, -1e-3, 5e-4, 0.02, 0.6, 0.2, 0.05]),
    "fisheye": ("fisheye", [0.08, -0.01, 0.004, -0.001]),
}


@pytest.fixture(params=LENSES)
def camera(request):
    model, distortion = LENSES[request.param]
    return Camera(model, [*PARAMETERS, *distortion], (1280, 720))


@pytest.fixture
def points(rng):
    return rng.uniform([-0.5, -0.3, 0.6], [0.5, 0.3, 1.4], (4, 25, 3))


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def opencv_pixels(camera, points):
    flat = points.reshape(-1, 1, 3)
    matrix = np.array([[camera.focal[0], 0, camera.center[0]], [0, camera.focal[1], camera.center[1]], [0, 0, 1]])
    project = cv2.projectPoints if camera.model == "pinhole" else cv2.fisheye.projectPoints
    distortion = camera.distortion if len(camera.distortion) else None
    pixels, _ = project(flat, np.zeros(3), np.zeros(3), matrix, distortion)
    return pixels.reshape(*points.shape[:-1], 2)


def exact_pixel(camera, point):
    """The formulas of both lens models in mpmath."""
    fx, fy, cx, cy, *k = map(mpmath.mpf, camera.parameters.tolist())
    x, y, z = point
    if camera.model == "fisheye":
        r = mpmath.hypot(x, y)
        t = mpmath.atan2(r, z)
        d = t + sum(c * t ** (2 * i + 3) for i, c in enumerate(k))
        return [fx * x / r * d + cx, fy * y / r * d + cy]
    k1, k2, p1, p2, k3, k4, k5, k6 = k + [mpmath.mpf(0)] * (8 - len(k))
    a, b = x / z, y / z
    s = a**2 + b**2
    radial = (1 + k1 * s + k2 * s**2 + k3 * s**3) / (1 + k4 * s + k5 * s**2 + k6 * s**3)
    u = a * radial + 2 * p1 * a * b + p2 * (s + 2 * a**2)
    v = b * radial + p1 * (s + 2 * b**2) + 2 * p2 * a * b
    return [fx * u + cx, fy * v + cy]


def test_camera_matrix_has_focal_lengths_and_principal_point(camera):
    """The matrix also maps a ray of an undistorted lens to its pixel."""
    plain = Camera("pinhole", np.array(PARAMETERS), (1280, 720))
    np.testing.assert_array_equal(camera.matrix, plain.matrix)
    point = np.array([0.2, -0.1, 0.8])
    np.testing.assert_allclose(plain.matrix @ point / 0.8, [*plain.project(point), 1.0])


def test_pixels_equal_opencv(camera, points):
    """Both lens models agree with OpenCV to rounding."""
    np.testing.assert_allclose(camera.project(points), opencv_pixels(camera, points), rtol=0, atol=1e-9)


@pytest.mark.parametrize("intrinsics", [False, True])
def test_pixels_are_independent_of_requested_derivatives(camera, points, intrinsics):
    """`project` and `project_with_derivatives` return the same pixels."""
    pixels, _, _ = camera.project_with_derivatives(points, intrinsics)
    np.testing.assert_array_equal(pixels, camera.project(points))


@pytest.mark.parametrize("intrinsics", [False, True])
def test_derivative_by_points(camera, points, intrinsics):
    """The derivative by a point equals finite differences."""
    _, d_points, _ = camera.project_with_derivatives(points, intrinsics)
    check_derivative(lambda d: camera.project(points + d), d_points, step=5e-3)


def test_derivative_by_parameters(camera, points):
    """The derivative by focal lengths, centre and every distortion term equals finite differences."""
    _, _, d_parameters = camera.project_with_derivatives(points, intrinsics=True)
    assert d_parameters.shape == (4, 25, 2, len(camera.parameters))
    check_derivative(lambda d: camera.with_parameters(camera.parameters + d).project(points), d_parameters)


@pytest.mark.parametrize("terms", [4, 5, 8])
def test_derivative_by_zero_distortion_terms(points, terms):
    """Distortion terms of zero have a derivative, because they are first estimated from zero."""
    camera = Camera("pinhole", [*PARAMETERS, *[0.0] * terms])
    _, d_points, d_parameters = camera.project_with_derivatives(points, intrinsics=True)
    check_derivative(lambda d: camera.with_parameters(camera.parameters + d).project(points), d_parameters)
    check_derivative(lambda d: camera.project(points + d), d_points, step=5e-3)


EXTREME = {
    "nearly on the axis": (1e-9, -2e-9, 0.7),
    "hardly off the axis": (1e-150, 2e-150, 0.7),
    "near": (1e-7, 2e-7, 1e-6),
    "far": (1e5, -2e5, 1e6),
    "wide": (2.0, -1.0, 0.5),
}


@pytest.mark.parametrize("point", EXTREME.values(), ids=EXTREME)
def test_extreme_points_are_exact(camera, point):
    """Pixels and derivatives keep twelve digits near the axis, near the lens, far and wide.

    1e-12 of the largest entry is a few hundred roundings: the polynomials cancel by up to that.
    """
    pixel, d_point, _ = camera.project_with_derivatives(np.array(point))
    with mpmath.workdps(400):
        exact = [mpmath.mpf(x) for x in point]
        want = np.array([float(x) for x in exact_pixel(camera, exact)])
        h = mpmath.mpf(10) ** -200 * abs(exact[0])
        slopes = np.empty((2, 3))
        for i in range(3):
            ends = [exact_pixel(camera, [x + s * h * (i == j) for j, x in enumerate(exact)]) for s in (1, -1)]
            slopes[:, i] = [float((a - b) / (2 * h)) for a, b in zip(*ends, strict=True)]
    np.testing.assert_allclose(pixel, want, rtol=1e-12, atol=1e-12 * np.abs(want).max())
    np.testing.assert_allclose(d_point, slopes, rtol=0, atol=1e-12 * np.abs(slopes).max())


def test_fisheye_projects_points_behind_itself():
    """A fisheye projects points beyond 90 deg by its polynomial, with their derivative."""
    camera = Camera("fisheye", [300.0, 310.0, 500.0, 510.0, 0.01, 0.0, 0.0, 0.0])
    points = np.array([[0.5, 0.2, -0.3], [-0.4, 0.6, 0.0]])
    pixels, d_points, _ = camera.project_with_derivatives(points)
    with mpmath.workdps(40):
        want = [[float(x) for x in exact_pixel(camera, [mpmath.mpf(x) for x in p])] for p in points.tolist()]
    np.testing.assert_allclose(pixels, want, rtol=1e-14)
    check_derivative(lambda d: camera.project(points + d), d_points)
    rays, valid = camera.undistort(pixels)
    assert valid.all()
    np.testing.assert_allclose(rays, points / np.linalg.norm(points, axis=-1, keepdims=True), atol=1e-13)


def test_projection_is_smooth_on_the_axis(camera):
    """On the axis the pixel is the centre and the derivative focal / z."""
    pixel, d_point, d_parameters = camera.project_with_derivatives(np.array([0.0, 0.0, 2.0]), intrinsics=True)
    np.testing.assert_array_equal(pixel, camera.center)
    np.testing.assert_allclose(d_point, [[camera.focal[0] / 2, 0, 0], [0, camera.focal[1] / 2, 0]], atol=1e-12)
    np.testing.assert_array_equal(d_parameters[:, 4:], 0.0)


@pytest.mark.parametrize("z", [0.0, -0.5, np.nan])
def test_points_behind_the_lens_are_nan(camera, z):
    """Pixel and derivatives are NaN if the lens has no image of a point, without effect on its neighbours."""
    x = 0.1 if camera.model == "pinhole" else 0.0
    points = np.array([[x, 0.0, z], [0.1, 0.2, 1.0]])
    pixels, d_points, d_parameters = camera.project_with_derivatives(points, intrinsics=True)
    assert np.isnan(pixels[0]).all()
    assert np.isnan(d_points[0]).all()
    assert np.isfinite(pixels[1]).all()
    assert np.isfinite(d_points[1]).all()
    assert np.isfinite(d_parameters[1]).all()
    np.testing.assert_array_equal(camera.project(points), pixels)
    np.testing.assert_array_equal(camera.sees(points), [False, True])


def test_undistort_inverts_projection(camera, rng):
    """Every point that a camera sees is recovered from its pixel as its own direction."""
    points = rng.uniform([-1.2, -0.8, 0.5], [1.2, 0.8, 1.5], (50, 60, 3))
    seen = camera.sees(points)
    assert seen.mean() > 0.4
    rays, valid = camera.undistort(camera.project(points))
    assert valid[seen].all()
    unit = points / np.linalg.norm(points, axis=-1, keepdims=True)
    np.testing.assert_allclose(rays[seen], unit[seen], rtol=0, atol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(rays[valid], axis=-1), 1.0, atol=1e-14)


def test_valid_directions_project_to_their_pixels(camera):
    """Over the whole image, each valid direction projects to its pixel."""
    pixels = np.stack(np.meshgrid(np.arange(0, 1280, 40.0), np.arange(0, 720, 40.0)), -1)
    rays, valid = camera.undistort(pixels)
    assert valid.mean() > 0.95
    np.testing.assert_allclose(camera.project(rays[valid]), pixels[valid], rtol=0, atol=1e-8)
    assert np.isnan(rays[~valid]).all()


@pytest.mark.parametrize(("model", "k1"), [("pinhole", -0.35), ("fisheye", -0.2)])
def test_no_direction_beyond_the_fold(model, k1):
    """A polynomial r + k1 r^3 turns back at r^2 = -1 / (3 k1). No image is beyond two thirds of that r."""
    camera = Camera(model, [500.0, 500.0, 0.0, 0.0, k1, 0.0, 0.0, 0.0])
    fold = np.sqrt(-1 / (3 * k1))
    rim = 500.0 * fold * 2 / 3
    along = np.array([np.cos(0.7), np.sin(0.7)])
    _, valid = camera.undistort(rim * np.array([0.5, 0.99, 0.99999, 1.00001, 1.1, 3.0])[:, None] * along)
    np.testing.assert_array_equal(valid, [True, True, True, False, False, False])


@pytest.mark.parametrize(("model", "k1"), [("pinhole", -0.35), ("fisheye", -0.2)])
def test_points_beyond_the_fold_are_not_seen(model, k1):
    """A point beyond the fold has a pixel by the formula, but it belongs to another direction."""
    camera = Camera(model, [500.0, 500.0, 640.0, 360.0, k1, 0.0, 0.0, 0.0], (1280, 720))
    fold = np.sqrt(-1 / (3 * k1))
    reach = np.array([0.3, 0.99, 1.01, 1.3]) * fold
    angle = np.arctan(reach) if model == "pinhole" else reach
    points = np.stack([np.sin(angle), np.zeros(4), np.cos(angle)], -1)
    np.testing.assert_array_equal(camera.sees(points), [True, True, False, False])


def test_pole_of_the_rational_lens_is_a_fold():
    """The lens ends at the zero of the rational model's denominator."""
    camera = Camera("pinhole", [500.0, 500.0, 0.0, 0.0, 0, 0, 0, 0, 0, -1.0, 0, 0])
    points = np.array([[0.9, 0.0, 1.0], [1.1, 0.0, 1.0]])
    np.testing.assert_array_equal(camera.sees(points), [True, False])


def test_valid_directions_are_never_mirrored():
    """Extreme tangential terms fold a lens inside its radial range. Directions beyond that fold are not valid."""
    camera = Camera("pinhole", [500.0, 500.0, 0.0, 0.0, 0.718, -0.169, -0.18, 0.23])
    pixels = np.stack(np.meshgrid(np.arange(-900, 900, 60.0), np.arange(-900, 900, 60.0)), -1)
    rays, valid = camera.undistort(pixels)
    assert 0.2 < valid.mean() < 0.9
    at, d_points, _ = camera.project_with_derivatives(rays[valid])
    np.testing.assert_allclose(at, pixels[valid], rtol=0, atol=1e-8)
    assert np.all(np.linalg.eigvalsh(d_points[..., :2]) > 0)


def test_fisheye_ends_behind_itself():
    """An undistorted fisheye images every direction, up to pi times its focal length from the centre."""
    camera = Camera("fisheye", [100.0, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    rays, valid = camera.undistort(np.array([[0.0, 314.0], [0.0, 314.2]]))
    np.testing.assert_array_equal(valid, [True, False])
    np.testing.assert_allclose(rays[0], [0, np.sin(3.14), np.cos(3.14)], atol=1e-13)


def test_points_outside_the_image_are_not_seen():
    """The image extends half a pixel beyond the centres of its outer pixels."""
    camera = Camera("pinhole", [100.0, 100.0, 0.0, 0.0], (200, 100))
    pixels = np.array([[-0.4, 0.0], [-0.6, 0.0], [199.4, 99.4], [199.6, 0.0], [0.0, 99.6]])
    points = np.column_stack([pixels / 100.0, np.ones(5)])
    np.testing.assert_array_equal(camera.sees(points), [True, False, True, False, False])


def test_non_finite_pixels_have_no_direction(camera):
    """NaN and infinite pixels are not valid, without a warning."""
    rays, valid = camera.undistort(np.array([[np.nan, 3.0], [np.inf, 3.0], camera.center]))
    np.testing.assert_array_equal(valid, [False, False, True])
    np.testing.assert_allclose(rays[2], [0, 0, 1], atol=1e-15)
    assert np.isnan(rays[:2]).all()


@pytest.mark.parametrize("shape", [(), (0,), (1,), (2, 3)])
def test_leading_axes_are_a_batch(camera, shape, rng):
    """Points of any leading shape give results of that shape, equal entry by entry."""
    points = rng.uniform([-0.3, -0.3, 0.8], [0.3, 0.3, 1.2], (*shape, 3))
    pixels, d_points, d_parameters = camera.project_with_derivatives(points, intrinsics=True)
    assert pixels.shape == (*shape, 2)
    assert d_points.shape == (*shape, 2, 3)
    assert d_parameters.shape == (*shape, 2, len(camera.parameters))
    one_by_one = [camera.project(p) for p in points.reshape(-1, 3)]
    np.testing.assert_allclose(pixels.reshape(-1, 2), np.reshape(one_by_one, (-1, 2)), rtol=1e-15)
    rays, valid = camera.undistort(pixels)
    assert (rays.shape, valid.shape) == ((*shape, 3), shape)


def test_batch_of_lenses_equals_separate_lenses(camera, rng):
    """Lenses (2, 3) with points (2, 3, 4, 5) project and differentiate entry by entry as each lens alone."""
    scale = 1 + 0.01 * rng.standard_normal((2, 3, len(camera.parameters)))
    batch = camera.with_parameters(camera.parameters * scale)
    points = rng.uniform([-0.3, -0.3, 0.8], [0.3, 0.3, 1.2], (2, 3, 4, 5, 3))
    pixels, d_points, d_parameters = batch.project_with_derivatives(points, intrinsics=True)
    np.testing.assert_allclose(batch.project(points), pixels, rtol=1e-14)
    for i, j in np.ndindex(2, 3):
        alone = batch[i, j].project_with_derivatives(points[i, j], intrinsics=True)
        for ours, theirs in zip((pixels, d_points, d_parameters), alone, strict=True):
            np.testing.assert_allclose(ours[i, j], theirs, rtol=1e-12, atol=1e-12)


def test_parameters_are_kept_and_replaced():
    """The parts equal the given ones. New parameters keep model and size, and arrays are read-only."""
    camera = Camera("pinhole", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0], (10, 20))
    np.testing.assert_array_equal(camera.focal, [1, 2])
    np.testing.assert_array_equal(camera.center, [3, 4])
    np.testing.assert_array_equal(camera.distortion, [5, 6, 7, 8, 9])
    other = camera.with_parameters(camera.parameters + 1)
    assert (other.model, other.size_px) == ("pinhole", (10, 20))
    np.testing.assert_array_equal(other.parameters, camera.parameters + 1)
    with pytest.raises(ValueError, match="read-only"):
        camera.parameters[0] = 3.0


@pytest.mark.parametrize(
    ("model", "parameters", "size", "message"),
    [
        ("pinhole", [1, 1, 0], None, "fx, fy, cx, cy"),
        ("pinhole", [1, 1, 0, 0, 0.1], None, "0 or 4 or 5 or 8"),
        ("fisheye", [1, 1, 0, 0], None, "4 distortion"),
        ("pinhole", 1.0, None, "shape"),
        ("pinhole", [0, 1, 0, 0], None, "focal"),
        ("pinhole", [1, -1, 0, 0], None, "focal"),
        ("pinhole", [1, np.nan, 0, 0], None, "NaN"),
        ("pinhole", [1, 1, np.inf, 0], None, "infinity"),
        ("pinhol", [1, 1, 0, 0], None, "did you mean 'pinhole'"),
        ("pinhole", [1, 1, 0, 0], (0, 5), "size_px"),
        ("pinhole", [1, 1, 0, 0], (5,), "size_px"),
        ("pinhole", [1, 1, 0, 0], (5, 0), "size_px"),
        ("pinhole", [1, 1, 0, 0], (5, 5, 5), "size_px"),
    ],
)
def test_invalid_cameras_are_refused(model, parameters, size, message):
    """An invalid camera raises InputError with the expected values."""
    with pytest.raises(InputError, match=message):
        Camera(model, parameters, size)


def test_wrong_last_axis_is_refused(camera):
    """Points have three coordinates and pixels two."""
    for call, values in (
        (camera.project, np.zeros((5, 2))),
        (camera.project_with_derivatives, np.zeros((5, 4))),
        (camera.sees, np.float64(1.0)),
        (camera.undistort, np.zeros((5, 3))),
        (camera.project, "x"),
        (camera.undistort, [[1.0, 2.0], [3.0]]),
    ):
        with pytest.raises(InputError, match="expected"):
            call(values)


@pytest.mark.parametrize("terms", [False, True])
def test_pixels_are_scaled_and_shifted_images(camera, points, terms):
    """Focal lengths scale the image on the unit plane, and the centre shifts it. Derivatives follow from it, too."""
    pixels, image = camera.image(points, terms)
    expected, by_points, by_parameters = camera.project_with_derivatives(points, terms)
    np.testing.assert_array_equal(pixels, expected)
    np.testing.assert_array_equal(image.by_points, by_points)
    np.testing.assert_allclose(np.stack([image.u, image.v], -1) * camera.focal + camera.center, pixels, rtol=1e-13)
    if terms:
        np.testing.assert_array_equal(by_parameters[..., 0, 0], image.u)
        np.testing.assert_array_equal(by_parameters[..., 1, 1], image.v)
        np.testing.assert_array_equal(by_parameters[..., 4:], image.by_terms)
    else:
        assert image.by_terms is None


def test_invalid_focal_lengths_are_reported():
    """The error has the smallest focal length of each axis, of one lens or of many."""
    with pytest.raises(InputError, match=r"focal lengths are 500 and -3 px, expected both above 0"):
        Camera("pinhole", [500.0, -3.0, 320.0, 240.0])
    with pytest.raises(InputError, match=r"focal lengths are 0 and 400 px"):
        Camera("pinhole", [[500.0, 400.0, 1, 1], [0.0, 410.0, 1, 1], [600.0, 420.0, 1, 1]])


@pytest.mark.parametrize(
    ("model", "count", "known"),
    [("pinhole", 0, []), ("pinhole", 4, [2, 3]), ("pinhole", 5, [2, 3, 4]), ("fisheye", 4, [])],
)
def test_term_sigmas_of_real_lenses(model, count, known):
    """Tangential terms have sigmas of thousandths, the third radial one of about a tenth.

    The others have an infinite sigma.
    """
    sigmas = Camera(model, [*PARAMETERS, *[0.0] * count]).term_sigmas
    assert sigmas.shape == (count,)
    assert np.flatnonzero(np.isfinite(sigmas)).tolist() == known
    assert np.all((sigmas[2:4] > 1e-3) & (sigmas[2:4] < 1e-2) | (model == "fisheye"))
    assert np.all((sigmas[4:] > 0.03) & (sigmas[4:] < 0.3))
    assert np.all(np.isinf(Camera("pinhole", [*PARAMETERS, *[0.0] * 8]).term_sigmas))


def test_image_edges_are_half_a_pixel_outside():
    """Half a pixel before the first centre is inside, half a pixel beyond the last is outside.

    Without a size, all points are inside.
    """
    camera = Camera("pinhole", [1.0, 1.0, 0.0, 0.0], (8, 4))
    pixels = np.array([[-0.5, -0.5], [7.5, 0.0], [0.0, 3.5], [7.25, 3.25], [-0.625, 0.0], [0.0, -0.625]])
    points = np.column_stack([pixels, np.ones(6)])
    np.testing.assert_array_equal(camera.sees(points), [True, False, False, True, False, False])
    assert Camera("pinhole", [1.0, 1.0, 0.0, 0.0]).sees(points).all()


def test_image_size_may_be_one_pixel_or_unknown():
    """A camera may have an image of a single pixel, or no size at all."""
    assert Camera("pinhole", [1, 1, 0, 0], (1, 1)).size_px == (1, 1)
    assert Camera("pinhole", [1, 1, 0, 0]).size_px is None
