"""Tests of the parsing of typed arguments."""

from __future__ import annotations

import pytest

from basecal.cli import build_app, main
from basecal.cli.typed_words import normalise_words, typed_command


@pytest.mark.parametrize(
    ("typed", "words"),
    [
        (["--task-point", "0.8 -0.1 0.3", "--json"], ["--task-point", "0.8", "-0.1", "0.3", "--json"]),
        (["--task-point", "-1, 2, 3"], ["--task-point", "-1", "2", "3"]),
        (["--task-box=0 0 0 1 1 1"], ["--task-box", "0", "0", "0", "1", "1", "1"]),
        (["--task-point", "1", "2", "3"], ["--task-point", "1", "2", "3"]),
        (["plan", "a cell", "--output=b c"], ["plan", "a cell", "--output=b c"]),
        (["--task-point", ""], ["--task-point", ""]),
    ],
)
def test_quoted_numbers_are_split(typed, words):
    """They are split only after options of several numbers."""
    assert list(normalise_words(typed)) == words


def test_command_is_a_line_to_paste():
    """Omitted options are left out; words are quoted for a shell, numbers are separate words."""
    options = {
        "--tolerance": "0.2 mm",
        "--task-point": (0.8, -0.1, 0.0),
        "--samples": None,
        "--seed": 0,
        "--anew": True,
    }
    line = typed_command("basecal plan mycell", options)
    assert line == "basecal plan mycell --tolerance '0.2 mm' --task-point 0.8 -0.1 0 --anew"
    assert typed_command("basecal plan mycell", {"--touches": False}) == "basecal plan mycell"


@pytest.mark.parametrize("words", ["--scene a", "a --scene", "--scene --json a"])
def test_scene_alone_takes_no_argument(words):
    """The folder after `--scene` is the folder of the cell."""
    assert arguments(words) == ("a", True)


@pytest.mark.parametrize("words", ["--scene also a", "a --scene also", "--scene=also a"])
def test_scene_beside_targets(words):
    assert arguments(words) == ("a", "also")


def arguments(words):
    """Folder of the cell and scene that `calibrate` receives for the given words."""
    typed = list(normalise_words(["calibrate", *words.split()]))
    _, bound, _ = build_app(typed).parse_args(typed, exit_on_error=False, print_error=False)
    return str(bound.arguments["cell"]), bound.arguments["scene"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("import poses c a.csv --robot r --session day2", "more words than expected: 'day2'; --session takes no value"),
        ("import poses c --session day2 a.csv", "more words than expected: 'a.csv'; --session takes no value"),
        ("import poses c a.csv --session=day2", "--session takes no value: leave 'day2' out"),
        ("calibrate c --json --verbose no", "more words than expected: 'no'; --verbose takes no value"),
        ("fix c d", "more words than expected: 'd'"),
    ],
)
def test_value_of_a_flag_is_reported(words: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    """For each verb the message uses the user's words, not those of the parser."""
    assert main(words.split()) == 2
    assert capsys.readouterr().err == f"basecal: error: {message}\n"


def test_no_arguments_print_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    """The command is `basecal` alone."""
    assert main([]) == 0
    assert "Usage: basecal COMMAND" in capsys.readouterr().out
