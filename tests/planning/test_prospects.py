"""What samples would say, against the solution of samples that were taken so."""

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


def test_information_adds_up_to_what_is_solved(cell):
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


def test_what_was_recorded_is_known_as_well_as_calibrated(cell):
    """With nothing chosen the covariance is the calibration's, less what bends of mounts add: at most a quarter."""
    made, calibration, sketch, drawn = cell
    prospect = prospects(made.cell, made.recording, calibration, [(sketch, drawn)])
    solved = prospect.solution([]).transforms[BASE]
    assert np.all(solved.sigma_t <= 1.01 * calibration[BASE].sigma_t)
    assert np.all(solved.sigma_t >= 0.75 * calibration[BASE].sigma_t)


def test_without_observations_nothing_is_recorded(cell):
    """Then the assumed noise counts for what states none, and numbers go on after the taught samples."""
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
def test_noise_is_assumed_where_nothing_is_stated(target, sigmas):
    """As docs/plan.md has it: 0.3 px of a view, 1 mm and 3 mrad of a pose, 1 mm of a point."""
    made = simulate(Scenario(samples=3, target=target, state_pixel_noise=False), 0)
    problem, _ = build_problem(made.cell, made.recording)
    bare = (replace(group, measurement=group.measurement.without_sigmas()) for group in problem.groups)
    (group,) = _with_noise(problem.with_groups(bare), None).groups
    found = 1 / group.measurement.weight
    np.testing.assert_allclose(found, np.resize(sigmas, found.shape))


def test_a_cell_without_guesses_needs_a_calibration(cell):
    """The transform without a value is named."""
    with pytest.raises(InputError, match=BASE):
        sketches(cell[0].cell, None)


def test_what_nothing_is_known_of_is_open(cell):
    """Without a recorded sample each direction has a sigma of 0.3 m or rad."""
    made, calibration, sketch, drawn = cell
    bare = Recording(tuple(Sample(s.sample, robots=s.robots) for s in made.recording.samples))
    prospect = prospects(made.cell, bare, calibration, [(sketch, drawn)])
    where = prospect.problem.columns[BASE]
    np.testing.assert_allclose(prospect.covariance[where, where], 0.3**2 * np.eye(6), atol=1e-12)


@pytest.mark.parametrize("size", [1, 5])
def test_candidates_after_one_another_add_up(cell, size):
    """Those that share no stop say together what they say alone."""
    made, calibration, sketch, drawn = cell
    prospect = prospects(made.cell, made.recording, calibration, [(sketch, drawn)])
    alone = (prospect.roots @ prospect.roots.mT).reshape(-1, size, *prospect.covariance.shape).sum(1)
    together = prospect.group_roots(size)
    np.testing.assert_allclose(together @ together.mT, alone, rtol=0, atol=1e-6 * np.abs(alone).max())


def test_a_sketch_has_the_calibrated_transforms_and_the_stated_cell(cell):
    """A lens of which nothing is stated is that calibrated."""
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
    """From zero on if there is no sample."""
    made, calibration, sketch, drawn = cell
    later = replace(made.recording.samples[0], sample=40)
    for samples, first in (((later, *made.recording.samples[1:]), 41), ((), 0)):
        prospect = prospects(made.cell, Recording(samples), calibration, [(sketch, drawn[:3])])
        assert [each.sample for each in prospect.samples] == [first, first + 1, first + 2]
        assert prospect.recorded == {each.sample for each in samples}
        seen = {number for group in prospect.recorded_problem.groups for number in group.sample.tolist()}
        assert seen == prospect.recorded


def test_predicted_covariances_are_those_of_the_noise(cell):
    """They are not rescaled by residuals, which there are none of."""
    made, calibration, sketch, drawn = cell
    found = prospects(made.cell, made.recording, calibration, [(sketch, drawn)]).solution([0, 1])
    assert found.noise.factor == 1.0
    assert found.converged
    hessian = linearise(found.problem, found.state).hessian
    np.testing.assert_allclose(found.covariance @ hessian, np.eye(len(hessian)), atol=1e-6)


def test_calibrated_noise_counts_before_assumed_noise():
    """Of robots by name and of cameras by name; the calibration's own if a camera has none."""
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


def test_an_unknown_lens_is_open(cell):
    """Without a recorded sample its focal lengths, centre and first terms have sigmas of a thousand."""
    made = simulate(Scenario(samples=3, intrinsics="free"), 0)
    calibration = cell[1]
    sketch = sketches(made.cell, replace(calibration, cameras={"wrist": (made.cameras["wrist"], np.eye(9))}))[0]
    prospect = prospects(made.cell, Recording(()), calibration, [(sketch, cell[3][:1])])
    where = prospect.problem.columns["wrist"]
    np.testing.assert_allclose(np.sqrt(np.diag(prospect.covariance[where, where]))[:6], 1e3, rtol=1e-9)


def test_views_are_predicted_by_what_the_sensor_measures(cell):
    """Pixels of a camera with a lens, a pose without one or of a target without a shape, and a touch of a tip."""
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


def test_groups_of_views_are_joined_by_what_each_candidate_has():
    """Of as many numbers they stand in one place, since no candidate is in both; of other numbers side by side."""
    rng = np.random.default_rng(0)
    first, second = rng.standard_normal((4, 5, 3)), rng.standard_normal((4, 5, 3))
    first[:2], second[2:] = 0, 0
    for more in (second, second[..., :2], second[..., :0]):
        joined = _join_roots(first, more)
        wanted = first @ first.mT + more @ more.mT
        np.testing.assert_allclose(joined @ joined.mT, wanted)
        assert joined.shape == (4, 5, 3 + (more.shape[-1] if more.shape[-1] < 3 else 0))


def test_arms_of_unknown_noise_are_as_noisy_as_arms_are():
    """Between 0.1 and 0.5 mm, and 0.2 and 1 mrad, per axis; all three axes alike."""
    shift, turn = ASSUMED_ROBOT_SIGMAS[:3], ASSUMED_ROBOT_SIGMAS[3:]
    assert np.ptp(shift) == np.ptp(turn) == 0
    assert 1e-4 < shift[0] < 5e-4
    assert 2e-4 < turn[0] < 1e-3
