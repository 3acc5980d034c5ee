"""Tests of `basecal plan` from end to end."""

from __future__ import annotations

import html
import json
import shlex
import shutil
from dataclasses import replace

import pytest
from tests.shared.remembered import remembering
from tests.shared.stages import without_stages

from basecal.accuracy import calibrate as calibrating
from basecal.accuracy.stages.solving import screen_conventions
from basecal.cell import Driver
from basecal.cell.files import latest_run, read_calibration, read_cell, read_plan, write_cell
from basecal.cli import main
from basecal.planning import plan as planning

no_conventions = without_stages(screen_conventions)

calibrated_once = remembering(calibrating, "calibrate")
planned_once = remembering(planning, "plan_for_task")


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan") / "cell"
    assert main(["simulate", str(folder), "--samples", "12", "--seed", "3", "--target", "points"]) == 0
    assert main(["calibrate", str(folder), "--robot-noise", "stated"]) == 0
    return folder


@pytest.mark.journey
def test_json_has_the_documented_fields(cell, capsys):
    """Samples have robots only, their number is the required one, and predictions are given.

    A quoted point is accepted.
    """
    capsys.readouterr()
    asked = ["plan", str(cell), "--tolerance", "0.5mm", "--task-point", "-0.3 0.7 0.1", "--json", "--anew"]
    assert main(asked) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["reachable"] is True
    assert found["needed"] == len(found["samples"])
    assert 0 < found["predicted_mm"] <= 0.5005
    assert all(set(sample) == {"sample", "robots"} for sample in found["samples"])
    assert found["forbidden_by"] is None


@pytest.mark.journey
def test_unreachable_tolerance_exits_with_code_1(cell, capsys):
    """The output names the error source that limits the result."""
    asked = ["plan", str(cell), "--tolerance", "1um", "--task-point", "-0.3", "0.7", "0.1"]
    assert main(asked) == 5
    assert "cannot be reached. " in capsys.readouterr().out
    assert main([*asked, "--json"]) == 5
    found = json.loads(capsys.readouterr().out)
    assert (found["needed"], found["reachable"]) == (None, False)
    assert found["forbidden_by"] == found["budget"][0]["source"]


@pytest.mark.journey
def test_reached_tolerance_needs_no_samples(cell, capsys):
    """The recorded samples suffice."""
    assert main(["plan", str(cell), "--tolerance", "10cm", "--task-point", "-0.3", "0.7", "0.1"]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("100 mm at the task point is already reached (95 %: ")


@pytest.mark.journey
def test_default_place_is_the_recorded_workspace(tmp_path, capsys):
    """`calibrate` judges the same place: its own error is reached already, and a little less needs samples."""
    cell = tmp_path / "cell"
    assert main(["simulate", str(cell), "--samples", "12", "--seed", "3", "--target", "points"]) == 0
    assert main(["calibrate", str(cell)]) == 0
    capsys.readouterr()
    expected_m = read_calibration(latest_run(cell)).meeting.expected_95_m
    needed = []
    for share in (1.001, 0.95):
        asked = ["plan", str(cell), "--tolerance", f"{1e3 * share * expected_m:.6f}mm", "--json"]
        assert main(asked) == 0
        needed.append(json.loads(capsys.readouterr().out)["needed"])
    assert needed[0] == 0
    assert needed[1] > 0


@pytest.mark.journey
def test_empty_recording_needs_a_task_point(cell, capsys):
    """One line requests the task point."""
    assert main(["plan", str(cell), "--samples", "3", "--anew"]) == 3
    assert "name a task point: --task-point X Y Z" in capsys.readouterr().err


@pytest.mark.journey
def test_plan_file_is_read_by_capture(cell, tmp_path, capsys):
    """Its lines are a plan that is read back."""
    file = tmp_path / "plan.jsonl"
    assert main(["plan", str(cell), "--samples", "4", "--task-box", "-0.4 0.6 0 -0.2 0.8 0.2", "-o", str(file)]) == 0
    assert "next, for robots' own programs, as the cell has no drivers: basecal plan " in capsys.readouterr().out
    assert len(read_plan(file, cell, read_cell(cell))) == 4
    assert main(["plan", str(cell), "--samples", "3", "--task-point", "0 0 0", "-o", str(tmp_path / "plan.json")]) == 0
    assert len(json.loads((tmp_path / "plan.json").read_text())["samples"]) == 3


@pytest.mark.journey
def test_reached_tolerance_advises_to_calibrate(cell, tmp_path, capsys):
    """The next command calibrates the recording with the same tolerance; an empty plan is not advised."""
    assert main(["calibrate", str(cell)]) in (0, 1)
    capsys.readouterr()
    asked = ["plan", str(cell), "--tolerance", "900mm", "-o", str(tmp_path / "plan.jsonl")]
    assert main(asked) == 0
    *_, last = capsys.readouterr().out.splitlines()
    assert last == f"next, to judge what is recorded: basecal calibrate {cell} --tolerance 900mm"


@pytest.mark.journey
def test_robot_programs_are_printed_or_written(cell, tmp_path, capsys):
    """Each format is printed, or written with -o; a program for one arm needs its name."""
    asked = ["plan", str(cell), "--samples", "3", "--task-point", "-0.3 0.7 0.1"]
    capsys.readouterr()
    assert main([*asked, "--to", "csv"]) == 0
    assert capsys.readouterr().out.startswith("sample,eye_")
    file = tmp_path / "eye.script"
    assert main([*asked, "--to", "ur-script", "--robot", "eye", "-o", str(file)]) == 0
    assert f"written: {file}" in capsys.readouterr().out
    assert file.read_text().count("movej(p[") == 3
    assert main([*asked, "--to", "ur-script"]) == 3
    assert "--robot: eye, hand" in capsys.readouterr().err


@pytest.mark.parametrize(
    "options",
    [
        ["--task-point", "0 0 0", "--samples", "3", "--to", "krl"],
        ["--task-point", "0 0 0", "--samples", "3", "--robot", "eye"],
        ["--task-point", "0 0 0", "--samples", "3", "--to", "csv", "--json"],
        ["--task-point", "0 0 0"],
        ["--task-point", "0 0", "--samples", "3"],
        ["--task-point", "0 0 0", "--task-box", "0 0 0 1 1 1", "--samples", "3"],
        ["--task-point", "0 0 0", "--tolerance", "0.2"],
    ],
)
def test_bad_options_are_one_line(cell, options, capsys):
    """No tolerance, a point of two numbers, both point and box, and a missing unit are refused in one line."""
    assert main(["plan", str(cell), *options]) in (2, 3)
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
def test_shifts_are_planned_by_complete_stations(cell, tmp_path, capsys):
    """Twenty samples are three stations, which capture reads from a file."""
    asked = ["plan", str(cell), "--pattern", "shifts", "--samples", "20", "--task-point", "-0.3 0.7 0.1"]
    assert main([*asked, "-o", str(tmp_path / "plan.jsonl")]) == 0
    capsys.readouterr()
    assert len(read_plan(tmp_path / "plan.jsonl", cell, read_cell(cell))) == 21


@pytest.mark.journey
def test_plan_has_a_page(cell, tmp_path, capsys):
    """It is in the cell's folder; without drivers it has the complete, runnable command for programs of the robots."""
    asked = ["plan", str(cell), "--samples", "3", "--task-point", "-0.3 0.7 0.1", "--anew", "--report", "--json"]
    assert main(asked) == 0
    assert "page: " in capsys.readouterr().err
    page, whole = html.unescape((cell / "plan.html").read_text()), f"basecal plan {cell} --task-point -0.3 0.7 0.1"
    whole += " --samples 3 --anew --to csv -o plan.csv"
    assert f"as the cell has no drivers: <code>{whole}</code>" in page
    *words, _ = shlex.split(whole)[1:]
    assert main([*words, str(tmp_path / "plan.csv")]) == 0
    assert (tmp_path / "plan.csv").read_text().count("\n") == 4


@pytest.mark.journey
def test_page_of_a_cell_with_drivers_names_the_capture(cell, tmp_path, capsys):
    """The complete quoted command writes the samples; then page and terminal name the capture."""
    found = read_cell(cell)
    robots = {name: replace(robot, driver=Driver("manual")) for name, robot in found.robots.items()}
    cameras = {name: replace(camera, driver=Driver("manual")) for name, camera in found.cameras.items()}
    driven = tmp_path / "my cell"
    shutil.copytree(cell, driven)
    write_cell(replace(found, robots=robots, cameras=cameras), driven)
    asked = ["plan", str(driven), "--samples", "3", "--task-point", "0 0 0", "--seed", "2", "--report"]
    again, file = f"basecal plan '{driven}' --task-point 0 0 0 --samples 3 --seed 2 -o", tmp_path / "next.jsonl"
    capsys.readouterr()
    assert main(asked) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"next, to write the samples: {again} plan.jsonl"
    page = html.unescape((driven / "plan.html").read_text())
    assert f"<code>{again} plan.jsonl</code>" in page
    assert f"<code>basecal capture '{driven}' --plan plan.jsonl --go</code>" in page
    assert main([*asked, "-o", str(file)]) == 0
    assert capsys.readouterr().out.splitlines()[-2:] == [
        f"written: {file}",
        f"next, to record the samples: basecal capture '{driven}' --plan {file}",
    ]
    page = html.unescape((driven / "plan.html").read_text())
    assert f"<code>basecal capture '{driven}' --plan {file} --go</code>" in page
    assert again not in page
