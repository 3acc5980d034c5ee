"""Tests of `basecal verify` and `basecal compare` on the folder of a cell."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from tests.shared.remembered import remembering
from tests.shared.stages import without_stages

from basecal.accuracy.drift import verify as drift
from basecal.accuracy.drift.verify import Verification
from basecal.accuracy.stages.solving import screen_conventions
from basecal.cell import Calibration, Driver, Recording, Sample
from basecal.cell.files import read_calibration, read_cell, read_recording
from basecal.cli import main
from basecal.cli.verify import _next_command as next_command
from basecal.cli.verify import _recalibrate as recalibrate
from basecal.simulation import Scenario, simulate

no_conventions = without_stages(screen_conventions)

verified_once = remembering(drift, "verify")


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Calibrated cell, and files of samples that were not used for it."""
    folder = tmp_path_factory.mktemp("verified") / "cell"
    assert main(["simulate", str(folder), "--samples", "26", "--seed", "3"]) == 0
    journal = folder / "recording" / "samples.jsonl"
    lines = journal.read_text().splitlines(keepends=True)
    journal.write_text("".join(lines[:20]))
    (folder / "new.jsonl").write_text("".join(lines[20:]))
    moved = [json.loads(line) for line in lines[20:]]
    for sample in moved:
        sample["robots"]["hand"]["base_from_flange"]["t_m"][1] += 0.05
    (folder / "moved.jsonl").write_text("".join(json.dumps(sample) + "\n" for sample in moved))
    assert main(["calibrate", str(folder)]) == 0
    return folder


def test_unchanged_cell_exits_with_code_0(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(cell), str(cell / "new.jsonl"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["moved"] is False
    assert data["detectable_mm"] > 0


def test_moved_cell_exits_with_code_1(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(cell), str(cell / "moved.jsonl"), "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["moved"] is True
    assert data["frame"] == "hand_base"
    assert data["shift_mm"] == pytest.approx(50.0, abs=5.0)
    assert main(["verify", str(cell), str(cell / "moved.jsonl")]) == 1
    assert capsys.readouterr().out.startswith("MOVED: 6 samples")


def test_unused_samples_are_listed(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A truncated line is left out of the check, and the check reports it."""
    (tmp_path / "cut.jsonl").write_text((cell / "new.jsonl").read_text()[:-300])
    assert main(["verify", str(cell), str(tmp_path / "cut.jsonl")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("NOT MOVED: 5 samples")
    assert lines[-1].startswith("info: dropped-sample: ")
    assert main(["verify", str(cell), str(tmp_path / "cut.jsonl"), "--json"]) == 0
    assert [each["code"] for each in json.loads(capsys.readouterr().out)["findings"]] == ["dropped-sample"]


def test_verifications_are_logged_and_charted(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each verification is a line of the cell's log with its measurements; the page has a chart."""
    (cell / "verifications.jsonl").unlink(missing_ok=True)
    capsys.readouterr()
    assert main(["verify", str(cell), "--history"]) == 0
    shown = capsys.readouterr()
    assert "nothing was verified yet" in shown.out
    assert "--history" not in shown.err, "the next step is the command that was typed"
    assert main(["verify", str(cell), str(cell / "new.jsonl")]) == 0
    assert "--history" in capsys.readouterr().err
    assert main(["verify", str(cell), str(cell / "moved.jsonl"), "--history", "--json"]) == 1
    first, second = json.loads(capsys.readouterr().out)["verifications"]
    assert (first["moved"], second["moved"], second["frame"]) == (False, True, "hand_base")
    assert second["shift_mm"]["eye_base_from_hand_base"] == pytest.approx(50.0, abs=5.0)
    main(["report", str(cell)])
    (page,) = (cell / "runs").glob("*/report.html")
    assert "Verified since" in page.read_text()


@pytest.mark.journey
def test_samples_are_added_if_no_base_moved(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The recording then has them, and the run uses all; if something moved the recording is unchanged."""
    copy = Path(shutil.copytree(cell, tmp_path / "cell"))
    journal = copy / "recording" / "samples.jsonl"
    capsys.readouterr()
    assert main(["verify", str(copy), str(copy / "moved.jsonl"), "--recalibrate"]) == 1
    assert "not calibrated again" in capsys.readouterr().out
    assert len(journal.read_text().splitlines()) == 20
    assert main(["verify", str(copy), str(copy / "new.jsonl"), "--recalibrate", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["recalibration"]
    assert told["added"] == list(range(20, 26))
    assert [json.loads(line)["sample"] for line in journal.read_text().splitlines()] == list(range(26))
    assert (copy / "runs" / told["run"] / "calibration.json").is_file()


def test_added_samples_have_the_verified_views(cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They have views, or none if the scene verified them; other samples have no effect, and outliers are excluded."""
    copy = Path(shutil.copytree(cell, tmp_path / "cell"))
    seen, *_ = read_recording(copy).samples
    bare = [Sample(number, robots=seen.robots) for number in (5, 6)]
    new = Recording((*bare, replace(seen, sample=7), replace(seen, sample=8)))
    made = SimpleNamespace(run=copy / "runs" / "new", calibration=Calibration("good"))
    monkeypatch.setattr("basecal.cli.calibrate.recalibrate_folder", lambda *_: made)
    verification = Verification(False, 1.0, None, (), None, (5, 8), outliers=(8,))
    (run,) = (copy / "runs").iterdir()
    told, code = recalibrate(copy, read_cell(copy), run, new, verification, [])
    assert (told["added"], code) == ([20, 21], 0)
    assert [len(sample.observations) for sample in read_recording(copy).samples[20:]] == [0, 1]


@pytest.mark.journey
def test_added_samples_use_the_settings_of_the_run(cell: Path, tmp_path: Path) -> None:
    """No other settings were requested, and `compare` reports no difference."""
    copy = Path(shutil.copytree(cell, tmp_path / "cell"))
    shutil.rmtree(copy / "runs")
    assert main(["calibrate", str(copy), "--task-point", "0.5", "0", "0.5", "--tolerance", "1cm"]) == 0
    assert main(["verify", str(copy), str(copy / "new.jsonl"), "--recalibrate"]) == 0
    first, second = (read_calibration(run) for run in sorted((copy / "runs").iterdir()))
    assert second.settings == first.settings
    assert second.tolerance is not None


@pytest.mark.journey
def test_missed_tolerance_is_reported_with_added_samples(
    cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Text and exit code are those of `calibrate`."""
    copy = Path(shutil.copytree(cell, tmp_path / "cell"))
    assert main(["calibrate", str(copy), "--task-point", "0.5", "0", "0.5", "--tolerance", "1um"]) == 5
    capsys.readouterr()
    assert main(["verify", str(copy), str(copy / "new.jsonl"), "--recalibrate"]) == 5
    assert "6 new samples, fail: run" in capsys.readouterr().out


@pytest.mark.journey
def test_samples_of_the_calibration_are_reported(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They agree with it in any case: a warning says so, and --recalibrate does not add them a second time."""
    journal = cell / "recording" / "samples.jsonl"
    lines = journal.read_text()
    for words in ([str(journal)], [str(cell)], [str(journal), "--recalibrate"]):
        assert main(["verify", str(cell), *words]) == 0
        warning = "20 of 20 samples are those of the calibration, from sample 0 on, and agree in any case"
        assert f"warning: {warning}" in " ".join(capsys.readouterr().out.split())
    assert journal.read_text() == lines


def test_verify_needs_samples(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in ([], ["--recalibrate"], ["--recalibrate", "--history"]):
        assert main(["verify", str(cell), *words]) == 2
        assert "give the new samples" in capsys.readouterr().err


def test_unreadable_samples_exit_with_code_3(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(cell), str(cell / "missing.jsonl")]) == 3
    assert "missing.jsonl" in capsys.readouterr().err
    (cell / "broken.jsonl").write_text('{"sample": 1, "wrong": 2}\n')
    assert main(["verify", str(cell), str(cell / "broken.jsonl")]) == 3
    assert "broken.jsonl:1" in capsys.readouterr().err


def test_cell_without_a_run_is_refused_with_advice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", str(tmp_path / "cell"), "--samples", "5"]) == 0
    journal = tmp_path / "cell" / "recording" / "samples.jsonl"
    assert main(["verify", str(tmp_path / "cell"), str(journal)]) == 3
    assert "has no run yet: basecal calibrate" in capsys.readouterr().err


def test_samples_may_be_in_another_cell(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """New samples were imported into another folder: its recording is read with the calibrated cell."""
    (tmp_path / "today" / "recording").mkdir(parents=True)
    (tmp_path / "today" / "recording" / "samples.jsonl").write_text((cell / "new.jsonl").read_text())
    assert main(["verify", str(cell), str(tmp_path / "today")]) == 0
    assert capsys.readouterr().out.startswith("NOT MOVED: 6 samples")
    assert main(["verify", str(cell), str(tmp_path)]) == 3
    assert "samples.jsonl" in capsys.readouterr().err


def test_first_missing_image_is_reported(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message has its path; an image with recorded views is not read, and may be missing."""
    lines = [json.loads(line) for line in (cell / "new.jsonl").read_text().splitlines()]
    for sample in lines:
        sample["images"] = {"wrist": f"images/wrist/{sample['sample']}.png"}
    noted, bare = tmp_path / "noted.jsonl", tmp_path / "bare.jsonl"
    noted.write_text("".join(json.dumps(sample) + "\n" for sample in lines))
    assert main(["verify", str(cell), str(noted)]) == 0
    bare.write_text("".join(json.dumps({**sample, "observations": []}) + "\n" for sample in lines))
    capsys.readouterr()
    assert main(["verify", str(cell), str(bare)]) == 3
    image = cell / "recording" / "images" / "wrist" / f"{lines[0]['sample']}.png"
    said = f"sample {lines[0]['sample']}: the image of 'wrist' is missing, looked for at {image}; put it there"
    assert said in capsys.readouterr().err


def test_moved_cell_is_captured_only_with_drivers() -> None:
    """Otherwise samples are recorded and imported; the arms of a scene are guided by hand."""
    cell = simulate(Scenario(samples=1), 0).cell
    driver = Driver("manual")
    driven = replace(
        cell,
        robots={name: replace(each, driver=driver) for name, each in cell.robots.items()},
        cameras={name: replace(each, driver=driver) for name, each in cell.cameras.items()},
    )
    scene = replace(driven, targets={}, sees_scene=True)
    assert next_command(cell, Path("c"), True).endswith("record again, and import that into a new folder")
    assert next_command(driven, Path("c"), True).endswith("record again: basecal capture c")
    assert next_command(scene, Path("c"), True).endswith("record again: basecal capture c --freedrive")
    assert next_command(driven, Path("c"), None) == "all verifications so far: basecal verify c --history"
