"""Lengths and counts as they are typed, and what a tolerance does to a run."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from basecal.cell.files import latest_run
from basecal.cli import main
from basecal.errors import InputError, UsageError
from basecal.fields.typed_length import columns_rows, length_m, parse_name_options


@pytest.mark.parametrize(
    ("text", "metres"),
    [("0.5mm", 5e-4), ("0.5 mm", 5e-4), (".5mm", 5e-4), ("500um", 5e-4), ("5e-4m", 5e-4), ("2cm", 0.02)],
)
def test_lengths_are_read(text: str, metres: float) -> None:
    """A number and its unit."""
    assert length_m(text) == pytest.approx(metres)


@pytest.mark.parametrize("text", ["0.5", "mm", "-1mm", "0mm", "1inch", "nanmm", "1e999m", ""])
def test_what_is_no_length_is_refused(text: str) -> None:
    """Without a unit nobody knows what is meant; the error shows how it is written."""
    with pytest.raises(InputError, match=r"such as 0\.5mm"):
        length_m(text)


def test_speeds_are_lengths_a_second() -> None:
    """Their errors name a speed, the option and the example."""
    assert length_m("250mm/s", "--speed", "100mm/s", "/s") == pytest.approx(0.25)
    for text in ("250mm", "250/s", "0mm/s", "-1m/s", "/s"):
        with pytest.raises(UsageError) as caught:
            length_m(text, "--speed", "100mm/s", "/s")
        assert str(caught.value) == f"--speed {text!r}: expected a speed above zero with its unit, such as 100mm/s"
    with pytest.raises(UsageError, match=r"^--tolerance '5mm/s': expected a length above zero"):
        length_m("5mm/s")


def test_counts_are_read() -> None:
    """Columns first; what is not two numbers names the option."""
    assert columns_rows("5x7", "--squares") == columns_rows("5, 7", "--squares") == (5, 7)
    for text in ("5", "5x", "axb", "5x7x9", "-5x7"):
        with pytest.raises(InputError, match=r"--squares .*such as 5x7"):
            columns_rows(text, "--squares")


def test_a_tolerance_decides_and_is_remembered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Missed, the run ends with 5 and says so; `report` knows it from the run, and takes another one."""
    main(["simulate", str(tmp_path), "--samples", "12", "--robot-noise-mm", "0.1", "--robot-noise-mrad", "0.2"])
    capsys.readouterr()
    assert main(["calibrate", str(tmp_path), "--tolerance", "0.001mm"]) == 5
    assert capsys.readouterr().out.startswith("FAIL: expected error ")
    assert main(["report", str(tmp_path)]) == 5
    capsys.readouterr()
    assert main(["report", str(tmp_path), "--json"]) == 5
    missed = json.loads(capsys.readouterr().out)["tolerance"]
    assert (missed["asked_m"], missed["met"]) == (1e-6, False)
    assert 1e-6 < missed["expected_95_m"] < 1e-2
    assert main(["report", str(tmp_path), "--tolerance", "1cm"]) == 0
    assert capsys.readouterr().out.startswith("PASS: expected error ")
    run = latest_run(tmp_path)
    assert run is not None
    assert ">PASS<" in (run / "report.html").read_text(encoding="utf-8")
    assert (run / "report.txt").read_text(encoding="utf-8").startswith("FAIL: ")
    assert json.loads((run / "calibration.json").read_text(encoding="utf-8"))["tolerance"]["asked_m"] == 1e-6


def test_words_stand_by_their_names():
    """What comes behind the first equals sign is the words, whatever is in them."""
    assert parse_name_options("--robot", ["left=a,b", "right=/x=y"], "NAME=WORDS") == {"left": "a,b", "right": "/x=y"}


@pytest.mark.parametrize(
    ("given", "error"),
    [(["left"], "expected NAME=WORDS"), (["=a"], "expected NAME=WORDS"), (["a=b", "a=c"], "given twice")],
)
def test_what_has_another_form(given, error):
    """No name, no words, and the same name twice."""
    with pytest.raises(UsageError, match=f"--robot .*: {error}"):
        parse_name_options("--robot", given, "NAME=WORDS")
