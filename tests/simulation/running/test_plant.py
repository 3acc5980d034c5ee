"""Tests of a running cell, and of faults that act over time."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from basecal.effects.mount_play import slide
from basecal.errors import InputError
from basecal.simulation.running.faults import read_faults
from basecal.simulation.running.plant import Clock, Plant
from basecal.vision.detectors import find_target
from shared.facing_arms import facing_arms


def plant(*faults, target="led"):
    world = facing_arms(target, faults=read_faults(faults))
    return world, Plant(world, Clock(0))


def spot(cell):
    """Pixel of the detected LED."""
    world, running = cell
    return find_target(running.shot("wrist").image, world.cell.targets["light"].target).pixels[0]


def arrive(running, robot, joints):
    running.move(robot, joints, 1.0)
    while np.any(running.state(robot)[1] != joints):
        pass


def test_states_and_images_share_a_clock():
    """Stamps of states of both arms and of images increase by the duration of each request."""
    _, running = plant()
    stamps = [running.state("eye")[0], running.shot("wrist").stamp_s, running.state("hand")[0]]
    assert stamps == sorted(stamps)
    assert stamps[2] - stamps[0] == pytest.approx(1 / 30 + 1 / 125)


@pytest.mark.parametrize(("fault", "ahead_s"), [("clock-offset=0.5", 0.5), ("late-trigger=0.5", 0.0)])
def test_camera_stamps_have_clock_offset(fault, ahead_s):
    """A camera clock that is ahead has stamps ahead; a late trigger does not change the stamp."""
    _, running = plant(fault)
    _, sound = plant()
    assert running.shot("wrist").stamp_s - sound.shot("wrist").stamp_s == pytest.approx(ahead_s)


def test_late_trigger_shows_later_scene():
    """While an arm moves, the image shows the LED at its later position."""
    late, sound = plant("late-trigger=0.3"), plant()
    places = []
    for world, running in (late, sound):
        running.move("hand", world.home["hand"] + [0.05, 0, 0, 0, 0, 0], 1.0)
        places.append(spot((world, running)))
    assert np.linalg.norm(places[0] - places[1]) > 5


@pytest.mark.parametrize(
    ("targets", "message"),
    [({}, "the cell has no target, and a running cell draws no scene"), (None, "as all targets are")],
)
def test_a_camera_without_a_target_is_refused(targets, message):
    """A cell without targets cannot run. An image of a camera that faces no target is refused."""
    world = facing_arms("led")
    light = replace(world.cell.targets["light"], on=world.cell.cameras["wrist"].on)
    world = replace(world, cell=replace(world.cell, targets={"light": light} if targets is None else targets))
    with pytest.raises(InputError, match=message):
        Plant(world, Clock(0)).shot("wrist")


@pytest.mark.journey
def test_dropped_frames_delay_images():
    """The requested share of frames is lost. The other images take accordingly longer, and are unaffected."""
    _, running = plant("dropped-frames=0.5")
    stamps = [running.shot("wrist").stamp_s for _ in range(16)]
    frames = np.rint(np.diff(stamps) * 30)
    assert 1.4 < frames.mean() < 2.9  # 2 +- 0.36
    assert frames.min() == 1


@pytest.mark.journey
@pytest.mark.parametrize(("fault", "robot"), [("base-bumped=20@1", "hand"), ("board-remounted=20@1", "hand")])
def test_sudden_fault_acts_at_stated_move(fault, robot):
    """The LED is displaced at the second move of the arm, not at the first."""
    off, sound = plant(fault), plant()
    for moves in (1, 2):
        for world, running in (off, sound):
            arrive(running, robot, world.home[robot] + 0.01 * moves)
        away = float(np.linalg.norm(spot(off) - spot(sound)))
        assert (away > 3) == (moves == 2)


@pytest.mark.parametrize(("fault", "is_turn"), [("mount-bend=5", True), ("mount-play=5", False)])
def test_mounts_deflect_by_gravity(fault, is_turn):
    """The mounts of both arms deflect by the size if gravity is across the axis of the flange."""
    off, sound = plant(fault), plant()
    for name, on in (("wrist", "eye"), ("light", "hand")):
        bent, straight = (running._pose_in_world(name, on, 0.0) for _, running in (off, sound))
        flange = sound[1]._carrier(on, 0.0)
        moved = (flange.inverse() @ bent @ straight.inverse() @ flange).log()
        down = -flange.rotation[2]
        expected = np.append(np.zeros(3), np.cross([0, 0, 5e-3], down)) if is_turn else slide(5e-3, down)
        np.testing.assert_allclose(moved, expected, atol=1e-12)


@pytest.mark.journey
def test_running_cell_is_deterministic():
    """Two cells with the same requests give the same images, to the last bit. A new arrival restarts the noise."""
    images = []
    for _ in range(2):
        world, running = plant()
        arrive(running, "eye", world.home["eye"] + 0.01)
        images += [running.shot("wrist").image, running.shot("wrist").image]
        arrive(running, "eye", world.home["eye"] + 0.01)
        images.append(running.shot("wrist").image)
    assert np.array_equal(images[0], images[3])
    assert np.array_equal(images[0], images[2])
    assert not np.array_equal(images[0], images[1])


def test_tray_reflects_the_led():
    """The reflection is mirrored at a plane below the initial LED.

    There is none if the LED is below the plane, or without the fault.
    """
    world, running = plant("reflection")
    seen = running._camera_scene("wrist", 0.0)
    scene = running._carrier("eye", 0.0) @ running._mount("wrist", "eye")
    light, again = scene @ (seen.camera_from_target @ seen.shape.points), scene @ seen.reflected
    assert np.allclose((light - again)[0], [0, 0, 0.24])
    spots = find_target(running.shot("wrist").image, seen.shape).pixels
    true = world.lenses["wrist"].project(np.vstack([seen.camera_from_target @ seen.shape.points, seen.reflected]))
    assert np.allclose(spots, true, atol=0.3)
    assert len(plant()[1]._camera_scene("wrist", 0.0).reflected) == 0
    running._trays["wrist"] = running._trays["wrist"] + [0, 0, 0.5]
    assert len(running._camera_scene("wrist", 0.0).reflected) == 0


def test_unknown_names_are_refused():
    """The error for an unknown robot or camera lists the existing ones."""
    _, running = plant()
    with pytest.raises(InputError, match="no robot 'foot'; there are: eye, hand"):
        running.state("foot")
    with pytest.raises(InputError, match="no camera 'hall'; there are: wrist"):
        running.shot("hall")


def test_arrival_time_is_that_of_last_arm():
    """The last arm reaches its goal at the stated time, and not before."""
    world, running = plant()
    running.move("eye", world.home["eye"] + 0.1, 1.0)
    running.move("hand", world.home["hand"] + 0.3, 1.0)
    running.wait(running.arrived_s - 0.05)
    assert not np.array_equal(running.state("hand")[1], world.home["hand"] + 0.3)
    running.wait(0.1)
    assert np.array_equal(running.state("hand")[1], world.home["hand"] + 0.3)
    assert np.array_equal(
        running.camera_scene("wrist").camera_from_target.matrix,
        running._camera_scene("wrist", 99.0).camera_from_target.matrix,
    )


def test_clock_at_speed_zero_advances_by_waiting():
    """At speed 0 only waiting advances the time, exactly and immediately."""
    clock, began = Clock(0), time.monotonic()
    assert [clock.time_s(), clock.wait(1000.0), clock.time_s()] == [0.0, 1000.0, 1000.0]
    assert time.monotonic() - began < 10


def test_clock_speed_scales_time():
    """At speed 100 a second of waiting takes a hundredth of a second, and time advances continuously."""
    clock, began = Clock(100), time.monotonic()
    assert clock.wait(1.0) >= 1.0
    assert time.monotonic() - began < 1.0
    before = clock.time_s()
    time.sleep(0.01)
    assert clock.time_s() - before >= 1.0


def test_objects_on_world_are_never_displaced():
    """An object on an arm is displaced after more than the stated moves."""
    world, running = plant("board-remounted=5@1")
    assert not running._is_pushed("board-remounted", "world")
    pushed = []
    for _ in range(3):
        pushed.append(running._is_pushed("board-remounted", "hand"))
        running.move("hand", world.home["hand"], 1.0)
    assert pushed == [False, False, True]
    assert not running._is_pushed("board-remounted", "eye")


def test_clock_runs_in_real_time(monkeypatch):
    """The clock runs in real time from its start, unless another speed is stated."""
    now = iter((5.0, 7.5, 5.0, 7.5))
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    for clock, passed_s in ((Clock, 2.5), (partial(Clock, 4.0), 10.0)):
        assert clock().time_s() == passed_s
