"""What a task adds to a calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.task.task_error import add_task_error
from basecal.errors import InputError
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


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
    with pytest.raises(InputError, match="Leave the task point out"):
        calibrate(lone.cell, lone.recording, Settings(task_point=(0.0, 0.0, 0.0)))


def test_what_noise_is_not_and_clocks_are_lines_of_the_budget():
    """Each by what it adds to the variance at the task; the map has both on top of the noise."""
    made = simulate(Scenario(samples=10, target="pose", robot_noise=(1e-4, 2e-4)), 2)
    calibration, fitted = calibrate(made.cell, made.recording), solve(made.cell, made.recording)
    base = fitted.problem.columns[BASE].start
    model, clocks = np.zeros_like(fitted.covariance), np.zeros_like(fitted.covariance)
    model[base, base], clocks[base + 1, base + 1] = 4e-6, 1e-6  # 2 mm along x and 1 mm along y
    modelled = replace(fitted, covariance=fitted.covariance + model)
    every = replace(modelled, covariance=modelled.covariance + clocks)
    own = calibration[BASE]
    wide = own.covariance + np.diag([4e-6, 1e-6, 0, 0, 0, 0])
    stated = replace(calibration, transforms={**calibration.transforms, BASE: replace(own, covariance=wide)})
    found = add_task_error(made.cell, stated, Settings(task_point=(0.4, 0.0, 0.3)), (fitted, modelled, every))
    told = {entry.source: entry.rms_m for entry in found.budget}
    assert told["what is systematic: robots, lens, fits that differ"] == pytest.approx(2e-3, rel=1e-3)
    assert told["offsets of clocks"] == pytest.approx(1e-3, rel=1e-3)
    plain = add_task_error(made.cell, calibration, Settings(task_point=(0.4, 0.0, 0.3)), (fitted, fitted, fitted))
    assert not {"offsets of clocks", "what is systematic: robots, lens, fits that differ"} & {
        entry.source for entry in plain.budget
    }
    assert np.all(found.error_map.length_95_m > plain.error_map.length_95_m)
    np.testing.assert_allclose(found.error_map.angle_95_rad, plain.error_map.angle_95_rad, rtol=1e-6)
