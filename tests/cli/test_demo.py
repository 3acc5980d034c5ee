"""Tests of `basecal demo`, except its capture, which other tests run."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.cli import main
from basecal.cli.demo import _capture, _comparison, demo, true_error
from basecal.errors import InputError
from basecal.estimation.settings import Settings
from basecal.geometry import SE3, PoseEstimate
from export_example import BASE, CALIBRATION, CELL


def test_true_error_is_in_sigmas_of_the_answer() -> None:
    """A step of one sigma along one axis and of two about another is a chi-square of five."""
    covariance = np.diag(np.array([1e-3, 2e-3, 1e-3, 1e-2, 1e-2, 2e-2]) ** 2)
    mean = SE3.from_rpy([0.3, -0.2, 1.0], [1.0, 2.0, 0.5])
    truth = mean @ SE3.exp(np.array([0, 2e-3, 0, 2e-2, 0, 0]))
    error = true_error(PoseEstimate(mean, covariance), truth)
    assert error["squared_sigmas"] == pytest.approx(5.0)
    assert error["error_mm"] == pytest.approx(2.0)
    assert error["error_deg"] == pytest.approx(np.degrees(0.02))


def test_cell_not_made_by_demo_is_unchanged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only the result of a demo is replaced."""
    assert main(["new", str(tmp_path / "c")]) == 0
    text = (tmp_path / "c" / "cell.yaml").read_text()
    assert main(["demo", str(tmp_path / "c")]) == 3
    assert "is not overwritten" in capsys.readouterr().err
    assert (tmp_path / "c" / "cell.yaml").read_text() == text


def test_truth_is_printed_with_the_digits_of_sigma() -> None:
    """The limit of chi-square is printed in words."""
    estimate = PoseEstimate(SE3.identity(), np.diag(np.array([1e-3, 2e-3, 1e-3, 1e-2, 1e-2, 2e-2]) ** 2))
    lines = _comparison(estimate, true_error(estimate, SE3.exp(np.array([0, 2e-3, 0, 0, 0, 0]))), "b").splitlines()
    assert lines[2].split() == ["true", "error", "0.0", "2.0", "0.0", "mm"]
    assert lines[4].split() == ["in", "sigmas", "0.00", "1.00", "0.00"]
    assert lines[-1] == "  chi-square 1.0 with 6 degrees of freedom (99 % limit 16.8): consistent"
    far = _comparison(estimate, true_error(estimate, SE3.exp(np.array([0.1, 0, 0, 0, 0, 0]))), "b")
    assert far.endswith("inconsistent")


@pytest.mark.parametrize(("words", "kind"), [([], "charuco"), (["--led"], "led")])
def test_demo_shows_a_board_unless_an_led_is_requested(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], kind: str
) -> None:
    """The folder is marked as a demo, and files of an earlier demo are removed before the arms start."""

    def refuse(folder: Path, target: str) -> None:
        assert (folder / ".made-by-basecal-demo").exists()
        assert not (folder / "truth.yaml").exists()
        raise InputError(f"no arms for {target}")

    monkeypatch.setattr("basecal.cli.demo.simulated_process", refuse)
    folder = tmp_path / "c"
    for _ in range(2):
        with pytest.raises(InputError, match=f"no arms for {kind}$"):
            demo(folder, led=bool(words))
        assert main(["demo", str(folder), *words]) == 3
        (folder / "truth.yaml").write_text("old")
        (folder / "notes.txt").write_text("mine")
    assert (folder / "notes.txt").read_text() == "mine"
    monkeypatch.setattr("basecal.cli.demo.simulated_process", lambda folder, target: refuse(folder, f"{target} of all"))
    with pytest.raises(InputError, match="no arms for charuco of all"):
        demo(folder)


@pytest.mark.parametrize(("off", "word"), [(16.7, "consistent"), (16.9, "inconsistent")])
def test_error_beyond_the_99_percent_limit_is_inconsistent(off: float, word: str) -> None:
    """The chi-square of all six decides; sigmas are printed in millimetres and degrees."""
    estimate = PoseEstimate(SE3.identity(), np.diag(np.array([1e-3, 2e-3, 4e-3, 1e-2, 2e-2, 4e-2]) ** 2))
    error = true_error(estimate, SE3.exp(np.array([0, 0, 0, 0, 0, 4e-2 * np.sqrt(off)])))
    lines = _comparison(estimate, error, "b").splitlines()
    assert lines[:2] == ["", "b against the truth, along x y z of hand_base:"]
    assert lines[3].split() == ["sigma", "1.0", "2.0", "4.0", "mm"]
    assert [float(value) for value in lines[6].split()[1:4]] == pytest.approx([0.573, 1.146, 2.292], abs=0.06)
    assert float(lines[5].split()[4]) == pytest.approx(np.degrees(4e-2 * np.sqrt(off)), abs=0.06)
    assert float(lines[7].split()[4]) == pytest.approx(np.sqrt(off), abs=0.01)
    assert lines[-1].endswith(f": {word}")


def calibrated(monkeypatch: pytest.MonkeyPatch, transforms: dict[str, PoseEstimate]) -> list[object]:
    """Demo with given arms, captures and calibrations; the calls in order."""
    calls: list[object] = []

    def calibrate(folder: Path, cell: object, settings: Settings) -> SimpleNamespace:
        calls.append(settings.method)
        return SimpleNamespace(calibration=replace(CALIBRATION, transforms=transforms), run=folder / "run")

    monkeypatch.setattr("basecal.cli.demo.simulated_process", lambda folder, target: nullcontext(calls.append(target)))
    monkeypatch.setattr("basecal.cli.demo._capture", lambda folder, pattern, quiet: calls.append((pattern, quiet)))
    monkeypatch.setattr("basecal.cli.demo.calibrate_folder", calibrate)
    monkeypatch.setattr("basecal.cli.demo.print_calibration", lambda cell, calibration: calls.append("show"))
    monkeypatch.setattr("basecal.cli.demo.show_page", lambda page, opens: calls.append((page.parent.name, opens)))
    monkeypatch.setattr("basecal.cell.files.read_cell", lambda folder: CELL)
    monkeypatch.setattr("basecal.cell.files.read_truth", lambda folder: {BASE: CALIBRATION[BASE].mean})
    return calls


@pytest.mark.parametrize("led", [False, True])
def test_demo_compares_with_the_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], led: bool
) -> None:
    """A board by maximum likelihood, an LED also by the closed form of the paper; programs get both errors."""
    calls = calibrated(monkeypatch, dict(CALIBRATION.transforms))
    assert demo(tmp_path / "c", led=led, opens_page=True) == 0
    methods = ["axis-shift", "maximum-likelihood"] if led else ["maximum-likelihood"]
    capture = ["led", ("shifts", False)] if led else ["charuco", ("poses", False)]
    assert calls == [*capture, *methods, "show", ("run", True)]
    out = capsys.readouterr().out
    assert [line.split(" against")[0] for line in out.splitlines() if " against the truth" in line] == (
        ["the paper's closed form", "maximum likelihood"] if led else [BASE]
    )
    assert f"next: look into {tmp_path / 'c' / 'cell.yaml'}; basecal report {tmp_path / 'c'}" in out
    assert demo(tmp_path / "c", led=led, json=True) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["true_error"][BASE]["squared_sigmas"] == pytest.approx(0.0, abs=1e-9)
    assert ("closed_form_error" in answer) == led
    assert calls[-1] == "maximum-likelihood"


def test_demo_without_a_base_has_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """If the base was not estimated, no comparison is printed."""
    calibrated(monkeypatch, {})
    demo(tmp_path / "c", led=True)
    assert "against the truth" not in capsys.readouterr().out
    demo(tmp_path / "c", json=True)
    assert json.loads(capsys.readouterr().out)["true_error"] == {BASE: None}


@pytest.mark.parametrize(("pattern", "count"), [("poses", 25), ("shifts", 35)])
def test_samples_of_a_demo_are_printed(monkeypatch: pytest.MonkeyPatch, pattern: str, count: int) -> None:
    """Each sample is a line; no line is printed for programs."""
    asked, said = [], []
    monkeypatch.setattr("basecal.cli.capture.captured_steps", lambda *given: asked.append(given) or iter("ab"))
    monkeypatch.setattr("basecal.cli.capture_view.say_step", lambda *given: said.append(given))
    for quiet in (False, True):
        _capture(Path("c"), pattern, quiet)
    assert said == [("a",), ("b",)]
    assert asked == [(Path("c"), pattern, count, 120.0)] * 2
