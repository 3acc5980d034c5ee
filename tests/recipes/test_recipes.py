"""Tests of the commands in the recipes, the tutorial and the README, run as printed."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from basecal.cell.files import latest_run, read_calibration
from basecal.cli import main
from tests.recipes.raw import RAW

ROOT = Path(__file__).parents[2]
LISTED = {
    path.stem: path for path in (*sorted((ROOT / "docs" / "recipes").glob("*.md")), ROOT / "docs" / "tutorial.md")
}
PAGES = {**LISTED, "README": ROOT / "README.md"}
NEEDED = {"lerobot": ("pyarrow",), "scene": ("rosbags", "pyarrow")}
QUICK = {"camera_beside", "touches", "tracker"}
"""Pages that run with the fast tests."""


DOUBTFUL = {"scene"}
"""Pages whose answer has to be checked by other means."""


def commands(page: Path) -> list[list[str]]:
    """Words of each command of a page, in order; a backslash continues a line."""
    blocks = re.findall(r"^```bash\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in sorted(PAGES)]
)
def test_documented_commands_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each command ends with 0, and every calibrated cell is good.

    A page whose answer is doubtful has cells that are doubtful, with exit code 1. The error of the README's ten stops
    exceeds the stated tolerance: exit code 5.
    """
    for library in NEEDED.get(name, ()):
        pytest.importorskip(library, reason=f"the extra for {library} is not installed")
    RAW[name](tmp_path)
    monkeypatch.chdir(tmp_path)
    for program, *words in commands(PAGES[name]):
        assert program == "basecal"
        doubtful = name in DOUBTFUL and words[0] == "calibrate"
        missed = name == "README" and "--tolerance" in words
        assert main(words) == (5 if missed else int(doubtful)), (words, capsys.readouterr())
    folders = [each for each in (*tmp_path.iterdir(), *tmp_path.glob("examples/*")) if each.is_dir()]
    runs = [run for folder in folders if (run := latest_run(folder)) is not None]
    assert runs
    assert {read_calibration(run).verdict for run in runs} == {"doubtful" if name in DOUBTFUL else "good"}


def test_every_page_is_tested_and_listed() -> None:
    """Pages, raw files, the contents of the documentation and the list of recipes have the same names."""
    assert {*RAW} == {*PAGES}
    contents = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    for name, path in LISTED.items():
        assert f"- {path.relative_to(ROOT / 'docs')}\n" in contents, name
        assert commands(path), name
