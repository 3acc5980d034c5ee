"""What reaches a terminal, and what happens where there is none."""

from __future__ import annotations

import io
import os
import shlex
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from basecal.cli import main, terminal
from basecal.cli.terminal import ask, quote_path, say, say_verdict
from basecal.errors import UsageError, printable

CLI = Path(__file__).parents[2] / "src" / "basecal" / "cli"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain, ü 漢, two\nlines", "plain, ü 漢, two\nlines"),
        ("\x1b[2J\x07\r\b\x7f\x9b", "\\x1b[2J\\x07\\r\\x08\\x7f\\x9b"),
        ("\u202egnp.exe", "\\u202egnp.exe"),
        ("bad\udcff", "bad\\udcff"),
    ],
)
def test_a_terminal_is_not_steered(text: str, shown: str) -> None:
    """What a terminal would obey or turn around is written out."""
    assert printable(text) == shown


def test_a_stream_that_cannot_hold_a_letter() -> None:
    """Letters that its encoding lacks are written out."""
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii")
    say("ü", stream)
    stream.flush()
    assert raw.getvalue() == b"\\xfc\n"


@pytest.mark.parametrize("name", ["my cell", "a;touch b", "$(x)", "plain", "it's"])
def test_a_path_to_paste_is_one_word(name: str) -> None:
    """Whatever it is called."""
    assert shlex.split(quote_path(Path(name))) == [name]


@pytest.mark.parametrize(("answer", "error"), [("y\n", ""), ("YES\n", ""), ("n\n", "refused"), ("", "refused")])
def test_a_question_needs_a_yes(answer: str, error: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """No other word, and no end of the input, is one; without a terminal nobody is asked."""
    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    with pytest.raises(UsageError, match="unasked"):
        ask("Really?", "unasked", "refused")
    monkeypatch.setattr(terminal, "is_terminal", lambda stream: True)
    with pytest.raises(UsageError, match=error) if error else nullcontext():
        ask("Really?", "unasked", "refused")


def test_everything_is_said_by_one_function() -> None:
    """No verb prints by itself, past what guards the terminal."""
    printing = [path.name for path in CLI.glob("*.py") if " print(" in path.read_text(encoding="utf-8")]
    assert printing == ["terminal.py"]


def run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A shell's command, `basecal` and the folder in it."""
    whole = command.replace("basecal", f"{shlex.quote(sys.executable)} -m basecal").replace("CELL", str(folder / "c"))
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.run(["sh", "-c", whole], capture_output=True, text=True, check=False, env=buffered)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("basecal new CELL >&-", "stdout: cannot be written to, it is closed"),
        ("basecal simulate CELL --samples 3 --json >/dev/full", "No space left on device"),
    ],
)
def test_an_answer_that_goes_nowhere_is_an_error(command: str, said: str, tmp_path: Path) -> None:
    """A closed or a full output is one line and exit code 3, not silence."""
    ended = run(command, tmp_path)
    assert ended.returncode == 3
    assert said in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_without_an_error_stream(tmp_path: Path) -> None:
    """The answer does not need it, and an error has its exit code."""
    assert run("basecal simulate CELL --samples 3 --json 2>&-", tmp_path).returncode == 0
    assert run("basecal new CELL 2>&-", tmp_path).returncode == 3


def test_names_of_images_do_not_steer_a_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing that a file holds arrives as an escape sequence."""
    main(["simulate", str(tmp_path / "c"), "--samples", "3"])
    samples = tmp_path / "c" / "recording" / "samples.jsonl"
    samples.write_text(samples.read_text().replace('"eye"', '"\\u001b[2J"', 1))
    capsys.readouterr()
    assert main(["calibrate", str(tmp_path / "c")]) == 3
    assert "\x1b" not in "".join(capsys.readouterr())


def test_several_mistakes_name_their_file_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The line of each follows, on one line."""
    main(["new", str(tmp_path)])
    path = tmp_path / "cell.yaml"
    path.write_text(path.read_text().replace("squares:", "squars:").replace("model: pinhole", "model: pinhol"))
    capsys.readouterr()
    assert main(["calibrate", str(tmp_path)]) == 3
    said = capsys.readouterr().err
    assert said.count("cell.yaml") == 1
    assert said.count("; line ") >= 2
    assert said.count("\n") == 1


class Watched(io.StringIO):
    """A stream that somebody watches."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("settings", "is_coloured"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)]
)
def test_a_verdict_has_a_colour(settings: dict[str, str], is_coloured: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its first word alone, where somebody watches and allows it."""
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    stream = Watched()
    monkeypatch.setattr(sys, "stdout", stream)
    say_verdict("FAIL: 3 mm\n\x1b[2J", "refused")
    word = "\x1b[1;31mFAIL\x1b[0m" if is_coloured else "FAIL"
    assert stream.getvalue() == f"{word}: 3 mm\n\\x1b[2J\n"
    plain = io.StringIO()
    monkeypatch.setattr(sys, "stdout", plain)
    say_verdict("FAIL: 3 mm", "refused")
    assert plain.getvalue() == "FAIL: 3 mm\n"
