"""Tests of the view of a running capture."""

from __future__ import annotations

import io
import os
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.acquisition.capture import Step
from basecal.acquisition.coverage import COVERAGE_GRID, Coverage
from basecal.acquisition.rig import Rig
from basecal.acquisition.running.check import Doubt
from basecal.acquisition.watching import End
from basecal.cli.capture_view import capture_view, pressed_keys, say_step
from basecal.errors import DriverError
from basecal.simulation import Scenario, simulate

CELL = simulate(Scenario(samples=2), 0).cell


class Terminal(io.StringIO):
    """Stream that is a terminal."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


def step() -> Step:
    return Step(3, "", 4, 9, Coverage(np.ones(COVERAGE_GRID, dtype=bool), {}), (1e-3, 1e-3))


def rig(is_live: bool = True) -> Rig:
    return Rig({"eye": SimpleNamespace(is_live=is_live)}, {})  # type: ignore[dict-item]


def shown(stream: io.StringIO, monkeypatch: pytest.MonkeyPatch, of: Rig, quiet: bool = False) -> str:
    monkeypatch.setattr(sys, "stdout", stream)
    with capture_view(of, CELL, Path(), web=False, port=0, quiet=quiet) as view:
        view.watch.notify("sample 4: arms move")
        view.report("camera wrist: images arrive late")
        view.note(step())
        view.watch.end(End("GOOD", "9 of 9 samples taken", "basecal calibrate mycell"))
    assert of.arms.show == view.watch.note_state
    assert view.watch.snapshot.end.word == "GOOD"
    return stream.getvalue()


def test_sample_is_a_line_without_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """After reports, the line has the coverage and the sigma of the base; no line is printed for programs."""
    late = "camera wrist: images arrive late\n"
    line = late + "   4/9 sample 3: taken, 100 % of the image; base known to 1.0 mm and 0.057 deg (1 sigma, 3-D norm)\n"
    assert shown(io.StringIO(), monkeypatch, rig()) == line
    assert shown(io.StringIO(), monkeypatch, rig(), quiet=True) == ""


def test_terminal_has_a_view(monkeypatch: pytest.MonkeyPatch) -> None:
    """A view replaces lines, unless a robot's driver asks on that terminal."""
    monkeypatch.setenv("TERM", "xterm")
    assert "4 taken, 9 planned" in shown(Terminal(), monkeypatch, rig())
    assert shown(Terminal(), monkeypatch, rig(is_live=False)).splitlines()[1].startswith("   4/9 sample 3: taken")


def test_view_ends_with_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """The view ends with the message of the error that ended the capture."""
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    with (
        pytest.raises(DriverError),
        capture_view(rig(), CELL, Path(), web=False, port=0, quiet=True) as view,
    ):
        raise DriverError("eye: its link is lost")
    assert view.watch.snapshot.end == End("STOPPED", "eye: its link is lost")


@pytest.mark.parametrize(("lines", "kept"), [(0, "0 samples are"), (1, "1 sample is"), (3, "3 samples are")])
def test_interrupted_capture_reports_kept_samples(
    lines: int, kept: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The message says that the same command continues; the page says it, too."""
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    (tmp_path / "recording").mkdir()
    (tmp_path / "recording" / "samples.jsonl").write_text("{}\n" * lines)
    told = f"nterrupted: {kept} kept, and the same command goes on"
    with (
        pytest.raises(KeyboardInterrupt, match=f"^i{told}$"),
        capture_view(rig(), CELL, tmp_path, web=False, port=0, quiet=True) as view,
    ):
        raise KeyboardInterrupt
    assert view.watch.snapshot.end == End("STOPPED", f"I{told}.")


def test_pipes_and_closed_streams_have_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe or a closed stream yields no key, and is not read."""
    for stream in (io.StringIO("q"), None):
        monkeypatch.setattr(sys, "stdin", stream)
        with pressed_keys() as key:
            assert key() == ""


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")
def test_key_at_a_terminal_is_read_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A key is read once without a newline, also two in a row; afterwards the terminal is as before."""
    import pty
    import termios

    outside, inside = pty.openpty()
    before = termios.tcgetattr(inside)
    with os.fdopen(inside, "r") as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        with pressed_keys() as key:
            assert key() == ""
            os.write(outside, b" q")
            assert [key(), key(), key()] == [" ", "q", ""]
        assert termios.tcgetattr(stream.fileno()) == before
    os.close(outside)


@pytest.mark.parametrize(("changes", "line"), [
    ({"sigma": None}, "   4/9 sample 3: taken, 100 % of the image"),
    ({"sigma": None, "why_not": "target not seen"}, "   4/9 sample 3: not taken: target not seen"),
    ({"taken": 12, "planned": 1000, "sigma": None}, "  12/1000 sample 3: taken, 100 % of the image"),
    ({"unchecked": 3}, "   4/9 sample 3: taken, 100 % of the image; base known to 1.0 mm and 0.057 deg "
                       "(1 sigma, 3-D norm, after 1 sample)"),
])  # fmt: skip
def test_sample_is_printed_as_a_line(changes: dict[str, object], line: str, capsys: pytest.CaptureFixture[str]) -> None:
    """It has no sigma if the base is unobservable, the reason if it was not taken, and the samples of a late sigma."""
    say_step(replace(step(), **changes))  # type: ignore[arg-type]
    assert capsys.readouterr().out == f"{line}\n"


def test_advice_and_doubts_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    """Advice is in the line, doubts are below; persistent doubts are warnings."""
    half = Coverage(np.arange(24).reshape(COVERAGE_GRID) < 12, {"eye": np.array([0.5, 0.1, 0.5])})
    doubts = (Doubt(3, "eye moved", True), Doubt(3, "blurred", False))
    say_step(replace(step(), coverage=half, sigma=None, taken=5, doubts=doubts))
    assert capsys.readouterr().out.splitlines() == [
        "   5/9 sample 3: taken, 50 % of the image; rotate eye further about y",
        "  WARNING: eye moved",
        "  check: blurred",
    ]


@pytest.mark.parametrize(("is_live", "key"), [(True, "q"), (False, "")])
def test_keys_belong_to_a_driver_that_asks_on_the_terminal(
    monkeypatch: pytest.MonkeyPatch, is_live: bool, key: str
) -> None:
    """A driver that asks there reads its own lines; otherwise keys reach the capture."""
    monkeypatch.setattr("basecal.cli.capture_view.pressed_keys", lambda: nullcontext(lambda: "q"))
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    with capture_view(rig(is_live), CELL, Path(), web=False, port=0, quiet=True) as view:
        assert view.key() == key
        assert not view.has_lines
