"""Plans: lines of samples with robots alone."""

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


def test_a_plan_is_read_back(tmp_path):
    """Numbers and places come back; a plan is written over another."""
    write_plan(PLAN[:1], tmp_path / "recording" / "plan.jsonl", tmp_path)
    write_plan(PLAN, tmp_path / "recording" / "plan.jsonl", tmp_path)
    found = read_plan(tmp_path / "recording" / "plan.jsonl", tmp_path, CELL)
    assert [sample.sample for sample in found] == [3, 4, 5]
    assert np.array_equal(found[2].robots["eye"].base_from_flange.translation, [2, 0, 0.5])


def test_a_recording_is_a_plan(tmp_path):
    """What was recorded is gone to again, whatever else its lines hold."""
    append_samples(tmp_path, [Sample(0, 1.5, PLAN[0].robots)])
    (found,) = read_plan(tmp_path / "recording" / "samples.jsonl", tmp_path, CELL)
    assert found.stamp_s is None


@pytest.mark.parametrize(
    "line", ['{"sample": 0}', '{"sample": 0, "robots": {}}', '{"sample": 0, "robots": {"foot": {}}}']
)
def test_lines_that_say_nothing(tmp_path, line):
    """A line without a robot, or with one that is not there, is an error with its number."""
    (tmp_path / "plan.jsonl").write_text("\n" + line + "\n")
    with pytest.raises(DatasetError, match=r"plan\.jsonl:2: robots"):
        read_plan(tmp_path / "plan.jsonl", tmp_path, CELL)


def test_a_plan_in_one_object(tmp_path):
    """What `basecal plan --json` prints is a plan as its lines are; what else stands in it is left alone."""
    write_plan(PLAN, tmp_path / "plan.jsonl", tmp_path)
    lines = (tmp_path / "plan.jsonl").read_text().splitlines()
    (tmp_path / "plan.json").write_text('{"needed": 3, "samples": [' + ",\n".join(lines) + "]}\n")
    found = read_plan(tmp_path / "plan.json", tmp_path, CELL)
    assert [sample.sample for sample in found] == [3, 4, 5]


def test_a_sample_that_cannot_be_used_is_no_place_to_go_to(tmp_path):
    """What names points that its target has not is dropped of a recording, and an error in a plan."""
    target = CellTarget("board", "world", target=points_target([[0, 0, 0], [1, 0, 0]]))
    cell = Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": CellCamera("wrist", "eye")}, targets={"board": target})
    seen = PointObservation("wrist", "board", np.array([7]), np.zeros((1, 3)))
    write_plan([Sample(0, robots=PLAN[0].robots, observations=(seen,))], tmp_path / "plan.jsonl", tmp_path)
    with pytest.raises(DatasetError, match=r"plan\.jsonl:1: robots: expected the planned joints or flange poses"):
        read_plan(tmp_path / "plan.jsonl", tmp_path, cell)
