"""Tests of the stages before the solve."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from basecal.accuracy.stages import reading
from basecal.accuracy.stages.case import Case
from basecal.cell import Finding, Recording, Sample
from basecal.estimation.settings import Settings
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=3), seed=0)
CASE = Case(MADE.cell, MADE.recording, Settings())
ERROR, WARNING = (Finding(s, s, (), s) for s in ("error", "warning"))


def test_task_needs_placed_transform(monkeypatch):
    """A task needs a placed transform, except for the axis-shift method, whose task is the place of the base."""
    asked = []
    monkeypatch.setattr(reading, "require_placed_transforms", asked.append)
    for settings, count in (
        (Settings(), 0),
        (Settings(task_point=(0, 0, 0), method="axis-shift"), 0),
        (Settings(task_point=(0, 0, 0)), 1),
    ):
        case = Case(MADE.cell, MADE.recording, settings)
        assert reading.check_task(case) is case
        assert asked == [MADE.cell] * count


@pytest.mark.parametrize("clocked", [None, SimpleNamespace(add_jitter=lambda problem: f"{problem} with jitter")])
def test_samples_with_estimated_clocks_are_on_paths(monkeypatch, clocked):
    """With estimated clocks the input checks know that samples are on paths, and the problem has the stamp jitter."""
    inputs = []
    monkeypatch.setattr(reading, "build_problem", lambda *given: ("problem", [WARNING]))
    monkeypatch.setattr(reading, "INPUT_CHECKS", [lambda given: inputs.append(given) or []])
    case = reading.check_input(reading.pack_problem(Case(MADE.cell, MADE.recording, Settings(), clocked=clocked)))
    assert inputs[0].on_paths == (clocked is not None)
    assert inputs[0].problem == case.problem == ("problem" if clocked is None else "problem with jitter")
    assert case.findings == inputs[0].findings == (WARNING,)


@pytest.mark.parametrize(("findings", "ended"), [([], False), ([WARNING], False), ([WARNING, ERROR], True)])
def test_input_error_ends_case(monkeypatch, findings, ended):
    """An error of the input ends the case with all findings."""
    monkeypatch.setattr(reading, "INPUT_CHECKS", [lambda given: findings])
    found = reading.check_input(reading.pack_problem(CASE))
    assert found.is_ended == ended
    assert found.findings == tuple(findings)
    if ended:
        assert (found.calibration.verdict, found.calibration.findings) == ("refused", tuple(findings))


@pytest.mark.parametrize("units", [[], [ERROR]])
def test_impossible_units_end_case(monkeypatch, units):
    """Impossible units end the case before the problem is packed."""
    monkeypatch.setattr(reading, "impossible_units", lambda *given: units)
    assert reading.screen_units(CASE).is_ended == bool(units)


def test_requested_closed_form_ends_case(monkeypatch):
    """The closed form ends the case if it is requested."""
    monkeypatch.setattr(reading, "calibrate_axis_shift", lambda *given: "calibration")
    assert reading.calibrate_by_shifts(reading.pack_problem(CASE)).calibration is None
    asked = Case(MADE.cell, MADE.recording, Settings(method="axis-shift"))
    found = reading.calibrate_by_shifts(reading.pack_problem(asked))
    assert (found.calibration, found.is_ended) == ("calibration", True)


def test_images_are_counted_for_input_checks(monkeypatch):
    """The number of unsearched images is passed to the input checks."""
    inputs = []
    monkeypatch.setattr(reading, "INPUT_CHECKS", [lambda given: inputs.append(given) or []])
    samples = [replace(each, observations=(), images={"wrist": "0.png"}) for each in MADE.recording.samples]
    reading.check_input(reading.pack_problem(Case(MADE.cell, Recording(tuple(samples)), Settings())))
    assert inputs[0].image_count == 3


@pytest.mark.parametrize(
    ("method", "sees_scene", "tracks", "observations", "is_scene"),
    [
        ("auto", False, (), ("view",), False),
        ("auto", False, (), (), False),
        ("auto", False, ("track",), (), True),
        ("auto", False, ("track",), ("view",), False),
        ("auto", True, (), ("view",), True),
        ("scene", False, (), ("view",), True),
    ],
)
def test_scene_is_used_if_alone_or_requested(monkeypatch, method, sees_scene, tracks, observations, is_scene):
    """A scene is calibrated if there are no target views or it is requested; that ends the case."""
    monkeypatch.setattr("basecal.accuracy.scene.calibrate_scene.calibrate_scene", lambda *given: given)
    samples = (Sample(0, tracks=tracks), Sample(1, observations=observations))
    cell, settings = SimpleNamespace(sees_scene=sees_scene), SimpleNamespace(method=method)
    case = Case(cell, Recording(samples), settings)
    found = reading.calibrate_from_scene(case)
    assert found.is_ended == is_scene
    if is_scene:
        assert found.calibration == (cell, case.recording, settings)
    else:
        assert found is case


def test_unit_lengths_are_converted(monkeypatch):
    """Poses of another unit are converted.

    A failed estimate ends the case with all findings; without such poses the case is unchanged.
    """
    recording = Recording(findings=(WARNING,))
    case = Case(MADE.cell, recording, Settings())
    monkeypatch.setattr(reading, "convert_units", lambda given, units_m: (given, units_m))
    monkeypatch.setattr(reading, "estimate_units", lambda *given: ({}, []))
    assert reading.measure_units(case) is case
    monkeypatch.setattr(reading, "estimate_units", lambda *given: ({"board": 0.04}, []))
    found = reading.measure_units(case)
    assert (found.units_m, found.recording) == ({"board": 0.04}, (recording, {"board": 0.04}))
    monkeypatch.setattr(reading, "estimate_units", lambda *given: ({"board": 0.04}, [ERROR]))
    found = reading.measure_units(case)
    assert (found.is_ended, found.recording, found.findings) == (True, recording, (ERROR, WARNING))


def test_clocks_of_streams_are_estimated_first(monkeypatch):
    """The recording is that of the estimated clocks; without streams the case is unchanged."""
    monkeypatch.setattr(reading, "recording_streams", lambda *given: None)
    assert reading.estimate_clocks(CASE) is CASE
    clocked = SimpleNamespace(recording="interpolated")
    monkeypatch.setattr(reading, "recording_streams", lambda *given: "streams")
    monkeypatch.setattr(reading, "search_offsets", lambda streams, settings: clocked)
    found = reading.estimate_clocks(CASE)
    assert (found.clocked, found.recording) == (clocked, "interpolated")
