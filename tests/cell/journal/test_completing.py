"""Tests of additions to a recording: joined by sample number, never overwritten, other lines unchanged."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.cell import PoseObservation, RobotState, Sample
from basecal.cell.files import completed_recording_text, recording_from_text
from basecal.cell.schema.cell_file import cell_from_dict
from basecal.errors import DatasetError, InputError
from basecal.geometry import SE3

CELL = cell_from_dict(
    {
        "schema": "basecal/cell/1",
        "reference": "left",
        "robots": {"left": {}, "right": {}},
        "cameras": {"cam": {"on": "left"}},
        "targets": {"board": {"on": "right"}},
    }
)
LINE = '{"sample":  0, "robots": {"left": {"base_from_flange": {"t_m": [0.1, 0, 0], "q_xyzw": [0, 0, 0, 1]}}}}\n'
STATE = RobotState(SE3.from_rotvec([0, 0, 1.0], [0.3, 0.2, 0.1]))


def journal(folder: Path, text: str) -> Path:
    (folder / "recording").mkdir()
    (folder / "recording" / "samples.jsonl").write_text(text)
    return folder


def test_robot_is_added_to_its_sample(tmp_path: Path) -> None:
    """The second robot of a sample is added to its line; a new sample number is a new line; both are read back."""
    added = [Sample(0, 2.5, {"right": STATE}), Sample(7, None, {"right": STATE})]
    text = completed_recording_text(journal(tmp_path, LINE), added)
    first, second = recording_from_text(text.encode(), tmp_path, CELL).samples
    assert (first.sample, first.stamp_s, sorted(first.robots)) == (0, 2.5, ["left", "right"])
    assert second.sample == 7
    pose = first.robots["right"].base_from_flange
    assert pose is not None
    assert STATE.base_from_flange is not None
    np.testing.assert_allclose(pose.matrix, STATE.base_from_flange.matrix, atol=1e-15)


def test_other_lines_are_unchanged(tmp_path: Path) -> None:
    """Lines without additions are kept to the byte; a truncated last line is dropped."""
    other = LINE.replace('"sample":  0', '"sample":  4')
    folder = journal(tmp_path, LINE + other + '{"sample": 5, "rob')
    text = completed_recording_text(folder, [Sample(0, None, {"right": STATE})])
    assert text.splitlines(keepends=True)[1:] == [other]


@pytest.mark.parametrize(
    ("added", "named"),
    [
        (Sample(0, None, {"left": STATE}), "robots.left"),
        (Sample(0, None, {}, (), {"cam": "recording/images/cam/b.png"}), "images.cam"),
        (Sample(0, None, {}, (PoseObservation("cam", "board", SE3.identity()),)), "observation of cam and board"),
    ],
)
def test_recorded_data_is_not_overwritten(tmp_path: Path, added: Sample, named: str) -> None:
    """A robot, image or observation that is already recorded is an error that names it and its line."""
    line = LINE[:-2] + (
        ', "images": {"cam": "images/cam/a.png"}, "observations": [{"camera": "cam", "target": "board", '
        '"camera_from_target": {"t_m": [0, 0, 1], "q_xyzw": [0, 0, 0, 1]}}]}\n'
    )
    with pytest.raises(DatasetError, match=f"samples.jsonl:1: {named}: is recorded already"):
        completed_recording_text(journal(tmp_path, line), [added])


def test_damaged_line_is_refused(tmp_path: Path) -> None:
    """A line in the middle that is not JSON is an error, since no sample could be joined to it."""
    with pytest.raises(DatasetError, match=r"samples.jsonl:1: not JSON"):
        completed_recording_text(journal(tmp_path, "{oops\n" + LINE), [Sample(0, None, {"right": STATE})])


SEEN = PoseObservation("cam", "board", SE3.identity())


def test_missing_recording_is_created(tmp_path: Path) -> None:
    """A cell without a recording gets one, with its samples in the given order."""
    text = completed_recording_text(tmp_path, [Sample(n, None, {"right": STATE}) for n in (7, 3)])
    assert [sample.sample for sample in recording_from_text(text.encode(), tmp_path, CELL).samples] == [7, 3]


def test_observation_of_another_target_is_added(tmp_path: Path) -> None:
    """A sample without observations gets them; the same pair of camera and target twice is an error."""
    once = completed_recording_text(journal(tmp_path, LINE), [Sample(0, 2.0, {}, (SEEN,))])
    (first,) = recording_from_text(once.encode(), tmp_path, CELL).samples
    assert [(o.camera, o.target) for o in first.observations] == [("cam", "board")]
    (tmp_path / "recording" / "samples.jsonl").write_text(once)
    twice = completed_recording_text(tmp_path, [Sample(0, 3.0, {"right": STATE})])
    (second,) = recording_from_text(twice.encode(), tmp_path, CELL).samples
    assert (second.stamp_s, len(second.observations), len(second.robots)) == (2.0, 1, 2)
    other = completed_recording_text(tmp_path, [Sample(0, None, {}, (replace(SEEN, target="second"),))])
    assert [o["target"] for o in json.loads(other)["observations"]] == ["board", "second"]
    with pytest.raises(InputError, match=r"samples\.jsonl:1: observation of cam and board: is recorded already"):
        completed_recording_text(tmp_path, [Sample(0, None, {}, (SEEN,))])


def test_replace_overwrites_robot_state(tmp_path: Path) -> None:
    """A robot of a line gets the new state with `replace`, and other lines are kept to the byte."""
    other = LINE.replace('"sample":  0', '"sample":  1')
    folder = journal(tmp_path, LINE + other)
    text = completed_recording_text(folder, [Sample(0, None, {"left": STATE})], replace=True)
    first, second = text.splitlines(keepends=True)
    assert second == other
    assert json.loads(first)["robots"]["left"]["base_from_flange"]["t_m"] == [0.3, 0.2, 0.1]


def test_non_finite_numbers_are_not_written(tmp_path: Path) -> None:
    """NaN is refused both in an existing line and in a new one."""
    folder = journal(tmp_path, LINE)
    lost = RobotState(joints_rad=np.array([0.1, np.nan]))
    for number in (0, 1):
        with pytest.raises((ValueError, InputError), match=r"not JSON compliant|holds NaN or infinity"):
            completed_recording_text(folder, [Sample(number, None, {"right": lost})])
