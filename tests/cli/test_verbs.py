"""Tests of the command line: help, usage, exit codes and new."""

from __future__ import annotations

import inspect
import io
import re
import subprocess
import sys
import textwrap
from contextlib import redirect_stdout
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest
from rich.console import Console

from basecal.cell.files import read_cell, read_recording
from basecal.cli import _VERBS, build_app, main
from basecal.exchange.importers.registry import IMPORTERS
from pose_files import options, pose_files

VERBS = ["new", "simulate", "demo", "calibrate", "report", "export", "merge", "study"]
VERBS += [f"import {kind}" for kind in IMPORTERS]


@cache
def help_of(verb: str) -> str:
    """Output of `--help` of a verb, which exits with code 0."""
    with redirect_stdout(io.StringIO()) as told:
        assert main([*verb.split(), "--help"]) == 0
    return told.getvalue()


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help_with_an_example(verb: str) -> None:
    """`--help` of a verb has an example with its name, and exits with code 0."""
    told = help_of(verb)
    assert "For example:" in told
    assert f"    basecal {verb}" in told


BARE_OPTION = re.compile(r"^│ (?:\* {2}| {3})?(--[\w-]+)(?: [A-Z.]+)* +(?:\[.*)?│$", re.MULTILINE)


@pytest.mark.parametrize("verb", dict.fromkeys([*_VERBS, *VERBS]))
def test_every_option_has_help(verb: str) -> None:
    """Text is beside the name of each option, before its choices and its default."""
    bare = BARE_OPTION.findall(help_of(verb))
    assert not bare, f"describe {', '.join(bare)} under `Args:` in the docstring of the function behind {verb!r}"


@pytest.mark.parametrize("verb", [*_VERBS])
def test_examples_are_not_wrapped(
    verb: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a terminal of 80 columns each example is one unchanged line."""
    monkeypatch.setenv("COLUMNS", "80")
    assert main([verb, "--help"]) == 0
    told = capsys.readouterr().out
    assert [line for line in written_examples(verb) if line not in told.splitlines()] == []


@pytest.mark.parametrize(
    "verb", ["", *dict.fromkeys([*_VERBS, *VERBS, "import", "driver", "driver check", "study paper"])]
)
def test_help_text_is_wrapped_to_the_terminal(verb: str) -> None:
    """The text above the tables has the same words on 80 and on 300 columns, and its lines fill the terminal."""
    texts = []
    for width in (80, 300):
        text = io.StringIO()
        build_app(verb.split()).help_print(verb.split(), console=Console(file=text, width=width))
        usage, *paragraphs = text.getvalue().partition("╭")[0].split("\n\n")
        texts.append([paragraph.split() for paragraph in paragraphs])
        assert usage.startswith("Usage: ")
        assert len(paragraphs[0].splitlines()) == len(textwrap.wrap(paragraphs[0].replace("\n", " "), width))
    assert texts[0] == texts[1]


def written_examples(verb: str) -> list[str]:
    """Examples in the docstring of a verb."""
    function = getattr(import_module(f"basecal.cli.{verb}"), verb)
    lines = inspect.cleandoc(function.__doc__ or "").splitlines()
    return [line for line in lines if line.startswith("    basecal ")]


def test_help_lists_the_verbs(capsys: pytest.CaptureFixture[str]) -> None:
    """`--help` names each verb, and `--version` prints the package's version."""
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    assert all(verb.split()[0] in told for verb in VERBS)
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip()[0].isdigit()


@pytest.mark.parametrize("verb", [*_VERBS])
def test_list_of_verbs_uses_their_first_sentences(verb: str) -> None:
    """The line of a verb in the list is the first sentence of its help."""
    told = getattr(import_module(f"basecal.cli.{verb}"), verb).__doc__
    assert " ".join(told.split("\n\n")[0].split()) == _VERBS[verb]


@pytest.mark.parametrize(
    "words",
    [
        ["calibrat"],
        ["new"],
        ["new", "x", "--robots", "two"],
        ["new", "x", "--robots", "0"],
        ["new", "x", "--target", "unicorn"],
        ["new", "x", "--bogus"],
        ["simulate", "x", "--pixel-px", "-1"],
        ["simulate", "x", "--pixel-px", "nan"],
        ["simulate", "x", "--seed", "-1"],
        ["study"],
        ["study", "x.yaml", "--workers", "0"],
        ["study", "paper", "--seed", "-1"],
        ["study", "paper", "--draws", "1"],
        ["import", "poses", "x", "--camera-from-target", "b.txt"],
        ["import", "poses", "x", "--camera-from-target", "b.txt", "--length-unit", "mile"],
        ["import", "poses", "x", "--camera-from-target", "b.txt", "--length-unit", "m", "--invert", "everything"],
    ],
)
def test_wrong_usage_exits_with_code_2(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """Wrong usage is one line on stderr."""
    assert main(words) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("basecal: error: ")
    assert said.err.count("\n") == 1


@pytest.mark.journey
def test_process_exit_code(tmp_path: Path) -> None:
    """The process ends with the code, without a traceback."""
    ended = subprocess.run(
        [sys.executable, "-m", "basecal", "calibrate", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 3
    assert ended.stdout == ""
    assert ended.stderr.startswith("basecal: error: ")
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize("robots", [1, 2, 3, 4])
@pytest.mark.parametrize("target", ["charuco", "chessboard", "circles", "apriltag", "points", "led", "pose"])
def test_new_cells_can_be_read(tmp_path: Path, robots: int, target: str) -> None:
    """A new cell is readable for each kind of target and number of robots, with all transforms free."""
    assert main(["new", str(tmp_path / "c"), "--robots", str(robots), "--target", target]) == 0
    cell = read_cell(tmp_path / "c")
    assert len(cell.robots) == robots
    assert {unknown.status for unknown in cell.transforms.values()} == {"free"}
    assert len(cell.transforms) == 3 * max(robots - 1, 0) + (2 if robots == 1 else 0)
    assert read_recording(tmp_path / "c").samples == ()


def test_new_explains_every_transform(tmp_path: Path) -> None:
    """The comments of a new cell name each transform like the library."""
    main(["new", str(tmp_path), "--robots", "3"])
    text = (tmp_path / "cell.yaml").read_text()
    assert all(f"# {name}" in text for name in read_cell(tmp_path).transforms)


def test_existing_cells_are_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`new`, `simulate` and `demo` refuse a folder with a cell; a table of complete rows is added to the recording."""
    folder = str(tmp_path / "c")
    assert main(["simulate", folder, "--samples", "1"]) == 0
    before = {path: path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()}
    capsys.readouterr()
    for words in (["new", folder], ["simulate", folder], ["demo", folder]):
        assert main(words) == 3
        assert "not overwritten" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()} == before
    importing = ["import", "poses", folder, *options(pose_files(tmp_path, 3)), "--length-unit", "m"]
    assert main(importing) == 0
    count = len(read_recording(folder).samples)
    assert count == 4
    assert main(importing) == 3
    assert "is recorded already" in capsys.readouterr().err
    assert len(read_recording(folder).samples) == count


@pytest.mark.parametrize(("verb", "name"), [("driver", "check"), ("study", "paper")])
def test_list_of_one_command_describes_it(verb: str, name: str) -> None:
    """The line is the beginning of the first sentence of the command's help."""
    (line,) = re.findall(rf"^│ {name} +(.*?) +│$", help_of(verb), re.MULTILINE)
    assert line
    assert help_of(f"{verb} {name}").split("\n\n")[1].startswith(line)


@pytest.mark.parametrize("verb", ["new", "import images", "merge"])
def test_option_without_a_default_shows_none(verb: str) -> None:
    """An empty tuple and None are no values that can be typed."""
    assert re.findall(r"\[default:\s(?:\(\)|None)", help_of(verb)) == []
