"""Stages before anything is solved."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from basecal.accuracy.stages import reading
from basecal.accuracy.stages.case import Case
from basecal.cell import Finding, Recording
from basecal.errors import InputError
from basecal.estimation.settings import Settings
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=3), seed=0)
CASE = Case(MADE.cell, MADE.recording, Settings())
ERROR, WARNING = (Finding(s, s, (), s) for s in ("error", "warning"))


def test_a_task_needs_something_that_is_placed():
    """But for the axis-shift method, whose task is where the base is wanted."""
    world = simulate(Scenario(layout="eye_in_hand", samples=3), 0)
    for settings, wanted in (
        (Settings(), False),
        (Settings(task_point=(0, 0, 0)), True),
        (Settings(task_point=(0, 0, 0), method="axis-shift"), False),
    ):
        case = Case(world.cell, world.recording, settings)
        try:
            assert reading.check_task(case) is case
        except InputError:
            assert wanted


@pytest.mark.parametrize("clocked", [None, SimpleNamespace(add_jitter=lambda problem: f"{problem} with jitter")])
def test_samples_by_estimated_clocks_are_on_paths(monkeypatch, clocked):
    """Checks of the input know of it, and the problem has the jitter of stamps."""
    inputs = []
    monkeypatch.setattr(reading, "build_problem", lambda *given: ("problem", [WARNING]))
    monkeypatch.setattr(reading, "INPUT_CHECKS", [lambda given: inputs.append(given) or []])
    case = reading.check_input(reading.pack_problem(Case(MADE.cell, MADE.recording, Settings(), clocked=clocked)))
    assert inputs[0].on_paths == (clocked is not None)
    assert inputs[0].problem == case.problem == ("problem" if clocked is None else "problem with jitter")
    assert case.findings == inputs[0].findings == (WARNING,)


@pytest.mark.parametrize(("findings", "ended"), [([], False), ([WARNING], False), ([WARNING, ERROR], True)])
def test_an_error_of_the_input_ends_the_case(monkeypatch, findings, ended):
    """With all that was found."""
    monkeypatch.setattr(reading, "INPUT_CHECKS", [lambda given: findings])
    found = reading.check_input(reading.pack_problem(CASE))
    assert found.is_ended == ended
    assert found.findings == tuple(findings)
    if ended:
        assert (found.calibration.verdict, found.calibration.findings) == ("refused", tuple(findings))


@pytest.mark.parametrize("units", [[], [ERROR]])
def test_impossible_units_end_the_case(monkeypatch, units):
    """Before anything is packed."""
    monkeypatch.setattr(reading, "impossible_units", lambda *given: units)
    assert reading.screen_units(CASE).is_ended == bool(units)


def test_the_closed_form_ends_the_case(monkeypatch):
    """If it is asked for."""
    monkeypatch.setattr(reading, "calibrate_axis_shift", lambda *given: "calibration")
    assert reading.calibrate_by_shifts(reading.pack_problem(CASE)).calibration is None
    asked = Case(MADE.cell, MADE.recording, Settings(method="axis-shift"))
    found = reading.calibrate_by_shifts(reading.pack_problem(asked))
    assert (found.calibration, found.is_ended) == ("calibration", True)


def test_images_are_counted_for_checks_of_the_input(monkeypatch):
    """A recording whose images were not searched says how many they are."""
    inputs = []
    monkeypatch.setattr(reading, "INPUT_CHECKS", [lambda given: inputs.append(given) or []])
    samples = [replace(each, observations=(), images={"wrist": "0.png"}) for each in MADE.recording.samples]
    reading.check_input(reading.pack_problem(Case(MADE.cell, Recording(tuple(samples)), Settings())))
    assert inputs[0].images == 3
