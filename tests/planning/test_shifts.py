"""Tests of the pattern of the paper's programmed shifts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.cell import Calibration, Sample
from basecal.errors import InputError
from basecal.geometry import PoseEstimate
from basecal.planning import shifts
from basecal.planning.feasible import is_feasible
from basecal.planning.prospects import sketches
from basecal.planning.shifts import STATION_SAMPLES, stations
from basecal.planning.sketch import sketch_cell
from basecal.simulation import Scenario, simulate
from shared.facing_arms import facing_arms
from shared.running_cell import home

WORLD = facing_arms("led")
SKETCH, HOME = sketch_cell(WORLD.cell), home(WORLD)


def test_stations_follow_the_paper():
    """At each station the camera looks straight at the LED, which shifts in both directions along its own axes."""
    plan = shifts.plan(SKETCH, HOME, 14)
    assert len(plan) == 14
    for station in (plan[:7], plan[7:]):
        light = SKETCH.camera_from_target(station[0]) @ np.zeros(3)
        assert np.linalg.norm(light[:2]) < 1e-6 * light[2]
        assert all(np.array_equal(s.robots["eye"].joints_rad, station[0].robots["eye"].joints_rad) for s in station)
        mount = SKETCH.transforms["hand_flange_from_light"]
        lights = [SKETCH.base_from_flange("hand", s.robots["hand"]) @ mount for s in station]
        moved = np.stack([(lights[0].inverse() @ light).log() for light in lights])
        length = shifts.shift_length(SKETCH, station[0])
        np.testing.assert_allclose(moved[1:, :3], length * np.concatenate([np.eye(3), -np.eye(3)]), atol=1e-8)
        np.testing.assert_allclose(moved[:, 3:], 0, atol=1e-8)
    assert not np.array_equal(plan[0].robots["eye"].joints_rad, plan[7].robots["eye"].joints_rad)


def test_shift_length_minimises_the_error():
    """The shift length minimises the sum of noise over the length and neglected depth over its square."""
    at = Sample(0, robots=HOME)
    length = shifts.shift_length(SKETCH, at)
    depth = np.linalg.norm(SKETCH.camera_from_target(at).translation)

    def error(shift):
        return 0.1 * depth / (np.sqrt(2) * SKETCH.lens.focal.mean() * shift) + (shift / depth) ** 2

    assert error(length) < min(error(0.97 * length), error(1.03 * length))


def test_led_on_world_cannot_be_shifted():
    """An LED on the world is refused, because no robot can shift it."""
    light = replace(WORLD.cell.targets["light"], on="world")
    truth = {**SKETCH.transforms, "eye_base_from_light": SKETCH.transforms["hand_flange_from_light"]}
    still = replace(SKETCH, cell=replace(WORLD.cell, targets={"light": light}), transforms=truth)
    with pytest.raises(InputError, match="'light' is on the world"):
        shifts.plan(still, HOME, 7)


def make_sketch(layout="dual"):
    """Sketch of a cell at its truth, and the robot states of its recording."""
    made = simulate(Scenario(samples=5, layout=layout), 3)
    known = Calibration("doubtful", {name: PoseEstimate(mean, np.eye(6)) for name, mean in made.truth.items()})
    return sketches(made.cell, known)[0], [dict(sample.robots) for sample in made.recording.samples]


@pytest.mark.journey
def test_stations_are_complete_and_feasible():
    """Stations have seven feasible samples each, with several shift lengths among them."""
    sketch, taught = make_sketch()
    found = stations(sketch, taught)
    assert len(found) % STATION_SAMPLES == 0
    assert all(is_feasible(sketch, sample) for sample in found)
    first = [sketch.camera_from_target(sample).translation for sample in found]
    lengths = [np.linalg.norm(first[k + 1] - first[k]) for k in range(0, len(first), STATION_SAMPLES)]
    assert max(lengths) > 1.9 * min(lengths)


def test_board_on_world_has_no_stations():
    """A board on the world has no stations."""
    with pytest.raises(InputError, match="on the world"):
        stations(*make_sketch("eye_in_hand"))


def test_unstated_led_noise_is_0_1_px():
    """The shift length for unstated noise is that for 0.1 px. It grows with the cube root of the noise."""
    at, cells = Sample(0, robots=HOME), [replace(WORLD.cell, pixel_px=noise) for noise in (None, 0.1, 0.8)]
    unstated, tenth, more = (shifts.shift_length(replace(SKETCH, cell=cell), at) for cell in cells)
    assert unstated == tenth
    assert more == pytest.approx(2 * tenth)


@pytest.mark.parametrize(("samples", "count"), [(0, 1), (1, 1), (7, 1), (8, 2), (14, 2)])
def test_number_of_stations_is_rounded_up(monkeypatch, samples, count):
    """The plan has as many stations as hold the samples, at least one.

    Unreachable or blocked stations are drawn anew.
    """
    tried = []

    def draw(sketch, home, wanted, seed):
        tried.append((wanted, seed))
        return [Sample(k, robots=HOME) for k in range(wanted)]

    stations_made = iter([None, "blocked", *([[Sample(0, robots=HOME)] * 7] * 9)])
    monkeypatch.setattr(shifts.poses, "plan", draw)
    monkeypatch.setattr(shifts, "aim_camera", lambda sketch, sample: sample)
    monkeypatch.setattr(shifts, "make_station", lambda sketch, origin, length_m: next(stations_made))
    monkeypatch.setattr(shifts, "blocked_samples", lambda sketch, before, station: station == "blocked")
    found = shifts.plan(SKETCH, HOME, samples, seed=3)
    assert [each.sample for each in found] == list(range(7 * count))
    assert tried == [(count, 3 + k) for k in range(len(tried))]


def test_too_few_stations_are_an_error(monkeypatch):
    """The error states how many of the requested stations are feasible."""
    monkeypatch.setattr(shifts.poses, "plan", lambda *given: [Sample(0, robots=HOME)])
    monkeypatch.setattr(shifts, "aim_camera", lambda sketch, sample: None)
    with pytest.raises(InputError, match="only 0 of 2 stations are feasible"):
        shifts.plan(SKETCH, HOME, 8)
    monkeypatch.setattr(shifts, "candidates", lambda *given: [Sample(0, robots=HOME)])
    with pytest.raises(InputError, match="no station is feasible"):
        stations(SKETCH, [HOME])


@pytest.mark.parametrize(("reach", "tried", "count"), [(9.0, [1.0, 2.0, 4.0], 3), (1.5, [1.0, 2.0], 1)])
def test_stations_have_three_shift_lengths(monkeypatch, reach, tried, count):
    """Stations of an origin have one, two and four times the best length.

    A station out of reach ends those of its origin.
    """
    best, lengths = shifts.shift_length(SKETCH, Sample(0, robots=HOME)), []

    def make(sketch, origin, length_m):
        lengths.append(length_m)
        return [origin] * STATION_SAMPLES if length_m < reach * best else None

    monkeypatch.setattr(shifts, "candidates", lambda *given: [Sample(k, robots=HOME) for k in range(2)])
    monkeypatch.setattr(shifts, "aim_camera", lambda sketch, sample: sample)
    monkeypatch.setattr(shifts, "make_station", make)
    monkeypatch.setattr(shifts, "blocked_samples", lambda *given: [])
    assert len(stations(SKETCH, [HOME])) == 2 * count * STATION_SAMPLES
    np.testing.assert_allclose(lengths, best * np.array(2 * tried))
