"""Tests of observations as arrays: stated, detected and shared sigmas, and alternative readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import CandidateObservation, PixelObservation, PointObservation, PoseObservation, Recording
from basecal.errors import InputError
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.measurements import alternative_readings, make_measurement
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def test_stated_sigmas_are_kept_and_detected_ones_weight():
    """Two points have detected sigmas of 0.1 and 0.3 px around the median 0.2 px.

    One has twice the weight, one two thirds.
    """
    cell = replace(simulate(Scenario(samples=4), seed=0).cell, pixel_px=None)
    stated = PixelObservation("wrist", "board", np.array([0, 2]), np.ones((2, 2)), np.array([0.1, 0.3]))
    of_detector = replace(stated, detected=True)
    measurement = make_measurement(cell, "wrist", "board", "PixelObservation", [stated, of_detector])
    np.testing.assert_allclose(measurement.stated[:, [0, 2]], [[10, 1 / 0.3], [0, 0]])
    np.testing.assert_allclose(measurement.relative[1, [0, 2]], [2, 2 / 3])
    assert np.count_nonzero(measurement.seen) == 4
    assert measurement.common_px == 0.0


def test_poses_may_state_a_sigma():
    """The array has 1 / sigma of each freedom if stated, else zero."""
    cell = simulate(Scenario(samples=4, target="pose"), seed=0).cell
    seen = [PoseObservation("wrist", "board", SE3.identity(), sigma) for sigma in (None, np.full(6, 0.25))]
    measurement = make_measurement(cell, "wrist", "board", "PoseObservation", seen)
    np.testing.assert_array_equal(measurement.stated, [[0.0] * 6, [4.0] * 6])


def test_points_without_a_target_kind_are_refused():
    """Points of a target without a kind, and pixels of a camera without a lens, are refused.

    Each error says what is missing.
    """
    cell = simulate(Scenario(samples=4), seed=0).cell
    (board,), (wrist,) = cell.targets.values(), cell.cameras.values()
    with pytest.raises(InputError, match="'board' is seen as points and has no `kind`"):
        make_measurement(replace(cell, targets={"board": replace(board, target=None)}), "wrist", "board", "Pixel", [])
    with pytest.raises(InputError, match="'wrist' gives pixels and has no `intrinsics`"):
        make_measurement(replace(cell, cameras={"wrist": replace(wrist, intrinsics=None)}), "wrist", "board", "P", [])


def test_shared_error_needs_the_noise_of_single_points():
    """`correlated_px` without `pixel_px` is an error, and with it reaches the measurement."""
    s = simulate(Scenario(samples=4, correlated_px=0.3), seed=0)
    problem, _ = build_problem(s.cell, s.recording)
    assert problem.groups[0].measurement.common_px == 0.3
    with pytest.raises(InputError, match="correlated_px needs pixel_px"):
        build_problem(replace(s.cell, pixel_px=None), s.recording)


@pytest.mark.parametrize(("spots", "readings"), [(1, 0), (2, 2), (3, 3)])
def test_candidates_have_one_reading_each(spots, readings):
    """Each spot of a view may be the LED. A single spot has no alternative, and corners have none."""
    s = simulate(Scenario(samples=4, target="led"), seed=0)
    samples = []
    for sample in s.recording.samples:
        (seen,) = sample.observations
        pixels = np.concatenate([seen.pixels, np.arange(2.0 * spots - 2).reshape(-1, 2)])
        samples.append(replace(sample, observations=(CandidateObservation(seen.camera, seen.target, pixels),)))
    (group,) = build_problem(s.cell, Recording(tuple(samples)))[0].groups
    assert len(group.readings) == readings
    for k, reading in enumerate(group.readings):
        np.testing.assert_array_equal(reading.pixels[0, 0], samples[0].observations[0].pixels[k])
    board = simulate(Scenario(samples=4), seed=0)
    assert build_problem(board.cell, board.recording)[0].groups[0].readings == ()


def test_3d_points_are_in_rows_of_their_ids():
    """Points have 1 / sigma if stated, and unseen points have neither a position nor a weight."""
    cell = simulate(Scenario(samples=4, target="points3d"), seed=0).cell
    (board,) = cell.targets.values()
    rng, ids = np.random.default_rng(0), board.target.ids
    stated = PointObservation("wrist", "board", ids[[3, 1]], rng.standard_normal((2, 3)), np.array([0.5, 0.25]))
    silent = PointObservation("wrist", "board", ids[[0]], rng.standard_normal((1, 3)))
    measurement = make_measurement(cell, "wrist", "board", "PointObservation", [stated, silent])
    expected, inverse = np.zeros((2, len(ids), 3)), np.zeros((2, len(ids)))
    expected[0, [3, 1]], expected[1, 0], inverse[0, [3, 1]] = stated.points_in_camera, silent.points_in_camera, (2, 4)
    np.testing.assert_array_equal(measurement.points_in_camera, expected)
    np.testing.assert_array_equal(measurement.stated, inverse)
    np.testing.assert_array_equal(np.argwhere(measurement.seen), [[0, 1], [0, 3], [1, 0]])
    np.testing.assert_array_equal(measurement.points_in_target, board.target.points)


def test_detected_sigmas_are_relative_to_the_cells():
    """With 0.5 px, a point detected at twice the median has half the weight, and stated sigmas are kept."""
    cell = replace(simulate(Scenario(samples=4), seed=0).cell, pixel_px=0.5)
    pixels = np.ones((3, 2))
    detected = PixelObservation(
        "wrist", "board", np.array([0, 1, 2]), pixels, np.array([0.2, 0.1, 0.05]), detected=True
    )
    plain = PixelObservation("wrist", "board", np.array([0, 1, 2]), pixels)
    stated = PixelObservation("wrist", "board", np.array([0, 1, 2]), pixels, np.array([0.2, 0.1, 0.05]))
    measurement = make_measurement(cell, "wrist", "board", "PixelObservation", [detected, plain, stated])
    np.testing.assert_allclose(measurement.stated[:, :3], [[1, 2, 4], [2, 2, 2], [5, 10, 20]])
    np.testing.assert_allclose(measurement.relative[:, :3], [[0.5, 1, 2], [1, 1, 1], [1, 1, 1]])
    assert make_measurement(cell, "wrist", "board", "PixelObservation", [plain, stated]).relative is None


def test_views_with_fewer_spots_repeat_their_first():
    """With three, one and two spots there are three readings, each spot with its own sigma.

    With ten spots there are at most eight.
    """
    cell = simulate(Scenario(samples=4, target="led"), seed=0).cell
    spots = np.arange(20.0).reshape(10, 2)
    (light,) = cell.targets.values()
    few = [CandidateObservation("wrist", light.name, spots[:n], 0.1 * (1 + np.arange(n))) for n in (3, 1, 2)]
    measurement = make_measurement(cell, "wrist", light.name, "PixelObservation", few)
    np.testing.assert_allclose(measurement.stated[:, 0], 10.0)
    readings = alternative_readings(measurement, light.target, few)
    assert [reading.pixels[:, 0, 0].tolist() for reading in readings] == [[0, 0, 0], [2, 0, 2], [4, 0, 0]]
    for name in ("stated", "weight"):
        inverse = [getattr(reading, name)[:, 0] for reading in readings]
        np.testing.assert_allclose(inverse, [[10, 10, 10], [5, 10, 5], [10 / 3, 10, 10]])
    detected = [replace(of, detected=True) for of in few]
    measurement = make_measurement(replace(cell, pixel_px=None), "wrist", light.name, "PixelObservation", detected)
    readings = alternative_readings(measurement, light.target, detected)
    np.testing.assert_allclose([r.relative[:, 0] for r in readings], [[1, 1, 1], [0.5, 1, 0.5], [1 / 3, 1, 1]])
    assert not any(reading.stated.any() for reading in readings)
    assert {reading.stated.shape for reading in readings} == {(3, 1)}
    half = [detected[0], few[2]]
    measurement = make_measurement(replace(cell, pixel_px=None), "wrist", light.name, "PixelObservation", half)
    assert [r.relative[1, 0] for r in alternative_readings(measurement, light.target, half)] == [1, 1, 1]
    many = [CandidateObservation("wrist", light.name, spots)]
    assert len(alternative_readings(make_measurement(cell, "wrist", light.name, "P", many), light.target, many)) == 8
    mixed = [few[0], PixelObservation("wrist", light.name, light.target.ids, spots[9:])]
    readings = alternative_readings(make_measurement(cell, "wrist", light.name, "P", mixed), light.target, mixed)
    assert [reading.pixels[:, 0, 0].tolist() for reading in readings] == [[0, 18], [2, 18], [4, 18]]


def test_only_pixels_have_alternative_readings():
    """Poses of a chessboard, and views of a target without a kind, have one reading."""
    board = simulate(Scenario(samples=3, target="chessboard"), 0).cell.targets["board"].target
    cell = simulate(Scenario(samples=4, target="pose"), seed=0).cell
    seen = [PoseObservation("wrist", "board", SE3.identity(), None)]
    measurement = make_measurement(cell, "wrist", "board", "PoseObservation", seen)
    assert alternative_readings(measurement, board, seen) == ()
    assert alternative_readings(measurement, None, seen) == ()
