"""Tests of the page in a browser: picker, copy buttons, slider, scene and print."""

from __future__ import annotations

import base64
import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.shared.browser import browsing
from tests.shared.page_faults import faults
from tests.situations import find_faults, situations

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.fit_details import fit_details
from basecal.reporting.page import page
from basecal.simulation import Scenario, simulate

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
LONGEST_S = 120  # on a busy machine
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
# Simulates a user, and stores the visible state in an attribute of the document.
USER = """
document.addEventListener("scene", async () => {
  const shown = () => [...document.querySelectorAll(".answer .copy")].filter((pane) => !pane.hidden);
  const choose = (box, value) => { box.value = value; box.dispatchEvent(new Event("change")); };
  const slider = document.getElementById("sample");
  const said = { first: shown().map((pane) => pane.dataset.kind) };
  document.querySelector(".answer .chip[data-kind=ur]").click();
  said.pressed = [...document.querySelectorAll(".answer .chip[aria-pressed=true]")].map((chip) => chip.textContent);
  said.kinds = [...new Set(shown().map((pane) => pane.dataset.kind))];
  const ways = document.querySelector(".answer .way");
  choose(ways, ways.options[1].value);
  said.ways = shown().map((pane) => pane.dataset.way);
  said.wanted = ways.value;
  const button = shown()[0].querySelector("button");
  document.querySelector(".copy-answer").click();
  await new Promise((done) => setTimeout(done, 100));
  said.button = button.textContent;
  said.selected = String(window.getSelection());
  said.pasted = shown()[0].querySelector("pre").textContent;
  said.opening = document.querySelector(".slider output").textContent;
  slider.value = 3;
  slider.dispatchEvent(new Event("input"));
  said.moved = document.querySelector(".slider output").textContent;
  const bars = [...document.querySelectorAll("[data-sample]")];
  said.chosen = [...new Set(bars.filter((bar) => bar.classList.contains("chosen")).map((bar) => bar.dataset.sample))];
  bars.find((bar) => bar.dataset.sample === "7").dispatchEvent(new MouseEvent("click", { bubbles: true }));
  said.after_a_bar = slider.value;
  said.plain = window.sceneAsGltf().nodes.length;
  document.querySelector("[data-ghosts]").click();
  said.gltf = window.sceneAsGltf();
  // Chromium may load a page again to print it, with what was chosen before.
  if (!sessionStorage.getItem("said")) sessionStorage.setItem("said", JSON.stringify(said));
  document.documentElement.dataset.said = sessionStorage.getItem("said");
});
"""

pytestmark = [
    pytest.mark.journey,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium, which is not installed here"),
]


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """File with a page."""
    made = simulate(Scenario(samples=12, robot_noise=(1e-4, 2e-4)), 4)
    calibration = calibrate(made.cell, made.recording)
    path = tmp_path_factory.mktemp("page") / "report.html"
    details = fit_details(made.cell, made.recording, calibration)
    path.write_text(page(made.cell, made.recording, calibration, details), encoding="utf-8")
    return path


def browser(path: Path, *words: str) -> str:
    """Output of the browser for a page."""
    assert CHROMIUM is not None
    profile = f"--user-data-dir={path.parent / 'profile'}"
    command = [CHROMIUM, *FLAGS, profile, *words, path.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=LONGEST_S, check=True).stdout


def use_page(path: Path) -> dict[str, Any]:
    """State of a page after a simulated user picks, copies and slides; the policy is removed for its script."""
    text = POLICY.sub("", path.read_text(encoding="utf-8"), count=1).replace(
        "</body>", f"<script>{USER}</script></body>"
    )
    tried = path.with_name("tried.html")
    tried.write_text(text.replace("</body>", f"<script>{USER}</script></body>"), encoding="utf-8")
    found = re.search(r'data-said="([^"]*)"', browser(tried, "--virtual-time-budget=3000", "--dump-dom"))
    assert found is not None, "a script of the page ended with an error"
    state: dict[str, Any] = json.loads(html.unescape(found[1]))
    return state


def test_picker_copy_button_and_slider_work(page_file: Path) -> None:
    """Exactly one pane is shown for a format and a direction, and the copied text is the shown one.

    The slider and the bars select the same sample.
    """
    state = use_page(page_file)
    assert len(state["first"]) == 1
    assert state["kinds"] == state["pressed"] == ["ur"]
    assert state["ways"] == [state["wanted"]]
    assert state["button"] in ("copied", "selected")
    assert state["selected"].strip() == state["pasted"].strip() != ""
    assert state["opening"].endswith("deg")
    assert ", the worst" in state["opening"]
    assert state["moved"].startswith("sample 3")
    assert state["chosen"] == ["3"]
    assert state["after_a_bar"] == "7"


def test_answer_table_fits_at_all_widths(page_file: Path, tmp_path: Path) -> None:
    """The table of an answer fits its card from 390 to 700 px.

    A table that does not fit has a shade at the edge beyond which it continues.
    """
    narrowed = "document.querySelector('.answer .scroll').style.width = '3rem'"
    shade = "getComputedStyle(document.querySelector('.answer .scroll')).backgroundImage.includes('gradient')"
    beyond = "(box => box.scrollWidth - box.clientWidth)(document.querySelector('.answer .scroll'))"
    with browsing(tmp_path) as tab:
        for width in (390, 479, 485, 500, 530, 560, 605, 700):
            tab.resize(width, 900)
            tab.go(page_file.as_uri(), ".answer .scroll")
            assert tab.value(beyond) == 0, width
        tab.value(narrowed)
        assert tab.value(beyond) > 0
        assert tab.value(shade)


def test_scene_is_unpacked_under_the_policy(page_file: Path, tmp_path: Path) -> None:
    """The scene replaces the still image, and the slider shows its sample. No request and no script error occurs."""
    with browsing(tmp_path) as tab:
        tab.go(page_file.as_uri(), selector=".live:not([hidden]) canvas")
        assert tab.value("document.querySelector('.live canvas') !== null && document.querySelector('.still').hidden")
        assert tab.value("document.querySelector('.slider output').textContent").startswith("sample ")
        assert tab.visit.errors == []
        assert [address for address in tab.visit.requests if not address.startswith(("file:", "data:"))] == []


def test_scene_is_exported_as_gltf(page_file: Path) -> None:
    """The exported nodes have the cell's names and poses, and include the other samples if they are shown.

    All numbers are in the buffer.
    """
    state = use_page(page_file)
    made = state["gltf"]
    assert len(made["nodes"]) > state["plain"] + 10
    data = base64.b64decode(made["buffers"][0]["uri"].partition(",")[2])
    assert len(data) == made["buffers"][0]["byteLength"]
    assert all(view["byteOffset"] + view["byteLength"] <= len(data) for view in made["bufferViews"])
    nodes = {node.get("name"): node for node in made["nodes"]}
    assert {"world", "eye_base", "hand_base", "wrist", "board"} <= nodes.keys()
    scene = json.loads(re.search(r'id="scene-data">(.*?)</script>', page_file.read_text(encoding="utf-8"))[1])
    for arm in scene["arms"]:
        assert nodes[f"{arm['name']}_base"]["matrix"][12:15] == pytest.approx(arm["world_from_base"][:3])
    for accessor in made["accessors"]:
        view = made["bufferViews"][accessor["bufferView"]]
        kind = {5126: np.float32, 5123: np.uint16, 5125: np.uint32}[accessor["componentType"]]
        size = accessor["count"] * (3 if accessor["type"] == "VEC3" else 1)
        values = np.frombuffer(data, kind, size, view["byteOffset"])
        if "min" in accessor:
            np.testing.assert_allclose(values.reshape(-1, 3).min(0), accessor["min"], rtol=1e-6)


def test_page_prints_on_two_sheets(page_file: Path) -> None:
    """The printed page has two sheets."""
    browser(page_file, "--no-pdf-header-footer", f"--print-to-pdf={page_file.with_suffix('.pdf')}")
    assert len(re.findall(rb"/Type\s*/Page[^s]", page_file.with_suffix(".pdf").read_bytes())) == 2


def test_no_text_is_cut_at_any_size(tmp_path: Path) -> None:
    """No text is cut and no request is made at three window sizes, in light and dark colours.

    Pages of several situations are tested.
    """
    shown = {name: made for name, made in situations() if name in ("fail", "empty", "three_robots")}
    paths = []
    for name, (cell, recording, calibration, details) in shown.items():
        paths.append(tmp_path / f"{name}.html")
        paths[-1].write_text(page(cell, recording, calibration, details, title=name), encoding="utf-8")
    assert list(find_faults(paths, None, keeps_images=False)) == []
    with browsing(tmp_path / "profile") as tab:
        tab.go(paths[0].as_uri())
        tab.value("document.querySelector('.note').style = 'position: absolute; left: 99%; white-space: nowrap'")
        assert any("beyond the window" in fault for fault in faults(tab))
