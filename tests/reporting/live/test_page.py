"""The local page of a capture: what it shows, whom it serves, whom it asks."""

from __future__ import annotations

import sys
import urllib.error
import urllib.request
from dataclasses import replace
from urllib.parse import urlsplit

import numpy as np
import pytest

from basecal.acquisition.capture import Step
from basecal.acquisition.coverage import COVERAGE_GRID, Coverage
from basecal.acquisition.watching import Watch
from basecal.cell import RobotState
from basecal.cell.targets.charuco import charuco_target
from basecal.errors import InputError, MissingExtra
from basecal.geometry import SE3, Camera
from basecal.reporting.live import page
from basecal.vision.draw.render import render
from shared.browser import CHROMIUM, another_page, visit
from shared.facing_arms import facing_arms
from shared.needed import needed

needed("nicegui", "web")
pytestmark = pytest.mark.filterwarnings("ignore")  # of NiceGUI's own libraries

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
    watch.tell("sample 3: arms move")
    return watch


def status(address, **headers):
    try:
        return urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=60).status
    except urllib.error.HTTPError as refused:
        return refused.code


@pytest.fixture(scope="module")
def address(cell):
    another_page()
    with page.serve_page(captured(cell), cell) as at:
        yield at


def test_only_who_has_the_token_is_served(address):
    """Without it, with another, from another page or by another name nothing is answered but a refusal."""
    bare = address.partition("?")[0]
    assert status(address) == 200
    assert status(bare) == status(f"{bare}?token=wrong") == 403
    assert status(f"{bare}_nicegui/anything") == 403
    assert status(address, Origin="http://evil.example") == 403
    assert status(address, Host="evil.example") == 403
    port = urlsplit(address).port
    assert status(bare, Cookie=f"basecal={address.partition('token=')[2]}") == 403  # of another port's page
    assert status(bare, Cookie=f"basecal_{port}={address.partition('token=')[2]}") == 200


def test_it_is_served_on_this_machine_alone(address):
    """On the loopback address."""
    assert urlsplit(address).hostname == "127.0.0.1"


def test_a_port_that_is_taken_is_told(address, cell):
    """In a line."""
    with pytest.raises(InputError, match="cannot be used"), page.serve_page(Watch(), cell, urlsplit(address).port):
        pass


def test_without_nicegui_the_extra_is_named(monkeypatch, cell):
    """One line says what to install."""
    monkeypatch.setitem(sys.modules, "nicegui", None)
    with pytest.raises(MissingExtra, match=r"basecal\[web\]"), page.serve_page(Watch(), cell):
        pass


@pytest.mark.journey
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed: apt-get install chromium")
def test_in_a_browser(address, tmp_path):
    """It shows step, advice, sigma, picture, detections and arms; no error in the console, nobody else is asked."""
    came = visit(address, tmp_path, until="body:has(canvas) svg path[stroke='#ff3b30']")
    assert came.errors == []
    assert {urlsplit(asked).hostname for asked in came.asked if not asked.startswith("data:")} == {"127.0.0.1"}
    for words in ("sample 3: arms move", "turn hand further about y", "sample 2: taken", "7 taken, 25 planned"):
        assert words in came.words
