"""Tests of the coverage of samples."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.acquisition.coverage import (
    COVERAGE_GRID,
    Coverage,
    covered_cells,
    find_equal_sample,
    is_same_place,
    measure_coverage,
    rotation_ranges,
)
from basecal.cell import CandidateObservation, PixelObservation, RobotState, Sample
from basecal.geometry import SE3
from basecal.planning.sketch import sketch_cell
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms()
SKETCH, HOME = sketch_cell(WORLD.cell), home(WORLD)


def sample(number, turn=0.0, pixels=()):
    states = {**HOME, "eye": RobotState(joints_rad=WORLD.home["eye"] + [0, 0, 0, 0, 0, turn])}
    seen = PixelObservation("wrist", "board", np.arange(len(pixels)), np.array(pixels, dtype=float).reshape(-1, 2))
    return Sample(number, robots=states, observations=(seen,) if len(pixels) else ())


def test_points_cover_cells_of_the_image():
    """Points in two corners cover two cells, also if one lies slightly outside."""
    found = measure_coverage(SKETCH, [sample(0, pixels=[(3, 3)]), sample(1, pixels=[(1281, 719), (2, 4)])])
    assert found.cells.sum() == 2
    assert found.cells[0, 0]
    assert found.cells[-1, -1]
    assert found.share == 2 / 24


def test_missing_rotation_is_advised():
    """The last joint rotates the eye only about its flange's z: the advice is another axis."""
    samples = [sample(k, turn=0.2 * k) for k in range(5)]
    found = measure_coverage(SKETCH, samples)
    np.testing.assert_allclose(found.rotation_ranges_rad["eye"], [0, 0, 0.8], atol=1e-9)
    assert found.advice(5) in {"rotate eye further about x", "rotate eye further about y"}
    assert found.advice(4) == ""


def test_equal_samples_are_found():
    """A sample with all arms within the limits of another is reported; one with an arm elsewhere is not."""
    others = [sample(4), sample(5, turn=0.5)]
    assert find_equal_sample(SKETCH, sample(9, turn=0.501), others, 2e-3, 2e-3) == 5
    assert find_equal_sample(SKETCH, sample(9, turn=0.25), others, 2e-3, 2e-3) is None
    assert find_equal_sample(SKETCH, sample(9), [replace(sample(4), robots={})], 2e-3, 2e-3) is None


@pytest.mark.parametrize(("pixel", "row", "column"), [
    ((0, 0), 0, 0), ((213, 179), 0, 0), ((214, 181), 1, 1), ((1066, 0), 0, 4), ((1067, 0), 0, 5), ((0, 539), 2, 0),
    ((0, 541), 3, 0), ((5000, 5000), 3, 5), ((-400, -400), 0, 0),
])  # fmt: skip
def test_image_has_four_rows_of_six_cells(pixel, row, column):
    """The image has 1280 by 720 pixels; points outside count for the nearest cell."""
    cells = covered_cells(np.array([pixel], dtype=float), (1280, 720))
    assert np.argwhere(cells).tolist() == [[row, column]]


def test_only_pixels_of_the_camera_cover_its_image():
    """Candidates count; pixels of another camera, poses, and cameras without a size do not."""
    at = np.array([[3.0, 3.0]])
    other = PixelObservation("other", "board", np.arange(1), at + 1000)
    seen = Sample(0, observations=(CandidateObservation("wrist", "board", at), other))
    assert measure_coverage(SKETCH, [seen]).cells.sum() == 1
    blind = SimpleNamespace(lens=SimpleNamespace(size_px=None), view=SKETCH.view, movers=())
    assert not measure_coverage(blind, [seen]).cells.any()
    assert measure_coverage(SKETCH, []).share == 0.0


@pytest.mark.parametrize(("degrees", "advice"), [
    ([15.1, 15.1, 15.1], ""),
    ([15.1, 15.1, 14.9], "rotate a further about z"),
    ([14, 13, 16], "rotate a further about y"),
])  # fmt: skip
def test_fifteen_degrees_about_each_axis_are_enough(degrees, advice):
    """Below that, the axis of the least rotation is reported for the first such robot."""
    turned = {"b": np.radians([40.0, 40, 40]), "a": np.radians(degrees)}
    coverage = Coverage(np.zeros(COVERAGE_GRID, dtype=bool), turned)
    assert coverage.advice(5) == advice
    assert coverage.advice(4) == ""
    both = Coverage(coverage.cells, {"c": np.radians([1.0, 0, 0]), **turned})
    assert both.advice(9) == "rotate c further about y"


def test_rotation_range_is_over_all_samples():
    """The order does not matter; one sample has no range, and samples without the arm are left out."""
    turns = [0.1, 0.4, -0.3]
    samples = [sample(k, turn=turn) for k, turn in enumerate(turns)]
    samples.insert(1, replace(samples[0], robots={name: state for name, state in HOME.items() if name != "eye"}))
    assert rotation_ranges(SKETCH, samples)["eye"] == pytest.approx([0, 0, 0.7], abs=1e-9)
    assert rotation_ranges(SKETCH, samples[:1])["eye"].tolist() == [0, 0, 0]
    assert rotation_ranges(SKETCH, [])["eye"].tolist() == [0, 0, 0]


@pytest.mark.parametrize(("off", "is_same"), [
    ([1.9e-3, 0, 0, 0, 0, 1.9e-3], True), ([2.1e-3, 0, 0, 0, 0, 0], False),
    ([0, 0, 0, 0, 2.1e-3, 0], False), ([0, 0, 0, 2.1e-3, 0, 0], False),
    ([1.5e-3, 1.5e-3, 0, 0, 0, 0], False),
])  # fmt: skip
def test_poses_are_equal_within_two_millimetres_and_milliradians(off, is_same):
    """The limits are 3-D norms; a sample without the robot is equal to none."""
    pose = SKETCH.base_from_flange("eye", HOME["eye"])
    here, there = (
        Sample(k, robots={"eye": RobotState(base_from_flange=p)}) for k, p in enumerate((pose, pose @ SE3.exp(off)))
    )
    assert is_same_place(SKETCH, "eye", here, there) == is_same
    assert not is_same_place(SKETCH, "eye", here, Sample(2, robots={}))
    assert not is_same_place(SKETCH, "eye", Sample(2, robots={}), here)
    assert is_same_place(SKETCH, "eye", here, there, 5e-3, 5e-3)
