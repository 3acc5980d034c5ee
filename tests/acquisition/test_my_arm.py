"""Tests of the driver on the page about capture: a separate package, an arm behind HTTP, and a capture."""

from __future__ import annotations

import json
import threading
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest

from basecal.acquisition.capture import capture, store_plan
from basecal.acquisition.driver import Moves, Robot
from basecal.acquisition.rig import open_rig
from basecal.acquisition.taking import CaptureSettings, Taker
from basecal.cell import Driver
from basecal.planning import poses
from basecal.planning.sketch import sketch_cell
from basecal.simulation.running.protocol import connect, read_address
from safety.installed_driver import installed_driver
from shared.running_cell import home, running

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "capture.md").read_text(encoding="utf-8")
DRIVER = ROOT / "docs" / "my_arm.py"
LONGEST = 40  # lines with the module's words, of which thirty do something


@pytest.fixture
def installed(tmp_path):
    """Install the page's driver as pip does."""
    with installed_driver(tmp_path / "packages", "my_arm", DRIVER):
        yield


@pytest.fixture
def controller(tmp_path):
    """Simulated cell whose first arm is reached by HTTP as in the page's driver; its world and address."""
    with running(tmp_path) as world:
        cell, one_at_a_time = connect(read_address(tmp_path)), threading.Lock()

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self):
                said = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                with one_at_a_time:
                    answer = self.answer(said)
                self.send_response(200)
                self.end_headers()
                self.wfile.write(json.dumps(answer).encode())

            def answer(self, said):
                answer = {}
                if self.path == "/joints":
                    answer = {"degrees": np.degrees(cell.ask(do="state", robot="eye")["joints_rad"]).tolist()}
                elif self.path == "/move":
                    joints, speed = np.radians(said["degrees"]).tolist(), float(np.radians(said["speed"]))
                    cell.ask(do="move", robot="eye", joints_rad=joints, speed_rad_s=speed)
                else:
                    cell.ask(do="stop", robot="eye")
                return answer

            def log_message(self, *words):
                pass

        with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
            thread = threading.Thread(target=server.serve_forever, daemon=True)
            thread.start()
            yield world, f"http://127.0.0.1:{server.server_port}"
            server.shutdown()
            thread.join()
        cell.close()


@pytest.mark.journey
@pytest.mark.parametrize("samples", [2, pytest.param(20, marks=pytest.mark.slow)])
def test_documented_driver_captures_samples(tmp_path, installed, controller, samples):
    """One arm uses it, the rest uses the simulated driver."""
    world, address = controller
    eye = replace(world.cell.robots["eye"], driver=Driver("my_arm", {"address": address}))
    sketch = sketch_cell(replace(world.cell, robots={**world.cell.robots, "eye": eye}))
    with open_rig(sketch.cell, tmp_path) as rig:
        assert rig.guarantees["eye"] == "none"
        assert isinstance(rig.robots["eye"], Robot)
        assert isinstance(rig.robots["eye"], Moves)
        plan = store_plan(tmp_path, sketch.cell, poses.plan(sketch, home(world), samples, 0))
        steps = list(capture(Taker(rig, sketch, tmp_path, CaptureSettings(speed_rad_s=2.0, tool_m_s=10.0)), plan))
        rig.stop()
    assert [step.why_not for step in steps] == [""] * samples


def test_page_includes_the_tested_driver():
    """The page includes the tested file, and it is short."""
    assert '--8<-- "docs/my_arm.py"' in PAGE
    assert len(DRIVER.read_text(encoding="utf-8").splitlines()) <= LONGEST
