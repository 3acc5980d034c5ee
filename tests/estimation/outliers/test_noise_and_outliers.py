"""Tests of separating noise from outliers."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.shared.stages import skipping

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.stages.concluding import find_error_at_task
from basecal.accuracy.stages.solving import integrate_noise, screen_conventions
from basecal.estimation.outliers import noise_and_outliers
from basecal.estimation.outliers.noise_and_outliers import has_plausible_noise, solve_with_noise, with_noise
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def test_bumped_arm_is_excluded_from_the_noise_estimate():
    """One of 16 samples is off by 50 mm, and only it is excluded.

    The noise of the rest, 0.3 mm and 0.5 mrad, is found.
    """
    s = simulate(Scenario(samples=16, robot_noise=(3e-4, 5e-4), state_robot_noise=False), seed=1)
    samples = list(s.recording.samples)
    eye = samples[5].robots["eye"]
    off = replace(eye, base_from_flange=eye.base_from_flange @ SE3.exp([0.05, 0, 0, 0, 0, 0]))
    samples[5] = replace(samples[5], robots={**samples[5].robots, "eye": off})
    settings = Settings(robot_noise="estimated")
    plain = solve(s.cell, replace(s.recording, samples=tuple(samples)))
    found = solve_with_noise(s.cell, settings, plain, with_noise(plain, settings))
    assert {o.sample for o in found.outliers} == {samples[5].sample}
    assert has_plausible_noise(found.solution)
    assert np.all(found.solution.noise.robots["eye"] < 1.5e-3)


@pytest.mark.journey
@pytest.mark.parametrize("seed", range(6))
def test_gross_pose_error_is_not_hidden_by_estimated_noise(seed: int) -> None:
    """One flange of twelve is off by 100 mm, without stated noise of poses, 0.5 mm and 2 mrad."""
    rng = np.random.default_rng(seed)
    s = simulate(Scenario(samples=12, target="pose", state_robot_noise=False), seed=seed)
    samples = [replace(sample, observations=_without_sigma(sample.observations)) for sample in s.recording.samples]
    eye = samples[4].robots["eye"]
    way = rng.normal(size=3)
    off = replace(eye, base_from_flange=eye.base_from_flange @ SE3.exp([*(0.1 * way / np.linalg.norm(way)), 0, 0, 0]))
    bumped = [*samples[:4], replace(samples[4], robots={**samples[4].robots, "eye": off}), *samples[5:]]
    for recorded, culprits in ((samples, set()), (bumped, {samples[4].sample})):
        with skipping(screen_conventions, integrate_noise, find_error_at_task):
            found = calibrate(s.cell, replace(s.recording, samples=tuple(recorded)))
        assert {each.sample for each in found.outliers} == culprits


def _without_sigma(observations):
    return tuple(replace(each, sigma=None) for each in observations)


@pytest.mark.parametrize("as_of_arms", [True, False])
@pytest.mark.parametrize("given", [True, False])
def test_agreeing_samples_are_reported_if_noise_is_implausible(monkeypatch, as_of_arms, given):
    """Samples that agree with exact robots are dropped if the noise is plausible for arms."""
    s = simulate(Scenario(samples=8, robot_noise=(3e-4, 5e-4), state_robot_noise=False), seed=1)
    settings = Settings(robot_noise="estimated")
    plain = solve(s.cell, s.recording)
    exact = RobustSolution(plain, (), plain.problem.with_groups(()), 8, 0, (2, 5)) if given else None
    monkeypatch.setattr(noise_and_outliers, "has_plausible_noise", lambda solution: as_of_arms)
    monkeypatch.setattr(noise_and_outliers, "with_noise", lambda solution, *given: solution)
    monkeypatch.setattr(
        noise_and_outliers,
        "_judge",
        lambda cell, settings, plain, solution, before: RobustSolution(solution, (), before and before.left_out, 8, 0),
    )
    found = solve_with_noise(s.cell, settings, plain, plain, exact)
    assert found.agreeing == ((2, 5) if given and not as_of_arms else ())


@pytest.mark.parametrize(
    ("robots", "jitter_s", "converged", "usual"),
    [
        ({}, {}, True, False),
        ({"eye": (11.9e-3, 11.9e-3)}, {}, True, True),
        ({"eye": (11.9e-3, 11.9e-3)}, {}, False, False),
        ({"eye": (1e-4, 1e-4), "hand": (12.1e-3, 1e-4)}, {}, True, False),
        ({"eye": (1e-4, 12.1e-3)}, {}, True, False),
        ({}, {"wrist": 19e-3}, True, True),
        ({"eye": (1e-4, 1e-4)}, {"wrist": 21e-3}, True, False),
    ],
)
def test_plausible_noise_of_arms(robots, jitter_s, converged, usual):
    """The limits are 12 mm, 12 mrad and 20 ms, and noise without an estimate is not plausible."""
    sigmas = {name: np.repeat(of, 3) for name, of in robots.items()}
    noise = SimpleNamespace(robots=sigmas, jitter_s=jitter_s)
    assert has_plausible_noise(SimpleNamespace(noise=noise, converged=converged)) == usual
