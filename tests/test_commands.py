"""Tests of commands in the documents: the program accepts each, and those of the page about exports run."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from basecal.cell.format.yaml_text import parse_yaml, yaml_text
from basecal.cli import build_app, main
from basecal.cli.typed_words import normalise_words
from tests.recipes.test_recipes import LISTED

ROOT = Path(__file__).parents[1]
PAGES = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", *sorted((ROOT / "examples").rglob("*.md"))]
BLOCK = re.compile(r"^```(?:bash|text|sh)?\n(.*?)^```|((?:^(?: {4}.*)?\n)+)", re.DOTALL | re.MULTILINE)
SCENE = """<robot name="scene"><link name="table"/><link name="hand"/>
<joint name="table_to_hand" type="fixed"><parent link="table"/><child link="hand"/></joint></robot>
"""


def commands(page: Path) -> Iterator[list[str]]:
    """Words of each command in a page's code blocks; lines that end in a backslash continue."""
    for fenced, indented in BLOCK.findall(page.read_text(encoding="utf-8")):
        for line in (fenced or indented).replace("\\\n", " ").splitlines():
            if words := shlex.split(line, comments=True) if line.strip().startswith("basecal ") else []:
                yield words[1:]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_documented_command_is_accepted(page: Path) -> None:
    """The verb, options and values exist; nothing is run."""
    app = build_app()
    for words in commands(page):
        app.parse_args(list(normalise_words(words)), exit_on_error=False, print_error=False)


def test_commands_are_found_in_code_blocks() -> None:
    """Fenced and indented blocks are read; each recipe has commands."""
    assert sum(len(list(commands(page))) for page in PAGES) > 100
    assert [name for name, page in LISTED.items() if not list(commands(page))] == []
    assert ["plan", "mycell", "--tolerance", "0.2mm", "--task-point", "0.8", "0.1", "0.3"] in list(
        commands(ROOT / "docs" / "plan.md")
    )


@pytest.mark.slow  # a calibration with all its checks
def test_documented_exports_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The exports run on a cell of two arms with URDFs and estimated joint offsets.

    They also run on a scene with the joint between the arms.
    """
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "mycell", "--joints", "--joint-offset-deg", "0.2", "--samples", "30"]) == 0
    path = tmp_path / "mycell" / "cell.yaml"
    data = parse_yaml(path.read_text(), str(path)).data
    for robot, base in (("eye", "table"), ("hand", "hand")):
        data["robots"][robot]["frames"] = {"base": base, "flange": "tool0"}
    data["robots"]["hand"]["joint_offsets"] = {"status": "prior", "sigma_rad": 0.005}
    path.write_text(yaml_text(data))
    main(["calibrate", "mycell"])
    for robot in ("eye", "hand"):
        (tmp_path / f"{robot}.urdf").write_bytes((tmp_path / "mycell" / f"{robot}.urdf").read_bytes())
    (tmp_path / "scene.urdf").write_text(SCENE)
    for words in commands(ROOT / "docs" / "exporting.md"):
        assert main(words) == 0, (words, capsys.readouterr())
