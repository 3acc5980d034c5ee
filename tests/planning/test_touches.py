"""Tests of plans of touches."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from tests.touch_cells import BASE, MARKS, TIPS, TRUTH, recorded, touch_cell, touch_lines, write_folder

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Recording, RobotState
from basecal.cell.files import cell_to_dict
from basecal.cell.format.yaml_text import yaml_text
from basecal.cli import main
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.planning import touches
from basecal.planning.sketch import Sketch
from basecal.planning.touches import NEXT_MARK, _places, _touch_states, _touches, plan_touches, with_marks

TASK = np.array([[0.6, 0.1, 0.3]])
TWO = {name: MARKS[name] for name in ("mark_a", "mark_b")}


def guessed_cell(names):
    """Cell with these marks, whose base is known to some centimetres and degrees."""
    guess = TRUTH @ SE3.exp(np.array([0.03, -0.02, 0.02, 0.05, 0.03, -0.06]))
    pose = {"t_m": guess.translation.tolist(), "q_xyzw": guess.quaternion.tolist()}
    return touch_cell(names, bases={"hand": {"status": "prior", **pose, "sigma_t_m": 0.05, "sigma_r_rad": 0.1}})


@pytest.mark.journey
def test_next_mark_is_off_the_line():
    """Two marks leave a rotation uncertain.

    The next mark is far off their line, both arms touch it, and the error is a tenth of that without it.
    """
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


@pytest.mark.journey
def test_marks_of_calibrated_plate_are_offered():
    """A plate that was calibrated without a guess has a pose, and its marks are offered like others."""
    cell = touch_cell((), marks={"plate": {"points_m": {name: place.tolist() for name, place in MARKS.items()}}})
    recording = recorded(cell, touch_lines(np.random.default_rng(0), 18, 2e-4))
    calibration = calibrate(cell, recording)
    plan = plan_touches(cell, recording, calibration, TASK, count=4, places=0, rotations=20)
    assert {sample.observations[0].mark for sample in plan.samples} <= MARKS.keys()
    assert plan.expected_m < 3e-3


def test_touch_plan_requires_recorded_touches():
    """The reach of the arms is unknown without recorded touches."""
    tips = {f"{name}_tip": {"on": name, "offset": {"guess": {"t_m": [0, 0, 0.1]}}} for name in ("eye", "hand")}
    base = {"hand": {"status": "free", "guess": {"t_m": [1, 0, 0], "q_xyzw": [0, 0, 0, 1]}}}
    cell = touch_cell((), tips=tips, marks={"a": {"points_m": [[0.4, 0, 0]]}}, bases=base)
    with pytest.raises(InputError, match="needs recorded touches"):
        plan_touches(cell, Recording(), None, TASK, count=4)


@pytest.mark.journey
def test_plan_command_prints_mark_and_touches(tmp_path, monkeypatch, capsys):
    """The command prints a line for the mark and one for each touch. The file has the touches to take."""
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
    assert not any(line.startswith("next") for line in lines)  # no command makes arms touch
    data = json.loads(file.read_text())
    assert set(data["marks"]) == {NEXT_MARK}
    assert {"touch", "tip"} <= data["samples"][0]["observations"][0].keys()


@pytest.fixture(scope="module")
def touch_sketch():
    """Sketch at the truth of two arms that touched three marks, and their recording."""
    cell = touch_cell()
    recording = recorded(cell, touch_lines(np.random.default_rng(0), 12, 2e-4))
    means = {BASE: TRUTH, **{f"{robot}_flange_from_{robot}_tip": SE3(np.eye(3), tip) for robot, tip in TIPS.items()}}
    means |= {f"eye_base_from_{name}": SE3(np.eye(3), place) for name, place in MARKS.items()}
    return Sketch(cell, means, ("eye_tip", "mark_a")), recording


def test_touches_have_tip_and_state(touch_sketch):
    """Each touch has its tip and the state of the robot that carries it."""
    sketch, recording = touch_sketch
    found = list(_touches(sketch, recording))
    assert len(found) == 12
    for tip, state in found:
        place = sketch.body_pose(tip, {tip.removesuffix("_tip"): state}).translation
        assert min(np.linalg.norm(place - mark) for mark in MARKS.values()) < 2e-3


def test_next_mark_is_reachable_and_far_from_touches(touch_sketch):
    """New marks are within 0.6 m of the touches' centre and far from touches and each other.

    They are at most 1.05 times as far from a base as a touch.
    """
    sketch, recording = touch_sketch
    touches = list(_touches(sketch, recording))
    at = np.array([sketch.body_pose(tip, {tip.removesuffix("_tip"): state}).translation for tip, state in touches])
    places = np.array(_places(sketch, touches, 5, np.random.default_rng(0)))
    assert places.shape == (5, 3)
    assert np.linalg.norm(places - at.mean(0), axis=1).max() <= 0.6
    for robot in TIPS:
        base = sketch.world_from_base(robot).translation
        own = [tip == f"{robot}_tip" for tip, _ in touches]
        far = np.linalg.norm(places - base, axis=1).max() / np.linalg.norm(at[own] - base, axis=1).max()
        assert 0.9 < far <= 1.05
    apart = [np.linalg.norm(place - np.concatenate([at, places[:k]]), axis=1).min() for k, place in enumerate(places)]
    assert apart == sorted(apart, reverse=True)
    assert apart[0] > 0.3
    assert _places(sketch, touches, 0, np.random.default_rng(0)) == []


def test_tips_touch_mark_with_varied_rotations(touch_sketch):
    """The tip is at the mark, rotated by up to 1.6 rad from its initial rotation."""
    sketch, _ = touch_sketch
    start = RobotState(SE3.identity())
    for tip in ("eye_tip", "hand_tip"):
        view = replace(sketch, view=(tip, "mark_b"))
        found = _touch_states(view, [start] * 50, np.random.default_rng(0))
        places = [sketch.body_pose(tip, {tip.removesuffix("_tip"): state}).translation for state in found]
        np.testing.assert_allclose(places, [MARKS["mark_b"]] * 50, atol=1e-9)
        turns = [np.linalg.norm(state.base_from_flange.rotvec) for state in found]
        assert 1.4 < max(turns) <= 1.6


def test_added_marks_have_guessed_positions(touch_sketch):
    """Added marks are free points on the world, beside those of the cell."""
    cell = with_marks(touch_sketch[0].cell, {NEXT_MARK: np.array([0.1, 0.2, 0.3])})
    assert cell.targets.keys() == {*touch_sketch[0].cell.targets, NEXT_MARK}
    made = cell.targets[NEXT_MARK]
    assert (made.on, made.mount.status, made.target.kind) == ("world", "free", "mark")
    np.testing.assert_array_equal(made.mount.mean.translation, [0.1, 0.2, 0.3])
