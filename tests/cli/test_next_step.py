"""Tests of the advice on the next step before a calibration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from basecal.cell import Calibration, Driver, Finding, Recording, Tolerance
from basecal.cli import main
from basecal.cli.next_step import (
    cameras_without_lens,
    capture_command,
    fill_in_commands,
    has_drivers,
    next_command,
    next_step,
)
from basecal.simulation import Scenario, simulate

MADE = simulate(Scenario(samples=3), 0)


OFFER = Finding("robot-model", "warning", ("eye",), "Joints are off.", ("Write `joint_offsets: {status: free}`.",))


def step(folder: Path, cell=MADE.cell, recording=MADE.recording) -> str:  # type: ignore[no-untyped-def]
    return next_step(cell, recording, folder) or ""


def without(**fields: object) -> Recording:
    return Recording(tuple(replace(sample, **fields) for sample in MADE.recording.samples))  # type: ignore[arg-type]


def test_missing_parts_are_named_in_order(tmp_path: Path) -> None:
    """Robots come first, then images, then a target; a complete cell has no advice."""
    assert step(tmp_path) == ""
    silent = without(robots={})
    assert step(tmp_path, recording=silent).startswith("next, poses of eye, hand: basecal import poses ")
    blind = without(observations=())
    assert step(tmp_path, recording=blind).endswith(" DIR --camera wrist")
    assert "which target the images show" in step(tmp_path, replace(MADE.cell, targets={}))
    assert "calibrate" in step(tmp_path, replace(MADE.cell, targets={}))
    assert step(tmp_path, replace(MADE.cell, targets={}, sees_scene=True)).startswith("next, what hand carries: ")
    assert "--camera NAME --on ROBOT" in step(tmp_path, replace(MADE.cell, cameras={}))


def test_samples_without_the_carrying_arm_are_named(tmp_path: Path) -> None:
    """Samples of a session lack the arm that carries the observed target."""
    later = [
        replace(each, sample=each.sample + 3, robots={"eye": each.robots["eye"]}) for each in MADE.recording.samples
    ]
    told = step(tmp_path, recording=Recording((*MADE.recording.samples, *later)))
    assert told.startswith("next, the states of hand in samples 3 to 5: basecal import poses ")
    assert told.endswith(" --robot hand FILE --format FORMAT --still")


@pytest.mark.parametrize(
    ("importer", "urdf", "command"),
    [
        ("", None, "poses mycell --robot eye FILE --format FORMAT"),
        ("arrays", None, "poses mycell --robot eye FILE --format FORMAT"),
        ("images", "eye.urdf", "joints mycell --robot eye FILE"),
        ("joints", "eye.urdf", "joints mycell --robot eye FILE"),
        ("joints", None, "joints mycell --robot eye FILE --urdf URDF --base-link LINK --flange-link LINK"),
        ("lerobot", "eye.urdf", "lerobot mycell --robot eye DATASET --unit UNIT"),
        (
            "lerobot",
            None,
            "lerobot mycell --robot eye DATASET --unit UNIT --urdf URDF --base-link LINK --flange-link LINK",
        ),
    ],
)
def test_advice_uses_the_importer_of_the_first_arm(importer: str, urdf: str | None, command: str) -> None:
    """Or the description in `cell.yaml`: an arm with a URDF is recorded by joints."""
    cell = replace(MADE.cell, robots={**MADE.cell.robots, "eye": replace(MADE.cell.robots["eye"], urdf=urdf)})
    without_eye = Recording(
        tuple(replace(each, robots={"hand": each.robots["hand"]}) for each in MADE.recording.samples)
    )
    told = next_step(cell, without_eye, Path("mycell"), importer=importer)
    quantity = "poses" if "poses" in command else "joints"
    assert told == f"next, {quantity} of eye: basecal import {command}"
    later = [replace(each, sample=each.sample + 3) for each in without_eye.samples]
    told = next_step(cell, Recording((*MADE.recording.samples, *later)), Path("mycell"), importer=importer)
    still = "" if importer == "lerobot" else " --still"
    assert told == f"next, the states of eye in samples 3 to 5: basecal import {command}{still}"


def test_images_in_the_folder_of_the_cell_are_found(tmp_path: Path) -> None:
    """They are where they would be copied to, and are imported from there."""
    dropped = tmp_path / "recording" / "images" / "wrist"
    dropped.mkdir(parents=True)
    (dropped / "1.PNG").touch()
    assert f" {dropped} --camera wrist" in step(tmp_path, recording=without(observations=()))


def test_robot_without_camera_or_target_is_reported(tmp_path: Path) -> None:
    """Its base is unobservable."""
    targets = {name: replace(each, on="world") for name, each in MADE.cell.targets.items()}
    assert step(tmp_path, replace(MADE.cell, targets=targets)).startswith("next, what hand carries: ")


def test_calibrate_prints_the_next_command(tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    """A new cell is refused with the command that continues."""
    assert main(["new", str(tmp_path / "c")]) == 0
    assert "next, poses of eye, hand: basecal import poses" in capsys.readouterr().out
    assert main(["calibrate", str(tmp_path / "c")]) == 4
    assert "next, poses of eye, hand: basecal import poses" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("calibration", "command"),
    [
        (Calibration("good"), "basecal export cell"),
        (Calibration("good", tolerance=Tolerance(1e-3, 5e-4, True)), "basecal export cell"),
        (
            Calibration("good", tolerance=Tolerance(1e-3, 2e-3, False), settings={"tolerance_m": 1e-3}),
            "basecal plan cell --tolerance 1mm -o plan.jsonl",
        ),
        (
            Calibration(
                "doubtful",
                tolerance=Tolerance(5e-4, 2e-3, False),
                settings={"tolerance_m": 5e-4, "task_point": [0.8, 0.1, 0.3]},
            ),
            "basecal plan cell --tolerance 0.5mm --task-point 0.8 0.1 0.3 -o plan.jsonl",
        ),
        (
            Calibration(
                "good",
                tolerance=Tolerance(5e-4, 2e-3, False),
                settings={"tolerance_m": 5e-4, "task_point": [0.5, 0, 0], "task_box": [0, 0, 0, 1, 0, 0]},
            ),
            "basecal plan cell --tolerance 0.5mm --task-box 0 0 0 1 0 0 -o plan.jsonl",
        ),
        (Calibration("refused"), "follow the advice above, then basecal calibrate cell"),
        (
            Calibration("refused", settings={"method": "scene", "tolerance_m": 3e-4}),
            "follow the advice above, then basecal calibrate cell --scene --tolerance 0.3mm",
        ),
        (
            Calibration("doubtful", findings=(OFFER,), settings={"joins_scene": True}),
            "basecal fix cell, or follow the advice above, then basecal calibrate cell --scene also",
        ),
        (
            Calibration(
                "good", tolerance=Tolerance(1e-3, 2e-3, False), settings={"method": "scene", "tolerance_m": 1e-3}
            ),
            "import more images of each arm, then basecal calibrate cell --scene --tolerance 1mm",
        ),
    ],
)
def test_each_verdict_has_a_command(calibration: Calibration, command: str) -> None:
    """The command uses the answer, plans more samples, or fixes the problem."""
    assert next_command(MADE.cell, calibration, Path("cell")) == command


def test_scene_needs_hand_guided_samples(tmp_path: Path) -> None:
    """No plan is made for a scene: a person guides the arms to further samples."""
    driver = Driver("manual")
    robots = {name: replace(each, driver=driver) for name, each in MADE.cell.robots.items()}
    cameras = {name: replace(each, driver=driver) for name, each in MADE.cell.cameras.items()}
    cell = replace(MADE.cell, robots=robots, cameras=cameras, targets={}, sees_scene=True)
    settings = {"method": "scene", "tolerance_m": 1e-3}
    missed = Calibration("good", tolerance=Tolerance(1e-3, 2e-3, False), settings=settings)
    assert next_command(cell, missed, Path("cell")) == "basecal capture cell --freedrive"
    assert next_step(replace(MADE.cell, targets={}), MADE.recording, tmp_path, by_scene=True) != step(
        tmp_path, replace(MADE.cell, targets={})
    )


def test_findings_name_the_cell() -> None:
    """The folder's name is one word of a shell, whatever its characters."""
    finding = Finding("x", "warning", (), "Wrong.", ("Or let `basecal fix CELL` do so.",))
    (named,) = fill_in_commands(Calibration("doubtful", findings=(finding,)), Path("my cell")).findings
    assert named.message == "Wrong. Or let `basecal fix 'my cell'` do so."


def test_capture_needs_all_drivers() -> None:
    """Robots and cameras need drivers; a cell without any cannot be captured."""
    driver = Driver("manual")
    robots = {name: replace(each, driver=driver) for name, each in MADE.cell.robots.items()}
    cameras = {name: replace(each, driver=driver) for name, each in MADE.cell.cameras.items()}
    assert has_drivers(replace(MADE.cell, robots=robots, cameras=cameras))
    assert not has_drivers(replace(MADE.cell, robots=robots))
    assert not has_drivers(replace(MADE.cell, cameras=cameras))
    assert not has_drivers(replace(MADE.cell, robots={**robots, "eye": MADE.cell.robots["eye"]}, cameras=cameras))


def test_scene_is_captured_by_hand() -> None:
    """A scene that is seen, or a cell without a target, is captured by hand; a single target is planned for."""
    folder = Path("my cell")
    assert capture_command(MADE.cell, folder) == "basecal capture 'my cell'"
    for cell in (replace(MADE.cell, sees_scene=True), replace(MADE.cell, targets={})):
        assert capture_command(cell, folder) == "basecal capture 'my cell' --freedrive"


def test_missing_lens_is_reported_for_cameras_with_images() -> None:
    """Cameras without a lens that have images are reported; points in metres need none."""
    cameras = {name: replace(each, intrinsics=None) for name, each in MADE.cell.cameras.items()}
    blind = replace(MADE.cell, cameras=cameras)
    shown = without(images={"wrist": "a.png"})
    assert cameras_without_lens(blind, shown) == ["wrist"]
    assert cameras_without_lens(MADE.cell, shown) == []
    assert cameras_without_lens(blind, MADE.recording) == []
    told = next_step(blind, shown, Path("c"))
    assert told == "next, the lens of wrist: add `intrinsics: {status: free}` to it in cell.yaml"


def test_samples_without_any_robot_are_not_missed() -> None:
    """Nor are those of a cell's only robot; the first and last sample of a robot are named."""
    bare = [replace(each, sample=each.sample + 3, robots={}) for each in MADE.recording.samples]
    assert next_step(MADE.cell, Recording((*MADE.recording.samples, *bare)), Path("c")) is None
    alone = simulate(Scenario(samples=3, layout="eye_in_hand"), 0)
    still = [replace(each, sample=each.sample + 3, robots={}) for each in alone.recording.samples]
    assert next_step(alone.cell, Recording((*alone.recording.samples, *still)), Path("c")) is None


def test_images_beside_other_files_are_found(tmp_path: Path) -> None:
    """A folder that holds only notes has no images."""
    dropped = tmp_path / "recording" / "images" / "wrist"
    dropped.mkdir(parents=True)
    (dropped / "notes.txt").touch()
    assert " DIR --camera wrist" in step(tmp_path, recording=without(observations=()))


def test_single_arm_has_no_missing_arm(tmp_path: Path) -> None:
    """A sample of its camera without its pose is no session of another arm."""
    cell = replace(MADE.cell, robots={"eye": MADE.cell.robots["eye"]}, bases={}, targets={})
    target = replace(MADE.cell.targets["board"], on="world")
    first, *others = MADE.recording.samples
    still = {"eye": first.robots["eye"]}
    samples = (*(replace(each, robots=still) for each in others), replace(first, robots={"other": still["eye"]}))
    assert step(tmp_path, replace(cell, targets={"board": target}), Recording(samples)) == ""
