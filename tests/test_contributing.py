"""Tests of the examples of CONTRIBUTING.md: each adds its kind to a copy of the tree, and its commands run."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.words import DOCUMENTS

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
STEP = re.compile(
    r"^(?P<how>New file|In|At the end of|Try it)(?: `(?P<path>\S+?)`)?"
    r"(?:, (?P<where>after|instead of) `(?P<line>[^\n]+)`)?[^`\n]*:\n\n"
    r"```\w*\n(?P<block>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)


class Step(NamedTuple):
    """A step of an example: the file, the line after or instead of which lines are written, and these lines."""

    how: str
    path: str | None
    where: str | None
    line: str | None
    block: str


def examples() -> dict[str, list[Step]]:
    """The steps of each kind, by the heading of its section."""
    sections = re.split(r"\n### (?=An? )", TEXT)[1:]
    return {each.partition("\n")[0]: [Step(*found.groups()) for found in STEP.finditer(each)] for each in sections}


def take(step: Step, tree: Path) -> None:
    """Carry out a step."""
    if step.how == "Try it":
        programs = {".venv/bin/python": sys.executable, "basecal": f"{sys.executable} -m basecal"}
        path = os.pathsep.join(str(tree / each) for each in ("src", "tests", "."))
        for line in step.block.splitlines():
            settings, program, rest = re.fullmatch(r"((?:\w+=\S* )*)(\S+)(.*)", line).groups()  # type: ignore[union-attr]
            command = f"{settings}{programs.get(program, program)}{rest}"
            ended = subprocess.run(
                command, shell=True, cwd=tree, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True
            )
            assert ended.returncode == 0, f"{line}\n{ended.stdout}\n{ended.stderr}"
        return
    assert step.path is not None
    path = tree / step.path
    if step.how == "New file":
        assert not path.exists()
        path.write_text(step.block, encoding="utf-8")
        return
    text = path.read_text(encoding="utf-8")
    if step.how == "At the end of":
        path.write_text(text + step.block, encoding="utf-8")
        return
    assert text.count(f"\n{step.line}\n") == 1, step.line
    kept = f"{step.line}\n" if step.where == "after" else ""
    path.write_text(text.replace(f"\n{step.line}\n", f"\n{kept}{step.block}"), encoding="utf-8")


def faults_of_words(tree: Path) -> str:
    """Complaints about names and sentences of a tree."""
    modes = (["sentences"], ["names", "--faults"])
    return "".join(
        subprocess.run(
            [sys.executable, "-m", "tests.words", *mode], cwd=tree, capture_output=True, text=True, check=True
        ).stdout
        for mode in modes
    )


def copy_tree(folder: Path) -> None:
    """Copy what examples change, and what their tests read."""
    for name in ("src", "tests", "docs"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "mkdocs.yml", *DOCUMENTS):
        shutil.copy(ROOT / name, folder / name)


@pytest.mark.journey
@pytest.mark.parametrize(
    "command", [["ruff", "check"], ["ruff", "format", "--check"], ["mypy", "--cache-dir", "cache"]], ids=" ".join
)
def test_examples_pass_lint(command: list[str], tmp_path: Path) -> None:
    """All of them together, in the files that they make or change."""
    pytest.importorskip(command[0])
    copy_tree(tmp_path)
    made: dict[str, None] = {}
    for step in (step for steps in examples().values() for step in steps if step.path is not None):
        take(step, tmp_path)
        made |= {str(step.path): None} if str(step.path).endswith(".py") else {}
    ended = subprocess.run(
        [sys.executable, "-m", *command, *made], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr


@pytest.mark.journey
@pytest.mark.parametrize("kind", examples())
def test_example_adds_its_kind(kind: str, tmp_path: Path) -> None:
    """The example needs only the files and lines that it names."""
    copy_tree(tmp_path)
    steps = examples()[kind]
    assert steps[0].how == "New file"
    assert steps[-1].how == "Try it"
    for step in steps:
        take(step, tmp_path)
    assert faults_of_words(tmp_path) == ""


@pytest.mark.parametrize("kind", examples())
def test_table_lists_the_files_of_the_example(kind: str) -> None:
    """The table has NAME for the module's name, and the test below, which the rules of the house require."""
    row = re.search(rf"^\| {kind.lower()} \|(.*)$", TEXT, re.MULTILINE)
    assert row is not None, f"the table of files lacks {kind.lower()}"
    stated = set(re.findall(r"`(\S+)`", row[1]))
    steps = examples()[kind]
    module = steps[0].path
    assert module is not None
    made = {step.path for step in steps if step.path} - {module} | {
        module.replace(f"{Path(module).stem}.py", "NAME.py")
    }
    own_test = re.sub(r"src/basecal/(.*)/(\w+)\.py", r"tests/\1/test_NAME.py", module)
    assert stated - {"docs/draw_targets.py"} == made | {own_test}


def test_every_kind_has_an_example() -> None:
    """Each kind with a table has an example."""
    kinds = {"An exporter", "An importer", "A finding", "An effect", "A target", "A lens", "A driver"}
    assert examples().keys() == kinds
