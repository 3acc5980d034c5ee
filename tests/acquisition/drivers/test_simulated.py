"""Arms and camera of a running cell, as drivers."""

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
    """Where a robot or camera of a running cell is."""
    with CellServer(Plant(WORLD, Clock(0)), "token") as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield lambda name: Place(name, WORLD.cell, tmp_path, {"port": server.port, "token": "token"})
        server.shutdown()


def test_an_arm_goes_where_it_is_sent(place):
    """Its states end at the joints it was sent to, with rising stamps; it can be stopped."""
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


def test_a_camera_sees_the_light_switched(place):
    """Images come in the size of the lens, darker where the light is off."""
    camera = open_camera(place("wrist"))
    assert isinstance(camera, Camera)
    assert isinstance(camera, Switches)
    lit = camera.image().grey
    camera.light(False)
    dark = camera.image().grey
    assert lit.shape == (720, 1280)
    assert int(lit.max()) > 2 * int(dark.max())
    camera.close()


def test_no_cell_and_no_option(tmp_path):
    """Where nothing runs, and where an option is wrong, a line says what to do."""
    with pytest.raises(DriverError, match="start it with `basecal simulate"):
        open_robot(Place("eye", WORLD.cell, tmp_path, {}))
    with pytest.raises(DatasetError, match=r"robots\.eye\.driver\.port"):
        open_robot(Place("eye", WORLD.cell, tmp_path, {"port": 70_000}))


class Impostor(Connection):
    """A line on which something else answers."""

    def ask(self, **request):
        return {"stamp_s": float("inf"), "joints_rad": ["0"], "png_base64": "?"}


def test_what_else_answers_is_told(monkeypatch):
    """Whatever listens at the port: its answers are numbers and images, or an error that says so."""
    line = Impostor("token", None)
    for ask in (SimulatedRobot("eye", line).state, SimulatedCamera("wrist", line).image):
        with pytest.raises(DriverError, match=r"is not a simulated cell \(\w+"):
            ask()
    monkeypatch.setattr(Impostor, "ask", lambda self, **request: {"stamp_s": 0.0, "png_base64": "abc"})
    with pytest.raises(DriverError, match="wrist: an image is not written as base64"):
        SimulatedCamera("wrist", line).image()
