"""Tests of waiting until arms and image are at rest."""

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
    """Arm that glides to rest: joint 0 is `goal - exp(-t)` with noise, 100 states a second."""

    is_live = True

    def __init__(self, noise=0.0, speed=10.0):
        self.t, self.noise, self.speed, self.rng = 0.0, noise, speed, np.random.default_rng(0)

    def state(self):
        self.t += 0.01
        at = 1.0 - np.exp(-self.speed * self.t) + self.noise * self.rng.standard_normal()
        return Reading(self.t, RobotState(joints_rad=np.array([at, 0.0])))


GOAL = {"arm": RobotState(joints_rad=np.array([1.0, 0.0]))}


def test_gliding_arm_is_waited_for():
    """It is at rest if a tenth of a second moves it by less than 0.1 mrad, near its goal."""
    found = wait_for_arms({"arm": Arm()}, GOAL, 5.0)["arm"]
    assert 0.7 < found.stamp_s < 1.2
    assert found.state.joints_rad[0] == pytest.approx(1.0, abs=1e-3)


def test_noise_is_averaged_and_is_no_motion():
    """States with ten times that scatter are at rest, and the mean of twelve is recorded."""
    found = wait_for_arms({"arm": Arm(noise=1e-3, speed=1000.0)}, GOAL, 5.0)["arm"]
    assert abs(found.state.joints_rad[0] - 1) < 1e-3  # sigma is 1e-3 / sqrt(12)


def test_hand_guided_arm_must_reach_another_place():
    """It counts once it is away from its previous place; an arm that stays is reported after the timeout."""
    wait_until_hand_guided({"arm": Arm()}, {"arm": RobotState(joints_rad=np.array([0.9, 0.0]))}, 5.0)
    arm = Arm()
    wait_until_hand_guided({"arm": arm}, {}, 5.0)
    assert arm.t < 1.5
    with pytest.raises(Unfit, match="arm not led to another place: arm"):
        wait_until_hand_guided({"arm": arm}, GOAL, 2.0)
    assert arm.t > 2.0


def test_arms_that_keep_moving_or_miss_the_goal_are_reported():
    """An arm that moves after the timeout, and one at rest away from its goal, are reported."""
    with pytest.raises(Unfit, match="arm still moving: arm"):
        wait_for_arms({"arm": Arm(speed=0.1)}, GOAL, 2.0)
    with pytest.raises(Unfit, match="arm not at its goal: arm"):
        wait_for_arms({"arm": Arm()}, {"arm": RobotState(joints_rad=np.array([2.0, 0.0]))}, 2.0)


def test_typed_pose_is_read_once():
    """A robot that is not live is asked once."""
    arm = Arm()
    arm.is_live = False
    arm.state = lambda: Reading(3.0, RobotState(SE3.identity()))
    assert wait_for_arms({"arm": arm}, {}, 1.0)["arm"].stamp_s == 3.0


class Film:
    """Camera whose images show a bright square that swings to rest within a second, 30 images a second."""

    is_live = True

    def __init__(self, swing_px):
        self.t, self.swing_px, self.rng = 0.0, swing_px, np.random.default_rng(1)

    def image(self):
        self.t += 1 / 30
        at = 200 + self.swing_px * max(0.0, 1 - self.t) * np.cos(60 * self.t)
        u, v = np.meshgrid(np.arange(400.0), np.arange(300.0))
        inside = 1 / (1 + np.exp(-(40 - np.maximum(np.abs(u - at), np.abs(v - 150))) / 0.7))
        return CameraImage(self.t, np.clip(60 + 120 * inside + self.rng.normal(0, 2, u.shape), 0, 255).astype(np.uint8))


def test_swinging_image_is_waited_for():
    """No image is accepted before the swing is below a tenth of a pixel, and none is much later."""
    assert 0.9 < wait_for_image(Film(5.0), [], 5.0).stamp_s < 1.3
    assert wait_for_image(Film(0.0), [], 5.0).stamp_s == pytest.approx(3 / 30)
    with pytest.raises(Unfit, match="image still moving"):
        wait_for_image(Film(50.0), [], 0.4)


def test_moving_image_is_refused_after_the_timeout():
    """The first image after the timeout decides."""
    film = Film(50.0)
    with pytest.raises(Unfit, match="image still moving"):
        wait_for_image(film, [], 0.4)
    assert film.t == pytest.approx(1 / 30 + 13 / 30)


def test_moving_image_of_a_camera_without_stamps_is_refused():
    """If all stamps are equal, this machine's clock counts."""
    film = Film(50.0)

    class Timeless:
        is_live = True

        def image(self):
            return replace(film.image(), stamp_s=0.0)

    with pytest.raises(Unfit, match="image still moving"):
        wait_for_image(Timeless(), [], 0.1)


class Delayed:
    """Camera whose images were exposed earlier, a given number of them before an instant."""

    is_live = True

    def __init__(self, late, after_s):
        self.exposed_s = [after_s - 1.0] * late + [after_s + 0.01] * 3

    def image(self):
        return CameraImage(0.0, np.zeros((8, 8), dtype=np.uint8), exposed_s=self.exposed_s.pop(0))


def test_images_before_an_instant_are_skipped():
    """They are skipped until the timeout; then the message has advice."""
    assert wait_for_image_after(Delayed(2, 5.0), 5.0, 5.0).exposed_s == 5.01
    with pytest.raises(Unfit, match="check the camera's clock"):
        wait_for_image_after(Delayed(2, 5.0), 5.0, -1.0)


def test_single_image_of_a_folder_is_accepted():
    """The next image is accepted: the person who saves it ensures that all is at rest."""
    film = Film(5.0)
    film.is_live = False
    assert wait_for_image(film, [], 5.0).stamp_s == pytest.approx(1 / 30)


@pytest.mark.journey
@pytest.mark.parametrize(("target", "places"), [pytest.param("charuco", 10, marks=pytest.mark.slow), ("led", 1)])
def test_images_are_taken_after_ringing(tmp_path, target, places):
    """After arrival, each image was taken after the ringing ended, and at most 0.3 s later."""
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
def test_states_that_differ_by_noise_are_at_rest(sigmas, still):
    """The means of both halves of twelve states may differ by four sigmas of their difference."""
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
    """Arm whose first joint moves by `step` per state, up to a number of states."""

    is_live = True

    def __init__(self, step, until=10**9):
        self.count, self.step, self.until = 0, step, until

    def state(self):
        self.count += 1
        return Reading(0.1 * self.count, RobotState(joints_rad=np.array([self.step * min(self.count, self.until)])))


@pytest.mark.parametrize(("step", "still"), [(1.6e-5, True), (1.7e-5, False), (-1.7e-5, False)])
def test_limit_between_halves_is_0_1_mrad(step, still):
    """A steady motion separates them by six steps."""
    arm = Paced(step)
    readings = [arm.state() for _ in range(12)]
    assert _is_still(readings, None) == still
    assert not _is_still(readings[1:], None)


def test_recorded_state_is_the_mean_of_twelve():
    """It has the stamp of the last; each state is shown."""
    shown = []
    found = wait_for_arms({"arm": Paced(1e-5)}, {}, 50.0, lambda *seen: shown.append(seen))
    assert found["arm"].stamp_s == pytest.approx(1.2)
    assert found["arm"].state.joints_rad[0] == pytest.approx(6.5e-5)
    assert [name for name, _ in shown] == ["arm"] * 12


def test_all_arms_wait_for_a_moving_arm():
    """The others keep sending states; a robot that is not live is asked once, and the moving one is reported."""
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
def test_new_place_is_two_millirad_away(off, is_new):
    """Each arm with a previous place must have left it; an arm without one may be anywhere."""
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
    """Camera with one picture per image, at given instants of its stamps and of this machine's clock."""

    is_live = True

    def __init__(self, greys, step_s=1.0, exposed_s=None):
        self.greys, self.step_s, self.exposed_s, self.count = greys, step_s, exposed_s, 0

    def image(self):
        self.count += 1
        grey = self.greys[min(self.count, len(self.greys)) - 1]
        return CameraImage(self.step_s * self.count, grey, exposed_s=self.exposed_s)


def spot(u, v=50.0):
    """Dark image with a spot of light at any place."""
    x, y = np.meshgrid(np.arange(100.0), np.arange(100.0))
    return np.round(20 + 200 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 2.0**2))).astype(np.uint8)


LED = TARGETS["led"].usual(np.random.default_rng(0))


@pytest.mark.parametrize(("off", "taken"), [(0.08, 3), (0.14, 6)])
def test_led_is_tracked_to_a_tenth_of_a_pixel(off, taken):
    """Three images in a row show it at one place; each is shown, and the last is returned."""
    shown = []
    slides = Slides([spot(50.0), spot(50.0), spot(50.0 + off), spot(50.0 + off)])
    found = wait_for_image(slides, [LED], 50.0, show=shown.append)
    assert (found.stamp_s, slides.count, len(shown)) == (taken, taken, taken)


def test_images_without_the_led_are_compared_completely():
    """An LED that is missing in one of them is no motion."""
    dark = np.full((100, 100), 20, dtype=np.uint8)
    assert wait_for_image(Slides([dark]), [LED], 5.0).stamp_s == 3.0


def test_image_must_be_exposed_after_the_instant():
    """A later image is accepted, and so is one of unknown exposure; each is shown."""
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
