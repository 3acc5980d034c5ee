"""`basecal plan` from end to end."""

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


def test_json_is_what_programs_rely_on(cell, capsys):
    """Samples with robots alone, as many as are needed, and what is predicted; a point between quotes is one."""
    capsys.readouterr()
    asked = ["plan", str(cell), "--tolerance", "0.5mm", "--task-point", "-0.3 0.7 0.1", "--json", "--anew"]
    assert main(asked) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["reachable"] is True
    assert found["needed"] == len(found["samples"])
    assert 0 < found["predicted_mm"] <= 0.5005
    assert all(set(sample) == {"sample", "robots"} for sample in found["samples"])
    assert found["forbidden_by"] is None


def test_out_of_reach(cell, capsys):
    """Exit 1, and the source that forbids it."""
    asked = ["plan", str(cell), "--tolerance", "1um", "--task-point", "-0.3", "0.7", "0.1"]
    assert main(asked) == 5
    assert "cannot be reached. " in capsys.readouterr().out
    assert main([*asked, "--json"]) == 5
    found = json.loads(capsys.readouterr().out)
    assert (found["needed"], found["reachable"]) == (None, False)
    assert found["forbidden_by"] == found["budget"][0]["source"]


def test_what_is_reached_already(cell, capsys):
    """Without a sample more, with what is recorded."""
    assert main(["plan", str(cell), "--tolerance", "10cm", "--task-point", "-0.3", "0.7", "0.1"]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith("100 mm at the task point is already reached (95 %: ")


def test_without_a_place_it_plans_for_where_the_arms_worked(tmp_path, capsys):
    """There `calibrate` judges, too: what it measures is reached already, and a bit less needs samples."""
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


def test_nothing_recorded_has_no_place(cell, capsys):
    """A line asks for the task point."""
    assert main(["plan", str(cell), "--samples", "3", "--anew"]) == 3
    assert "name a task point: --task-point X Y Z" in capsys.readouterr().err


def test_a_file_for_capture(cell, tmp_path, capsys):
    """Its lines are a plan that is read back."""
    file = tmp_path / "plan.jsonl"
    assert main(["plan", str(cell), "--samples", "4", "--task-box", "-0.4 0.6 0 -0.2 0.8 0.2", "-o", str(file)]) == 0
    assert "next, for robots' own programs, as the cell has no drivers: basecal plan " in capsys.readouterr().out
    assert len(read_plan(file, cell, read_cell(cell))) == 4
    assert main(["plan", str(cell), "--samples", "3", "--task-point", "0 0 0", "-o", str(tmp_path / "plan.json")]) == 0
    assert len(json.loads((tmp_path / "plan.json").read_text())["samples"]) == 3


def test_what_is_reached_needs_no_capture(cell, tmp_path, capsys):
    """The next command calibrates what is recorded, by the same tolerance; nothing says to record an empty plan."""
    assert main(["calibrate", str(cell)]) in (0, 1)
    capsys.readouterr()
    asked = ["plan", str(cell), "--tolerance", "900mm", "-o", str(tmp_path / "plan.jsonl")]
    assert main(asked) == 0
    *_, last = capsys.readouterr().out.splitlines()
    assert last == f"next, to judge what is recorded: basecal calibrate {cell} --tolerance 900mm"


def test_what_robots_run(cell, tmp_path, capsys):
    """Each kind is printed, or written with -o; a program of one arm asks which."""
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
    """Nothing to reach, a point of two numbers, both a point and a box, no unit."""
    assert main(["plan", str(cell), *options]) in (2, 3)
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
def test_shifts_are_planned_by_whole_stations(cell, tmp_path, capsys):
    """Twenty samples are three stations, which capture takes from a file."""
    asked = ["plan", str(cell), "--pattern", "shifts", "--samples", "20", "--task-point", "-0.3 0.7 0.1"]
    assert main([*asked, "-o", str(tmp_path / "plan.jsonl")]) == 0
    capsys.readouterr()
    assert len(read_plan(tmp_path / "plan.jsonl", cell, read_cell(cell))) == 21


def test_a_page_of_the_plan(cell, tmp_path, capsys):
    """In the cell's folder; without drivers it has the whole command for robots' own programs, which runs as it is."""
    asked = ["plan", str(cell), "--samples", "3", "--task-point", "-0.3 0.7 0.1", "--anew", "--report", "--json"]
    assert main(asked) == 0
    assert "page: " in capsys.readouterr().err
    page, whole = html.unescape((cell / "plan.html").read_text()), f"basecal plan {cell} --task-point -0.3 0.7 0.1"
    whole += " --samples 3 --anew --to csv -o plan.csv"
    assert f"as the cell has no drivers: <code>{whole}</code>" in page
    *words, _ = shlex.split(whole)[1:]
    assert main([*words, str(tmp_path / "plan.csv")]) == 0
    assert (tmp_path / "plan.csv").read_text().count("\n") == 4


def test_a_cell_with_drivers_is_captured(cell, tmp_path, capsys):
    """The samples are written by the whole command, quoted; then the page and the terminal name the capture."""
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
