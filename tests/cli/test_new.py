"""Tests of `basecal new`."""

from __future__ import annotations

import pytest

from basecal.cell.files import read_cell, read_recording
from basecal.cli import main


def test_cell_and_empty_recording_are_made(tmp_path, capsys):
    """The output has both paths and the next command, ready to paste."""
    folder = tmp_path / "my cell"
    assert main(["new", str(folder), "--robots", "1", "--target", "led"]) == 0
    told = capsys.readouterr().out
    assert str(folder / "cell.yaml") in told
    assert str(folder / "recording" / "samples.jsonl") in told
    assert f"basecal calibrate '{folder}'" in told
    assert read_cell(folder).targets["target"].target.kind == "led"
    assert (folder / "recording" / "samples.jsonl").read_bytes() == b""


def test_existing_samples_stay(tmp_path):
    """A recording without a cell is completed."""
    samples = tmp_path / "recording" / "samples.jsonl"
    samples.parent.mkdir()
    samples.write_text('{"sample": 1}\n')
    assert main(["new", str(tmp_path)]) == 0
    assert samples.read_text() == '{"sample": 1}\n'


def test_existing_cell_is_unchanged(tmp_path, capsys):
    """The output names it, it is unchanged, and no recording is made."""
    (tmp_path / "cell.yaml").write_text("mine")
    assert main(["new", str(tmp_path)]) == 3
    assert "cell.yaml" in capsys.readouterr().err
    assert (tmp_path / "cell.yaml").read_text() == "mine"
    assert not (tmp_path / "recording").exists()


@pytest.mark.parametrize("robots", ["0", "10"])
def test_one_to_nine_robots(tmp_path, robots):
    """Other numbers are wrong usage."""
    assert main(["new", str(tmp_path / "c"), "--robots", robots]) == 2
    assert main(["new", str(tmp_path / "c"), "--robots", "9"]) == 0
    assert len(read_cell(tmp_path / "c").robots) == 9
    assert read_recording(tmp_path / "c").samples == ()


def test_dictionaries_have_the_markers_of_a_board(tmp_path):
    """Each board has the smallest dictionary with enough markers; none is the beginning of another's."""
    words = ["--robots", "3", "--squares", "10x14", "--square", "24mm"]
    assert main(["new", str(tmp_path / "c"), *words]) == 0
    targets = read_cell(tmp_path / "c").targets.values()
    assert [each.target.options["dictionary"] for each in targets] == ["DICT_4X4_100", "DICT_5X5_100"]


def test_targets_of_several_robots_have_different_dictionaries(tmp_path, capsys):
    """The first has the requested dictionary; a kind without markers is reported."""
    words = ["--robots", "4", "--squares", "5x7", "--square", "40mm", "--dictionary", "DICT_6X6_50"]
    assert main(["new", str(tmp_path / "c"), *words]) == 0
    targets = read_cell(tmp_path / "c").targets.values()
    assert [each.target.options["dictionary"] for each in targets] == ["DICT_6X6_50", "DICT_4X4_50", "DICT_5X5_50"]
    assert capsys.readouterr().err == ""
    assert main(["new", str(tmp_path / "d"), "--robots", "3", "--target", "chessboard"]) == 0
    assert "'target' and 'target2' look the same, both chessboard" in capsys.readouterr().err
