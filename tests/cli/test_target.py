"""Tests of `basecal target`."""

from __future__ import annotations

import pytest

from basecal.cell.files import cell_from_dict, read_cell
from basecal.cell.format.yaml_text import parse_yaml
from basecal.cli import main


def printed(tmp_path, capsys, *words):
    """Exit code, and the target described by the lines for cell.yaml; None if there are none."""
    code = main(["target", str(tmp_path / "board.svg"), *words])
    out = capsys.readouterr().out
    assert "measure both rulers" in out
    lines = out.partition("under targets:\n")[2]
    if not lines:
        return code, None
    data = {
        "schema": "basecal/cell/1",
        "reference": "hand",
        "robots": {"hand": {}},
        "cameras": {"camera": {"on": "world"}},
        "targets": parse_yaml(lines, "text").data,
    }
    return code, cell_from_dict(data, path="printed").targets["board"].target


def test_lines_for_the_cell_describe_the_printed_target(tmp_path, capsys):
    """Sizes are in metres, and the marker is 75 % of the square."""
    code, board = printed(tmp_path, capsys, "--columns", "6", "--rows", "8", "--square-mm", "30")
    assert code == 0
    assert (tmp_path / "board.svg").read_text().lstrip().startswith("<")
    assert board.kind == "charuco"
    assert board.options["squares"] == [6, 8]
    assert board.options["square_m"] == 0.03
    assert board.options["marker_m"] == 0.0225
    assert len(board.points) == 5 * 7


def test_marker_and_single_fields_can_be_given(tmp_path, capsys):
    """The fields have the names of cell.yaml."""
    _, board = printed(tmp_path, capsys, "--marker-mm", "20", "--set", "legacy_pattern=true")
    assert board.options["marker_m"] == 0.02
    assert board.options["legacy_pattern"] is True


def test_squares_fill_the_paper(tmp_path, capsys):
    """They have whole millimetres on A4 or the named paper; the sheet states their size."""
    _, board = printed(tmp_path, capsys)
    assert board.options["square_m"] == 0.03
    assert "charuco, squares 5 x 7, square 30 mm, marker 22.5 mm" in (tmp_path / "board.svg").read_text()
    _, board = printed(tmp_path, capsys, "--paper", "a3")
    assert board.options["square_m"] == 0.044
    _, board = printed(tmp_path, capsys, "--square-mm", "40")
    assert board.options["square_m"] == 0.04


def test_tag_has_its_id(tmp_path, capsys):
    """A tag is as large as a square."""
    _, tag = printed(tmp_path, capsys, "--kind", "apriltag", "--tag", "3", "--square-mm", "80")
    assert tag.ids.tolist() == [12, 13, 14, 15]
    assert tag.points[:, 0].max() - tag.points[:, 0].min() == pytest.approx(0.08)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--set", "legacy_pattern"), "--set takes FIELD=VALUE"),
        (("--kind", "points"), "needs more than sizes"),
        (("--marker-mm", "50"), "marker"),
        (("--paper", "a4", "--square-mm", "50"), "do not fit on A4"),
    ],
)
def test_target_that_does_not_fit_is_refused(tmp_path, capsys, words, said):
    """No file is written."""
    assert main(["target", str(tmp_path / "board.svg"), *words]) == 3
    assert said in capsys.readouterr().err
    assert not (tmp_path / "board.svg").exists()


@pytest.fixture
def cell(tmp_path):
    """Cell with two boards."""
    main(["new", str(tmp_path / "cell"), "--robots", "3", "--target", "chessboard"])
    return tmp_path / "cell"


def test_target_of_a_cell_is_printed_by_name(cell, tmp_path, capsys):
    """Then no lines for cell.yaml are needed."""
    capsys.readouterr()
    code, lines = printed(tmp_path, capsys, "--cell", str(cell), "--name", "target2")
    assert (code, lines) == (0, None)
    assert read_cell(cell).targets["target2"].target.kind in (tmp_path / "board.svg").read_text()


@pytest.mark.parametrize(("words", "said"), [((), "has 2 targets"), (("--name", "bord"), "bord")])
def test_target_name_is_required_if_there_are_several(cell, tmp_path, capsys, words, said):
    """The name must exist."""
    assert main(["target", str(tmp_path / "board.svg"), "--cell", str(cell), *words]) == 3
    told = capsys.readouterr().err
    assert said in told
    assert "target2" in told


def test_cell_without_targets_is_reported(tmp_path, capsys):
    """No name could be chosen: the message says that the cell has no target."""
    (tmp_path / "cell.yaml").write_text(
        "schema: basecal/cell/1\nreference: arm\ntarget: scene\nrobots: {arm: {}}\ncameras: {eye: {on: arm}}\n"
    )
    assert main(["target", str(tmp_path / "board.svg"), "--cell", str(tmp_path)]) == 3
    told = capsys.readouterr().err
    assert "describes no target to print" in told
    assert "--name" not in told
