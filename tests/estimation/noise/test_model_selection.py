"""Robots' noise is found where it is, not found where it is not, and said to be out of reach where it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.estimation.noise.model_selection import threshold
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from
from basecal.simulation import Scenario, simulate

ESTIMATED = Settings(robot_noise="estimated")
TRUE = (3e-4, 5e-4)
SILENT = Scenario(samples=20, robot_noise=TRUE, state_robot_noise=False)


def solved(scenario: Scenario, seed: int, settings: Settings = ESTIMATED) -> Solution:
    """The optimum from the truth."""
    s = simulate(scenario, seed)
    problem, _ = build_problem(s.cell, s.recording)
    return solve_from(
        problem, State(s.truth, s.cameras if problem.lenses else {}, np.zeros((len(problem.stops), 6))), settings
    )


@pytest.mark.parametrize("told", [True, False])
def test_sigmas_of_robots_are_found(told):
    """The mean over eight cells is the truth, whether the pixels' sigma is told or found beside it.

    One cell scatters by 18 % (measured, and the curvature's own figure), a mean of eight by 6.4 %: five are 32 %.
    """
    cells = [solved(replace(SILENT, state_pixel_noise=told), seed) for seed in range(8)]
    found = np.array([cell.noise.robots["hand"][[0, 3]] for cell in cells])
    np.testing.assert_allclose(found.mean(0), TRUE, rtol=0.32)
    if not told:
        assert [cell.noise.noise.pixel_px for cell in cells] == pytest.approx([0.2] * 8, rel=0.1)


def test_robots_that_differ_get_sigmas_of_their_own():
    """The turns of an arm ten times as noisy as the other are told apart by their levers.

    Shifts are not: both arms move at every sample, and only the sum of their squares shows.
    """
    s = simulate(replace(SILENT, samples=40, robot_noise=(1e-4, 2e-4)), seed=0)
    rng = np.random.default_rng(1)
    worse = s.recording
    samples = []
    for sample in worse.samples:
        hand = sample.robots["hand"]
        off = type(hand.base_from_flange).exp(rng.standard_normal(6) * np.repeat([1e-3, 2e-3], 3))
        samples.append(
            replace(
                sample, robots={**sample.robots, "hand": replace(hand, base_from_flange=hand.base_from_flange @ off)}
            )
        )
    problem, _ = build_problem(s.cell, replace(worse, samples=tuple(samples)))
    found = solve_from(problem, State(s.truth, s.cameras, np.zeros((0, 6))), ESTIMATED).noise.robots
    # Some 120 numbers each, of which 18 unknowns take their share: five sigmas of 7 %.
    assert found["hand"][3] == pytest.approx(2e-3, rel=0.35)
    assert found["eye"][3] < 0.35 * found["hand"][3]
    assert np.hypot(found["eye"][0], found["hand"][0]) == pytest.approx(1e-3, rel=0.35)


@pytest.mark.parametrize("told", [True, False])
def test_clean_cells_get_no_noise_of_robots(told):
    """Without noise of robots none is found: the ratio's threshold is passed by chance in fewer than one cell in 1,000.

    The seeds are fixed; of 600 others none passed.
    """
    clean = Scenario(samples=10, target="points", state_pixel_noise=told)
    assert not any(solved(clean, seed).noise.robots for seed in range(10))


def test_threshold_is_that_of_the_border():
    """Half the tails of one and of two degrees of freedom: above the one's point, below the two's."""
    assert 15.1 < threshold(1e-4) < 18.43


def test_stated_noise_is_taken_at_its_word():
    """Where every robot states its noise nothing is estimated, and asking changes nothing."""
    told = replace(SILENT, state_robot_noise=True)
    asked, plain = solved(told, 0), solved(told, 0, Settings())
    assert not asked.noise.robots
    np.testing.assert_array_equal(asked.covariance, plain.covariance)


def test_a_still_arm_is_as_noisy_as_the_other_and_that_is_said():
    """A single stop shows no noise of its own: it takes that of the arm that moved, which the base's sigmas hold."""
    s = replace(SILENT, arms="eye_still", camera_mount="fixed")
    found = solved(s, 0)
    assert [(f.code, f.about) for f in found.findings] == [("noise-not-identifiable", ("eye",))]
    assert "taken to be as noisy as hand" in found.findings[0].message
    np.testing.assert_array_equal(found.noise.robots["eye"], found.noise.robots["hand"])
    base = found.transforms["eye_base_from_hand_base"]
    assert base.sigma_t.min() > 0.5 * found.noise.robots["eye"][0]


def test_a_light_cannot_tell_robots_from_pixels():
    """Two equations a view: with neither sigma told, one common factor is estimated, and that is said."""
    found = solved(
        Scenario(samples=20, target="led", robot_noise=(2e-4, 3e-4), state_robot_noise=False, state_pixel_noise=False),
        1,
    )
    assert not found.noise.robots
    assert [f.code for f in found.findings] == ["noise-not-identifiable"]


def test_pixels_worse_than_stated_are_not_blamed_on_robots():
    """A sigma stated too small by three is a matter of the pixels: a factor explains it, and robots get nothing."""
    s = simulate(Scenario(samples=15, pixel_px=0.6), seed=0)
    problem, _ = build_problem(replace(s.cell, pixel_px=0.2), s.recording)
    found = solve_from(problem, State(s.truth, s.cameras, np.zeros((0, 6))), ESTIMATED)
    assert not found.noise.robots
    assert found.noise.factor == pytest.approx(9.0, rel=0.2)


def test_exact_data_need_no_noise():
    """Data without any noise are left as they are."""
    found = solved(Scenario(samples=8, pixel_px=0.0), 0)
    assert not found.noise.robots
    assert found.noise.noise.pixel_px < 1e-6
