"""A cell.yaml that is added to: comments and values stay, contradictions are named."""

from __future__ import annotations

import pytest

from basecal.cell.files import cell_from_dict, completed_cell_text
from basecal.cell.format.yaml_text import parse_yaml
from basecal.errors import DatasetError

TEXT = """\
# Our cell
schema: basecal/cell/1
reference: left     # the one by the door
robots:
  left: {}          # poses
cameras:
  cam:
    on: left
    size_px: [1280, 720]   # as delivered
    intrinsics: {status: free}
"""


def test_comments_and_order_stay() -> None:
    """A robot is added at the end of the robots, and every line that was there is still there."""
    text, changed = completed_cell_text(TEXT, {"robots": {"right": {}, "left": {}}}, "cell.yaml")
    assert [line for line in text.splitlines() if line not in TEXT.splitlines()] == ["  right: {}"]
    assert set(TEXT.splitlines()) <= set(text.splitlines())
    assert changed == ("robots.right",)
    assert list(cell_from_dict(parse_yaml(text, "cell.yaml").data).robots) == ["left", "right"]


def test_nothing_new_changes_nothing() -> None:
    """What stands there already leaves the text as it is, to the byte."""
    assert completed_cell_text(TEXT, {"cameras": {"cam": {"size_px": [1280, 720]}}}, "cell.yaml") == (TEXT, ())


def test_a_contradiction_is_named() -> None:
    """Another value is an error with line and field, and both values; where it is to be replaced it is."""
    added = {"cameras": {"cam": {"size_px": [640, 480]}}}
    with pytest.raises(DatasetError, match=r"cell.yaml:9: cameras.cam.size_px: is .* in the imported data") as error:
        completed_cell_text(TEXT, added, "cell.yaml")
    assert "[1280, 720]" in str(error.value)
    assert "[640, 480]" in str(error.value)
    text, changed = completed_cell_text(TEXT, added, "cell.yaml", {("cameras", "cam", "size_px")})
    assert cell_from_dict(parse_yaml(text, "cell.yaml").data).cameras["cam"].size_px == (640, 480)
    assert changed == ("cameras.cam.size_px",)


def test_a_new_cell_is_all_that_is_added() -> None:
    """Where there is none, what is added makes it."""
    text, _ = completed_cell_text(None, {"reference": "left", "robots": {"left": {}}}, "cell.yaml")
    assert cell_from_dict(parse_yaml(text, "cell.yaml").data).reference == "left"


def test_what_is_added_is_written_as_by_hand() -> None:
    """A line for each innermost mapping or list, those around them as blocks."""
    added = {"cameras": {"cam": {"on": "left", "mount": {"status": "fixed", "t_m": [0.0, 0.1, 0.2]}}}}
    text, changed = completed_cell_text("schema: basecal/cell/1\n", added, "cell.yaml")
    assert text.splitlines()[1:] == [
        "cameras:",
        "  cam:",
        "    on: left",
        "    mount: {status: fixed, t_m: [0.0, 0.1, 0.2]}",
    ]
    assert changed == ("cameras",)


def test_quotes_stay() -> None:
    """Single and double ones, and plain words, as a person wrote them."""
    text = "schema: 'basecal/cell/1'\nreference: \"left\"\nrobots: {left: {}}\n"
    done, changed = completed_cell_text(text, {"noise": {"pixel_px": 0.3}}, "cell.yaml")
    assert done.startswith(text)
    assert changed == ("noise",)
    assert completed_cell_text("schema: basecal/cell/1\nrobots:\n", {"robots": {"a": {}}}, "c")[1] == ("robots",)


def test_long_lines_stay_one_line() -> None:
    """Of hundreds of characters, as of a list of points."""
    points = ", ".join(f"[{k}, 0, 0]" for k in range(60))
    text = f"schema: basecal/cell/1\nmarks: {{plate: {{points_m: [{points}]}}}}\n"
    assert completed_cell_text(text, {"reference": "a"}, "cell.yaml")[0] == text + "reference: a\n"


def test_a_mapping_is_no_number() -> None:
    """One where the cell has a plain value, or the other way about, is a contradiction."""
    for added in ({"cameras": {"cam": {"on": {"a": 1}}}}, {"cameras": {"cam": {"intrinsics": "free"}}}):
        with pytest.raises(DatasetError, match="in the imported data: correct the wrong one"):
            completed_cell_text(TEXT, added, "cell.yaml")
    text, _ = completed_cell_text(TEXT, {"cameras": {"cam": {"intrinsics": {"exact": False}}}}, "cell.yaml")
    assert "intrinsics: {status: free, exact: false}" in text
