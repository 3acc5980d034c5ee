"""The local page of a capture: what it shows, whom it asks, and what its button does."""

from __future__ import annotations

import json
import threading
import urllib.request
from dataclasses import replace
from urllib.parse import urlsplit

import numpy as np
import pytest

from basecal.acquisition.capture import Step
from basecal.acquisition.coverage import COVERAGE_GRID, Coverage
from basecal.acquisition.watching import End, Watch
from basecal.cell import RobotState, Unknown
from basecal.cell.targets.charuco import charuco_target
from basecal.errors import DriverError
from basecal.geometry import SE3, Camera
from basecal.reporting.live import page
from basecal.vision.draw.render import render
from shared.browser import CHROMIUM, visit
from shared.facing_arms import facing_arms

LENS = Camera("pinhole", np.array([500.0, 500.0, 319.5, 239.5]), (640, 480))
BOARD = charuco_target((5, 7), 0.04, 0.03, "DICT_4X4_50")


@pytest.fixture(scope="module")
def cell():
    made = facing_arms().cell
    (board,) = made.targets.values()
    return replace(made, targets={board.name: replace(board, target=BOARD)})


def captured(cell):
    """A capture after three samples, with a picture of a board."""
    watch, cells = Watch(), np.zeros(COVERAGE_GRID, dtype=bool)
    cells[1, 2:4] = True
    for k in range(3):
        turned = {"eye": np.full(3, 0.4), "hand": np.array([0.4, 0.1, 0.4])}
        watch.note(Step(k, "", 5 + k, 25, Coverage(cells, turned), (1e-3 / (k + 1), 1e-3)))
    watch.show(next(iter(cell.cameras)), render(LENS, BOARD, SE3(np.eye(3), np.array([-0.1, -0.14, 0.6]))))
    for robot, joints in facing_arms().home.items():
        watch.stand(robot, RobotState(joints_rad=joints))
    watch.send("hand", RobotState(joints_rad=facing_arms().home["hand"] + 0.1))
    watch.note(Step(3, "target not seen by wrist", 7, 25, Coverage(cells, turned), None))
    watch.expect(5e-4, 8e-4)
    watch.tell("sample 4: arms move")
    return watch


@pytest.mark.journey
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed: apt-get install chromium")
def test_in_a_browser(cell, tmp_path):
    """Step, advice, sigma, picture, points, arms and what failed; no error in the console, nobody else is asked."""
    with page.serve_page(captured(cell), cell, print) as address:
        came = visit(address, tmp_path, until="body:has(canvas) [data-camera] svg path.found[d]")
    assert came.errors == []
    assert {urlsplit(asked).hostname for asked in came.asked if not asked.startswith("data:")} == {"127.0.0.1"}
    shown = ("sample 4: arms move", "Turn hand further about y", "sample 2: taken", "7 of 25", "0.80 mm", "to go")
    for words in (*shown, "tolerance 0.5 mm", "sample 3: target not seen by wrist", "Stop all arms"):
        assert words in came.words


def test_its_button_stops_the_arms(cell):
    """The page's own POST, which `Guard` has checked, is handed to the rig with its reason."""
    reasons = []
    with page.serve_page(captured(cell), cell, reasons.append) as address:
        at = address.partition("?")[0]
        token = address.partition("token=")[2]
        headers = {"Cookie": f"basecal_{urlsplit(at).port}={token}", "Origin": at.rstrip("/")}
        request = urllib.request.Request(f"{at}stop", method="POST", headers=headers)
        assert urllib.request.urlopen(request, timeout=20).status == 200
    assert reasons == [page.STOP_REASON]


def test_the_end_is_a_verdict_with_what_to_type_next(cell):
    """In the colours of verdicts; how long it takes still is left out."""
    watch = captured(cell)
    live = page.LivePage(watch, cell)
    assert not live.state()["over"]
    assert "left, at the pace so far" in live.state()["html"]
    watch.end(End("FAIL", "0.5 mm at the task needs 9 samples more", "basecal calibrate mycell"))
    watch.end(End("GOOD", "a later end does not count"))
    state = live.state()
    assert state["over"]
    assert 'class="verdict refused"' in state["html"]
    assert "next: <code>basecal calibrate mycell</code>" in state["html"]
    assert "left, at the pace so far" not in state["html"]


def test_a_capture_that_was_stopped_is_seen_to_have_ended(cell, monkeypatch):
    """The page answers a little longer, also after an error."""
    monkeypatch.setattr(page, "_REFRESH_S", 1.0)
    watch, seen = captured(cell), []

    def look(address):
        seen.append(json.loads(urllib.request.urlopen(address.replace("/?", "/state?"), timeout=20).read()))

    def stop():
        with page.serve_page(watch, cell, print) as address:
            watch.end(End("STOPPED", "Stop was pressed on the page."))
            threading.Timer(0.1, look, [address]).start()
            raise DriverError("Stop was pressed on the page.")

    with pytest.raises(DriverError):
        stop()
    assert [state["over"] for state in seen] == [True]
    assert "STOPPED" in seen[0]["html"]


def test_arms_are_where_they_are_and_where_they_were_sent(cell):
    """The first flange of an arm is now, the second its goal; of a cell without guesses nothing is drawn."""
    arms = {arm["name"]: arm["flanges"] for arm in page.LivePage(captured(cell), cell).state()["arms"]}
    assert arms["eye"][0] == arms["eye"][1]
    assert np.linalg.norm(np.subtract(*arms["hand"])[:3]) > 0.05
    unknown = replace(cell, bases={"hand": Unknown("free", None)})
    assert page.LivePage(captured(cell), unknown).state()["arms"] == []
