"""What samples cover."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.acquisition.coverage import find_equal_sample, measure_coverage
from basecal.cell import PixelObservation, RobotState, Sample
from basecal.planning.sketch import sketch_cell
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms()
SKETCH, HOME = sketch_cell(WORLD.cell), home(WORLD)


def sample(number, turn=0.0, pixels=()):
    states = {**HOME, "eye": RobotState(joints_rad=WORLD.home["eye"] + [0, 0, 0, 0, 0, turn])}
    seen = PixelObservation("wrist", "board", np.arange(len(pixels)), np.array(pixels, dtype=float).reshape(-1, 2))
    return Sample(number, robots=states, observations=(seen,) if len(pixels) else ())


def test_cells_of_the_image():
    """Points in two corners cover two of the cells, also where one lies a little outside."""
    found = measure_coverage(SKETCH, [sample(0, pixels=[(3, 3)]), sample(1, pixels=[(1281, 719), (2, 4)])])
    assert found.cells.sum() == 2
    assert found.cells[0, 0]
    assert found.cells[-1, -1]
    assert found.share == 2 / 24


def test_turns_and_advice():
    """The last joint turns the eye about its flange's z alone: a person is told to turn it about another axis."""
    samples = [sample(k, turn=0.2 * k) for k in range(5)]
    found = measure_coverage(SKETCH, samples)
    np.testing.assert_allclose(found.turned_rad["eye"], [0, 0, 0.8], atol=1e-9)
    assert found.advice(5) in {"turn eye further about x", "turn eye further about y"}
    assert found.advice(4) == ""


def test_samples_that_are_alike():
    """One with all arms within the limits of another is named; one with an arm elsewhere is not."""
    others = [sample(4), sample(5, turn=0.5)]
    assert find_equal_sample(SKETCH, sample(9, turn=0.501), others, 2e-3, 2e-3) == 5
    assert find_equal_sample(SKETCH, sample(9, turn=0.25), others, 2e-3, 2e-3) is None
    assert find_equal_sample(SKETCH, sample(9), [replace(sample(4), robots={})], 2e-3, 2e-3) is None
