"""Tests of the local page of a capture: its contents, its requests and its button."""

from __future__ import annotations

import json
import re
import threading
import urllib.request
from dataclasses import replace
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest

from basecal.acquisition.capture import Step
from basecal.acquisition.coverage import COVERAGE_GRID, Coverage
from basecal.acquisition.watching import End, Sigma, Snapshot
from basecal.cell import RobotState, Unknown
from basecal.errors import DriverError
from basecal.geometry import SE3
from basecal.reporting.live import page
from drawings import ends
from shared.browser import CHROMIUM, browsing, visit
from shared.watched_capture import captured, cell_with_a_board


@pytest.fixture(scope="module")
def cell():
    return cell_with_a_board()


@pytest.mark.journey
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed: apt-get install chromium")
def test_live_page_in_a_browser(cell, tmp_path):
    """The page shows step, advice, sigma, image, points, arms and failures.

    It has no console errors and contacts no other host.
    """
    with page.serve_page(captured(cell), cell, print) as address:
        came = visit(address, tmp_path, selector="body:has(canvas) [data-camera] svg path.found[d]")
    assert came.errors == []
    assert {urlsplit(request).hostname for request in came.requests if not request.startswith("data:")} == {"127.0.0.1"}
    shown = ("Sample 4: arms move", "Rotate hand further about y", "sample 2: taken", "7 of 25", "0.80 mm", "to go")
    for words in (*shown, "tolerance 0.5 mm", "sample 3: target not seen by wrist", "Stop all arms"):
        assert words in came.words


@pytest.mark.journey
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed: apt-get install chromium")
def test_final_command_can_be_copied(cell, tmp_path):
    """A button appears after the command when the capture is over. It selects the command and confirms it."""
    watch = captured(cell)
    button = "document.querySelector('.verdict .do button')"
    selected = f"{button}.click(), String(window.getSelection())"
    button_text = f"new Promise((done) => setTimeout(() => done({button}.textContent), 100))"
    with page.serve_page(watch, cell, print) as address, browsing(tmp_path) as tab:
        tab.go(address, selector="[data-camera] svg")
        assert tab.value("document.querySelectorAll('.do button').length") == 0
        watch.end(End("GOOD", "all directions are known", "basecal calibrate 'my cell'"))
        tab.go(address, selector=".verdict .do button")
        assert tab.value(selected) == "basecal calibrate 'my cell'"
        assert tab.value(button_text) in ("copied", "selected")
    assert tab.visit.errors == []


def test_stop_button_stops_the_arms(cell):
    """The page's own POST, which `Guard` has checked, is passed to the rig with its reason."""
    reasons = []
    with page.serve_page(captured(cell), cell, reasons.append) as address:
        at = address.partition("?")[0]
        token = address.partition("token=")[2]
        headers = {"Cookie": f"basecal_{urlsplit(at).port}={token}", "Origin": at.rstrip("/")}
        request = urllib.request.Request(f"{at}stop", method="POST", headers=headers)
        assert urllib.request.urlopen(request, timeout=20).status == 200
    assert reasons == [page.STOP_REASON]


def test_finished_capture_shows_verdict_and_command(cell):
    """The verdict has its colour, and the remaining time is omitted."""
    watch = captured(cell)
    live = page.LivePage(watch, cell)
    assert not live.state()["over"]
    assert 'class="word">CAPTURING<' in live.page()  # before any request
    assert "left, at the pace so far" in live.state()["html"]
    watch.end(End("FAIL", "0.5 mm at the task needs 9 samples more", "basecal calibrate mycell"))
    watch.end(End("GOOD", "a later end does not count"))
    state = live.state()
    assert state["over"]
    assert 'class="verdict refused"' in state["html"]
    assert "next: <code>basecal calibrate mycell</code>" in state["html"]
    assert "left, at the pace so far" not in state["html"]
    assert "data-over" in state["html"]  # hides the button


@pytest.mark.journey
def test_stopped_capture_is_still_reported(cell, monkeypatch):
    """The page is served a little longer after the end, also after an error."""
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


def test_remaining_motion_has_fixed_digits(cell):
    """The remaining motion is in tenths of a millimetre and hundredths of a degree.

    This also holds for an arm that has arrived within a nanometre.
    """
    state = RobotState(SE3(np.eye(3), np.array([0.4, 0.0, 0.5])))
    near = RobotState(SE3(np.eye(3), np.array([0.4, 0.0, 0.5 + 1e-12])))
    snapshot = SimpleNamespace(states={"hand": state}, goals={"hand": near})
    assert list(page.LivePage(captured(cell), cell)._motions(snapshot)) == ["hand: 0.0 mm and 0.00 deg to go"]


def test_arms_show_current_and_goal_pose(cell):
    """The first flange of an arm is its current pose, the second its goal. A cell without guesses has no drawing."""
    arms = {arm["name"]: arm["base_from_flange"] for arm in page.LivePage(captured(cell), cell).state()["arms"]}
    assert arms["eye"][0] == arms["eye"][1]
    assert np.linalg.norm(np.subtract(*arms["hand"])[:3]) > 0.05
    unknown = replace(cell, bases={"hand": Unknown("free", None)})
    assert page.LivePage(captured(cell), unknown).state()["arms"] == []


def test_image_coverage_is_drawn_as_squares(cell):
    """Each covered part of the image is a full square, and the share is stated in words."""
    shown = page.LivePage(captured(cell), cell).state()["html"]
    drawn = shown[shown.index("covered-live") :].partition("</svg>")[0]
    assert (drawn.count("<rect"), drawn.count('class="tile"')) == (np.prod(COVERAGE_GRID), 2)
    assert "<title>8 % of the image is covered</title>" in drawn
    assert "samples taken" in shown
    assert "of the image covered" in shown


def test_progress_figure_shows_error_and_tolerance() -> None:
    """Without a tolerance the figure shows the sigma of the base; a single point has no figure."""
    sigmas = tuple(Sigma(k, 2e-3 / k, 1e-3) for k in range(1, 6))
    assert page._progress_figure(Snapshot(sigmas=sigmas[:1])) is None
    alone = page._progress_figure(Snapshot(sigmas=sigmas))
    assert alone is not None
    assert "2.0 mm with 1, 0.40 mm with 5 samples." in alone.caption
    task = page._progress_figure(Snapshot(sigmas=sigmas, errors=((4, 1e-3), (5, 8e-4)), tolerance_m=5e-4))
    assert task is not None
    assert "1.0 mm with 4, 0.80 mm with 5 samples. Dashed: the tolerance, 0.5 mm." in task.caption
    assert task.svg.count('class="level"') == 1


def test_last_image_shows_detected_points(cell):
    """Each detected point is marked, without a residual line. A camera without an image has no drawing."""
    live = page.LivePage(captured(cell), cell)
    (camera,) = cell.cameras
    drawn = live.image(camera)
    count = int(re.search(rf"last image of {camera}, (\d+) points found", drawn)[1])
    assert count > 10
    assert re.search(r'class="found" d="(.*?)"', drawn)[1].count("h0") == count
    assert all(np.ptp(line, axis=0).max() == 0 for line in ends(drawn, "off"))
    assert 'href="data:image/jpeg;base64,' in drawn
    assert live.image("another") == ""


def test_image_without_target_has_no_points(cell):
    watch = captured(cell)
    (camera,) = cell.cameras
    watch.note_image(camera, np.full((48, 64), 90, dtype=np.uint8))
    drawn = page.LivePage(watch, cell).image(camera)
    assert "0 points found" in drawn
    assert 'viewBox="0 0 360 270"' in drawn


def test_remaining_motion_is_length_and_angle(cell):
    """The remaining motion of an arm with a state and a goal is in mm and deg."""
    here, there = SE3.identity(), SE3.from_rpy((0, 0, np.radians(2)), (0.0, 0.0, 0.0125))
    states = {"hand": RobotState(here), "eye": RobotState(here)}
    snapshot = SimpleNamespace(states=states, goals={"hand": RobotState(there)})
    live = page.LivePage(captured(cell), cell)
    assert list(live._motions(snapshot)) == ["hand: 12.5 mm and 2.00 deg to go"]


def tiles(**fields):
    """Values and texts of the tiles of a snapshot."""
    return [(tile.value, tile.name) for tile in page._tiles(Snapshot(**fields))]


def test_tiles_show_known_quantities():
    """The tiles are counts, coverage and sigma of the last step, and the error only beside a tolerance."""
    coverage = Coverage(np.arange(np.prod(COVERAGE_GRID)).reshape(COVERAGE_GRID) < 6, {})
    step = Step(3, "", 7, 25, coverage, (2e-3, np.radians(0.5)))
    assert tiles() == []
    assert tiles(step=step) == [
        ("2.0 mm, 0.50 deg", "1 sigma (3-D norm) of the base"),
        ("7 of 25", "samples taken"),
        (f"{100 * coverage.share:.0f} %", "of the image covered"),
    ]
    assert tiles(step=replace(step, unchecked=2))[0][1] == "1 sigma (3-D norm) of the base, after 5 samples"
    assert len(tiles(step=replace(step, sigma=None))) == 2
    assert len(tiles(errors=((5, 8e-4),), tolerance_m=5e-4)) == 1
    assert tiles(errors=((5, 8e-4),)) == tiles(tolerance_m=5e-4) == []


def test_remaining_time_is_in_minutes_above_90_s():
    """There is no remaining time after the end."""
    step = Step(3, "", 7, 8, Coverage(np.zeros(COVERAGE_GRID, dtype=bool), {}), None)
    for seconds, text in ((90.0, "90 s"), (91.0, "2 min"), (0.0, "0 s")):
        assert tiles(step=step, times_s=(0.0, seconds))[-1] == (text, "left, at the pace so far")
    assert len(tiles(step=step, times_s=(0.0, 91.0), end=End("GOOD", ""))) == 2


def test_progress_figure_requires_two_values():
    """If there is a single error, the sigmas are drawn instead, if there are two."""
    one, two = ((4, 1e-3),), ((4, 1e-3), (5, 8e-4))
    sigmas = (Sigma(1, 2e-3, 1e-3), Sigma(2, 1e-3, 1e-3))
    assert page._progress_figure(Snapshot(errors=one)) is None
    assert "with 5 samples" in page._progress_figure(Snapshot(errors=two)).caption
    assert "with 2 samples" in page._progress_figure(Snapshot(errors=one, sigmas=sigmas)).caption
