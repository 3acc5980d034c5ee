"""Tests of `without_samples`: the calibration without some samples."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.residuals import without_samples as module
from basecal.accuracy.residuals.without_samples import without_samples
from basecal.cell import Recording
from basecal.errors import InputError
from basecal.estimation.solve import solve
from basecal.geometry import SE3, PoseEstimate
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


@pytest.fixture(scope="module")
def made():
    cell = simulate(Scenario(samples=15, robot_noise=(1e-4, 2e-4)), 4)
    return cell, calibrate(cell.cell, cell.recording)


def test_update_equals_solve_of_remaining_samples(made):
    """The update equals `solve` of the recording without these samples, and has no residuals of them."""
    cell, calibration = made
    found = without_samples(cell.cell, cell.recording, calibration, {3, 7})
    few = Recording(tuple(s for s in cell.recording.samples if s.sample not in {3, 7}))
    alone, whole = (solve(cell.cell, each).transforms[BASE] for each in (few, cell.recording))
    assert found.converged
    expected = calibration[BASE].mean @ whole.mean.inverse() @ alone.mean  # includes the mount bend
    assert np.abs((found.transforms[BASE].mean.inverse() @ expected).log()).max() < 1e-7
    covariance = calibration[BASE].covariance + alone.covariance - whole.covariance
    np.testing.assert_allclose(found.transforms[BASE].covariance, covariance, rtol=1e-4, atol=1e-12)
    assert {each.sample for each in found.residuals.per_sample} == set(range(15)) - {3, 7}


def test_too_few_remaining_samples_are_reported(made):
    """Without any sample there is an InputError; with one, unobservable transforms are omitted."""
    cell, calibration = made
    with pytest.raises(InputError, match="no sample is left"):
        without_samples(cell.cell, cell.recording, calibration, set(range(15)))
    assert BASE not in without_samples(cell.cell, cell.recording, calibration, set(range(1, 15))).transforms


def test_scene_calibration_cannot_be_updated(made):
    """A calibration from a scene has no target to solve from, and raises an InputError."""
    cell, calibration = made
    of_scene = replace(calibration, settings={**calibration.settings, "method": "scene"})
    bare = Recording(tuple(replace(each, observations=()) for each in cell.recording.samples))
    with pytest.raises(InputError, match="from a scene cannot be updated"):
        without_samples(cell.cell, bare, of_scene, {3})


@pytest.mark.journey
def test_estimated_noise_is_kept():
    """Estimated noise is that of the calibration with all samples."""
    made = simulate(Scenario(samples=14, robot_noise=(3e-4, 5e-4), state_robot_noise=False), 2)
    calibration = calibrate(made.cell, made.recording)
    found = without_samples(made.cell, made.recording, calibration, {5})
    before, after = (np.sqrt(np.diag(of.covariance)) for of in (calibration[BASE], found.transforms[BASE]))
    assert np.all(np.abs(np.log(after / before)) < 0.4)
    assert np.all(after > before)
    whole = without_samples(made.cell, made.recording, calibration, ())
    assert whole.transforms[BASE] is calibration[BASE]
    assert (whole.residuals, whole.converged) == (calibration.residuals, True)


def test_update_starts_from_calibration(made, monkeypatch):
    """The update starts from the calibration's transforms with its robot noise, and estimates no noise again."""
    cell, calibration = made
    bare = replace(cell.cell, robots={name: replace(of, noise=None) for name, of in cell.cell.robots.items()})
    robots = {"eye": {"sigma_t_m": [1e-3, 2e-3, 3e-3], "sigma_r_rad": [4e-3, 5e-3, 6e-3]}}
    known = replace(calibration, noise={**calibration.noise, "robots": robots})
    given = []

    def solve(problem, start, settings):
        """Records its arguments and returns unit estimates."""
        given.append((problem, start, settings))
        seen = SimpleNamespace(unobservable={cell.cell.mount_name("wrist")})
        transforms = {name: PoseEstimate(SE3.identity(), np.eye(6)) for name in problem.unknowns}
        return SimpleNamespace(transforms=transforms, observability=seen, converged=False)

    monkeypatch.setattr(module, "solve_from", solve)
    monkeypatch.setattr(module, "residuals", lambda solution: "residuals")
    found = without_samples(bare, cell.recording, known, {3})
    (problem, start, settings), _ = given
    assert problem.held
    assert settings.robot_noise == "stated"
    assert set(problem.stops.robot) == {"eye"}
    np.testing.assert_allclose(problem.stops.sigma, np.tile(np.arange(1, 7) * 1e-3, (14, 1)))
    assert start.stop_errors.shape == (14, 6)
    assert not start.stop_errors.any()
    for name in problem.unknowns:
        np.testing.assert_array_equal(start.transforms[name].matrix, calibration[name].mean.matrix)
    assert set(found.transforms) == set(cell.cell.requested_transforms) - {cell.cell.mount_name("wrist")}
    assert (found.residuals, found.converged) == ("residuals", False)
