"""Tests of plans of `capture`: refusals, and the output of --dry-run."""

from __future__ import annotations

import json
import re
from contextlib import nullcontext
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.cell import Calibration, Sample
from basecal.cell.calibration import Verdict
from basecal.cell.files import append_verification, input_hashes, write_calibration, write_cell, write_plan
from basecal.cell.results.verification_file import PastVerification
from basecal.cli import capture_plan as module
from basecal.cli import main
from basecal.cli.capture_plan import (
    _clearance_text,
    _finished_count,
    _speed_text,
    capture_plan,
    known_sketch,
    refuse_plan,
    say_plan,
    say_ways,
)
from basecal.cli.plan_options import PlanOptions
from basecal.errors import InputError, UsageError
from basecal.geometry import PoseEstimate
from basecal.simulation import Scenario, simulate
from basecal.simulation.arms import BASE_LINK
from basecal.simulation.running.protocol import connect, read_address
from basecal.simulation.running.world_file import write_world
from shared.facing_arms import facing_arms
from shared.running_cell import running


def plan_of(folder: Path, *joints: dict[str, list[float]]) -> str:
    """File of samples that move robots to joints."""
    lines = [
        {"sample": number, "robots": {name: {"joints_rad": list(values)} for name, values in robots.items()}}
        for number, robots in enumerate(joints)
    ]
    path = folder / "plan.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return str(path)


def where(folder: Path, robot: str) -> np.ndarray:
    """Current joints of an arm of a running cell."""
    line = connect(read_address(folder))
    found = np.array(line.ask(do="state", robot=robot)["joints_rad"])
    line.close()
    return found


@pytest.mark.journey
def test_plan_with_one_bad_sample_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The second sample of the second robot is beyond a limit: one line, exit code 3, and no arm has moved."""
    with running(tmp_path) as world:
        home = {name: joints.tolist() for name, joints in world.home.items()}
        sound = {**home, "eye": [*home["eye"][:5], home["eye"][5] + 0.2]}
        bad = {**home, "hand": [*home["hand"][:2], 3.4, *home["hand"][3:]]}
        words = ["capture", str(tmp_path), "--plan", plan_of(tmp_path, sound, bad), "--go"]
        assert main(words) == 3
        told = capsys.readouterr().err
        assert "sample 1: joint elbow of hand is 3.4 rad, but its limits are -3.142 to 3.142 rad" in told
        assert "1 of 2 samples of the plan are refused: nothing was moved" in told
        for name, joints in world.home.items():
            np.testing.assert_array_equal(where(tmp_path, name), joints)
    assert not (tmp_path / "recording").exists()


def test_dry_run_prints_each_motion_and_moves_no_arm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each motion has the speed of its leading joint, reduced for the tool; --go beside it is refused."""
    with running(tmp_path) as world:
        home = {name: joints.tolist() for name, joints in world.home.items()}
        far = {**home, "eye": [home["eye"][0] + 0.05, *home["eye"][1:]]}
        words = [
            "capture",
            str(tmp_path),
            "--plan",
            plan_of(tmp_path, far),
            "--dry-run",
            "--tool-speed-limit",
            "20mm/s",
        ]
        assert main(words) == 0
        told = capsys.readouterr().out
        (line,) = (line for line in told.splitlines() if line.split()[:2] == ["0", "eye"])
        joint, tool = map(float, line.split()[2:4])
        assert (tool, joint < 5) == (20.0, True)
        assert re.search(r" hand \d{3}$", line)  # mm
        assert re.search(r"least clearance of motions: \d{3} mm between eye and hand; nothing else is checked", told)
        assert "nothing has moved: add --go" in told
        assert main([*words, "--go"]) == 2
        assert "--dry-run moves nothing" in capsys.readouterr().err
        np.testing.assert_array_equal(where(tmp_path, "eye"), world.home["eye"])


@pytest.mark.parametrize("speed", ["20", "20mm", "0mm/s", "3m/s"])
def test_tool_speed_needs_a_unit(tmp_path: Path, capsys: pytest.CaptureFixture[str], speed: str) -> None:
    """Without a unit, or above 2 m/s, it is refused before any robot is reached."""
    write_world(facing_arms(), tmp_path)
    assert main(["capture", str(tmp_path), "--tool-speed-limit", speed]) == 2
    assert re.search(f"--tool-speed-limit '?{speed}'?: expected", capsys.readouterr().err)


@pytest.mark.journey
def test_missing_mesh_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The plan is checked with a line in place of the mesh, and a warning reports it."""
    with running(tmp_path) as world:
        urdf = tmp_path / "eye.urdf"
        body = '<collision><geometry><mesh filename="none.stl"/></geometry></collision>'
        urdf.write_text(re.sub(f'<link name="({BASE_LINK})" ?/>', rf'<link name="\1">{body}</link>', urdf.read_text()))
        home = {name: joints.tolist() for name, joints in world.home.items()}
        assert main(["capture", str(tmp_path), "--plan", plan_of(tmp_path, home), "--dry-run"]) == 0
    why = "mesh 'none.stl' is not in the cell's folder; copy it there. A line with a radius of 60 mm is checked"
    assert why in capsys.readouterr().out


def test_transforms_come_from_the_latest_run(tmp_path: Path) -> None:
    """As in `plan`, a cell without stated transforms uses those of the latest run.

    Those of a refused run or of another cell.yaml are not used.
    """
    made = simulate(Scenario(samples=1), 2)
    write_cell(made.cell, tmp_path)
    with pytest.raises(InputError, match="roughly where things are"):
        known_sketch(tmp_path)
    found = {name: PoseEstimate(pose, np.eye(6)) for name, pose in made.truth.items()}
    run = write_calibration(Calibration("good", found, inputs=input_hashes(tmp_path)), tmp_path).parent
    sketch = known_sketch(tmp_path)
    assert sketch.transforms.keys() == made.truth.keys()
    assert all(unknown.mean is None for unknown in sketch.cell.transforms.values())
    for moved, is_trusted in ((False, True), (None, False), (True, False)):
        past = PastVerification(datetime.now(UTC), run.name, 3, moved, 0.5, None, None, {})
        append_verification(tmp_path, past)
        with nullcontext() if is_trusted else pytest.raises(InputError, match="roughly where things are"):
            known_sketch(tmp_path)


@pytest.mark.parametrize("verdict", ["doubtful", "refused"])
def test_doubtful_calibration_moves_no_arm(verdict: Verdict, tmp_path: Path) -> None:
    """Clearances from a wrong base are meaningless: the cell has to state the transforms."""
    made = simulate(Scenario(samples=1), 2)
    write_cell(made.cell, tmp_path)
    found = {name: PoseEstimate(pose, np.eye(6)) for name, pose in made.truth.items()}
    write_calibration(Calibration(verdict, found, inputs=input_hashes(tmp_path)), tmp_path)
    with pytest.raises(InputError, match="roughly where things are"):
        known_sketch(tmp_path)


def test_plan_without_samples_has_no_motions(capsys: pytest.CaptureFixture[str]) -> None:
    """No motion is printed for a plan without samples."""
    replanner = SimpleNamespace(words=lambda: "0.3 mm at the task point reached")
    say_plan(None, None, [], True, None, False, replanner)  # type: ignore[arg-type]
    assert capsys.readouterr().out == "0.3 mm at the task point reached; nothing will move\n"


def test_dry_run_names_missing_drivers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The dry plan names missing drivers, which --go would refuse."""
    write_world(facing_arms(), tmp_path)
    text = (tmp_path / "cell.yaml").read_text()
    (tmp_path / "cell.yaml").write_text(re.sub(r"^ *driver: .*\n", "", text, flags=re.MULTILINE))
    home = {name: joints.tolist() for name, joints in facing_arms().home.items()}
    words = ["capture", str(tmp_path), "--plan", plan_of(tmp_path, home)]
    assert main(words) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "nothing has moved: no camera has a `driver`. Add it to cell.yaml before --go"
    assert main([*words, "--go"]) == 3
    assert "no camera of the cell has a `driver`" in capsys.readouterr().err
    assert not (tmp_path / "recording").exists(), "a refused capture has not begun"


@pytest.mark.parametrize("count", [20, 21])
def test_first_twenty_refusals_are_printed(count: int, capsys: pytest.CaptureFixture[str]) -> None:
    """A sample refused by several robots counts once; without a refusal no line is printed."""
    refusals = [SimpleNamespace(sample=k // 2) for k in range(count)]
    with pytest.raises(InputError, match=rf"^{(count + 1) // 2} of 30 samples of the plan are refused: nothing was"):
        refuse_plan(SimpleNamespace(refusals=refusals), 30)  # type: ignore[arg-type]
    assert len(capsys.readouterr().err.splitlines()) == 20
    refuse_plan(SimpleNamespace(refusals=[]), 30)  # type: ignore[arg-type]
    assert capsys.readouterr() == ("", "")


def way(sample: int, robot: str, *gaps: tuple[str, str, float], rad_s: float = 0.5, m_s: float = 0.1):  # type: ignore[no-untyped-def]
    """Motion with its clearances."""
    found = [SimpleNamespace(robot=one, other=other, gap_m=gap_m) for one, other, gap_m in gaps]
    return SimpleNamespace(sample=sample, robot=robot, joint_rad_s=rad_s, tool_m_s=m_s, gaps=found)


CHECK = SimpleNamespace(
    paths=[
        way(0, "eye", ("eye", "hand", 0.3), ("eye", "table", 0.5), rad_s=np.radians(30)),
        way(1, "hand", ("eye", "hand", 0.123), m_s=0.25),
    ],
    refusals=[SimpleNamespace(sample=1)],
)


def test_fastest_and_nearest_motions_are_printed() -> None:
    """The extremes of all motions are printed: the least clearance of each pair, the largest first.

    Without motions none is printed.
    """
    assert _speed_text(CHECK) == ", no joint faster than 30 deg/s and no point faster than 250 mm/s"  # type: ignore[arg-type]
    least = "500 mm between eye and table, 123 mm between eye and hand"
    assert _clearance_text(CHECK) == f"least clearance of motions: {least}; nothing else is checked"  # type: ignore[arg-type]
    still = SimpleNamespace(paths=[], refusals=[])
    assert (_speed_text(still), _clearance_text(still)) == ("", "the motions are not checked")  # type: ignore[arg-type]


def test_each_motion_is_printed_as_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    """The line has its speeds, its clearance to each other body, and whether its sample is refused."""
    say_ways(CHECK)  # type: ignore[arg-type]
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[1:] == [
        ["0", "eye", "30.0", "100", "hand", "300,", "table", "500"],
        ["1", "hand", "28.6", "250", "eye", "123", "refused"],
    ]


@pytest.mark.parametrize(("is_new", "go", "cameras", "said"), [
    (True, True, True, ["2 samples; no robot will move"]),
    (False, True, True, ["continues the interrupted plan: 2 samples; no robot will move"]),
    (True, False, True, ["2 samples; no robot", "nothing has moved: add --go"]),
    (True, False, False, ["2 samples; no robot", "nothing has moved: no camera has a `driver`"]),
    (True, True, False, ["2 samples; no robot"]),
])  # fmt: skip
def test_intended_capture_is_printed(
    is_new: bool, go: bool, cameras: bool, said: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """The output names what is continued, what moves, who guides arms by hand, and what is missing before --go."""
    robots = {name: SimpleNamespace(is_live=name != "typed") for name in ("left", "right", "typed")}
    rig = SimpleNamespace(robots=robots, cameras={"eye": None} if cameras else {})
    sketch = SimpleNamespace()
    still = SimpleNamespace(paths=[], refusals=[])
    say_plan(rig, sketch, [None, None], is_new, still, go, None)  # type: ignore[arg-type,list-item]
    lines = capsys.readouterr().out.splitlines()
    led = "left and right will be guided by hand: a sample is taken when all are at rest at a new pose"
    assert lines.pop(1) == led
    assert len(lines) == len(said)
    assert all(line.startswith(start) for line, start in zip(lines, said, strict=True))
    assert lines[0].endswith("samples; no robot will move; the motions are not checked")


@pytest.mark.parametrize(("recorded", "is_continued", "added"), [(None, False, 0), (None, True, 0), (7, True, 7)])
def test_further_samples_use_another_seed(
    recorded: int | None, is_continued: bool, added: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The seed is the number of recorded samples; a finished plan is continued only on request."""
    sketch = SimpleNamespace(cell=None)
    monkeypatch.setattr("basecal.acquisition.capture.finished_count", lambda *_: recorded)
    assert _finished_count(Path(), sketch, 25, is_continued) == added  # type: ignore[arg-type]
    for count, are in ((1, "1 sample is"), (7, "7 samples are")):
        monkeypatch.setattr("basecal.acquisition.capture.finished_count", lambda *_, count=count: count)
        with pytest.raises(UsageError, match=rf"The plan is finished: {are} recorded\. Add --more to record 25 more"):
            _finished_count(Path(), sketch, 25, False)  # type: ignore[arg-type]


def test_samples_come_from_pattern_file_or_interrupted_plan(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """An interrupted plan comes first; a pattern without a number has 25 samples."""
    asked: list[tuple[object, ...]] = []
    left: list[object] = []
    monkeypatch.setattr("basecal.acquisition.capture.remaining_samples", lambda *_: left)
    monkeypatch.setattr("basecal.acquisition.capture.finished_count", lambda *_: 3)
    monkeypatch.setattr("basecal.acquisition.rig.starting_states", lambda *_: "home")
    monkeypatch.setitem(module.PATTERNS, "poses", lambda *given: asked.append(given) or ["drawn"])
    sketch = SimpleNamespace(cell=None)

    def made(pattern: str, samples: int | None, replanner: object = None) -> tuple[object, bool]:
        """Plan of the next samples."""
        planning = PlanOptions(pattern, samples=samples, seed=10)
        return capture_plan(None, sketch, tmp_path, planning, replanner)  # type: ignore[arg-type]

    assert made("poses", None) == (["drawn"], True)
    assert made("poses", 4) == (["drawn"], True)
    assert asked == [(sketch, "home", 25, 13), (sketch, "home", 4, 13)]
    with pytest.raises(InputError, match=r"no pattern and no file 'poes' \(did you mean 'poses'\?\); the"):
        made("poes", 4)
    assert made("poes", 4, SimpleNamespace(samples=["planned"])) == (["planned"], True)
    left.append("left")
    assert made("poses", 4) == (["left"], False)


def test_another_file_is_not_the_interrupted_plan(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The file of the interrupted plan continues it; another one is refused, as its samples would not be taken."""
    simulation = simulate(Scenario(samples=3), 0)
    goals = [Sample(k, robots=sample.robots) for k, sample in enumerate(simulation.recording.samples)]
    (tmp_path / "recording").mkdir()
    write_plan(
        [replace(goal, sample=goal.sample + 7) for goal in goals], tmp_path / "recording" / "plan.jsonl", tmp_path
    )
    write_plan(goals, tmp_path / "same.jsonl", tmp_path)
    write_plan(goals[:2], tmp_path / "other.jsonl", tmp_path)
    monkeypatch.setattr("basecal.acquisition.capture.remaining_samples", lambda *_: goals[1:])
    sketch = SimpleNamespace(cell=simulation.cell)
    made = partial(capture_plan, None, sketch, tmp_path)  # type: ignore[arg-type]
    assert made(PlanOptions(str(tmp_path / "same.jsonl"))) == (goals[1:], False)
    with pytest.raises(UsageError, match=r"not the interrupted plan, of which 2 samples remain: .*, or remove .*plan"):
        made(PlanOptions(plan=tmp_path / "other.jsonl"))
