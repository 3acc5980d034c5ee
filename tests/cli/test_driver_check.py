"""Tests of `basecal driver check` with arms in another process and video streams read by OpenCV."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.shared.boxed_here import boxed_here

from basecal.acquisition.driver_check import check_process
from basecal.acquisition.driver_check.promises import Promise
from basecal.cell.format.locking import locked_folder
from basecal.cli import main
from basecal.simulation.running.plant import Clock
from shared import running_cell
from shared.running_cell import running


def checked(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, dict[str, tuple[str, bool | None]]]:
    """Exit code and measured value of each promise."""
    code = main(["driver", "check", *words, "--json"])
    told = json.loads(capsys.readouterr().out)
    return code, {each["promise"]: (each["measured"], each["holds"]) for each in told["promises"]}


@pytest.fixture
def real_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the time of a simulated cell follow this machine's clock."""
    monkeypatch.setattr(running_cell, "Clock", lambda speed: Clock(1.0))


@pytest.mark.slow
def test_correct_arm_keeps_its_promises(tmp_path: Path, capsys: pytest.CaptureFixture[str], real_time: None) -> None:
    """A simulated arm sends at least 20 states a second, stops within half a second, and no promise fails."""
    with running(tmp_path):
        code, found = checked(capsys, str(tmp_path), "eye", "--go")
    assert code == 0, found
    assert float(found["at least 10 in a second"][0].split()[0]) > 20
    measured, holds = found["stops within 0.5 s of an order"]
    assert holds
    assert 0 <= float(measured.split()[2]) < 3
    assert found["STOP_GUARANTEE is 'watchdog'"][1] is None


@pytest.mark.slow
def test_deviating_clock_is_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A clock faster than this machine's fails, and the exit code shows it."""
    with running(tmp_path):
        code, found = checked(capsys, str(tmp_path), "eye")
    assert code == 1
    assert found["clock within 1% of this machine's"][1] is False
    assert found["stops within 0.5 s of an order"] == ("not measured: --go moves one joint by 3 deg", None)


@pytest.mark.parametrize(("holds", "code"), [([True, None], 0), ([], 0), ([True, False, None], 1)])
def test_exit_code_shows_a_failed_promise(capsys, monkeypatch, holds, code) -> None:
    """A promise that was not measured has not failed."""
    promises = [Promise(f"promise {k}", "so", each) for k, each in enumerate(holds)]
    monkeypatch.setattr(check_process, "measure_promises", lambda check: promises)
    found, told = checked(capsys, "opencv", "--camera", "--option", "source=a.avi")
    assert found == code
    assert [each for _, each in told.values()] == holds


@pytest.mark.journey
def test_video_file_is_no_live_camera(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its images come on request: there is no rate and no freshness to measure."""
    path = tmp_path / "video.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30.0, (32, 24))
    for k in range(20):
        writer.write(np.full((24, 32, 3), k, np.uint8))
    writer.release()
    assert main(["driver", "check", "opencv", "--camera", "--option", f"source={path}"]) == 0
    assert "images come on demand" in capsys.readouterr().out


def test_a_cell_without_drivers(tmp_path, capsys):
    """The missing `driver` is named, not an empty list."""
    assert main(["new", str(tmp_path / "cell")]) == 0
    assert main(["driver", "check", str(tmp_path / "cell"), "eye"]) == 2
    assert "no robot or camera has a `driver`: add it to cell.yaml" in capsys.readouterr().err


@pytest.mark.journey
@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["urr"], 3, "no driver and no cell 'urr' (did you mean 'ur'?)"),
        (["opencv", "--camera", "--option", "source"], 2, "expected KEY=VALUE"),
        (["opencv"], 3, "no driver of that name is for robots"),
        (["opencv", "--camera", "--option", "sauce=1"], 3, "sauce"),
        (["{cell}"], 2, "give the robot or camera after the cell's folder; there are: eye, hand, wrist"),
        (["{cell}", "nobody"], 2, "there are: eye, hand, wrist"),
        (["{cell}", "eye", "--option", "port=1"], 2, "the cell states its own options"),
    ],
)
def test_unknown_names_and_options_are_refused(tmp_path, capsys, words, code, message):
    """The message lists existing names and options."""
    if "{cell}" in words:
        with running(tmp_path):
            assert main(["driver", "check", *[str(tmp_path) if word == "{cell}" else word for word in words]]) == code
    else:
        with boxed_here(check_process):
            assert main(["driver", "check", *words]) == code
    assert message in capsys.readouterr().err


@pytest.mark.journey
def test_cell_in_use_is_not_opened(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No driver is opened while another process holds the folder."""
    with running(tmp_path), locked_folder(tmp_path):
        assert main(["driver", "check", str(tmp_path), "eye", "--go"]) == 3
    assert "is in use by another capture or driver check" in capsys.readouterr().err
