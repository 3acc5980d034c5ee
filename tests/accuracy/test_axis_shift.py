"""Tests of the paper's closed form (axis shift): covariance, neglected depth, choice of station."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.axis_shift import calibrate_axis_shift, compare_closed_form, find_pair_stations
from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import FitDetails
from basecal.cell import Calibration, Unknown
from basecal.errors import NotObservable
from basecal.estimation.axis_shift.stations import fuse_bases
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
EYE = SE3.identity()
LIGHT = SE3.from_rotvec([0.2, 0.1, 0.0], [0.1, 0.05, 0.4])


def batch(transform, spread, count, seed):
    return transform @ SE3.exp(spread * np.random.default_rng(seed).standard_normal((count, 6)))


def simulate_stations(shift_m=0.02, stations=2, two_sided=True, pixel_px=0.05, seed=0):
    return simulate_shifts(
        TRUE, batch(EYE, 0.02, stations, 1), batch(LIGHT, 0.05, stations, 2), CAMERA, shift_m, two_sided, pixel_px, seed
    )


def calibrate_shifts(simulated, settings=None, **changed):
    cell = replace(simulated.cell, **changed)
    problem, _ = build_problem(cell, simulated.recording)
    return calibrate_axis_shift(cell, problem, settings or Settings(method="axis-shift"), [])


def stations(simulated):
    return find_pair_stations(build_problem(simulated.cell, simulated.recording)[0], simulated.cell)


def codes(calibration):
    return [(f.code, f.severity) for f in calibration.findings]


@pytest.mark.journey
def test_covariance_matches_pixel_noise():
    """Over 30 draws the scatter of the base matches its random covariance: the mean square is 1 within 0.6.

    Numbers of 29 x 6 freedoms scatter by 0.11, those of one draw are correlated; the random part is of first order.
    """
    exact = calibrate_shifts(simulate_stations(pixel_px=0.0), pixel_px=1e-9)[NAME]
    found = [calibrate_shifts(simulate_stations(pixel_px=0.02, seed=seed), pixel_px=0.02)[NAME] for seed in range(30)]
    off = np.stack([(exact.mean.inverse() @ estimate.mean).log() for estimate in found])
    random = found[0].covariance - exact.covariance
    squares = np.einsum("ni,ij,nj->n", off, np.linalg.inv(random), off) / 6
    assert np.mean(squares) == pytest.approx(1.0, abs=0.6)


def test_covariance_grows_with_stated_pixel_sigma():
    """The pixels' part of the covariance grows with the squared sigma, that of neglected depth does not."""
    small, large, larger = (
        calibrate_shifts(simulate_stations(), pixel_px=px)[NAME].covariance for px in (1e-9, 0.1, 0.2)
    )
    np.testing.assert_allclose(larger - small, 4 * (large - small), rtol=1e-6)
    assert np.linalg.matrix_rank(small, tol=1e-9 * np.abs(small).max()) == 1


def test_assumed_pixel_sigma_is_reported():
    """Without a stated pixel sigma 0.3 px are assumed and reported as an info; with one there is none."""
    silent, stated = (
        calibrate_shifts(simulate_stations(), pixel_px=None),
        calibrate_shifts(simulate_stations(), pixel_px=0.3),
    )
    np.testing.assert_allclose(silent[NAME].covariance, stated[NAME].covariance)
    assert silent.noise["pixel_px"] == 0.3
    messages = [f.message for f in silent.findings if "0.3 px are assumed" in f.message]
    assert len(messages) == 1
    assert not any("assumed" in f.message for f in stated.findings)


def test_neglected_depth_warns_from_two_sigmas():
    """Neglected depth is a warning from two sigmas on: at a pixel sigma a tenth below the limit, not a tenth above."""
    simulated = simulate_stations(0.1, two_sided=False, pixel_px=0.0)
    exact, by_one_px = (calibrate_shifts(simulated, pixel_px=px)[NAME].covariance for px in (1e-9, 1.0))
    systematic, random = np.sqrt(np.diag(exact)), np.sqrt(np.diag(by_one_px - exact))
    limit = float(np.max(systematic / (2 * random)))
    above, below = calibrate_shifts(simulated, pixel_px=0.9 * limit), calibrate_shifts(simulated, pixel_px=1.1 * limit)
    assert ("neglected-depth", "warning") in codes(above)
    assert above.verdict == "doubtful"
    assert set(codes(below)) == {("axis-shift-station", "info")}
    assert below.verdict == "good"
    (message,) = [f.message for f in above.findings if f.code == "neglected-depth"]
    assert f"about {1e3 * np.linalg.norm(systematic[:3]):.2g} mm" in message
    assert f"{np.degrees(np.linalg.norm(systematic[3:])):.2g} deg" in message


def test_every_station_is_reported():
    """Each station is reported with its samples, and its LED and base in the eye's base."""
    simulated = simulate_stations(stations=3)
    found = calibrate_shifts(simulated)
    of = [f for f in found.findings if f.code == "axis-shift-station"]
    assert [f.about for f in of] == [tuple(str(int(n)) for n in s.samples) for s in stations(simulated)]
    base = stations(simulated)[1].base()
    light = (base @ stations(simulated)[1].hand_base_from_led).translation
    assert f"LED at ({', '.join(f'{1e3 * v:.1f}' for v in light)}) mm" in of[1].message
    assert f"base at ({', '.join(f'{1e3 * v:.1f}' for v in base.translation)}) mm" in of[1].message


def test_stations_are_weighted_by_shift_over_depth():
    """Without a task, the mean of all bases is weighted by the squared ratio of LED shift to distance."""
    simulated = simulate_stations(stations=3)
    of = stations(simulated)
    weights = [(s.rms_shift_m / np.linalg.norm(s.camera_from_led().translation)) ** 2 for s in of]
    wanted = fuse_bases([s.base() for s in of], weights)
    np.testing.assert_allclose(calibrate_shifts(simulated)[NAME].mean.matrix, wanted.matrix, atol=1e-12)


@pytest.mark.parametrize("choice", ["nearest", "weighted"])
def test_task_chooses_its_station(choice):
    """At a station's own LED, its base and covariance are the answer, alone or by weight."""
    simulated = simulate_stations(stations=3)
    of = stations(simulated)[1]
    task = (of.base() @ of.hand_base_from_led).translation
    settings = Settings(method="axis-shift", task_point=tuple(task), station_choice=choice)
    found = calibrate_shifts(simulated, settings)
    np.testing.assert_allclose(found[NAME].mean.matrix, of.base().matrix, atol=1e-6)
    chosen = [s for s in simulated.recording.samples if s.sample in of.samples]
    alone = replace(simulated, recording=replace(simulated.recording, samples=tuple(chosen)))
    np.testing.assert_allclose(found[NAME].covariance, calibrate_shifts(alone)[NAME].covariance, rtol=1e-3)


def test_nearest_station_answers_alone():
    """Beside an LED the nearest station gives the answer alone; by weights all stations contribute."""
    simulated = simulate_stations(stations=3)
    of = stations(simulated)[1]
    task = (of.base() @ of.hand_base_from_led).translation + np.array([0.01, 0.0, 0.0])
    for choice, alone in (("nearest", True), ("weighted", False)):
        settings = Settings(method="axis-shift", task_point=tuple(task), station_choice=choice)
        off = (calibrate_shifts(simulated, settings)[NAME].mean.inverse() @ of.base()).log()
        assert (np.abs(off).max() < 1e-9) == alone


def test_stations_are_weighted_equally_in_mean_and_covariance():
    """For a task between stations, each counts by the distance to the power of minus two, its noise by the square."""
    simulated = simulate_stations(stations=3)
    of, task = stations(simulated), np.array([0.3, -0.2, 2.0])
    settings = Settings(method="axis-shift", task_point=tuple(task), station_choice="weighted")

    def by_pixels(recorded, settings=None):
        """Contribution of one pixel of noise to the covariance."""
        with_noise, without = (calibrate_shifts(recorded, settings, pixel_px=px)[NAME].covariance for px in (1.0, 1e-9))
        return with_noise - without

    distance = [np.linalg.norm((s.base() @ s.hand_base_from_led).translation - task) for s in of]
    weights = np.array(distance) ** -2.0 / np.sum(np.array(distance) ** -2.0)
    alone = []
    for station in of:
        chosen = tuple(s for s in simulated.recording.samples if s.sample in station.samples)
        alone.append(by_pixels(replace(simulated, recording=replace(simulated.recording, samples=chosen))))
    wanted = sum(w**2 * each for w, each in zip(weights, alone, strict=True))
    np.testing.assert_allclose(by_pixels(simulated, settings), wanted, rtol=1e-6, atol=1e-9 * np.abs(wanted).max())


def test_base_of_eye_is_inverse():
    """If the robot with the LED is the reference, the inverse base and covariance are requested and given."""
    simulated = simulate_stations()
    known = Unknown()
    inverse = calibrate_shifts(simulated, reference="hand", bases={"eye": known})
    plain = calibrate_shifts(simulated)[NAME].inverse()
    estimate = inverse["hand_base_from_eye_base"]
    np.testing.assert_allclose(estimate.mean.matrix, plain.mean.matrix, atol=1e-9)
    np.testing.assert_allclose(estimate.covariance, plain.covariance, rtol=1e-6)
    np.testing.assert_allclose(inverse.joint_covariance, plain.covariance, rtol=1e-6)
    assert inverse.order == ("hand_base_from_eye_base",)


def test_missing_lens_and_several_bases_are_refused():
    """The closed form needs a lens and one base to find; the errors state it."""
    simulated = simulate_stations()
    camera = replace(simulated.cell.cameras["camera"], intrinsics=None)
    with pytest.raises(NotObservable, match="the lens of camera"):
        calibrate_shifts(simulated, cameras={"camera": replace(camera, intrinsics=replace(
            simulated.cell.cameras["camera"].intrinsics, status="free", camera=None))})  # fmt: skip
    with pytest.raises(NotObservable, match="ask for one base"):
        calibrate_shifts(simulated, bases={"hand": Unknown("fixed", TRUE)})


STATIONS = 3


@pytest.fixture(scope="module")
def shifted():
    """Shifts from three stations, without robot noise."""
    rng = np.random.default_rng(0)
    eyes = SE3.exp(0.02 * rng.standard_normal((STATIONS, 6)))
    lights = SE3.from_rotvec([0.2, 0.1, 0.0], [0.1, 0.05, 0.4]) @ SE3.exp(0.05 * rng.standard_normal((STATIONS, 6)))
    return simulate_shifts(TRUE, eyes, lights, CAMERA, 0.02, True, 0.05, 0)


def answer(base, **settings):
    """A calibration that gives a base."""
    return Calibration("good", transforms={NAME: PoseEstimate(base, 1e-8 * np.eye(6))}, settings=settings)


def test_comparison_equals_closed_form_of_recording(shifted):
    """The comparison's estimate is that of the method alone, and its difference that from the other answer."""
    beside = compare_closed_form(shifted.cell, shifted.recording, answer(TRUE))
    problem, _ = build_problem(shifted.cell, shifted.recording)
    alone = calibrate_axis_shift(shifted.cell, problem, Settings(method="axis-shift"), []).transforms[NAME]
    assert np.array_equal(beside.estimate.mean.matrix, alone.mean.matrix)
    assert np.allclose(beside.difference, (TRUE.inverse() @ alone.mean).log())


def test_stations_have_samples_and_weights(shifted):
    """Each station has seven samples, a weight (sum one) and its own base."""
    stations = compare_closed_form(shifted.cell, shifted.recording, answer(TRUE)).stations
    assert [len(each.samples) for each in stations] == [7] * STATIONS
    assert sum(each.weight for each in stations) == pytest.approx(1)
    own = find_pair_stations(build_problem(shifted.cell, shifted.recording)[0], shifted.cell)
    assert np.allclose([each.difference for each in stations], [(TRUE.inverse() @ each.base()).log() for each in own])


def test_task_point_chooses_nearest_station(shifted):
    """With a task point, the station whose LED is nearest has all the weight."""
    plain = compare_closed_form(shifted.cell, shifted.recording, answer(TRUE)).stations
    for place, station in enumerate(plain):
        beside = compare_closed_form(shifted.cell, shifted.recording, answer(TRUE, task_point=station.led.tolist()))
        assert [each.weight for each in beside.stations] == [float(k == place) for k in range(STATIONS)]


def test_inapplicable_calibrations_have_no_comparison(shifted):
    """A board, a calibration by the closed form itself, and a refused one have no comparison."""
    board = simulate(Scenario(samples=8), 1)
    assert compare_closed_form(board.cell, board.recording, answer(TRUE)) is None
    assert compare_closed_form(shifted.cell, shifted.recording, answer(TRUE, method="axis-shift")) is None
    assert compare_closed_form(shifted.cell, shifted.recording, Calibration("refused")) is None


@pytest.mark.journey
def test_report_shows_both_methods(shifted):
    """The report shows the numbers of both methods and all stations; the one with the largest weight is marked."""
    calibration = calibrate(shifted.cell, shifted.recording)
    beside = compare_closed_form(shifted.cell, shifted.recording, calibration)
    html = page(shifted.cell, shifted.recording, calibration, FitDetails(closed_form=beside))
    part = html.split("Comparison of two methods")[1].split("</section>")[0]
    assert part.count("<tr><td>") + part.count('<tr class="chosen"><td>') == 2 + STATIONS
    assert part.count('class="chosen"') == 1
    for estimate in (beside.other, beside.estimate):
        assert all(f"<td><b>{number}</b>" in part for row in estimate_rows(estimate) for number in row.values)
    plain = page(shifted.cell, shifted.recording, calibration, replace(FitDetails(), closed_form=None))
    assert "Two methods" not in plain


def test_comparison_with_inverse_base(shifted):
    """If the robot with the LED is the reference, inverses are compared, and LED positions are unchanged."""
    cell = replace(shifted.cell, reference="hand", bases={"eye": Unknown()})
    calibration = Calibration("good", {"hand_base_from_eye_base": PoseEstimate(TRUE.inverse(), 1e-8 * np.eye(6))})
    beside = compare_closed_form(cell, shifted.recording, calibration)
    plain = compare_closed_form(shifted.cell, shifted.recording, answer(TRUE))
    assert beside.name == "hand_base_from_eye_base"
    np.testing.assert_allclose(beside.estimate.mean.matrix, plain.estimate.mean.inverse().matrix, atol=1e-12)
    own = find_pair_stations(build_problem(shifted.cell, shifted.recording)[0], shifted.cell)
    for each, other, station in zip(beside.stations, plain.stations, own, strict=True):
        np.testing.assert_allclose(each.difference, (TRUE @ station.base().inverse()).log(), atol=1e-12)
        np.testing.assert_allclose(each.led, other.led)
        assert (each.samples, each.weight) == (other.samples, pytest.approx(other.weight))
