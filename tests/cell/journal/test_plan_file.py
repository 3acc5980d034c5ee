"""Tests of plans: lines of samples with robots only."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell import Cell, CellCamera, CellTarget, PointObservation, Robot, RobotState, Sample
from basecal.cell.files import append_samples, read_plan, write_plan
from basecal.cell.targets.points import points_target
from basecal.errors import DatasetError
from basecal.geometry import SE3

CELL = Cell("eye", {"eye": Robot("eye")})
PLAN = [Sample(3 + k, robots={"eye": RobotState(SE3(np.eye(3), np.array([k, 0.0, 0.5])))}) for k in range(3)]


def test_plan_round_trip(tmp_path):
    """Sample numbers and poses are read back, and a plan overwrites an earlier one."""
    write_plan(PLAN[:1], tmp_path / "recording" / "plan.jsonl", tmp_path)
    write_plan(PLAN, tmp_path / "recording" / "plan.jsonl", tmp_path)
    found = read_plan(tmp_path / "recording" / "plan.jsonl", tmp_path, CELL)
    assert [sample.sample for sample in found] == [3, 4, 5]
    assert np.array_equal(found[2].robots["eye"].base_from_flange.translation, [2, 0, 0.5])


def test_recording_is_valid_plan(tmp_path):
    """A recording can be visited again as a plan; other contents of its lines are ignored."""
    append_samples(tmp_path, [Sample(0, 1.5, PLAN[0].robots)])
    (found,) = read_plan(tmp_path / "recording" / "samples.jsonl", tmp_path, CELL)
    assert found.stamp_s is None


@pytest.mark.parametrize(
    "line", ['{"sample": 0}', '{"sample": 0, "robots": {}}', '{"sample": 0, "robots": {"foot": {}}}']
)
def test_plan_lines_need_known_robot(tmp_path, line):
    """A line without a robot, or with an unknown one, is an error with its line number."""
    (tmp_path / "plan.jsonl").write_text("\n" + line + "\n")
    with pytest.raises(DatasetError, match=r"plan\.jsonl:2: robots"):
        read_plan(tmp_path / "plan.jsonl", tmp_path, CELL)


def test_plan_in_one_json_object_is_read(tmp_path):
    """The output of `basecal plan --json` is read like a plan of lines; its other fields are ignored."""
    write_plan(PLAN, tmp_path / "plan.jsonl", tmp_path)
    lines = (tmp_path / "plan.jsonl").read_text().splitlines()
    (tmp_path / "plan.json").write_text('{"needed": 3, "samples": [' + ",\n".join(lines) + "]}\n")
    found = read_plan(tmp_path / "plan.json", tmp_path, CELL)
    assert [sample.sample for sample in found] == [3, 4, 5]


def test_unknown_point_in_plan_is_refused(tmp_path):
    """A sample with points unknown to its target is dropped from a recording, but is an error in a plan."""
    target = CellTarget("board", "world", target=points_target([[0, 0, 0], [1, 0, 0]]))
    cell = Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": CellCamera("wrist", "eye")}, targets={"board": target})
    seen = PointObservation("wrist", "board", np.array([7]), np.zeros((1, 3)))
    write_plan([Sample(0, robots=PLAN[0].robots, observations=(seen,))], tmp_path / "plan.jsonl", tmp_path)
    with pytest.raises(DatasetError, match=r"plan\.jsonl:1: robots: expected the planned joints or flange poses"):
        read_plan(tmp_path / "plan.jsonl", tmp_path, cell)
