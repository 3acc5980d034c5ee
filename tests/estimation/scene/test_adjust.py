"""Tests of the optimum of a scene, and of residuals about it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Intrinsics, Unknown
from basecal.estimation.scene.adjust import SceneProblem, adjust, prior_information, residuals_px, scene_fit
from basecal.estimation.scene.state import take_step
from basecal.geometry import SE3
from scene_points import ARM_M, ARM_RAD, BASE, LENS, MOUNT, PIXEL, made_scene, started

NOISE = np.repeat([ARM_M, ARM_RAD], 3)


def test_exact_data_give_the_truth():
    """Exact image points and poses give mounts and base to 10 um."""
    scene = made_scene(3, arms=2, noise=0.0)
    state = replace(started(scene, 1e-3), points=scene.truth.points)
    noise = np.tile(NOISE, (len(scene.views.stop_robot), 1))
    found = adjust(SceneProblem(scene.views, scene.tracks, PIXEL, noise, (LENS, LENS)), state).state
    assert np.linalg.norm((BASE.inverse() @ found.bases[1]).log()) < 1e-5
    assert np.linalg.norm((MOUNT.inverse() @ found.mounts[0]).log()) < 1e-5


def test_pixel_information_is_normalised_to_one_pixel():
    """The pixel information is the same for any sigma.

    Scaled by the sigma, and added to that of poses, it gives the whole.
    """
    scene = made_scene(5)
    noise = np.tile(NOISE, (len(scene.views.stop_robot), 1))
    one, other = (
        scene_fit(SceneProblem(scene.views, scene.tracks, px, noise, (LENS,)), scene.truth) for px in (0.5, 2.0)
    )
    for name in ("gradient", "information"):
        by_pixels, whole = getattr(one, f"pixel_{name}"), getattr(one, name)
        close = {"rtol": 0, "atol": 1e-9 * np.abs(whole).max()}
        np.testing.assert_allclose(getattr(other, f"pixel_{name}"), by_pixels, **close)
        np.testing.assert_allclose(getattr(other, name), whole + (1 / 4 - 4) * by_pixels, **close)


def test_point_behind_its_camera_has_an_infinite_residual():
    """Residuals of exact image points are zero."""
    scene = made_scene(6, noise=0.0)
    assert np.abs(residuals_px(scene.views, scene.tracks, scene.truth)).max() < 1e-9
    points = scene.truth.points.copy()
    points[0] = (0.0, 0.0, 5.0)
    off = residuals_px(scene.views, scene.tracks, scene.truth.with_points(points))
    assert np.all(np.isinf(off[scene.tracks.point == 0]))
    assert np.all(np.isfinite(off[scene.tracks.point != 0]))


def test_robust_tail_protects_the_mount_from_gross_errors():
    """A tail at two sigmas limits the effect of image points 50 px off.

    They move the mount by less than a tenth of their effect without it.
    """
    scene = made_scene(7)
    pixels = scene.tracks.pixels.copy()
    pixels[::40] += 50.0
    tracks = replace(scene.tracks, pixels=pixels)
    noise = np.tile(NOISE, (len(scene.views.stop_robot), 1))
    sound, plain, robust = (
        adjust(SceneProblem(scene.views, each, PIXEL, noise, (LENS,), tail=tail), scene.truth).state.mounts[0]
        for each, tail in ((scene.tracks, np.inf), (tracks, np.inf), (tracks, 2.0))
    )

    def apart(mount: SE3) -> float:
        """Distance to the mount of data without gross errors [m, rad]."""
        return float(np.linalg.norm((sound.inverse() @ mount).log()))

    assert apart(robust) < 0.1 * apart(plain)


def test_prior_gradients_equal_finite_differences():
    """The gradient is correct for a mount with a prior, a stated lens, a free lens and stop errors."""
    scene = made_scene(1, arms=2, count=3)
    known = Unknown("prior", MOUNT, np.full(6, 0.01))
    stated = Intrinsics("prior", LENS, np.full(9, 0.5))
    first = replace(scene.views.cameras[0], mount=known, lens=stated)
    views = replace(scene.views, cameras=(first, scene.views.cameras[1]))
    sigmas = np.full((6, 6), 1e-3)
    task = SceneProblem(views, scene.tracks, PIXEL, sigmas, (LENS, LENS))
    columns = task.columns
    rng = np.random.default_rng(0)
    state = take_step(scene.truth, columns, rng.normal(0, 1e-3, columns.errors.stop))
    about = prior_information(task, state)
    for _ in range(5):
        step = rng.normal(0, 1e-7, columns.errors.stop)
        ahead, behind = (prior_information(task, take_step(state, columns, sign * step)).cost for sign in (1, -1))
        assert ahead - behind == pytest.approx(4 * about.gradient @ step, rel=1e-3, abs=1e-9)


def test_prior_at_its_mean_has_zero_cost():
    """The expected state has no cost, and one sigma of a mount costs one."""
    scene = made_scene(2, count=3)
    first = replace(scene.views.cameras[0], mount=Unknown("prior", MOUNT, np.full(6, 0.01)))
    views = replace(scene.views, cameras=(replace(first, lens=Intrinsics("prior", LENS, np.full(9, 0.5))),))
    task = SceneProblem(views, scene.tracks, PIXEL, np.full((3, 6), 1e-3), (LENS,))
    about = prior_information(task, scene.truth)
    assert about.cost == pytest.approx(0.0, abs=1e-12)
    off = replace(scene.truth, mounts=SE3.stack([MOUNT @ SE3.exp([0.01, 0, 0, 0, 0, 0])]))
    assert prior_information(task, off).cost == pytest.approx(1.0)


@pytest.mark.parametrize(("parameter", "off"), [
    ((0, 1), 90.0), ((0, 1), -90.0), ((1,), 0.9), ((2,), 0.03 * 1280), ((3,), 0.03 * 720), ((4,), None), ((6,), None),
])  # fmt: skip
def test_free_lens_has_a_prior_around_its_guess(parameter, off):
    """The prior has sigmas that cost one each.

    They are 10 % of the focal length, 0.1 % of the aspect, 3 % of the image, and the terms of real lenses.
    """
    scene = made_scene(2, count=3)
    guess = LENS.with_parameters(np.array([900.0, 900.0, 639.5, 359.5, 0.0, 0, 0, 0, 0]))
    task = SceneProblem(scene.views, scene.tracks, PIXEL, np.full((3, 6), 1e-3), (guess,))

    def cost(parameters):
        """The prior cost of a lens."""
        return float(prior_information(task, replace(scene.truth, lenses=(LENS.with_parameters(parameters),))).cost)

    assert cost(guess.parameters) == pytest.approx(0.0, abs=1e-12)
    sigmas = np.where(np.isfinite(guess.term_sigmas), guess.term_sigmas, 1.0)
    moved = guess.parameters.copy()
    moved[list(parameter)] += sigmas[parameter[0] - 4] if off is None else off
    assert cost(moved) == pytest.approx(1.0)


def test_lens_without_a_size_is_twice_its_focal_length_wide():
    """Three hundredths of that are the sigma of the principal point, along both axes."""
    scene = made_scene(2, count=3)
    guess = replace(LENS, size_px=None)
    task = SceneProblem(scene.views, scene.tracks, PIXEL, np.full((3, 6), 1e-3), (guess,))
    start = float(prior_information(task, scene.truth).cost)
    for k in (2, 3):
        moved = LENS.parameters.copy()
        moved[k] += 0.03 * 1800
        found = prior_information(task, replace(scene.truth, lenses=(LENS.with_parameters(moved),)))
        assert float(found.cost) - start == pytest.approx(1.0)


@pytest.mark.parametrize("tail", [2.0, 10.0, 30.0, np.inf])
def test_cost_is_a_cauchy_loss(tail):
    """The loss is tail^2 ln(1 + e^2 / tail^2) of each residual e in sigmas, or e^2 without a tail.

    A point behind the camera has a bounded cost.
    """
    scene = made_scene(3, count=4, points=30)
    pixels = scene.tracks.pixels.copy()
    pixels[::7] += 20 * PIXEL
    task = SceneProblem(
        scene.views, replace(scene.tracks, pixels=pixels), PIXEL, np.full((4, 6), 1e-3), (LENS,), tail=tail
    )
    squares = np.sum(residuals_px(task.views, task.tracks, scene.truth) ** 2, 1) / PIXEL**2
    expected = squares.sum() if tail == np.inf else np.sum(tail**2 * np.log1p(squares / tail**2))
    about = task.linearise(scene.truth)[0]
    assert float(about.cost) == pytest.approx(expected)
    behind = scene.truth.points.copy()
    behind[0] = (0.0, 0.0, 5.0)
    lost = np.count_nonzero(task.tracks.point == 0)
    rest = squares[task.tracks.point != 0]
    rest_cost = rest.sum() if tail == np.inf else np.sum(tail**2 * np.log1p(rest / tail**2))
    found = float(task.linearise(scene.truth.with_points(behind))[0].cost)
    assert found - rest_cost == pytest.approx(lost * min(tail, 10.0) ** 2 * np.log(101.0))


def test_stop_priors_are_added():
    """A stop error of one sigma costs one, and its information is that of its sigma."""
    scene = made_scene(2, count=3)
    sigmas = np.full((3, 6), 1e-3)
    sigmas[1] = 2e-3
    task = SceneProblem(scene.views, scene.tracks, PIXEL, sigmas, (LENS,))
    errors = np.zeros((3, 6))
    errors[1, 4] = 2e-3
    about, plain = (prior_information(task, replace(scene.truth, errors=each)) for each in (errors, 0 * errors))
    assert float(about.cost - plain.cost) == pytest.approx(1.0)
    own = task.columns.errors
    np.testing.assert_allclose(np.diag(about.hessian)[own], 1 / sigmas.ravel() ** 2)
    np.testing.assert_allclose(about.gradient[own], (errors / sigmas**2).ravel())
