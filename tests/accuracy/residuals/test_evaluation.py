"""Tests of `evaluate_recording`: the refit of a calibration's recording."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.residuals import evaluation as module
from basecal.accuracy.residuals.evaluation import evaluate_recording, known_views, with_camera_noise
from basecal.cell import Calibration, Outlier, Recording
from basecal.effects.target_shape import unit_shifts
from basecal.estimation.problem.build import build_problem
from basecal.estimation.view.measurement import Noise
from basecal.geometry import PoseEstimate
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=10, robot_noise=(2e-4, 4e-4)), 1)


@pytest.fixture(scope="module")
def calibration():
    """Calibration of the shared recording."""
    return calibrate(MADE.cell, MADE.recording)


def test_views_without_transforms_are_omitted(calibration):
    """Views whose mount is missing in the calibration are omitted."""
    assert len(evaluate_recording(MADE.cell, MADE.recording, calibration).problem.groups) == 1
    lacking = replace(calibration, transforms={})
    assert evaluate_recording(MADE.cell, MADE.recording, lacking).problem.groups == ()


def test_outlier_does_not_affect_shared_stop(calibration):
    """A sample with the pose of an outlier is predicted as well as without the outlier."""
    samples = list(MADE.recording.samples)
    samples[5] = replace(samples[5], robots={**samples[5].robots, "hand": samples[4].robots["hand"]})
    with_outlier = replace(calibration, outliers=(Outlier(5, "wrist", "board", (), "bumped"),))
    twice = evaluate_recording(MADE.cell, Recording(tuple(samples)), with_outlier)
    alone = evaluate_recording(MADE.cell, Recording((*samples[:5], *samples[6:])), with_outlier)
    poses = [one.state.camera_from_target(one.problem.groups[0], one.problem.stops)[4] for one in (twice, alone)]
    np.testing.assert_allclose(poses[0].matrix, poses[1].matrix, atol=1e-9)
    assert len(twice.problem.groups[0]) == 10


def test_stop_errors_are_estimated(calibration):
    """With robot noise, stop errors at the optimum have the order of one sigma."""
    fitted = evaluate_recording(MADE.cell, MADE.recording, calibration)
    assert 0.1 < np.sqrt(np.mean(fitted.state.stop_errors**2)) < 1.5


def test_targets_have_estimated_shapes(calibration):
    """Target points are moved by the calibration's shape coefficients, if their number fits the target."""
    (stated,) = evaluate_recording(MADE.cell, MADE.recording, calibration).problem.groups
    points = stated.measurement.points_in_target
    for shape, moved in (([3.0, 0.0, -2.0], True), ([1.0, 2.0], False)):
        noise = {**calibration.noise, "targets": {"board": {"shape": shape}}}
        (found,) = evaluate_recording(MADE.cell, MADE.recording, replace(calibration, noise=noise)).problem.groups
        expected = points + unit_shifts(points) @ np.array(shape) if moved else points
        np.testing.assert_allclose(found.measurement.points_in_target, expected, atol=1e-15)
        assert moved == bool(np.abs(expected - points).max() > 1e-4)


@pytest.mark.journey
def test_led_has_no_shape():
    """An LED has no size to divide by, and no shape."""
    light = simulate(Scenario(samples=12, target="led", camera_mount="fixed", target_mount="fixed"), 1)
    calibration = calibrate(light.cell, light.recording)
    with np.errstate(all="raise"):
        assert len(evaluate_recording(light.cell, light.recording, calibration).problem.groups) == 1


@pytest.mark.parametrize(
    ("camera", "expected"),
    [
        ("a", {"pixel_px": 0.5, "pose_m": 2e-3}),
        ("b", {"pixel_px": 0.3, "pose_m": 2e-3}),
        ("c", {"pixel_px": 0.3, "pose_m": 7e-3}),
    ],
)
def test_noise_is_own_camera_or_all(camera, expected):
    """The noise is that of the camera, else that of all, else the usual one."""
    cameras = {"a": {"pixel_px": 0.5, "pose_m": None}, "c": {"pose_m": 7e-3}}
    calibration = Calibration("good", noise={"pixel_px": 0.3, "pose_m": 2e-3, "cameras": cameras})
    found = with_camera_noise(SimpleNamespace(camera=camera, with_noise=lambda noise: noise), calibration)
    assert found == Noise(**expected)


@pytest.mark.parametrize(
    ("lacking", "lens", "target", "is_known"),
    [
        (None, True, "charuco", True),
        ("camera_mount", True, "charuco", False),
        ("target_mount", True, "charuco", False),
        ("hand_base", True, "charuco", False),
        (None, False, "charuco", False),
        (None, False, "pose", True),
    ],
)
def test_view_needs_all_transforms_and_lens(lacking, lens, target, is_known):
    """A view is known if all its transforms are, and in pixels its lens."""
    made = simulate(Scenario(samples=2, target=target), 1)
    (group,) = build_problem(made.cell, made.recording)[0].groups
    known = {"camera_mount": group.eye.mount, "target_mount": group.hand.mount, "hand_base": group.hand.base}
    transforms = {name: made.truth[name] for what, name in known.items() if what != lacking}
    assert module._is_known(group, transforms, made.cameras if lens else {}) == is_known


def test_lens_is_taken_from_calibration_unless_fixed():
    """A lens that is not fixed is that of the calibration; a guess alone is none."""
    made = simulate(Scenario(samples=2, intrinsics="prior"), 1)
    estimates = {name: PoseEstimate(of, np.zeros((6, 6))) for name, of in made.truth.items()}
    calibration = Calibration("good", transforms=estimates)
    assert known_views(made.cell, made.recording, calibration).problem.groups == ()
    lens = made.cameras["wrist"]
    found = known_views(made.cell, made.recording, replace(calibration, cameras={"wrist": (lens, np.zeros((9, 9)))}))
    assert len(found.problem.groups) == 1
    assert found.state.cameras == {"wrist": lens}
    fixed = simulate(Scenario(samples=2), 1)
    assert len(known_views(fixed.cell, fixed.recording, calibration).problem.groups) == 1


def test_stop_errors_are_most_probable():
    """Stop errors are the most probable ones by stated noise, else by the calibration's; they are at an optimum."""
    truth = {name: PoseEstimate(of, np.zeros((6, 6))) for name, of in MADE.truth.items()}
    sigmas = {"sigma_t_m": [2e-4] * 3, "sigma_r_rad": [4e-4] * 3}
    robots = {name: replace(of, noise=None) for name, of in MADE.cell.robots.items()}
    bare = replace(MADE.cell, robots=robots)
    stated, found, none = (
        evaluate_recording(cell, MADE.recording, Calibration("good", transforms=truth, noise={"robots": noise}))
        for cell, noise in ((MADE.cell, {}), (bare, {"eye": sigmas, "hand": sigmas}), (bare, {}))
    )
    np.testing.assert_allclose(found.state.stop_errors, stated.state.stop_errors, rtol=1e-9)
    assert (len(stated.problem.stops), len(none.problem.stops)) == (20, 0)
    again = module.retract(stated.problem, stated.state, module.linearise(stated.problem, stated.state), np.zeros(0))
    np.testing.assert_allclose(again.stop_errors, stated.state.stop_errors, atol=1e-9)
    assert np.abs(stated.state.stop_errors).max() > 0.5
