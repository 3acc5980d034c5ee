"""Tests of lengths and counts as typed on the command line, and of the effect of a tolerance on a run."""

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
def test_lengths_are_parsed(text: str, metres: float) -> None:
    """A length is a number and its unit."""
    assert length_m(text) == pytest.approx(metres)


@pytest.mark.parametrize("text", ["0.5", "mm", "-1mm", "0mm", "1inch", "nanmm", "1e999m", ""])
def test_malformed_lengths_are_refused(text: str) -> None:
    """A length without a unit is ambiguous and refused; the error shows an example."""
    with pytest.raises(InputError, match=r"such as 0\.5mm"):
        length_m(text)


def test_speeds_are_parsed_as_length_per_second() -> None:
    """Speeds are lengths per second; their errors name a speed, the option and an example."""
    assert length_m("250mm/s", "--speed", "100mm/s", "/s") == pytest.approx(0.25)
    for text in ("250mm", "250/s", "0mm/s", "-1m/s", "/s"):
        with pytest.raises(UsageError) as caught:
            length_m(text, "--speed", "100mm/s", "/s")
        assert str(caught.value) == f"--speed {text!r}: expected a speed above zero with its unit, such as 100mm/s"
    with pytest.raises(UsageError, match=r"^--tolerance '5mm/s': expected a length above zero"):
        length_m("5mm/s")


def test_column_and_row_counts_are_parsed() -> None:
    """Columns come before rows; the error for anything but two numbers names the option."""
    assert columns_rows("5x7", "--squares") == columns_rows("5, 7", "--squares") == (5, 7)
    for text in ("5", "5x", "axb", "5x7x9", "-5x7"):
        with pytest.raises(InputError, match=r"--squares .*such as 5x7"):
            columns_rows(text, "--squares")


@pytest.mark.journey
def test_tolerance_sets_exit_code_and_is_stored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A missed tolerance ends `calibrate` with exit code 5 and FAIL.

    `report` takes the tolerance from the run, or another one from its option.
    """
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


def test_name_options_split_at_first_equals():
    """Everything after the first equals sign is the value, whatever it contains."""
    assert parse_name_options("--robot", ["left=a,b", "right=/x=y"], "NAME=WORDS") == {"left": "a,b", "right": "/x=y"}


@pytest.mark.parametrize(
    ("given", "error"),
    [(["left"], "expected NAME=WORDS"), (["=a"], "expected NAME=WORDS"), (["a=b", "a=c"], "given twice")],
)
def test_malformed_name_options_are_refused(given, error):
    """A missing name, a missing value and a repeated name are errors."""
    with pytest.raises(UsageError, match=f"--robot .*: {error}"):
        parse_name_options("--robot", given, "NAME=WORDS")
