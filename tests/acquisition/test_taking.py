"""Tests of taking one sample."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from basecal.acquisition import taking as module
from basecal.acquisition.driver import Reading
from basecal.acquisition.rig import Rig, open_rig
from basecal.acquisition.stillness import Moving, Unfit
from basecal.acquisition.taking import CaptureSettings, Sharpness, Taker, visible_targets
from basecal.acquisition.watching import Watch
from basecal.cell import RobotState, Sample
from basecal.errors import DriverError
from basecal.geometry import SE3
from basecal.planning.sketch import sketch_cell
from basecal.vision.draw.motion_blur import blur_motion
from basecal.vision.draw.render import RenderSettings, expose, radiance
from basecal.vision.edge_width import EdgeWidth, edge_width
from basecal.vision.image_file import grey_image, read_bytes
from shared.facing_arms import facing_arms
from shared.running_cell import running

FAST = CaptureSettings(speed_rad_s=2.0, tool_m_s=10.0, patience_s=3.0)
WORLD = facing_arms()
BOARD, LENS = WORLD.cell.targets["board"].target, WORLD.lenses["wrist"]
VIEW = ("wrist", "board")


@pytest.mark.journey
def test_steps_of_a_sample_are_reported(tmp_path):
    """Waiting and detecting are reported when they begin; arms that stay are not reported to move."""
    told = []
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        sample = Taker(rig, sketch_cell(world.cell), tmp_path, FAST, told.append).take(Sample(4), [])
    assert told == ["sample 4", "sample 4: waiting for a still image", "sample 4: looking for the target"]
    assert sample.observations[0].target == "board"


@pytest.mark.journey
def test_states_images_and_goals_are_shown(tmp_path):
    """The view of a capture gets the state and goal of each arm, and the image of the sample."""
    watch = Watch()
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        rig.arms.show = watch.note_state
        here = {name: robot.state().state for name, robot in rig.robots.items()}
        by = Taker(rig, sketch_cell(world.cell), tmp_path, FAST, show_image=watch.note_image, show_goal=watch.note_goal)
        sample = by.take(Sample(0, robots={"eye": here["eye"]}), [])
    glance = watch.snapshot
    assert dict(glance.goals) == {"eye": here["eye"]}
    assert {name: state.joints_rad.shape for name, state in glance.states} == {"eye": (6,), "hand": (6,)}
    np.testing.assert_array_equal(dict(glance.images)["wrist"], read_grey(tmp_path / sample.images["wrist"]))


def test_motion_is_waited_for_once_more(tmp_path, monkeypatch):
    """After the first motion the sample is tried again; other problems are reported at once."""
    why = [Moving("arm still moving: eye"), Unfit("too blurred")]

    def attempt(by, wanted, taken, patience_s):
        raise why.pop(0)

    monkeypatch.setattr(module, "_take_sample", attempt)
    told = []
    with pytest.raises(Unfit, match="too blurred"):
        Taker(Rig({}, {}), None, tmp_path, FAST, told.append).take(Sample(0), [])
    assert told == ["sample 0", "arm still moving: eye; once more"]


@pytest.mark.journey
def test_camera_ignores_targets_on_its_own_carrier(tmp_path):
    """Only targets on other bodies can be in its view."""
    with running(tmp_path) as world:
        assert len(visible_targets(world.cell, "wrist")) == 1


class LateEye:
    """Camera whose next image was exposed before the LED was switched."""

    is_live = True

    def __init__(self, camera):
        self.camera, self.waiting = camera, []

    def light(self, on):
        self.waiting = [replace(self.camera.image(), exposed_s=time.monotonic())]
        self.camera.light(on)

    def image(self):
        if self.waiting:
            return self.waiting.pop()
        return replace(self.camera.image(), exposed_s=time.monotonic() + 60, note="late")

    def close(self):
        self.camera.close()


@pytest.mark.journey
def test_background_is_exposed_with_the_led_off(tmp_path):
    """An image on its way when the LED was switched off is not accepted; the reason is reported."""
    reports = []
    with running(tmp_path, target="led") as world, open_rig(world.cell, tmp_path) as rig:
        late = Rig(rig.robots, {"wrist": LateEye(rig.cameras["wrist"])})
        by = Taker(late, sketch_cell(world.cell), tmp_path, FAST, report=reports.append)
        sample = by.take(Sample(0), [])
    lit, dark = (read_grey(tmp_path / paths["wrist"]) for paths in (sample.images, sample.background))
    assert dark.max() < lit.max() / 2
    assert set(reports) == {"late"}


def read_grey(path):
    return grey_image(read_bytes(path), None)


class Asked:
    """Arm whose controller is asked before a motion."""

    is_live = True

    def __init__(self, name, joints, said, why=""):
        self.name, self.joints, self.said, self.why = name, joints, said, why

    def state(self):
        return Reading(0.0, RobotState(joints_rad=self.joints))

    def goal_refusal(self, to):
        self.said.append(f"ask {self.name}")
        return self.why

    def move(self, to, speed_rad_s):
        self.said.append(f"move {self.name} {speed_rad_s:.3f}")

    def stop(self):
        self.said.append(f"stop {self.name}")

    def close(self):
        pass


def test_all_arms_accept_before_any_moves(tmp_path):
    """If one refuses, both stay; otherwise both move, each as fast as its path allows."""
    world = facing_arms("charuco")
    turn = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.2])
    goals = {name: RobotState(joints_rad=joints + turn) for name, joints in world.home.items()}
    for why in ("beyond its limits", ""):
        said = []
        robots = {name: Asked(name, world.home[name], said, why if name == "hand" else "") for name in world.home}
        by = Taker(Rig(robots, {}), sketch_cell(world.cell), tmp_path, CaptureSettings(0.5, 0.25))
        if why:
            with pytest.raises(Unfit, match="hand: beyond its limits; nothing was sent"):
                module._send_arms(by, Sample(0, robots=goals))
            assert said == ["ask eye", "ask hand"]
        else:
            module._send_arms(by, Sample(0, robots=goals))
            assert [words.rpartition(" ")[0] for words in said] == ["ask", "ask", "move eye", "move hand"]
            assert said[2:] == ["move eye 0.500", "move hand 0.500"]


@pytest.mark.journey
def test_slow_motion_is_waited_for(tmp_path):
    """The waiting time is that of the longest motion at its speed."""
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        at = {name: robot.state().state for name, robot in rig.robots.items()}
        turns = {"eye": 0.01, "hand": 0.02}
        goals = {name: RobotState(joints_rad=at[name].joints_rad + turn) for name, turn in turns.items()}
        by = Taker(rig, sketch_cell(world.cell), tmp_path, CaptureSettings(0.05, 10.0))
        assert module._send_arms(by, Sample(0, robots=goals)) == pytest.approx(0.4)
    assert module._joint_travel_rad(RobotState(SE3.identity()), RobotState(SE3.identity())) == np.pi


def test_moving_arm_gets_no_new_goal(tmp_path):
    """An arm far slower than planned, e.g. by a speed slider, ends the capture; an arm at rest does not."""

    class Slow(Asked):
        def state(self):
            self.joints = self.joints + 1e-3
            return super().state()

    sketch, settings = sketch_cell(WORLD.cell), CaptureSettings(1.0, 10.0, 0.02)
    arm = Slow("eye", np.zeros(6), [])
    with pytest.raises(DriverError, match=r"^arm still moving: eye .*\. No arm is sent while one moves\. "):
        Taker(Rig({"eye": arm}, {}), sketch, tmp_path, settings).take(Sample(0), [])


class Frozen:
    """Camera that always returns the same image, with newer stamps."""

    is_live, is_on_demand = True, True

    def __init__(self, image):
        self._image = image

    def image(self):
        return replace(self._image, stamp_s=time.monotonic())

    def close(self):
        pass


@pytest.mark.journey
def test_repeated_image_ends_the_capture(tmp_path):
    """A repeated image after a motion is an error; without a motion the sample equals the other."""
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        frozen = Rig(rig.robots, {"wrist": Frozen(rig.cameras["wrist"].image())})
        by = Taker(frozen, sketch_cell(world.cell), tmp_path, FAST)
        first = by.take(Sample(0), [])
        with pytest.raises(Unfit, match="too similar to sample 0"):
            by.take(Sample(1), [first])
        turned = RobotState(joints_rad=first.robots["eye"].joints_rad + 0.02)
        with pytest.raises(DriverError, match=r"^wrist: its image at sample 2 repeats that of sample 0, though arms"):
            by.take(Sample(2, robots={"eye": turned}), [first])
    assert not (tmp_path / "recording/images/wrist/000002.png").exists()


@pytest.mark.journey
def test_image_of_another_size_ends_the_capture(tmp_path):
    """The error has the camera, its size and that of `cell.yaml`."""
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        image = rig.cameras["wrist"].image()
        halved = Rig(rig.robots, {"wrist": Frozen(replace(image, grey=image.grey[::2, ::2]))})
        by = Taker(halved, sketch_cell(world.cell), tmp_path, FAST)
        with pytest.raises(DriverError, match=r"^wrist: its image has \d+ x \d+ pixels, its camera \d+ x \d+"):
            by.take(Sample(0), [])


def is_blurred(before, away_m=0.65, way=(0.0, 0.0), blur_px=0.5):
    """Judge an image of the board with distance, motion and blur during its exposure."""
    settings = RenderSettings(blur_px=blur_px)
    at = SE3(np.eye(3), np.array([0.0, 0.0, away_m]) - BOARD.points.mean(0))
    pixels = LENS.project(at @ BOARD.points)
    image = expose(blur_motion(radiance(LENS, [(BOARD, at)], settings), np.array(way)), settings, 0)
    return before.is_blurred(VIEW, edge_width(image, pixels), pixels, BOARD.points)


@pytest.mark.journey
@pytest.mark.parametrize("blur_px", [0.5, 4.0])
def test_uniform_blur_is_no_motion(blur_px):
    """A lens with uniform blur passes, sharp or out of focus by a point spread of 4 px."""
    before = Sharpness()
    assert not any(is_blurred(before, away_m, blur_px=blur_px) for away_m in (0.7, 0.5))


def test_motion_across_one_family_of_edges_is_found():
    """Four pixels of motion are too many, in the first image as well."""
    assert is_blurred(Sharpness(), way=(4.0, 0.0))


@pytest.mark.journey
def test_motion_across_all_edges_is_found_beside_a_sharp_view():
    """Blur of all edges is not focus if another view is sharper; the blurred view does not count itself."""
    before = Sharpness()
    assert not is_blurred(before)
    assert is_blurred(before, way=(4.0, 4.0))
    assert not is_blurred(before, 0.6)


def test_soft_print_has_wider_edges_at_short_distance():
    """Edges of constant width on the paper are a property of the print; wider ones are not."""
    points, before = np.array([[0.0, 0, 0], [0.1, 0.1, 0]]), Sharpness()
    for scale, wide_px, blurred in ((1000.0, 6.0, False), (3000.0, 18.0, False), (1000.0, 18.0, True)):
        pixels = scale * points[:, :2]
        assert before.is_blurred(VIEW, EdgeWidth(wide_px, wide_px), pixels, points) == blurred


def test_single_corner_has_no_scale():
    """It is not blurred, and later views are not compared with it."""
    before = Sharpness()
    assert not before.is_blurred(VIEW, EdgeWidth(3.0, 9.0), np.zeros((1, 2)), np.zeros((1, 3)))
    assert is_blurred(before, way=(4.0, 0.0))
