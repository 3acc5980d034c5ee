"""`basecal target`."""

from __future__ import annotations

import pytest

from basecal.cell.files import cell_from_dict, read_cell
from basecal.cell.format.yaml_text import parse_yaml
from basecal.cli import main


def printed(tmp_path, capsys, *words):
    """The exit code, and the target that the lines for cell.yaml describe; None where there are none."""
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


def test_the_lines_describe_what_was_printed(tmp_path, capsys):
    """Sizes in metres, the marker three quarters of the square."""
    code, board = printed(tmp_path, capsys, "--columns", "6", "--rows", "8", "--square-mm", "30")
    assert code == 0
    assert (tmp_path / "board.svg").read_text().lstrip().startswith("<")
    assert board.kind == "charuco"
    assert board.options["squares"] == [6, 8]
    assert board.options["square_m"] == 0.03
    assert board.options["marker_m"] == 0.0225
    assert len(board.points) == 5 * 7


def test_a_marker_and_single_fields_may_be_given(tmp_path, capsys):
    """In their own words of cell.yaml."""
    _, board = printed(tmp_path, capsys, "--marker-mm", "20", "--set", "legacy_pattern=true")
    assert board.options["marker_m"] == 0.02
    assert board.options["legacy_pattern"] is True


def test_squares_are_as_large_as_the_paper_allows(tmp_path, capsys):
    """Whole millimetres on A4, or on the paper that is named; with their size in words on the sheet."""
    _, board = printed(tmp_path, capsys)
    assert board.options["square_m"] == 0.03
    assert "charuco, squares 5 x 7, square 30 mm, marker 22.5 mm" in (tmp_path / "board.svg").read_text()
    _, board = printed(tmp_path, capsys, "--paper", "a3")
    assert board.options["square_m"] == 0.044
    _, board = printed(tmp_path, capsys, "--square-mm", "40")
    assert board.options["square_m"] == 0.04


def test_a_tag_has_its_number(tmp_path, capsys):
    """As large as a square."""
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
def test_what_cannot_be_printed_is_said(tmp_path, capsys, words, said):
    """And nothing is written."""
    assert main(["target", str(tmp_path / "board.svg"), *words]) == 3
    assert said in capsys.readouterr().err
    assert not (tmp_path / "board.svg").exists()


@pytest.fixture
def cell(tmp_path):
    """A cell of two boards."""
    main(["new", str(tmp_path / "cell"), "--robots", "3", "--target", "chessboard"])
    return tmp_path / "cell"


def test_a_target_of_a_cell_is_printed_by_its_name(cell, tmp_path, capsys):
    """Nothing needs to be said of cell.yaml then."""
    capsys.readouterr()
    code, lines = printed(tmp_path, capsys, "--cell", str(cell), "--name", "target2")
    assert (code, lines) == (0, None)
    assert read_cell(cell).targets["target2"].target.kind in (tmp_path / "board.svg").read_text()


@pytest.mark.parametrize(("words", "said"), [((), "has 2 targets"), (("--name", "bord"), "bord")])
def test_which_target_must_be_known(cell, tmp_path, capsys, words, said):
    """Of several one is to be named, and it must be there."""
    assert main(["target", str(tmp_path / "board.svg"), "--cell", str(cell), *words]) == 3
    told = capsys.readouterr().err
    assert said in told
    assert "target2" in told


def test_a_cell_without_a_target_prints_none(tmp_path, capsys):
    """No name could be chosen: that the cell has none is said."""
    (tmp_path / "cell.yaml").write_text(
        "schema: basecal/cell/1\nreference: arm\ntarget: scene\nrobots: {arm: {}}\ncameras: {eye: {on: arm}}\n"
    )
    assert main(["target", str(tmp_path / "board.svg"), "--cell", str(tmp_path)]) == 3
    told = capsys.readouterr().err
    assert "describes no target to print" in told
    assert "--name" not in told
