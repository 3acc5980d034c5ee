"""How well a base is known, by adding information."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.acquisition.running_estimate import running_estimate
from basecal.cell import PixelObservation, Recording, Sample
from basecal.estimation.solve import solve
from basecal.planning import poses
from basecal.planning.feasible import feasible_in
from basecal.planning.sketch import sketch_of
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms()
SKETCH = sketch_of(WORLD.cell)
PIXEL_PX = 0.15
BASE = "eye_base_from_hand_base"


@pytest.fixture(scope="module")
def samples():
    """Fifteen samples with pixels as the true cell gives them."""
    rng, board = np.random.default_rng(0), WORLD.cell.targets["board"].target
    true = sketch_of(WORLD.cell)
    true = type(true)(true.cell, WORLD.truth, true.view)
    found = []
    for sample in poses.plan(SKETCH, home(WORLD), feasible_in(SKETCH), 15):
        pixels = WORLD.lenses["wrist"].project(true.camera_from_target(sample) @ board.points)
        pixels += PIXEL_PX * rng.standard_normal(pixels.shape)
        found.append(
            Sample(
                sample.sample,
                robots=sample.robots,
                observations=(PixelObservation("wrist", "board", board.ids, pixels),),
            )
        )
    return found


def test_the_sigma_falls_and_is_that_of_a_solve(samples):
    """Nothing is said before it can be; then each sample lowers it, and in the end it is a solve's to a fifth."""
    from dataclasses import replace

    estimate, sigmas = running_estimate(SKETCH), []
    assert estimate.sigma() is None
    for sample in samples:
        estimate = estimate.added(sample)
        sigmas.append(estimate.sigma())
    assert sigmas[0] is None
    said = np.array([sigma for sigma in sigmas if sigma is not None])
    assert len(said) > 10
    assert np.all(np.diff(said, axis=0) < 0)
    noise = np.repeat([1e-4, 2e-4], 3)
    robots = {name: replace(robot, noise=noise) for name, robot in WORLD.cell.robots.items()}
    solved = solve(replace(WORLD.cell, robots=robots, pixel_px=PIXEL_PX), Recording(tuple(samples))).transforms[BASE]
    rms = [np.sqrt(np.mean(part**2)) for part in (solved.sigma_t, solved.sigma_r)]
    np.testing.assert_allclose(said[-1], rms, rtol=0.2)


def test_what_says_nothing_changes_nothing():
    """A sample in which nothing is seen adds nothing."""
    estimate = running_estimate(SKETCH)
    assert estimate.added(Sample(0, robots=home(WORLD))) is estimate
