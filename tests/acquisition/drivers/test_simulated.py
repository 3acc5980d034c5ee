"""Tests of the drivers of a running simulated cell."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from basecal.acquisition.driver import Camera, Moves, Place, Robot, Switches
from basecal.acquisition.drivers.simulated import SimulatedCamera, SimulatedRobot, open_camera, open_robot
from basecal.cell import RobotState
from basecal.errors import DatasetError, DriverError
from basecal.geometry import SE3
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.protocol import Connection
from basecal.simulation.running.server import CellServer
from shared.facing_arms import facing_arms

WORLD = facing_arms("led")


@pytest.fixture
def place(tmp_path):
    """Driver entry of a robot or camera of a running cell."""
    with CellServer(Plant(WORLD, Clock(0)), "token") as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield lambda name: Place(name, WORLD.cell, tmp_path, {"port": server.port, "token": "token"})
        server.shutdown()


def test_arm_moves_to_its_goal(place):
    """Its states end at the goal with increasing stamps; it can be stopped."""
    arm = open_robot(place("eye"))
    assert isinstance(arm, Robot)
    assert isinstance(arm, Moves)
    there = WORLD.home["eye"] + 0.05
    arm.move(RobotState(joints_rad=there), 1.0)
    readings = [arm.state() for _ in range(100)]
    np.testing.assert_array_equal(readings[-1].state.joints_rad, there)
    assert np.all(np.diff([reading.stamp_s for reading in readings]) > 0)
    arm.stop()
    with pytest.raises(DriverError, match="joints, not as poses"):
        arm.move(RobotState(SE3.identity()), 1.0)
    arm.close()


def test_camera_sees_the_switched_led(place):
    """Images have the size of the lens, and are darker with the LED off."""
    camera = open_camera(place("wrist"))
    assert isinstance(camera, Camera)
    assert isinstance(camera, Switches)
    lit = camera.image().grey
    camera.light(False)
    dark = camera.image().grey
    assert lit.shape == (720, 1280)
    assert int(lit.max()) > 2 * int(dark.max())
    camera.close()


def test_missing_cell_and_wrong_option_are_reported(tmp_path):
    """One line says what to do."""
    with pytest.raises(DriverError, match="start it with `basecal simulate"):
        open_robot(Place("eye", WORLD.cell, tmp_path, {}))
    with pytest.raises(DatasetError, match=r"robots\.eye\.driver\.port"):
        open_robot(Place("eye", WORLD.cell, tmp_path, {"port": 70_000}))


class Impostor(Connection):
    """Connection to another program."""

    def ask(self, **request):
        return {"stamp_s": float("inf"), "joints_rad": ["0"], "png_base64": "?"}


def test_other_program_at_the_port_is_reported(monkeypatch):
    """Its answers are numbers and images, or an error that says so."""
    line = Impostor("token", None)
    for ask in (SimulatedRobot("eye", line).state, SimulatedCamera("wrist", line).image):
        with pytest.raises(DriverError, match=r"is not a simulated cell \(\w+"):
            ask()
    monkeypatch.setattr(Impostor, "ask", lambda self, **request: {"stamp_s": 0.0, "png_base64": "abc"})
    with pytest.raises(DriverError, match="wrist: an image is not written as base64"):
        SimulatedCamera("wrist", line).image()
