"""Tests of additions to a cell.yaml: comments and values are kept, contradictions are reported."""

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


def test_comments_and_order_are_kept() -> None:
    """A new robot is appended to the robots, and every existing line is kept."""
    text, changed = completed_cell_text(TEXT, {"robots": {"right": {}, "left": {}}}, "cell.yaml")
    assert [line for line in text.splitlines() if line not in TEXT.splitlines()] == ["  right: {}"]
    assert set(TEXT.splitlines()) <= set(text.splitlines())
    assert changed == ("robots.right",)
    assert list(cell_from_dict(parse_yaml(text, "cell.yaml").data).robots) == ["left", "right"]


def test_repeated_values_leave_file_unchanged() -> None:
    """Adding values that the file already has leaves its text unchanged to the byte."""
    assert completed_cell_text(TEXT, {"cameras": {"cam": {"size_px": [1280, 720]}}}, "cell.yaml") == (TEXT, ())


def test_contradiction_reports_both_values() -> None:
    """Another value is an error with line, field and both values; it is replaced if replacement is requested."""
    added = {"cameras": {"cam": {"size_px": [640, 480]}}}
    with pytest.raises(DatasetError, match=r"cell.yaml:9: cameras.cam.size_px: is .* in the imported data") as error:
        completed_cell_text(TEXT, added, "cell.yaml")
    assert "[1280, 720]" in str(error.value)
    assert "[640, 480]" in str(error.value)
    text, changed = completed_cell_text(TEXT, added, "cell.yaml", {("cameras", "cam", "size_px")})
    assert cell_from_dict(parse_yaml(text, "cell.yaml").data).cameras["cam"].size_px == (640, 480)
    assert changed == ("cameras.cam.size_px",)


def test_missing_file_is_created_from_additions() -> None:
    """Without an existing file, the additions become the new cell.yaml."""
    text, _ = completed_cell_text(None, {"reference": "left", "robots": {"left": {}}}, "cell.yaml")
    assert cell_from_dict(parse_yaml(text, "cell.yaml").data).reference == "left"


def test_additions_are_written_in_block_style() -> None:
    """Each innermost mapping or list takes one line; the levels around it are blocks."""
    added = {"cameras": {"cam": {"on": "left", "mount": {"status": "fixed", "t_m": [0.0, 0.1, 0.2]}}}}
    text, changed = completed_cell_text("schema: basecal/cell/1\n", added, "cell.yaml")
    assert text.splitlines()[1:] == [
        "cameras:",
        "  cam:",
        "    on: left",
        "    mount: {status: fixed, t_m: [0.0, 0.1, 0.2]}",
    ]
    assert changed == ("cameras",)


def test_quotes_are_kept() -> None:
    """Single quotes, double quotes and plain words are kept as written."""
    text = "schema: 'basecal/cell/1'\nreference: \"left\"\nrobots: {left: {}}\n"
    done, changed = completed_cell_text(text, {"noise": {"pixel_px": 0.3}}, "cell.yaml")
    assert done.startswith(text)
    assert changed == ("noise",)
    assert completed_cell_text("schema: basecal/cell/1\nrobots:\n", {"robots": {"a": {}}}, "c")[1] == ("robots",)


def test_long_lines_are_not_wrapped() -> None:
    """Lines of hundreds of characters, such as a list of points, stay one line."""
    points = ", ".join(f"[{k}, 0, 0]" for k in range(60))
    text = f"schema: basecal/cell/1\nmarks: {{plate: {{points_m: [{points}]}}}}\n"
    assert completed_cell_text(text, {"reference": "a"}, "cell.yaml")[0] == text + "reference: a\n"


def test_mapping_contradicts_plain_value() -> None:
    """A mapping in place of a plain value, or the reverse, is a contradiction."""
    for added in ({"cameras": {"cam": {"on": {"a": 1}}}}, {"cameras": {"cam": {"intrinsics": "free"}}}):
        with pytest.raises(DatasetError, match="in the imported data: correct the wrong one"):
            completed_cell_text(TEXT, added, "cell.yaml")
    text, _ = completed_cell_text(TEXT, {"cameras": {"cam": {"intrinsics": {"exact": False}}}}, "cell.yaml")
    assert "intrinsics: {status: free, exact: false}" in text
