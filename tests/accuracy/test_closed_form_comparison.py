"""The closed form beside maximum likelihood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.axis_shift import calibrate_axis_shift, find_pair_stations
from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.closed_form_comparison import compare_closed_form
from basecal.accuracy.fit_details import FitDetails
from basecal.cell import Calibration, Unknown
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.geometry import SE3, Camera, PoseEstimate
from basecal.reporting.page import page
from basecal.reporting.text import estimate_rows
from basecal.simulation import Scenario, simulate
from basecal.simulation.shifts import simulate_shifts

NAME = "eye_base_from_hand_base"
CAMERA = Camera("pinhole", [1000.0, 1000.0, 640.0, 480.0], (1280, 960))
TRUE = SE3.from_rotvec([0.1, 3.0, 0.3], [0.2, 0.1, 2.5])
STATIONS = 3


@pytest.fixture(scope="module")
def made():
    """Shifts from three stations, without noise of robots."""
    rng = np.random.default_rng(0)
    eyes = SE3.exp(0.02 * rng.standard_normal((STATIONS, 6)))
    lights = SE3.from_rotvec([0.2, 0.1, 0.0], [0.1, 0.05, 0.4]) @ SE3.exp(0.05 * rng.standard_normal((STATIONS, 6)))
    return simulate_shifts(TRUE, eyes, lights, CAMERA, 0.02, True, 0.05, 0)


def answer(base, **settings):
    """A calibration that gives a base."""
    return Calibration("good", transforms={NAME: PoseEstimate(base, 1e-8 * np.eye(6))}, settings=settings)


def test_it_is_the_closed_form_of_the_recording(made):
    """Its estimate is what the method gives by itself, and its distance that from the other answer."""
    beside = compare_closed_form(made.cell, made.recording, answer(TRUE))
    problem, _ = build_problem(made.cell, made.recording)
    alone = calibrate_axis_shift(made.cell, problem, Settings(method="axis-shift"), []).transforms[NAME]
    assert np.array_equal(beside.estimate.mean.matrix, alone.mean.matrix)
    assert np.allclose(beside.difference, (TRUE.inverse() @ alone.mean).log())


def test_stations_have_their_samples_and_weights(made):
    """Seven samples each, weights that add up to one, and each station's own base."""
    stations = compare_closed_form(made.cell, made.recording, answer(TRUE)).stations
    assert [len(each.samples) for each in stations] == [7] * STATIONS
    assert sum(each.weight for each in stations) == pytest.approx(1)
    own = find_pair_stations(build_problem(made.cell, made.recording)[0], made.cell)
    assert np.allclose([each.off for each in stations], [(TRUE.inverse() @ each.base()).log() for each in own])


def test_with_a_task_point_one_station_is_chosen(made):
    """That whose light was nearest to it."""
    plain = compare_closed_form(made.cell, made.recording, answer(TRUE)).stations
    for place, station in enumerate(plain):
        beside = compare_closed_form(made.cell, made.recording, answer(TRUE, task_point=station.light.tolist()))
        assert [each.weight for each in beside.stations] == [float(k == place) for k in range(STATIONS)]


def test_there_is_none_where_it_says_nothing(made):
    """Of a board, of a calibration by the closed form itself, and of one that is refused."""
    board = simulate(Scenario(samples=8), 1)
    assert compare_closed_form(board.cell, board.recording, answer(TRUE)) is None
    assert compare_closed_form(made.cell, made.recording, answer(TRUE, method="axis-shift")) is None
    assert compare_closed_form(made.cell, made.recording, Calibration("refused")) is None


def test_the_page_shows_both_methods(made):
    """The numbers of both, with each station, of which the one that weighs most is marked."""
    calibration = calibrate(made.cell, made.recording)
    beside = compare_closed_form(made.cell, made.recording, calibration)
    html = page(made.cell, made.recording, calibration, FitDetails(closed_form=beside))
    part = html.split("Two methods beside each other")[1].split("</section>")[0]
    assert part.count("<tr><td>") + part.count('<tr class="chosen"><td>') == 2 + STATIONS
    assert part.count('class="chosen"') == 1
    for estimate in (beside.other, beside.estimate):
        assert all(f"<td><b>{number}</b>" in part for row in estimate_rows(estimate) for number in row.values)
    plain = page(made.cell, made.recording, calibration, replace(FitDetails(), closed_form=None))
    assert "Two methods" not in plain


def test_the_base_may_be_that_of_the_eye(made):
    """Where the robot with the light is the reference the inverses are compared, and lights stay where they were."""
    cell = replace(made.cell, reference="hand", bases={"eye": Unknown()})
    calibration = Calibration("good", {"hand_base_from_eye_base": PoseEstimate(TRUE.inverse(), 1e-8 * np.eye(6))})
    beside = compare_closed_form(cell, made.recording, calibration)
    plain = compare_closed_form(made.cell, made.recording, answer(TRUE))
    assert beside.name == "hand_base_from_eye_base"
    np.testing.assert_allclose(beside.estimate.mean.matrix, plain.estimate.mean.inverse().matrix, atol=1e-12)
    own = find_pair_stations(build_problem(made.cell, made.recording)[0], made.cell)
    for each, other, station in zip(beside.stations, plain.stations, own, strict=True):
        np.testing.assert_allclose(each.off, (TRUE @ station.base().inverse()).log(), atol=1e-12)
        np.testing.assert_allclose(each.light, other.light)
        assert (each.samples, each.weight) == (other.samples, pytest.approx(other.weight))
