"""Tests of `calibrate`, `report` and `demo` from end to end."""

from __future__ import annotations

import json
import shutil
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from tests.shared.remembered import remembering

from basecal.accuracy import calibrate as calibrating
from basecal.cell.files import latest_run, read_calibration, read_cell
from basecal.cli import calibrate as verb
from basecal.cli import main
from basecal.cli.calibrate import calibrate_folder
from basecal.cli.demo import _SAMPLES
from basecal.errors import UsageError
from basecal.estimation.settings import Settings
from basecal.geometry import SE3

BASE = "eye_base_from_hand_base"

calibrated_once = remembering(calibrating, "calibrate")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Simulated cell, calibrated once."""
    folder = tmp_path_factory.mktemp("simulated")
    assert main(["simulate", str(folder), "--samples", "15"]) == 0
    assert main(["calibrate", str(folder)]) == 0
    return folder


def test_calibrate_prints_a_short_summary(simulated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A new run is added to earlier ones; the printed summary is short, and `report` prints it again."""
    before = set((simulated / "runs").iterdir())
    assert main(["calibrate", str(simulated)]) == 0
    assert set((simulated / "runs").iterdir()) > before
    printed = capsys.readouterr().out
    assert main(["report", str(simulated)]) == 0
    assert capsys.readouterr().out == printed
    assert printed.startswith("GOOD: expected error ")
    assert len(printed.splitlines()) <= 15


@pytest.mark.parametrize("verb", ["calibrate", "report"])
def test_verbose_prints_the_written_report(simulated: Path, verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    """`--verbose` prints all of report.txt."""
    assert main([verb, str(simulated), "--verbose"]) == 0
    run = latest_run(simulated)
    assert run is not None
    assert (run / "report.txt").read_text() == capsys.readouterr().out


@pytest.mark.journey
def test_run_without_convergence_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One step from a closed form is no optimum: no transform, lens or joint covariance, and `report` says so."""
    assert main(["simulate", str(tmp_path), "--samples", "10"]) == 0
    calibration = calibrate_folder(tmp_path, read_cell(tmp_path), Settings(iterations=1)).calibration
    assert "not-converged" in {finding.code for finding in calibration.findings}
    run = latest_run(tmp_path)
    assert run is not None
    answer = json.loads((run / "calibration.json").read_text())
    assert (answer["transforms"], answer["intrinsics"], answer["joint"]) == ({}, {}, None)
    capsys.readouterr()
    assert main(["report", str(tmp_path)]) == 4
    assert capsys.readouterr().out.startswith("REFUSED: The solver did not converge.")


def test_json_is_one_object(simulated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--json` of both verbs prints one JSON object, that of calibration.json; a certificate only on request."""
    assert main(["calibrate", str(simulated), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    run = latest_run(simulated)
    assert run is not None
    assert json.loads((run / "calibration.json").read_text()) == answer
    assert main(["report", str(simulated), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == answer
    assert answer["schema"] == "basecal/calibration/1"
    assert answer["certificate"] is None
    assert answer["inputs"].keys() == {"cell.yaml", "recording/samples.jsonl"}
    assert np.array(answer["transforms"][BASE]["covariance"]).shape == (6, 6)


@pytest.mark.journey
def test_verbose_prints_the_time_of_each_stage(
    simulated: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`--verbose` lists each stage once on stderr, the longest first, and their sum; stdout stays one JSON object."""
    monkeypatch.setattr(calibrating, "calibrate", calibrating.calibrate.__wrapped__)  # what is kept takes none
    assert main(["calibrate", str(simulated), "--json", "--verbose"]) == 0
    out, err = capsys.readouterr()
    json.loads(out)
    lines = [line.split(" s  ") for line in err.splitlines()]
    seconds, names = [float(took) for took, _ in lines], [name for _, name in lines]
    assert {"start", "conventions", "outliers", "cross-validation"} <= set(names)
    assert len(set(names)) == len(names)
    assert seconds[:-1] == sorted(seconds[:-1], reverse=True)
    assert names[-1] == "all stages"
    assert seconds[-1] == pytest.approx(sum(seconds[:-1]), abs=1e-3 * len(seconds))


def test_new_cell_is_refused_with_advice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A cell without samples is refused with exit code 1 and advice on what to record, and has its run."""
    main(["new", str(tmp_path)])
    capsys.readouterr()
    assert main(["calibrate", str(tmp_path)]) == 4
    said = capsys.readouterr()
    assert said.out.startswith("REFUSED: ")
    assert "Record at least 10 samples" in " ".join(said.out.split())
    run = latest_run(tmp_path)
    assert run is not None
    assert Path(said.err.removeprefix("page: ").rstrip()).resolve() == (run / "report.html").resolve()
    assert {finding.code for finding in read_calibration(run).findings} == {"too-few-samples"}
    assert main(["report", str(tmp_path)]) == 4


@pytest.mark.parametrize("verb", ["calibrate", "report"])
def test_folder_without_a_cell_is_an_input_error(tmp_path: Path, verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder without a cell causes one line on stderr and exit code 3, with and without `--json`."""
    for words in ([verb, str(tmp_path)], [verb, str(tmp_path), "--json"]):
        assert main(words) == 3
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.startswith(f"basecal: error: {tmp_path}")
        assert said.err.count("\n") == 1


def test_report_without_a_run_advises_to_calibrate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`report` of a cell without a run advises to calibrate first."""
    main(["new", str(tmp_path)])
    assert main(["report", str(tmp_path)]) == 3
    assert f"basecal calibrate {tmp_path}" in capsys.readouterr().err


@pytest.mark.slow
def test_demo_prints_its_true_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The answer from ten samples is within the 1e-6 quantile of its covariance, has a page, and can be repeated.

    Its 25 samples are captured by `make demo`, which .ci/run runs.
    """
    folder = str(tmp_path / "demo")
    monkeypatch.setitem(_SAMPLES, "poses", 10)
    main(["demo", folder, "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert 0 < answer["true_error"][BASE]["squared_sigmas"] < 38.3
    assert answer["true_error"][BASE]["error_mm"] < 3
    (page,) = Path(folder).glob("runs/*/report.html")
    assert BASE in page.read_text(encoding="utf-8")
    monkeypatch.setitem(_SAMPLES, "poses", 5)
    main(["demo", folder])
    told = capsys.readouterr().out
    assert "5/5 sample 4: taken" in told
    assert "true error" in told
    assert "basecal new mycell" in told


@pytest.mark.slow
def test_demo_of_the_papers_sequence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`demo --led` shifts an LED: maximum likelihood is within its covariance and nearer than the closed form."""
    main(["demo", str(tmp_path / "demo"), "--led", "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert answer["true_error"][BASE]["squared_sigmas"] < 38.3
    assert answer["true_error"][BASE]["error_mm"] < answer["closed_form_error"]["error_mm"]


@pytest.mark.journey
def test_imported_poses_calibrate_exactly(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Noise-free poses written as text in mm yield the true base within 1e-6."""
    rng = np.random.default_rng(3)
    eye_flange_from_camera, hand_flange_from_target = SE3.exp(0.3 * rng.normal(size=(2, 6)))
    eye_base_from_hand_base = SE3.exp(np.array([1.2, -0.3, 0.1, 0.2, -0.1, 2.0]))
    eye_base_from_eye_flange = SE3.exp(0.5 * rng.normal(size=(12, 6)))
    hand_base_from_hand_flange = SE3.exp(0.5 * rng.normal(size=(12, 6)))
    eye_base_from_camera = eye_base_from_eye_flange @ eye_flange_from_camera
    eye_base_from_target = eye_base_from_hand_base @ hand_base_from_hand_flange @ hand_flange_from_target
    streams = {
        "eye-base-from-flange": eye_base_from_eye_flange,
        "hand-base-from-flange": hand_base_from_hand_flange,
        "camera-from-target": eye_base_from_camera.inverse() @ eye_base_from_target,
    }
    words = ["import", "poses", str(tmp_path / "c"), "--length-unit", "mm"]
    for name, poses in streams.items():
        matrices = poses.matrix
        matrices[:, :3, 3] *= 1000
        np.savetxt(tmp_path / name, matrices.reshape(-1, 4), fmt="%.15g")
        words += [f"--{name}", str(tmp_path / name)]
    assert main(words) == 0
    capsys.readouterr()
    main(["calibrate", str(tmp_path / "c"), "--json"])
    found = json.loads(capsys.readouterr().out)["transforms"][BASE]
    error = (eye_base_from_hand_base.inverse() @ SE3.from_quaternion(found["q_xyzw"], found["t_m"])).log()
    assert np.abs(error).max() < 1e-6


def test_report_has_the_frame_names_of_the_cell(
    simulated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line to paste has the frame names of cell.yaml."""
    shutil.copytree(simulated, tmp_path / "c")
    path = tmp_path / "c" / "cell.yaml"
    text = path.read_text().replace("eye: {", "eye: {frames: {base: left_base_link}, ", 1)
    path.write_text(text.replace(", }", "}"))
    assert read_cell(tmp_path / "c").robots["eye"].frames == {"base": "left_base_link"}
    assert main(["report", str(tmp_path / "c"), "--verbose"]) == 0
    assert "--frame-id left_base_link --child-frame-id hand_base" in capsys.readouterr().out


@pytest.mark.slow
def test_certificate_is_reported_on_request(simulated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With `--certify` JSON and report state that the optimum is proven."""
    assert main(["calibrate", str(simulated), "--certify", "--json"]) == 0
    certificate = json.loads(capsys.readouterr().out)["certificate"]
    assert certificate["global"] is True
    assert 0 <= certificate["gap"] < 1e-3
    assert certificate["reason"] == ""
    assert main(["report", str(simulated), "--verbose"]) == 0
    assert "certificate: global optimum proven" in capsys.readouterr().out


@pytest.mark.journey
def test_box_is_calibrated_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The summary recommends a calibration within the box, whose centre is the task point; it reports an empty box."""
    assert main(["simulate", str(tmp_path), "--samples", "15", "--target", "pose"]) == 0
    capsys.readouterr()
    assert main(["calibrate", str(tmp_path), "--task-box", "-9 -9 -9 9 9 8"]) == 0
    assert "(15 samples): held-out" in capsys.readouterr().out
    run = latest_run(tmp_path)
    assert run is not None
    told = read_calibration(run)
    assert told.settings["task_point"] == [0.0, 0.0, -0.5]
    assert [len(part.samples) for part in told.local] == [15]
    assert main(["calibrate", str(tmp_path), "--task-box", "8", "8", "8", "9", "9", "9"]) == 0
    assert "in the box: fewer than 10 samples" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "said"),
    [(["--task-point", "0 0 0"], "either --task-point"), (["--method", "axis-shift"], "--task-box has no effect on")],
)
def test_box_excludes_other_options(
    simulated: Path, more: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A box cannot be combined with a point or with the closed form of the paper."""
    assert main(["calibrate", str(simulated), "--task-box", "0 0 0 1 1 1", *more]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(("method", "start", "point", "box", "choice", "said"), [
    ("bundle", "closed", None, None, "nearest", ""),
    ("bundle", "guess", None, (0.0,) * 6, "nearest", ""),
    ("scene", "guess", None, None, "nearest", "--start guess has no effect on --scene"),
    ("scene", "closed", (0.0,) * 3, None, "nearest", ""),
    ("bundle", "closed", None, None, "mean", "--station-choice has no effect on --method bundle"),
    ("axis-shift", "closed", (0.0,) * 3, None, "mean", ""),
    ("axis-shift", "closed", None, None, "nearest", ""),
    ("axis-shift", "closed", None, None, "mean", "--station-choice needs a point"),
    ("axis-shift", "closed", None, (0.0,) * 6, "nearest", "--task-box has no effect on --method axis-shift"),
    ("axis-shift", "guess", None, None, "nearest", "--start guess is ignored: --method axis-shift"),
])  # fmt: skip
def test_options_without_effect_are_refused(method, start, point, box, choice, said):  # type: ignore[no-untyped-def]
    """Options are refused with a method that does not use them; all others are accepted."""
    with pytest.raises(UsageError, match=said) if said else nullcontext():
        verb._refuse_unused_options(method, start, point, box, choice)


def test_scene_is_a_method_or_is_joined() -> None:
    """A scene cannot be combined with the closed form of shifts."""
    assert [verb._method_in_use("bundle", scene) for scene in (True, False, "also")] == ["scene", "bundle", "bundle"]
    assert verb._method_in_use("axis-shift", False) == "axis-shift"
    with pytest.raises(UsageError, match="--scene also has no effect on --method axis-shift"):
        verb._method_in_use("axis-shift", "also")
