"""Tests of hand-guided arms."""

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
    """Arm that is guided along a path: one joint, one place per state."""

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


def test_sample_is_due_after_rest_at_a_new_place():
    """After nearly a second of rest one sample is due; none during motion, and no second one at the same place."""
    arm = Arm([0.0] * 12 + list(np.linspace(0.0, 0.5, 20)) + [0.5] * 30)
    person = led(arm)
    assert person.wait()
    first = arm.asked
    assert person.wait()
    assert 8 <= first <= 12
    assert 12 + 20 + 8 <= arm.asked <= 12 + 20 + 12


def test_small_step_is_no_new_place():
    """After a step of one degree, no sample is due until the arm is guided farther."""
    arm = Arm([0.0] * 12 + [0.02] * 30 + [0.2] * 30)
    person = led(arm)
    assert person.wait()
    assert person.wait()
    assert arm.asked > 12 + 30


def test_keys_take_a_sample_or_end():
    """The space bar takes a sample at any place; q ends."""
    keys = iter([TAKE_KEY, TAKE_KEY, "x", END_KEY])
    arm = Arm(np.linspace(0, 1, 50))
    person = led(arm, lambda: next(keys))
    assert [person.wait() for _ in range(3)] == [True, True, False]
    assert arm.asked == 4


def test_arms_are_free_until_a_sample_is_due():
    """Arms are held then, even after an error."""
    arm = Arm([0.0] * 30)
    assert led(arm).wait()
    assert arm.freedrives == [True, False]
    arm.way, arm.freedrives = [None], []
    with pytest.raises(TypeError):
        led(arm).wait()
    assert arm.freedrives == [True, False]


def test_typed_poses_are_due_at_once():
    """For robots that ask for typed poses, the next sample is due at once."""
    arm = Arm([0.0])
    arm.is_live = False
    assert led(arm).wait()
    assert arm.asked == 0


class Person:
    """Robot of a running cell that a person guides from place to place, and holds there."""

    is_live = True

    def __init__(self, robot, places):
        self.robot, self.places, self.held = robot, list(places), 0

    def state(self):
        self.held += 1
        if self.held > 250 and self.places:
            self.robot.move(self.places.pop(0), 2.0)
            self.held = 0
        return self.robot.state()


@pytest.mark.journey
def test_cell_is_captured_by_hand(tmp_path):
    """Each place at which the arms are held becomes a sample with its image; only the person moves them."""
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
def test_place_without_a_target_in_view_is_reported(tmp_path):
    """Its number is used for the next place."""
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
def test_new_place_is_0_03_rad_away(step, is_new):
    """The distance is from the place of the last sample, in any direction."""
    arm = Arm([0.0] * 12 + [step] * 40)
    keys = iter([""] * 45 + [END_KEY] * 9)
    person = led(arm, lambda: next(keys))
    assert person.wait()
    assert person.wait() == is_new


@pytest.mark.parametrize(("drift", "is_rest"), [(0.9e-4, True), (1.2e-4, False)])
def test_drifting_arms_are_not_at_rest(drift, is_rest):
    """The limit is a milliradian within nine states, 0.8 s and one more."""
    keys = iter([""] * 60 + [END_KEY])
    assert led(Arm(drift * np.arange(80)), lambda: next(keys)).wait() == is_rest


def test_all_arms_must_be_at_rest():
    """If one of two moves on, both stay free; arms without freedrive are not touched."""
    still, late = Arm([0.0] * 60), Arm([*np.linspace(0, 0.5, 20), *[0.5] * 40])
    bound = Arm([0.0] * 60)
    bound.freedrive = None
    person = HandGuiding(Rig({"eye": still, "hand": late}, {}), lambda: "", lambda words: None)
    assert person.wait()
    assert 28 <= late.asked == still.asked <= 32
    assert still.freedrives == late.freedrives == [True, False]


def test_key_ends_typed_poses():
    """Any other key continues."""
    arm = Arm([0.0])
    arm.is_live = False
    keys = iter(["", " ", END_KEY])
    person = led(arm, lambda: next(keys))
    assert [person.wait() for _ in range(3)] == [True, True, False]


def test_arms_without_freedrive_are_not_hand_guided():
    """Nor are robots that are not live; the new places of others are reported by their states."""
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
