"""The page of a cell's runs in a browser: what it says, and whom it asks."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import urlsplit

import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.reporting.viewing.page import Viewed, serve_view
from basecal.simulation import Scenario, simulate
from shared.browser import CHROMIUM, another_page, visit
from shared.needed import needed

needed("nicegui", "web")
pytestmark = pytest.mark.filterwarnings("ignore")  # of NiceGUI's own libraries


@pytest.mark.journey
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed: apt-get install chromium")
def test_in_a_browser(tmp_path: Path) -> None:
    """The answer with all samples, the first sample, a box for each; no error in the console, nobody else is asked."""
    made = simulate(Scenario(samples=12), 4)
    calibration = calibrate(made.cell, made.recording)
    viewed = Viewed(made.cell, made.recording, tmp_path, ("20260102T030405Z",), lambda name: calibration)
    another_page()
    with serve_view(viewed) as address:
        came = visit(address, tmp_path / "profile", until=".q-checkbox:nth-of-type(12)")
        assert urlsplit(address).hostname == "127.0.0.1"
    assert came.errors == []
    assert {urlsplit(asked).hostname for asked in came.asked if not asked.startswith("data:")} == {"127.0.0.1"}
    assert "samples that count" in came.words
