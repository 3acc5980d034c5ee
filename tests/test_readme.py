"""Tests of the README: its code runs, and its figures are measured."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path
from shutil import copytree
from statistics import median
from xml.etree.ElementTree import fromstring

import pytest
from benchmarks.readme import figures, sentences, updated
from markdown_it import MarkdownIt

from basecal.cli import main

ROOT = Path(__file__).parents[1]


TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def test_library_example_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The Python example runs unchanged, and prints a good result and its report."""
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    monkeypatch.chdir(ROOT)
    exec(code, {})
    printed = capsys.readouterr().out
    assert printed.startswith("good\n")
    assert "GOOD: expected error " in printed


@pytest.mark.journey
def test_report_equals_the_output_of_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The printed report equals the output of the command beside it."""
    copytree(ROOT / "examples" / "ur5e_dual", tmp_path / "ur5e_dual")
    assert main(["calibrate", str(tmp_path / "ur5e_dual")]) == 0
    shown = re.search(r"```text\n(.*?)```", TEXT, re.DOTALL)
    assert shown is not None
    assert capsys.readouterr().out == shown[1]
    picture = runpy.run_path(str(ROOT / "docs" / "draw_demo.py"))["drawing"](tmp_path / "ur5e_dual")
    assert fromstring(picture).tag.endswith("svg")
    assert picture.count('class="frame ') == 12
    assert shown[1].splitlines()[2].split()[1] in picture


def test_image_shows_the_demo() -> None:
    """The image is small, still for readers who prefer reduced motion, and shows the verdict of a run."""
    picture = (ROOT / "docs" / "figures" / "demo.svg").read_text(encoding="utf-8")
    assert len(picture) < 300_000
    assert "basecal demo" in picture
    assert ">GOOD</tspan>: expected error" in picture
    assert "prefers-reduced-motion" in picture
    panel = float(re.findall(r'<rect width="([\d.]+)"', picture)[1])
    rows = ["".join(row.itertext()) for row in fromstring(picture).iter() if row.get("x") == "20"]
    assert 20 + 8.5 * max(map(len, rows)) <= panel  # of letters of 14 px that all are as wide


def test_first_screen_has_the_setup_commands() -> None:
    """The image and existing targets of the Makefile come before any heading."""
    first = TEXT[: TEXT.index("\n## ")]
    targets = re.findall(r"^make (\w+)", first, re.MULTILINE)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert targets == ["demo", "test"]
    assert all(f"\n{target}: " in makefile for target in targets)
    assert "docs/figures/demo.svg" in first


def test_first_figure_is_measured() -> None:
    """The figure is the median over the pairs of recordings in the stored results."""
    rows = json.loads((ROOT / "benchmarks" / "results" / "two_arms.json").read_text(encoding="utf-8"))["rows"]
    theirs, ours = (median(row[key][0] for row in rows) for key in ("opencv", "ours"))
    assert f"**Calibrate twice and concatenate: {theirs:.1f} mm. basecal: {ours:.1f} mm.**" in TEXT


def test_figures_are_measured() -> None:
    """The table and the sentences above it equal the output of `python -m benchmarks.readme` for the stored results."""
    assert updated(TEXT) == TEXT
    stale = TEXT
    for shown in (figures(), sentences()):
        stale = stale.replace(shown, shown.replace("1", "7"))
    assert stale != TEXT
    assert updated(stale) == TEXT


@pytest.mark.journey
def test_plots_equal_the_output_of_the_script() -> None:
    """Each file has the same elements up to rounding, and a document shows each."""
    files = runpy.run_path(str(ROOT / "docs" / "draw_plots.py"))["drawings"]()
    figures = ROOT / "docs" / "figures"
    assert {path.name for path in figures.glob("plot_*.svg")} == files.keys()
    shown = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md"))
    for name, drawn in files.items():
        stored = (figures / name).read_text(encoding="utf-8")
        assert re.findall(r"<(\w+)", stored) == re.findall(r"<(\w+)", drawn)
        assert name in shown


def test_links_and_tables_are_valid() -> None:
    """As GitHub renders the README, each linked or shown file exists, and each table is complete."""
    rendered = MarkdownIt("commonmark").enable("table").render(TEXT)
    linked = [each for each in re.findall(r'(?:href|src)="([^"#]+)', rendered) if not each.startswith("http")]
    assert len(linked) > 10
    assert [each for each in linked if not (ROOT / each).exists()] == []
    assert rendered.count("<table>") == len(re.findall(r"^\|(?: ?-+ ?\|)+$", TEXT, re.MULTILINE)) == 3
    assert [line for line in rendered.splitlines() if line.startswith(("<p>|", "|"))] == []
