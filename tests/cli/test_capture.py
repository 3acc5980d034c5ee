"""Tests of `basecal capture`: its output, its refusals and its exit codes."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.acquisition.rig import Rig
from basecal.cell import Sample
from basecal.cli import capture as module
from basecal.cli import main
from basecal.errors import InputError
from basecal.planning.plan_check import PlanCheck, Refusal
from basecal.simulation.running.protocol import connect, read_address
from shared.running_cell import running


def joints(folder: Path) -> np.ndarray:
    """Current joints of the first arm of a running cell."""
    line = connect(read_address(folder))
    found = np.array(line.ask(do="state", robot="eye")["joints_rad"])
    line.close()
    return found


@pytest.mark.journey
def test_no_arm_moves_without_go(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The output names the robots that would move, with speeds and counts; arms stay, and no file is written."""
    with running(tmp_path) as world:
        assert main(["capture", str(tmp_path), "--samples", "3"]) == 0
        told = capsys.readouterr().out
        assert "3 samples; eye and hand will move, no joint faster than 30 deg/s" in told
        assert "add --go" in told
        assert np.array_equal(joints(tmp_path), world.home["eye"])
    assert not (tmp_path / "recording").exists()


@pytest.mark.journey
def test_json_lists_the_captured_samples(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--json` prints one object with the samples; a finished plan is refused, and --more records other samples."""
    words = ["capture", str(tmp_path), "--go", "--json", "--speed-limit-deg-s", "120"]
    with running(tmp_path):
        for more in ([], ["--more"]):
            first, count = (2, 1) if more else (0, 2)
            assert main([*words, "--samples", str(count), *more]) == 0
            answer = json.loads(capsys.readouterr().out)
            assert answer["captured"] == list(range(first, first + count))
            assert (answer["given_up"], answer["planned"]) == ([], count)
            assert 0 < answer["covered"] <= 1
            assert main([*words, "--samples", "4"]) == 2
            said = f"The plan is finished: {first + count} samples are recorded. Add --more to record 4 more"
            assert said in capsys.readouterr().err
    assert len((tmp_path / "recording" / "samples.jsonl").read_text().splitlines()) == 3


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Folder of a running cell, for refused commands."""
    folder = tmp_path_factory.mktemp("cell")
    with running(folder):
        yield folder


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--pattern", "pose"], "no pattern and no file 'pose' (did you mean 'poses'?)"),
        (["--pattern", "none.jsonl"], "no file 'none.jsonl'"),
        (["--plan", "none.jsonl"], "no file 'none.jsonl'"),
        (["--plan", "plan.jsonl", "--pattern", "shifts"], "give only one of them"),
        (["--speed-limit-deg-s", "0"], "speed-limit-deg-s"),
        (["--freedrive", "--go"], "--freedrive moves no arm, a person does: leave --go out"),
        (["--freedrive", "--plan", "x.jsonl", "--seed", "3"], "leave --plan, --seed out"),
        (["--freedrive", "--tool-speed-limit", "1m/s"], "leave --tool-speed-limit out"),
        (["--port", "5000"], "give --web"),
        (["--task-point", "0.5 0 0.3"], "give --tolerance"),
        (["--tolerance", "1mm"], "give either --task-point"),
        (
            ["--tolerance", "1mm", "--task-point", "0.5 0 0.3", "--plan", "x.jsonl", "--pattern", "shifts"],
            "give only one of",
        ),
        (["--tolerance", "1mm", "--task-point", "0.5 0 0.3", "--pattern", "x.jsonl"], "cannot be combined"),
        (["--task-point", "0.5 0 0.3", "--pattern", "shifts", "--freedrive"], "leave --pattern, --task-point out"),
    ],
)
def test_invalid_options_are_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    """An unknown pattern and a speed of zero are each refused in one line."""
    assert main(["capture", str(folder), *words]) in (2, 3)
    assert message in capsys.readouterr().err


@pytest.mark.slow
def test_shifts_are_planned_for_a_task(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Complete stations are planned; their description is printed without motion."""
    words = ["capture", str(folder), "--pattern", "shifts", "--task-point", "0.5 0 0.3"]
    assert main([*words, "--samples", "8"]) == 0
    told = capsys.readouterr().out
    assert "14 samples; eye and hand will move" in told
    assert "at the task" not in told


@pytest.mark.slow
def test_capture_ends_when_the_tolerance_is_reached(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With a tolerance, the expected number of samples is printed first.

    At most the largest allowed number is taken.
    """
    words = [
        "capture",
        str(tmp_path),
        "--tolerance",
        "1.5mm",
        "--task-point",
        "0.5 0 0.3",
        "--speed-limit-deg-s",
        "120",
    ]
    with running(tmp_path):
        assert main(words) == 0
        assert "1.5 mm at the task point needs" in capsys.readouterr().out
        assert main([*words, "--samples", "2", "--go", "--json"]) == 5
        answer = json.loads(capsys.readouterr().out)
        assert (len(answer["captured"]), answer["reached"]) == (2, False)
        assert main([*words, "--go"]) == 0
        assert "1.5 mm at the task point is reached" in capsys.readouterr().out


@pytest.mark.journey
def test_unready_cell_is_refused_with_advice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A new cell without guesses, and a simulated cell that does not run, are refused with advice."""
    main(["new", str(tmp_path / "new")])
    assert main(["capture", str(tmp_path / "new"), "--go"]) == 3
    assert "give eye_base_from_hand_base a value" in capsys.readouterr().err
    with running(tmp_path / "stopped"):
        pass
    (tmp_path / "stopped" / "derived" / "simulated.json").unlink()
    assert main(["capture", str(tmp_path / "stopped"), "--go"]) == 3
    assert "--process`" in capsys.readouterr().err


@pytest.mark.journey
def test_ctrl_c_stops_the_arms(tmp_path: Path) -> None:
    """An interrupted motion ends with exit code 130, and the arm is at rest before its goal."""
    with running(tmp_path) as world:
        words = [sys.executable, "-m", "basecal", "capture", str(tmp_path), "--samples", "2", "--go"]
        with subprocess.Popen(
            [*words, "--speed-limit-deg-s", "0.2"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(
                signal.SIGINT, signal.SIG_DFL
            ),  # what runs in the background may ignore it
        ) as process:
            process.stdout.readline()
            while np.array_equal(joints(tmp_path), world.home["eye"]):
                time.sleep(0.02)
            process.send_signal(signal.SIGINT)
            assert process.wait(60) == 130
            assert "interrupted: 0 samples are kept, and the same command goes on" in process.stderr.read()
        for _ in range(40):
            rest = joints(tmp_path)
        assert np.array_equal(rest, joints(tmp_path))
        assert not np.array_equal(rest, world.home["eye"])


def test_task_plan_replaces_refused_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan for a task is repeated until no sample is refused; any other plan is refused as a whole."""
    plan = [Sample(k) for k in range(3)]
    left_out: list[list[int]] = []

    def leave_out(refused: Sequence[Sample]) -> list[Sample]:
        left_out.append([sample.sample for sample in refused])
        return [sample for sample in plan if not any(sample.sample in each for each in left_out)]

    def checked(rig: object, sketch: object, plan: Sequence[Sample], *_: object, **__: object) -> PlanCheck:
        refused = [Refusal(s.sample, "it meets the table", "Leave it out") for s in plan if s.sample < 2]
        return PlanCheck((), tuple(refused[:1]))

    monkeypatch.setattr(module, "check_whole_plan", checked)
    monkeypatch.setattr("basecal.acquisition.rig.check_guarantees", lambda *_: None)

    def found(replanner: object) -> list[int]:
        moving, rig = module.MotionOptions(), Rig({}, {"wrist": SimpleNamespace()})
        given = module._check_capture(rig, None, plan, True, moving, replanner, go=True, dry_run=False, quiet=True)
        return [sample.sample for sample in given]

    assert found(SimpleNamespace(exclude=leave_out)) == [2]
    assert left_out == [[0], [1]]
    with pytest.raises(InputError, match="1 of 3 samples of the plan are refused"):
        found(None)


@pytest.mark.parametrize(
    ("planning", "is_replanned"),
    [
        ({"pattern": "shifts", "task_point": (0.5, 0.0, 0.3), "tolerance": "1mm"}, False),
        ({"pattern": "poses", "task_point": (0.5, 0.0, 0.3), "tolerance": "1mm"}, True),
        ({"task_point": (0.5, 0.0, 0.3), "tolerance": "1mm"}, True),
        ({"pattern": "poses"}, False),
    ],
)
def test_poses_for_a_task_are_planned_again(
    monkeypatch: pytest.MonkeyPatch, planning: dict[str, object], is_replanned: bool
) -> None:
    """Poses for a task are planned again after each sample; stations of shifts, or poses without a task, only once."""
    replanners: list[object] = []

    def planned(rig: object, sketch: object, cell: object, planning: object, replanner: object, *_: object) -> object:
        replanners.append(replanner)
        return [], True

    monkeypatch.setattr(module, "known_sketch", lambda *_: SimpleNamespace(cell=None))
    monkeypatch.setattr(module, "allowed_rig", lambda *_: nullcontext("rig"))
    monkeypatch.setattr(module, "Replanner", lambda *_: "replanner")
    monkeypatch.setattr(module, "capture_plan", planned)
    monkeypatch.setattr(module, "_check_capture", lambda rig, sketch, plan, *_, **__: plan)
    assert module.capture(Path("cell"), planning=module.PlanOptions(**planning)) == 0  # type: ignore[arg-type]
    assert replanners == ["replanner" if is_replanned else None]


@pytest.mark.slow
def test_capture_ends_at_a_persistent_disagreement(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A board at a new place is reported.

    With the option the capture ends there; without it all samples are recorded.
    """
    words = ["capture", "--go", "--samples", "14", "--speed-limit-deg-s", "120", "--json"]
    for name, options in (("ends", ["--stop-on-disagreement"]), ("goes_on", [])):
        folder = tmp_path / name
        with running(folder, "board-remounted=8@8"):
            assert main([*words, str(folder), *options]) == 1
        answer = json.loads(capsys.readouterr().out)
        assert any("moved at sample" in doubt["message"] for doubt in answer["doubts"] if doubt["is_lasting"])
        lines = (folder / "recording" / "samples.jsonl").read_text().splitlines()
        assert len(lines) == len(answer["captured"])
        assert (len(lines) < 14) == bool(options)


@pytest.mark.parametrize(
    ("reached", "lasting", "word"),
    [(True, False, "PASS"), (True, True, "DOUBTFUL"), (False, True, "FAIL"), (None, True, "DOUBTFUL")],
)
def test_a_lasting_disagreement_ends_no_capture_with_pass(reached: bool | None, lasting: bool, word: str) -> None:
    """The page ends as the exit code does."""
    doubt = SimpleNamespace(message="hand_base moved at sample 3", is_lasting=lasting)
    steps = [SimpleNamespace(sample=3, why_not="", doubts=(doubt,))]
    replanner = None if reached is None else SimpleNamespace(is_reached=reached, words=lambda: "0.3 mm is reached")
    assert module._outcome(steps, replanner, "next").word == word  # type: ignore[arg-type]
