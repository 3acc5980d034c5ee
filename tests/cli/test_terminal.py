"""Tests of output to terminals, and of output without one."""

from __future__ import annotations

import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from basecal.accuracy.calibrate import JUDGING_STAGES, READING_STAGES, SOLVING_STAGES
from basecal.cell.files import read_cell
from basecal.cli import main, terminal
from basecal.cli.detect import detected_recording
from basecal.cli.terminal import (
    _SHARES,
    TimeLeft,
    ask,
    can_ask,
    is_terminal,
    print_json,
    print_stages,
    progress,
    progress_bar,
    quote_path,
    say,
    say_next,
    say_verdict,
)
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
def test_control_characters_are_escaped(text: str, shown: str) -> None:
    """Characters that a terminal would execute or reverse are escaped."""
    assert printable(text) == shown


def test_letters_outside_the_encoding_are_escaped() -> None:
    """Letters missing in the stream's encoding are escaped."""
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="ascii")
    say("ü", stream)
    stream.flush()
    assert raw.getvalue() == b"\\xfc\n"


@pytest.mark.parametrize("name", ["my cell", "a;touch b", "$(x)", "plain", "it's"])
def test_printed_path_is_one_shell_word(name: str) -> None:
    """Any name of a folder is one word."""
    assert shlex.split(quote_path(Path(name))) == [name]


@pytest.mark.parametrize(("answer", "error"), [("y\n", ""), ("YES\n", ""), ("n\n", "refused"), ("", "refused")])
def test_question_needs_yes(answer: str, error: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other answers and the end of the input count as no; without a terminal no question is asked."""
    monkeypatch.setattr("sys.stdin", io.StringIO(answer))
    with pytest.raises(UsageError, match="unasked"):
        ask("Really?", "unasked", "refused")
    monkeypatch.setattr(terminal, "is_terminal", lambda stream: True)
    with pytest.raises(UsageError, match=error) if error else nullcontext():
        ask("Really?", "unasked", "refused")


def test_all_output_passes_one_function() -> None:
    """No verb prints directly, around the escaping of control characters."""
    printing = [path.name for path in CLI.glob("*.py") if " print(" in path.read_text(encoding="utf-8")]
    assert printing == ["terminal.py"]


def run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a shell command with `basecal` and the folder."""
    whole = command.replace("basecal", f"{shlex.quote(sys.executable)} -m basecal").replace("CELL", str(folder / "c"))
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.run(["sh", "-c", whole], capture_output=True, text=True, check=False, env=buffered)


@pytest.mark.journey
@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("basecal new CELL >&-", "stdout: cannot be written to, it is closed"),
        ("basecal simulate CELL --samples 3 --json >/dev/full", "No space left on device"),
    ],
)
def test_closed_or_full_output_is_an_error(command: str, said: str, tmp_path: Path) -> None:
    """It is one line and exit code 3, not silence."""
    ended = run(command, tmp_path)
    assert ended.returncode == 3
    assert said in ended.stderr
    assert ended.stderr.count("\n") == 1


@pytest.mark.journey
def test_missing_error_stream_is_accepted(tmp_path: Path) -> None:
    """The answer does not need it, and an error has its exit code."""
    assert run("basecal simulate CELL --samples 3 --json 2>&-", tmp_path).returncode == 0
    assert run("basecal new CELL 2>&-", tmp_path).returncode == 3


def test_names_of_images_are_escaped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No content of a file reaches the terminal as an escape sequence."""
    main(["simulate", str(tmp_path / "c"), "--samples", "3"])
    samples = tmp_path / "c" / "recording" / "samples.jsonl"
    samples.write_text(samples.read_text().replace('"eye"', '"\\u001b[2J"', 1))
    capsys.readouterr()
    assert main(["calibrate", str(tmp_path / "c")]) == 3
    assert "\x1b" not in "".join(capsys.readouterr())


def test_several_errors_name_their_file_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The line number of each follows, on one line."""
    main(["new", str(tmp_path)])
    path = tmp_path / "cell.yaml"
    path.write_text(path.read_text().replace("squares:", "squars:").replace("model: pinhole", "model: pinhol"))
    capsys.readouterr()
    assert main(["calibrate", str(tmp_path)]) == 3
    said = capsys.readouterr().err
    assert said.count("cell.yaml") == 1
    assert said.count("; line ") >= 2
    assert said.count("\n") == 1


@pytest.mark.journey
def test_several_mistakes_of_driver_options_are_separated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Options in a cell have the line of `cell.yaml`, options on the command line have none."""
    (tmp_path / "cell.yaml").write_text(
        "schema: basecal/cell/1\nreference: eye\nrobots:\n  eye: {}\n"
        "cameras:\n  wrist: {on: eye, driver: {kind: folder, pth: x}}\n"
    )
    in_cell, alone = [str(tmp_path), "wrist", "--yes"], ["folder", "--camera", "--option", "pth=x"]
    for words, place in ((in_cell, "line 6"), (alone, "cell.yaml")):
        assert main(["driver", "check", *words]) == 3
        said = capsys.readouterr().err
        assert re.search(rf"driver\.path: missing; add it; {place}: cameras\.\w+\.driver\.pth: unknown field", said)
        assert said.count("\n") == 1


class Watched(io.StringIO):
    """Stream that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("settings", "is_coloured"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)]
)
def test_verdict_has_a_colour(settings: dict[str, str], is_coloured: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only its first word is coloured, on a terminal that allows colours."""
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


class Clock:
    """Clock that advances on request."""

    time_s = 100.0

    def __call__(self) -> float:
        return self.time_s


@pytest.fixture
def clock() -> Iterator[Clock]:
    return Clock()


def test_progress_names_the_stage(clock: Clock) -> None:
    """It begins with the first stage; no time is printed before one is known."""
    left = TimeLeft("calibrating", clock)
    assert str(left) == "calibrating"
    left.enter("noise")
    clock.time_s += 0.4
    assert str(left) == "calibrating: noise"
    assert left.seconds() is None


def test_progress_shows_the_remaining_time(clock: Clock) -> None:
    """The remaining time is that of the coming stages, less the time spent in the present one."""
    left = TimeLeft("calibrating", clock)
    left.enter("noise")
    clock.time_s += 32.0
    left.enter("conventions")
    assert left.seconds() == pytest.approx(103.0)
    clock.time_s += 8.0
    assert str(left) == "calibrating: conventions, about 95 s left"
    clock.time_s += 1000.0
    assert str(left) == "calibrating: conventions"


def test_repeated_stage_counts_once(clock: Clock) -> None:
    """An unknown stage does not count."""
    left = TimeLeft("calibrating", clock)
    for stage in ("noise", "conventions", "noise", "new"):
        left.enter(stage)
        clock.time_s += 9.0
    left.enter("cross-validation")
    assert left.seconds() == pytest.approx(36.0 * 63 / 72)


def test_parts_of_a_stage_are_shown(clock: Clock) -> None:
    """The done share of a stage is shown, and its time counts from its beginning."""
    left = TimeLeft("calibrating", clock)
    left.enter("noise")
    clock.time_s += 32.0
    left.enter("conventions")
    clock.time_s += 4.0
    left.enter("conventions, 3 of 9")
    clock.time_s += 4.0
    assert str(left) == "calibrating: conventions, 3 of 9, about 95 s left"


def test_stages_of_calibrate_have_shares():
    """Each stage of every calibration has a share of time; those of streams and of a task are not counted."""
    named = {stage.name for stage in (*READING_STAGES, *SOLVING_STAGES, *JUDGING_STAGES)} - {None}
    assert named - _SHARES.keys() == {"clocks", "task"}


def test_recording_without_images_loads_no_detector(tmp_path, monkeypatch):
    """No target is searched for."""
    main(["simulate", str(tmp_path / "c"), "--samples", "3"])
    monkeypatch.setitem(sys.modules, "basecal.vision.detect", None)
    recording = detected_recording(tmp_path / "c", read_cell(tmp_path / "c"))
    assert [len(sample.observations) for sample in recording.samples] == [1, 1, 1]


@pytest.mark.journey
def test_targets_are_detected_in_images(tmp_path):
    """Each rendered corner is found within a pixel of a second detection."""
    main(["simulate", str(tmp_path / "c"), "--samples", "2", "--images"])
    cell = read_cell(tmp_path / "c")
    first, again = (detected_recording(tmp_path / "c", cell) for _ in range(2))
    for a, b in zip(first.samples, again.samples, strict=True):
        assert len(a.observations) == 1
        np.testing.assert_array_equal(a.observations[0].pixels, b.observations[0].pixels)


def test_steps_are_counted_only_on_a_terminal(monkeypatch, capsys):
    """Otherwise no text is written."""
    with progress_bar("detecting") as step:
        step(1, 2)
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(terminal, "is_terminal", lambda stream: True)
    monkeypatch.setenv("FORCE_COLOR", "1")
    with progress_bar("detecting") as step:
        step(2, 2)
    assert "detecting" in capsys.readouterr().err


@pytest.mark.parametrize("total", [1, 50])
def test_last_step_shows_100_percent(monkeypatch, capsys, total):
    """A full bar shows 100 %."""
    monkeypatch.setattr(terminal, "is_terminal", lambda stream: True)
    monkeypatch.setenv("FORCE_COLOR", "1")
    with progress_bar("detecting") as step:
        step(total, total)
    assert "100%" in capsys.readouterr().err


def test_stages_are_printed_by_their_time(capsys: pytest.CaptureFixture[str]) -> None:
    """The longest stage comes first, the sum last."""
    print_stages({"start": 0.25, "noise": 2.0, "descent": 1.0})
    lines = [line.split() for line in capsys.readouterr().err.splitlines()]
    assert lines == [
        ["2.000", "s", "noise"],
        ["1.000", "s", "descent"],
        ["0.250", "s", "start"],
        ["3.250", "s", "all", "stages"],
    ]


def test_json_has_no_nan(capsys: pytest.CaptureFixture[str]) -> None:
    """An answer is one line of JSON without NaN."""
    print_json({"a": 1.5, "b": [None, "ü"]})
    assert capsys.readouterr().out == '{"a": 1.5, "b": [null, "\\u00fc"]}\n'
    with pytest.raises(ValueError, match="not JSON compliant"):
        print_json({"a": float("nan")})


@pytest.mark.parametrize(("passed_s", "is_known"), [(0.9, False), (1.1, True)])
def test_remaining_time_is_known_after_a_second(clock: Clock, passed_s: float, is_known: bool) -> None:
    """Before that, the first stages do not determine the remaining time."""
    left = TimeLeft("calibrating", clock)
    left.enter("noise")
    clock.time_s += passed_s
    left.enter("conventions")
    assert (left.seconds() is not None) == is_known


@pytest.mark.parametrize(("later_s", "shown"), [(8.9, ", about 1 s left"), (9.1, "")])
def test_last_second_is_not_counted(clock: Clock, later_s: float, shown: str) -> None:
    """The example has 10 s left at the start of a stage."""
    left = TimeLeft("calibrating", clock)
    done = sum(_SHARES.values()) - _SHARES["noise"]
    for stage in _SHARES:
        if stage != "noise":
            left.enter(stage)
    clock.time_s += 10.0 * done / _SHARES["noise"]
    left.enter("noise")
    clock.time_s += later_s
    assert str(left) == f"calibrating: noise{shown}"


@pytest.mark.parametrize("is_watched", [False, True])
def test_progress_is_shown_only_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], is_watched: bool
) -> None:
    """A terminal shows the present stage."""
    monkeypatch.setattr(terminal, "is_terminal", lambda stream: is_watched)
    monkeypatch.setenv("FORCE_COLOR", "1")
    with progress("calibrating") as enter:
        enter("noise")
    said = capsys.readouterr()
    assert ("calibrating" in said.err) == is_watched
    assert said.out == ""


def test_next_command_is_printed_to_stderr(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without stderr it is omitted; the answer is printed to stdout, or is an error."""
    say_next("basecal report c")
    assert capsys.readouterr() == ("", "next: basecal report c\n")
    monkeypatch.setattr(sys, "stderr", None)
    say_next("basecal report c")
    monkeypatch.setattr(sys, "stdout", None)
    with pytest.raises(OSError, match="it is closed"):
        say("answer")
    assert not is_terminal(None)


@pytest.mark.parametrize(("reads", "writes"), [(True, True), (True, False), (False, True)])
def test_questions_need_input_and_output(monkeypatch: pytest.MonkeyPatch, reads: bool, writes: bool) -> None:
    """They need a terminal for input, and one that shows the question."""
    monkeypatch.setattr(sys, "stdin", Watched() if reads else io.StringIO())
    monkeypatch.setattr(sys, "stderr", Watched() if writes else io.StringIO())
    assert can_ask() == (reads and writes)


def test_progress_bar_is_removed_at_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is removed from the terminal."""
    made = []

    class Bar:
        """Bar that records its arguments."""

        def __init__(self, *, console: object, transient: bool) -> None:
            made.append(transient)

        def __enter__(self) -> Bar:
            return self

        def __exit__(self, *_: object) -> None:
            made.append("end")

        def add_task(self, activity: str) -> str:
            return activity

        def update(self, task: str, completed: int, total: int) -> None:
            made.append((task, completed, total))

    monkeypatch.setattr("rich.progress.Progress", Bar)
    monkeypatch.setattr("basecal.cli.terminal.is_terminal", lambda stream: True)
    with progress_bar("detecting") as step:
        step(1, 3)
    assert made == [True, ("detecting", 1, 3), "end"]
