"""Tests of the driver that replays a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.acquisition.driver import Place
from basecal.acquisition.drivers.replay import Playback, ReplayRobot, open_camera, open_robot
from basecal.cell.files import write_cell, write_recording
from basecal.errors import DatasetError, DriverError
from basecal.simulation.scenario import Scenario
from basecal.simulation.testbed import simulate
from basecal.vision.image_file import write_png


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Recording of three samples, each with an image of its own grey level, the second with one of the LED off."""
    folder = tmp_path_factory.mktemp("recorded")
    made = simulate(Scenario(samples=3), 0)
    samples = []
    for sample in made.recording.samples:
        name = f"recording/images/wrist/{sample.sample}.png"
        write_png(folder / name, np.full((720, 1280), 10 * (sample.sample + 1), dtype=np.uint8))
        dark = {"wrist": "recording/images/wrist/0.png"} if sample.sample == 1 else {}
        samples.append(replace(sample, observations=(), images={"wrist": name}, background=dark))
    write_cell(made.cell, folder)
    write_recording(replace(made.recording, samples=tuple(samples)), folder)
    return folder, made


def place(made, name, recording=None):
    folder, simulated = made
    return Place(name, simulated.cell, folder, {"recording": recording or str(folder)})


def test_robots_move_to_recorded_states(made):
    """Near a recorded state, robots report that state, and the camera returns its image."""
    eye, hand, wrist = (
        open_robot(place(made, "eye")),
        open_robot(place(made, "hand")),
        open_camera(place(made, "wrist")),
    )
    samples = made[1].recording.samples
    for number in (2, 0, 1):
        for name, robot in (("eye", eye), ("hand", hand)):
            robot.move(samples[number].robots[name], 1.0)
        reading, image = hand.state(), wrist.image()
        recorded = samples[number].robots["hand"].base_from_flange
        np.testing.assert_allclose(reading.state.base_from_flange.translation, recorded.translation, atol=1e-12)
        assert image.grey[0, 0] == 10 * (number + 1)
        assert reading.stamp_s < image.stamp_s < hand.state().stamp_s


def test_background_needs_a_recording_with_the_led_off(made):
    """With the LED off the background is returned; without one there is an error."""
    wrist, eye = open_camera(place(made, "wrist")), open_robot(place(made, "eye"))
    hand = open_robot(place(made, "hand"))
    for name, robot in (("eye", eye), ("hand", hand)):
        robot.move(made[1].recording.samples[1].robots[name], 1.0)
    wrist.light(False)
    assert wrist.image().grey[0, 0] == 10
    for name, robot in (("eye", eye), ("hand", hand)):
        robot.move(made[1].recording.samples[2].robots[name], 1.0)
    with pytest.raises(DriverError, match="no image with the LED off in sample 2"):
        wrist.image()


def test_robot_without_states_is_an_error(made):
    """A robot that is in no sample is an error without a sample number."""
    samples = tuple(replace(sample, robots={}) for sample in made[1].recording.samples)
    robot = ReplayRobot("eye", Playback(made[1].cell, replace(made[1].recording, samples=samples)))
    with pytest.raises(DriverError, match=r"eye: the recording has no data of this device$"):
        robot.state()


def test_missing_recording_is_an_error(made, tmp_path):
    """So is a recording without the robot."""
    with pytest.raises(DatasetError):
        open_robot(place(made, "eye", str(tmp_path)))
    with pytest.raises(DatasetError, match="is not a path: it holds a null character"):
        open_robot(place(made, "eye", "a\0b"))
    robots = made[1].cell.robots
    third = {**robots, "third": replace(robots["eye"], name="third")}
    with pytest.raises(DatasetError, match=r"robots\.third\.driver\.recording: .* has no robot 'third'"):
        open_robot(
            Place(
                "third",
                replace(made[1].cell, robots=third),
                made[0],
                {"recording": "."},
            )
        )
