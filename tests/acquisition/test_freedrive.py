"""Arms that a person leads."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.acquisition.capture import capture_by_hand
from basecal.acquisition.driver import Reading
from basecal.acquisition.freedrive import END_KEY, TAKE_KEY, HandGuiding, wait_for_hand_guided_arms
from basecal.acquisition.rig import Rig, open_rig
from basecal.acquisition.taking import CaptureSettings, Taker
from basecal.cell import RobotState
from basecal.cell.files import read_recording
from basecal.planning import poses
from basecal.planning.sketch import sketch_cell
from shared.running_cell import home, running

STEP_S = 0.1


class Arm:
    """An arm that is led along a way: one joint, a place for each state."""

    is_live = True

    def __init__(self, way):
        self.way, self.asked, self.freedrives = list(way), 0, []

    def state(self):
        place = self.way[min(self.asked, len(self.way) - 1)]
        self.asked += 1
        return Reading(STEP_S * self.asked, RobotState(joints_rad=np.array([place])))

    def freedrive(self, on):
        self.freedrives.append(on)

    def close(self):
        pass


def led(arm, key=lambda: ""):
    return HandGuiding(Rig({"eye": arm}, {}), key, lambda words: None)


def test_held_still_at_a_new_place_a_sample_is_due():
    """After most of a second of rest, once a place; not on the way, and not again until it was led away."""
    arm = Arm([0.0] * 12 + list(np.linspace(0.0, 0.5, 20)) + [0.5] * 30)
    person = led(arm)
    assert person.wait()
    first = arm.asked
    assert person.wait()
    assert 8 <= first <= 12
    assert 12 + 20 + 8 <= arm.asked <= 12 + 20 + 12


def test_a_small_step_is_no_new_place():
    """An arm that is led away by a degree and held is waited for until it was led farther."""
    arm = Arm([0.0] * 12 + [0.02] * 30 + [0.2] * 30)
    person = led(arm)
    assert person.wait()
    assert person.wait()
    assert arm.asked > 12 + 30


def test_keys_take_and_end():
    """The space bar takes at once, wherever the arm is; q ends."""
    keys = iter([TAKE_KEY, TAKE_KEY, "x", END_KEY])
    arm = Arm(np.linspace(0, 1, 50))
    person = led(arm, lambda: next(keys))
    assert [person.wait() for _ in range(3)] == [True, True, False]
    assert arm.asked == 4


def test_arms_are_free_until_a_sample_is_due():
    """And held then, even after an error."""
    arm = Arm([0.0] * 30)
    assert led(arm).wait()
    assert arm.freedrives == [True, False]
    arm.way, arm.freedrives = [None], []
    with pytest.raises(TypeError):
        led(arm).wait()
    assert arm.freedrives == [True, False]


def test_whoever_types_poses_is_not_waited_for():
    """Of robots that ask, the next sample is due at once."""
    arm = Arm([0.0])
    arm.is_live = False
    assert led(arm).wait()
    assert arm.asked == 0


class Person:
    """A robot of a running cell that somebody leads to one place after another, and holds there."""

    is_live = True

    def __init__(self, robot, places):
        self.robot, self.places, self.held = robot, list(places), 0

    def state(self):
        self.held += 1
        if self.held > 250 and self.places:
            self.robot.move(self.places.pop(0), 2.0)
            self.held = 0
        return self.robot.state()


def test_a_cell_is_captured_by_hand(tmp_path):
    """Each place at which the arms are held becomes a sample with its image; nothing moves them but the person."""
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        sketch = sketch_cell(world.cell)
        plan = poses.plan(sketch, home(world), 1, 0)
        robots = {name: Person(robot, [sample.robots[name] for sample in plan]) for name, robot in rig.robots.items()}
        by = Taker(Rig(robots, rig.cameras), sketch, tmp_path, CaptureSettings(2.0, 10.0))
        steps = list(capture_by_hand(by, 2, lambda: ""))
        assert [(step.sample, step.why_not) for step in steps] == [(0, ""), (1, "")]
    taken = read_recording(tmp_path).samples
    for sample, wanted in zip(taken[1:], plan, strict=True):
        for name, state in sample.robots.items():
            np.testing.assert_allclose(state.joints_rad, wanted.robots[name].joints_rad, atol=1e-6)
        assert (tmp_path / sample.images["wrist"]).exists()


@pytest.mark.journey
def test_a_place_where_nothing_is_seen_is_told_and_waited_for_anew(tmp_path):
    """The number stays free for the next place."""
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        sketch = sketch_cell(world.cell)
        away = RobotState(joints_rad=world.home["hand"] + [0, 0, 0, 0, 1.2, 0])
        back = RobotState(joints_rad=world.home["hand"])
        rig.robots["hand"].move(away, 3.0)
        robots = {**rig.robots, "hand": Person(rig.robots["hand"], [back])}
        robots["hand"].held = -600
        by = Taker(Rig(robots, rig.cameras), sketch, tmp_path, CaptureSettings(2.0, 10.0))
        steps = list(capture_by_hand(by, 1, lambda: ""))
    assert [step.sample for step in steps] == [0, 0]
    assert "not seen" in steps[0].why_not
    assert steps[1].why_not == ""


@pytest.mark.parametrize(("step", "is_new"), [(0.029, False), (0.031, True), (-0.031, True)])
def test_a_new_place_is_three_hundredths_away(step, is_new):
    """From where the last sample was taken, whichever way."""
    arm = Arm([0.0] * 12 + [step] * 40)
    keys = iter([""] * 45 + [END_KEY] * 9)
    person = led(arm, lambda: next(keys))
    assert person.wait()
    assert person.wait() == is_new


@pytest.mark.parametrize(("drift", "is_rest"), [(0.9e-4, True), (1.2e-4, False)])
def test_arms_that_drift_are_not_held(drift, is_rest):
    """By a milliradian within nine states, 0.8 s and one more."""
    keys = iter([""] * 60 + [END_KEY])
    assert led(Arm(drift * np.arange(80)), lambda: next(keys)).wait() == is_rest


def test_all_arms_are_held():
    """One of two that moves on is waited for; both are free meanwhile, and those that cannot be are left alone."""
    still, late = Arm([0.0] * 60), Arm([*np.linspace(0, 0.5, 20), *[0.5] * 40])
    bound = Arm([0.0] * 60)
    bound.freedrive = None
    person = HandGuiding(Rig({"eye": still, "hand": late}, {}), lambda: "", lambda words: None)
    assert person.wait()
    assert 28 <= late.asked == still.asked <= 32
    assert still.freedrives == late.freedrives == [True, False]


def test_whoever_types_poses_ends_with_a_key():
    """Any other key goes on."""
    arm = Arm([0.0])
    arm.is_live = False
    keys = iter(["", " ", END_KEY])
    person = led(arm, lambda: next(keys))
    assert [person.wait() for _ in range(3)] == [True, True, False]


def test_arms_that_a_program_moves_are_not_led():
    """Nor are those that are not live; the others are told by their new states."""
    moved, typed = Arm([0.0]), Arm([0.0])
    moved.move = moved.stop = moved.goal_refusal = lambda *_: ""
    typed.is_live = False
    free = Arm([0.0] * 3 + [0.4] * 40)
    rig = Rig({"free": free, "typed": typed, "moved": moved}, {})
    before = {"free": RobotState(joints_rad=np.array([0.0]))}
    found = wait_for_hand_guided_arms(rig, before, 9.0)
    assert {name: state.joints_rad.tolist() for name, state in found.items()} == {"free": [0.4]}
    assert free.freedrives == [True, False]
    assert wait_for_hand_guided_arms(Rig({"typed": typed}, {}), {}, 9.0) == {}
    assert (typed.asked, moved.asked, moved.freedrives) == (0, 0, [])
