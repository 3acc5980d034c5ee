"""Tests of the predicted information of samples, against the solution with these samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Intrinsics, Recording, Sample
from basecal.errors import InputError
from basecal.estimation.least_squares.normal_equations import linearise
from basecal.estimation.problem.build import build_problem
from basecal.planning.candidates import candidates
from basecal.planning.prospects import (
    ASSUMED_NOISE,
    ASSUMED_ROBOT_SIGMAS,
    _join_roots,
    _predict_observation,
    _with_noise,
    calibrated_sketch,
    prospects,
    sketches,
)
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


@pytest.fixture(scope="module")
def cell():
    made = simulate(Scenario(samples=12, robot_noise=(1e-4, 2e-4)), 3)
    calibration = calibrate(made.cell, made.recording)
    sketch = sketches(made.cell, calibration)[0]
    drawn = candidates(sketch, [dict(s.robots) for s in made.recording.samples], 10)
    return made, calibration, sketch, drawn


def test_information_roots_add_up_to_solution(cell):
    """The covariance of recorded and chosen samples by their roots is that of the problem with all of them."""
    made, calibration, sketch, drawn = cell
    prospect = prospects(made.cell, made.recording, calibration, [(sketch, drawn)])
    chosen = [1, 4, 7]
    information = np.linalg.inv(prospect.covariance) + sum(prospect.roots[k] @ prospect.roots[k].T for k in chosen)
    where = prospect.problem.columns[BASE]
    solved = prospect.solution(chosen).transforms[BASE].covariance
    np.testing.assert_allclose(
        np.linalg.inv(information)[where, where], solved, rtol=1e-3, atol=1e-3 * np.abs(solved).max()
    )


def test_empty_choice_has_calibrated_covariance(cell):
    """Without a choice the covariance is the calibration's, less the contribution of the bends of mounts.

    It is at most a quarter.
    """
    made, calibration, sketch, drawn = cell
    prospect = prospects(made.cell, made.recording, calibration, [(sketch, drawn)])
    solved = prospect.solution([]).transforms[BASE]
    assert np.all(solved.sigma_t <= 1.01 * calibration[BASE].sigma_t)
    assert np.all(solved.sigma_t >= 0.75 * calibration[BASE].sigma_t)


def test_samples_without_observations_are_not_recorded(cell):
    """Without observations the assumed noise replaces unstated noise, and numbers continue after the taught samples."""
    made, _, sketch, drawn = cell
    bare = Recording(tuple(Sample(s.sample, robots=s.robots) for s in made.recording.samples))
    quiet = replace(made.cell, pixel_px=None)
    prospect = prospects(quiet, bare, None, [(sketch, drawn)])
    assert prospect.recorded == frozenset()
    assert prospect.samples[0].sample == 12
    (group,) = prospect.problem.groups
    assert group.measurement.weight.max() == pytest.approx(1 / ASSUMED_NOISE.pixel_px)


@pytest.mark.parametrize(("target", "sigmas"), [
    ("charuco", [0.3]), ("pose", [1e-3] * 3 + [3e-3] * 3), ("points3d", [1e-3]),
])  # fmt: skip
def test_unstated_noise_has_documented_defaults(target, sigmas):
    """The defaults are those of docs/plan.md: 0.3 px of a view, 1 mm and 3 mrad of a pose, 1 mm of a point."""
    made = simulate(Scenario(samples=3, target=target, state_pixel_noise=False), 0)
    problem, _ = build_problem(made.cell, made.recording)
    bare = (replace(group, measurement=group.measurement.without_sigmas()) for group in problem.groups)
    (group,) = _with_noise(problem.with_groups(bare), None).groups
    found = 1 / group.measurement.weight
    np.testing.assert_allclose(found, np.resize(sigmas, found.shape))


def test_cell_without_guesses_requires_calibration(cell):
    """The error names the transform without a value."""
    with pytest.raises(InputError, match=BASE):
        sketches(cell[0].cell, None)


def test_unknown_transform_has_wide_prior(cell):
    """Without a recorded sample each direction has a sigma of 0.3 m or rad."""
    made, calibration, sketch, drawn = cell
    bare = Recording(tuple(Sample(s.sample, robots=s.robots) for s in made.recording.samples))
    prospect = prospects(made.cell, bare, calibration, [(sketch, drawn)])
    where = prospect.problem.columns[BASE]
    np.testing.assert_allclose(prospect.covariance[where, where], 0.3**2 * np.eye(6), atol=1e-12)


@pytest.mark.parametrize("size", [1, 5])
def test_independent_candidates_add_up(cell, size):
    """The information of consecutive candidates that share no stop is the sum of their own."""
    made, calibration, sketch, drawn = cell
    prospect = prospects(made.cell, made.recording, calibration, [(sketch, drawn)])
    alone = (prospect.roots @ prospect.roots.mT).reshape(-1, size, *prospect.covariance.shape).sum(1)
    together = prospect.group_roots(size)
    np.testing.assert_allclose(together @ together.mT, alone, rtol=0, atol=1e-6 * np.abs(alone).max())


def test_sketch_has_calibrated_transforms(cell):
    """The sketch has the calibrated transforms and the stated cell. An unstated lens is the calibrated one."""
    made, calibration, *_ = cell
    wrist = made.cell.cameras["wrist"]
    unknown = replace(wrist, intrinsics=Intrinsics("free", None), size_px=(1280, 720))
    bare = replace(made.cell, cameras={"wrist": unknown})
    lens = wrist.intrinsics.camera
    found = calibrated_sketch(bare, replace(calibration, cameras={"wrist": (lens, np.eye(9))}))
    assert found.lens is lens
    assert found.cell.bases == made.cell.bases
    np.testing.assert_array_equal(found.transforms[BASE].matrix, calibration[BASE].mean.matrix)
    assert calibrated_sketch(made.cell, calibration).cell.cameras["wrist"].intrinsics is wrist.intrinsics


def test_candidates_are_numbered_after_all_samples(cell):
    """Candidates are numbered after all recorded samples, from zero if there is none."""
    made, calibration, sketch, drawn = cell
    later = replace(made.recording.samples[0], sample=40)
    for samples, first in (((later, *made.recording.samples[1:]), 41), ((), 0)):
        prospect = prospects(made.cell, Recording(samples), calibration, [(sketch, drawn[:3])])
        assert [each.sample for each in prospect.samples] == [first, first + 1, first + 2]
        assert prospect.recorded == {each.sample for each in samples}
        seen = {number for group in prospect.recorded_problem.groups for number in group.sample.tolist()}
        assert seen == prospect.recorded


def test_predicted_covariance_is_not_rescaled(cell):
    """Predicted covariances are those of the noise and are not rescaled by residuals, since there are none."""
    made, calibration, sketch, drawn = cell
    found = prospects(made.cell, made.recording, calibration, [(sketch, drawn)]).solution([0, 1])
    assert found.noise.factor == 1.0
    assert found.converged
    hessian = linearise(found.problem, found.state).hessian
    np.testing.assert_allclose(found.covariance @ hessian, np.eye(len(hessian)), atol=1e-6)


def test_calibrated_noise_precedes_assumed_noise():
    """Calibrated noise of robots and cameras is used by name.

    A camera without its own has the overall noise of the calibration.
    """
    open_cell = simulate(Scenario(samples=3, robot_noise=(1e-4, 2e-4), state_robot_noise=False), 0)
    problem, _ = build_problem(open_cell.cell, open_cell.recording)
    bare = problem.with_groups(replace(g, measurement=g.measurement.without_sigmas()) for g in problem.groups)
    eye = {"sigma_t_m": [1e-3, 2e-3, 3e-3], "sigma_r_rad": [4e-3, 5e-3, 6e-3]}
    for cameras, pixel_px in (({"wrist": {"pixel_px": 0.7}}, 0.7), ({"other": {"pixel_px": 0.7}}, 0.5)):
        noise = {"pixel_px": 0.5, "cameras": cameras, "robots": {"eye": eye}}
        found = _with_noise(bare, Calibration("good", {}, noise=noise))
        np.testing.assert_allclose(1 / found.groups[0].measurement.weight, pixel_px)
        sigmas = dict(zip(found.stops.robot, found.stops.sigma, strict=True))
        np.testing.assert_allclose(sigmas["eye"], [1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3])
        np.testing.assert_allclose(sigmas["hand"], ASSUMED_ROBOT_SIGMAS)


def test_unknown_lens_has_wide_prior(cell):
    """An unknown lens without a recorded sample has a wide prior.

    Its focal lengths, centre and first distortion terms have sigmas of a thousand.
    """
    made = simulate(Scenario(samples=3, intrinsics="free"), 0)
    calibration = cell[1]
    sketch = sketches(made.cell, replace(calibration, cameras={"wrist": (made.cameras["wrist"], np.eye(9))}))[0]
    prospect = prospects(made.cell, Recording(()), calibration, [(sketch, cell[3][:1])])
    where = prospect.problem.columns["wrist"]
    np.testing.assert_allclose(np.sqrt(np.diag(prospect.covariance[where, where]))[:6], 1e3, rtol=1e-9)


def test_predicted_observation_matches_sensor_kind(cell):
    """A camera with a lens gives pixels, one without a lens or a target without a shape a pose, and a tip a touch."""
    made, _, sketch, drawn = cell
    seen = _predict_observation(sketch, drawn[0])
    pose, shape = sketch.camera_from_target(drawn[0]), sketch.target.target
    np.testing.assert_allclose(seen.pixels, sketch.lens.project(pose @ shape.points))
    np.testing.assert_array_equal(seen.ids, shape.ids)
    wrist, board = made.cell.cameras["wrist"], made.cell.targets["board"]
    for other in (
        replace(made.cell, cameras={"wrist": replace(wrist, intrinsics=None)}),
        replace(made.cell, targets={"board": replace(board, target=None)}),
    ):
        found = _predict_observation(replace(sketch, cell=other), drawn[0])
        np.testing.assert_allclose(found.camera_from_target.matrix, pose.matrix)
    tip = replace(made.cell, cameras={"wrist": replace(wrist, kind="tip")})
    found = _predict_observation(replace(sketch, cell=tip), drawn[0])
    assert (found.tip, found.mark) == ("wrist", "board")


def test_roots_of_view_groups_are_joined():
    """Roots with equal numbers of columns share them, since no candidate is in both groups.

    Others are placed side by side.
    """
    rng = np.random.default_rng(0)
    first, second = rng.standard_normal((4, 5, 3)), rng.standard_normal((4, 5, 3))
    first[:2], second[2:] = 0, 0
    for more in (second, second[..., :2], second[..., :0]):
        joined = _join_roots(first, more)
        wanted = first @ first.mT + more @ more.mT
        np.testing.assert_allclose(joined @ joined.mT, wanted)
        assert joined.shape == (4, 5, 3 + (more.shape[-1] if more.shape[-1] < 3 else 0))


def test_assumed_robot_noise_is_realistic():
    """The assumed noise is between 0.1 and 0.5 mm, and 0.2 and 1 mrad, per axis, equal for all three axes."""
    shift, turn = ASSUMED_ROBOT_SIGMAS[:3], ASSUMED_ROBOT_SIGMAS[3:]
    assert np.ptp(shift) == np.ptp(turn) == 0
    assert 1e-4 < shift[0] < 5e-4
    assert 2e-4 < turn[0] < 1e-3
