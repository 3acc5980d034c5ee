"""Plans of touches."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest
from tests.touch_cells import BASE, MARKS, TRUTH, recorded, touch_cell, touch_lines, write_folder

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Recording
from basecal.cell.files import cell_to_dict
from basecal.cell.format.yaml_text import yaml_text
from basecal.cli import main
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.planning import touches
from basecal.planning.touches import NEXT_MARK, plan_touches

TASK = np.array([[0.6, 0.1, 0.3]])
TWO = {name: MARKS[name] for name in ("mark_a", "mark_b")}


def guessed_cell(names):
    """The cell of these marks, whose base is known to some centimetres and degrees."""
    guess = TRUTH @ SE3.exp(np.array([0.03, -0.02, 0.02, 0.05, 0.03, -0.06]))
    pose = {"t_m": guess.translation.tolist(), "q_xyzw": guess.quaternion.tolist()}
    return touch_cell(names, bases={"hand": {"status": "prior", **pose, "sigma_t_m": 0.05, "sigma_r_rad": 0.1}})


def test_the_next_mark_is_off_the_line_and_touched_by_both():
    """Of two marks that leave a rotation open: a third far off their line, and an error a tenth of that without it."""
    cell = guessed_cell(list(TWO))
    recording = recorded(cell, touch_lines(np.random.default_rng(0), 12, 2e-4, TWO))
    calibration = calibrate(cell, recording)
    plan = plan_touches(cell, recording, calibration, TASK, count=8, places=2, rotations=40)
    along = (TWO["mark_b"] - TWO["mark_a"]) / np.linalg.norm(TWO["mark_b"] - TWO["mark_a"])
    assert np.linalg.norm(np.cross(plan.marks[NEXT_MARK] - TWO["mark_a"], along)) > 0.25
    tips = {sample.observations[0].tip for sample in plan.samples if sample.observations[0].mark == NEXT_MARK}
    assert len(plan.samples) == 8
    assert tips == {"eye_tip", "hand_tip"}
    sigma = np.sqrt(np.diag(calibration[BASE].covariance))
    assert plan.expected_m < 0.1 * sigma[3:].max() * 0.5


def test_marks_of_a_plate_are_touched_again():
    """A plate that was calibrated from nothing has a place: its marks are offered as others are."""
    cell = touch_cell((), marks={"plate": {"points_m": {name: place.tolist() for name, place in MARKS.items()}}})
    recording = recorded(cell, touch_lines(np.random.default_rng(0), 18, 2e-4))
    calibration = calibrate(cell, recording)
    plan = plan_touches(cell, recording, calibration, TASK, count=4, places=0, rotations=20)
    assert {sample.observations[0].mark for sample in plan.samples} <= MARKS.keys()
    assert plan.expected_m < 3e-3


def test_a_plan_begins_at_touches():
    """Nothing touched yet: where arms reach is not known."""
    tips = {f"{name}_tip": {"on": name, "offset": {"guess": {"t_m": [0, 0, 0.1]}}} for name in ("eye", "hand")}
    base = {"hand": {"status": "free", "guess": {"t_m": [1, 0, 0], "q_xyzw": [0, 0, 0, 1]}}}
    cell = touch_cell((), tips=tips, marks={"a": {"points_m": [[0.4, 0, 0]]}}, bases=base)
    with pytest.raises(InputError, match="needs recorded touches"):
        plan_touches(cell, Recording(), None, TASK, count=4)


def test_the_verb_says_where_to_make_the_mark(tmp_path, monkeypatch, capsys):
    """A line for the mark, one for each touch; the file holds what is to be touched."""
    monkeypatch.setattr(touches, "plan_touches", partial(plan_touches, places=1, rotations=20))
    cell = guessed_cell(list(TWO))
    folder = write_folder(
        tmp_path / "mycell", yaml_text(cell_to_dict(cell)), touch_lines(np.random.default_rng(0), 12, 2e-4, TWO)
    )
    file = tmp_path / "plan.json"
    words = ["plan", str(folder), "--touches", "--samples", "12", "--task-point", "0.6", "0.1", "0.3"]
    assert main([*words, "-o", str(file)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.startswith("Make a mark near (") for line in lines) == 1
    assert sum(line.startswith("  touch ") for line in lines) == 12
    assert not any(line.startswith("next") for line in lines)  # no command sends arms to touch
    data = json.loads(file.read_text())
    assert set(data["marks"]) == {NEXT_MARK}
    assert {"touch", "tip"} <= data["samples"][0]["observations"][0].keys()
