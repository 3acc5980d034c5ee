"""What a task adds to a calibration."""

from __future__ import annotations

import pytest

from basecal.accuracy.verdict import calibrate
from basecal.errors import InputError
from basecal.estimation.settings import Settings
from basecal.simulation import Scenario, simulate


def test_a_task_changes_nothing_but_what_is_told_of_it():
    """The same transforms and verdict; a budget, a map and parts beside them."""
    made = simulate(Scenario(samples=10, target="pose"), 2)
    plain = calibrate(made.cell, made.recording)
    told = calibrate(made.cell, made.recording, Settings(task_point=(0.4, 0.0, 0.3)))
    assert (plain.budget, plain.error_map, plain.local) == (None, None, None)
    assert told.verdict == plain.verdict
    assert told.budget
    assert len(told.error_map.points_m)
    assert told.local == ()  # ten samples have no parts
    for name, estimate in plain.transforms.items():
        assert (told[name].covariance == estimate.covariance).all()


def test_a_task_needs_something_placed():
    """A lone mount has no error at a point of the base: it is said before anything is computed."""
    lone = simulate(Scenario(samples=2, layout="eye_in_hand", target_mount="fixed"), 0)
    with pytest.raises(InputError, match="leave the task point out"):
        calibrate(lone.cell, lone.recording, Settings(task_point=(0.0, 0.0, 0.0)))
