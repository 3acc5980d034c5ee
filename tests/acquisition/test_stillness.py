"""Waiting until arms and image are still."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from basecal.acquisition.driver import CameraImage, Reading
from basecal.acquisition.rig import open_rig
from basecal.acquisition.stillness import (
    Moving,
    Unfit,
    _is_still,
    wait_for_arms,
    wait_for_image,
    wait_for_image_after,
    wait_until_hand_guided,
)
from basecal.cell import RobotState
from basecal.cell.targets.registry import TARGETS
from basecal.geometry import SE3
from shared.running_cell import running

STATE_S, RING_S = 1 / 125, 0.5


class Arm:
    """An arm that glides to rest: joint 0 is `goal - exp(-t)` with noise, 100 states a second."""

    is_live = True

    def __init__(self, noise=0.0, speed=10.0):
        self.t, self.noise, self.speed, self.rng = 0.0, noise, speed, np.random.default_rng(0)

    def state(self):
        self.t += 0.01
        at = 1.0 - np.exp(-self.speed * self.t) + self.noise * self.rng.standard_normal()
        return Reading(self.t, RobotState(joints_rad=np.array([at, 0.0])))


GOAL = {"arm": RobotState(joints_rad=np.array([1.0, 0.0]))}


def test_an_arm_that_glides_is_waited_for():
    """It counts as still when a tenth of a second moves it by less than 0.1 mrad, near where it was sent."""
    found = wait_for_arms({"arm": Arm()}, GOAL, 5.0)["arm"]
    assert 0.7 < found.stamp_s < 1.2
    assert found.state.joints_rad[0] == pytest.approx(1.0, abs=1e-3)


def test_noise_is_no_motion_and_is_averaged():
    """States that scatter by ten times that are still, and their mean of twelve is what is taken."""
    found = wait_for_arms({"arm": Arm(noise=1e-3, speed=1000.0)}, GOAL, 5.0)["arm"]
    assert abs(found.state.joints_rad[0] - 1) < 1e-3  # sigma is 1e-3 / sqrt(12)


def test_an_arm_that_is_led_comes_to_another_place():
    """It counts once it stands away from where it was; one that nobody leads is told after the patience."""
    wait_until_hand_guided({"arm": Arm()}, {"arm": RobotState(joints_rad=np.array([0.9, 0.0]))}, 5.0)
    arm = Arm()
    wait_until_hand_guided({"arm": arm}, {}, 5.0)
    assert arm.t < 1.5
    with pytest.raises(Unfit, match="arm not led to another place: arm"):
        wait_until_hand_guided({"arm": arm}, GOAL, 2.0)
    assert arm.t > 2.0


def test_arms_that_never_rest_or_stop_short():
    """One that is still moving after the patience, and one that rests elsewhere than it was sent, are told."""
    with pytest.raises(Unfit, match="arm still moving: arm"):
        wait_for_arms({"arm": Arm(speed=0.1)}, GOAL, 2.0)
    with pytest.raises(Unfit, match="arm not at its goal: arm"):
        wait_for_arms({"arm": Arm()}, {"arm": RobotState(joints_rad=np.array([2.0, 0.0]))}, 2.0)


def test_a_typed_pose_is_taken_as_it_is():
    """A robot whose states do not come by themselves is asked once."""
    arm = Arm()
    arm.is_live = False
    arm.state = lambda: Reading(3.0, RobotState(SE3.identity()))
    assert wait_for_arms({"arm": arm}, {}, 1.0)["arm"].stamp_s == 3.0


class Film:
    """A camera whose images show a bright square that swings to rest within a second, 30 images a second."""

    is_live = True

    def __init__(self, swing_px):
        self.t, self.swing_px, self.rng = 0.0, swing_px, np.random.default_rng(1)

    def image(self):
        self.t += 1 / 30
        at = 200 + self.swing_px * max(0.0, 1 - self.t) * np.cos(60 * self.t)
        u, v = np.meshgrid(np.arange(400.0), np.arange(300.0))
        inside = 1 / (1 + np.exp(-(40 - np.maximum(np.abs(u - at), np.abs(v - 150))) / 0.7))
        return CameraImage(self.t, np.clip(60 + 120 * inside + self.rng.normal(0, 2, u.shape), 0, 255).astype(np.uint8))


def test_a_image_that_swings_is_waited_for():
    """None is taken before the swing is below a tenth of a pixel, and none long after."""
    assert 0.9 < wait_for_image(Film(5.0), [], 5.0).stamp_s < 1.3
    assert wait_for_image(Film(0.0), [], 5.0).stamp_s == pytest.approx(3 / 30)
    with pytest.raises(Unfit, match="image still moving"):
        wait_for_image(Film(50.0), [], 0.4)


def test_an_image_that_moves_is_given_up_after_the_patience():
    """With the first that comes later."""
    film = Film(50.0)
    with pytest.raises(Unfit, match="image still moving"):
        wait_for_image(film, [], 0.4)
    assert film.t == pytest.approx(1 / 30 + 13 / 30)


def test_an_image_that_moves_is_given_up_by_a_camera_without_a_clock():
    """By the time of this machine, if all its stamps are equal."""
    film = Film(50.0)

    class Timeless:
        is_live = True

        def image(self):
            return replace(film.image(), stamp_s=0.0)

    with pytest.raises(Unfit, match="image still moving"):
        wait_for_image(Timeless(), [], 0.1)


class Delayed:
    """A camera whose images were exposed a while ago, so many of them before an instant."""

    is_live = True

    def __init__(self, late, after_s):
        self.exposed_s = [after_s - 1.0] * late + [after_s + 0.01] * 3

    def image(self):
        return CameraImage(0.0, np.zeros((8, 8), dtype=np.uint8), exposed_s=self.exposed_s.pop(0))


def test_images_from_before_an_instant_are_passed_over():
    """As long as patience lasts; then it is said what to check."""
    assert wait_for_image_after(Delayed(2, 5.0), 5.0, 5.0).exposed_s == 5.01
    with pytest.raises(Unfit, match="check the camera's clock"):
        wait_for_image_after(Delayed(2, 5.0), 5.0, -1.0)


def test_a_camera_that_gives_one_image():
    """Of a folder the next image is taken as it is: a person vouches that all was still."""
    film = Film(5.0)
    film.is_live = False
    assert wait_for_image(film, [], 5.0).stamp_s == pytest.approx(1 / 30)


@pytest.mark.parametrize(("target", "places"), [pytest.param("charuco", 10, marks=pytest.mark.slow), ("led", 1)])
def test_ringing_arms_are_outwaited(tmp_path, target, places):
    """After arrival at a place, each image was taken when the ringing was over, and at most 0.3 s later."""
    with running(tmp_path, "ringing=4", target=target) as world, open_rig(world.cell, tmp_path) as rig:
        shape = next(iter(world.cell.targets.values())).target
        rng = np.random.default_rng(0)
        for _ in range(places):
            goals = {name: RobotState(joints_rad=q + rng.uniform(-0.05, 0.05, 6)) for name, q in world.home.items()}
            for name, goal in goals.items():
                rig.robots[name].move(goal, 1.0)
            while not all(
                np.array_equal(rig.robots[n].state().state.joints_rad, g.joints_rad) for n, g in goals.items()
            ):
                pass
            arrived = rig.robots["eye"].state().stamp_s
            wait_for_arms(rig.robots, goals, 5.0)
            image = wait_for_image(rig.cameras["wrist"], [shape], 5.0)
            assert RING_S - 4 * STATE_S < image.stamp_s - arrived < RING_S + 0.3


@pytest.mark.parametrize(("sigmas", "still"), [(3.0, True), (3.9, True), (4.1, False)])
def test_states_that_differ_by_noise_are_still(sigmas, still):
    """The two halves of twelve states may differ by four sigmas of the difference of their means."""
    noise = 1e-2 * np.resize([1.0, 1.0, -1.0, -1.0], 12)
    sigma = np.diff(noise).std() / np.sqrt(2)  # a shift between the halves adds to one difference of eleven
    step = sigmas * sigma * np.sqrt(2 / 6)
    for _ in range(20):  # until sigma counts the step, too
        values = noise + step * np.repeat([-0.5, 0.5], 6)
        shown = abs(values[6:].mean() - values[:6].mean()) / (np.diff(values).std() / np.sqrt(2) * np.sqrt(2 / 6))
        step *= sigmas / shown
    readings = [Reading(0.01 * k, RobotState(joints_rad=np.array([v]))) for k, v in enumerate(values)]
    assert _is_still(readings, None) == still


class Paced:
    """An arm whose first joint moves by `step` from one state to the next, until a number of states."""

    is_live = True

    def __init__(self, step, until=10**9):
        self.count, self.step, self.until = 0, step, until

    def state(self):
        self.count += 1
        return Reading(0.1 * self.count, RobotState(joints_rad=np.array([self.step * min(self.count, self.until)])))


@pytest.mark.parametrize(("step", "still"), [(1.6e-5, True), (1.7e-5, False), (-1.7e-5, False)])
def test_halves_of_twelve_states_differ_by_a_tenth_of_a_millirad(step, still):
    """A steady motion moves them apart by six steps."""
    arm = Paced(step)
    readings = [arm.state() for _ in range(12)]
    assert _is_still(readings, None) == still
    assert not _is_still(readings[1:], None)


def test_the_mean_is_of_twelve_states():
    """With the time of the last; every state is shown."""
    shown = []
    found = wait_for_arms({"arm": Paced(1e-5)}, {}, 50.0, lambda *seen: shown.append(seen))
    assert found["arm"].stamp_s == pytest.approx(1.2)
    assert found["arm"].state.joints_rad[0] == pytest.approx(6.5e-5)
    assert [name for name, _ in shown] == ["arm"] * 12


def test_one_arm_that_moves_is_waited_for_by_all():
    """The others go on giving states; a robot that is not live is asked once, and the moving one is named."""
    still, typed = Paced(0.0), Paced(0.0)
    typed.is_live = False
    arms = {"still": still, "typed": typed, "late": Paced(1e-2, until=30)}
    assert set(wait_for_arms(arms, {}, 50.0)) == set(arms)
    assert (still.count, typed.count) == (arms["late"].count, 1)
    assert still.count >= 30
    with pytest.raises(Moving, match=r"^arm still moving: late$"):
        wait_for_arms({"still": Paced(0.0), "late": Paced(1e-2)}, {}, 3.0)
    goals = {name: RobotState(joints_rad=np.array([0.5])) for name in ("still", "late")}
    with pytest.raises(Moving, match=r"^arm not at its goal: still$"):
        wait_for_arms({"still": Paced(0.0), "late": Paced(1e-2)}, goals, 3.0)


@pytest.mark.parametrize(("off", "is_new"), [(1.9e-3, False), (2.1e-3, True), (-2.1e-3, True)])
def test_a_new_place_is_two_millirad_away(off, is_new):
    """Every arm that was somewhere must be elsewhere; one that was nowhere may be anywhere."""
    before = {"arm": RobotState(joints_rad=np.array([off])), "gone": RobotState(joints_rad=np.array([9.0]))}
    arms = {"arm": Paced(0.0), "first": Paced(0.0)}
    if is_new:
        wait_until_hand_guided(arms, before, 5.0)
        with pytest.raises(Moving, match=r"^arm not led to another place: arm, first$"):
            wait_until_hand_guided(arms, {**before, "first": RobotState(joints_rad=np.array([1e-3]))}, 5.0)
    else:
        with pytest.raises(Moving):
            wait_until_hand_guided(arms, before, 5.0)


class Slides:
    """A camera whose images show one picture each, at given instants by its own stamps and by this machine's clock."""

    is_live = True

    def __init__(self, greys, step_s=1.0, exposed_s=None):
        self.greys, self.step_s, self.exposed_s, self.count = greys, step_s, exposed_s, 0

    def image(self):
        self.count += 1
        grey = self.greys[min(self.count, len(self.greys)) - 1]
        return CameraImage(self.step_s * self.count, grey, exposed_s=self.exposed_s)


def spot(u, v=50.0):
    """A spot of light in a dark image, whose middle is anywhere."""
    x, y = np.meshgrid(np.arange(100.0), np.arange(100.0))
    return np.round(20 + 200 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 2.0**2))).astype(np.uint8)


LED = TARGETS["led"].usual(np.random.default_rng(0))


@pytest.mark.parametrize(("off", "taken"), [(0.08, 3), (0.14, 6)])
def test_a_light_is_tracked_to_a_tenth_of_a_pixel(off, taken):
    """Three images in a row show it at one place; each is shown, and the last is taken."""
    shown = []
    slides = Slides([spot(50.0), spot(50.0), spot(50.0 + off), spot(50.0 + off)])
    found = wait_for_image(slides, [LED], 50.0, show=shown.append)
    assert (found.stamp_s, slides.count, len(shown)) == (taken, taken, taken)


def test_images_without_the_light_are_compared_as_a_whole():
    """A light that is not found in one of them is no motion."""
    dark = np.full((100, 100), 20, dtype=np.uint8)
    assert wait_for_image(Slides([dark]), [LED], 5.0).stamp_s == 3.0


def test_an_image_exposed_at_an_instant_is_not_after_it():
    """A later one is, and so is one whose exposure is unknown; each is shown."""
    shown = []
    late = Delayed(2, 5.0)
    assert wait_for_image_after(late, 4.0, 5.0, shown.append).exposed_s == 5.01
    assert len(shown) == 3
    unknown = Slides([spot(50.0)])
    assert wait_for_image_after(unknown, 1e9, 5.0).stamp_s == 1.0
    for exposed_s, is_after in ((4.0, False), (4.5, True)):
        slides = Slides([spot(50.0)], exposed_s=exposed_s)
        with nullcontext() if is_after else pytest.raises(Moving, match="image too old"):
            assert wait_for_image(slides, [], 0.0, after_s=4.0).stamp_s == 3.0
