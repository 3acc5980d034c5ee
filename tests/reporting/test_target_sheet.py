"""Tests of printed targets: true scale in PDF and SVG, margins, rulers, cut marks and axes."""

from __future__ import annotations

import re
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from basecal.cell.targets.apriltag import apriltag_target
from basecal.cell.targets.charuco import charuco_target
from basecal.cell.targets.chessboard import chessboard_target
from basecal.cell.targets.circles import circles_target
from basecal.cell.targets.led import led_target
from basecal.cell.targets.points import points_target
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.reporting.target_sheet import largest_pitch_mm, page_svg, printed_pages, write_pages

SHAPES = {
    "charuco": charuco_target((5, 7), 0.03, 0.022, "DICT_4X4_50"),
    "chessboard": chessboard_target((8, 5), 0.025),
    "circles": circles_target((4, 11), 0.02, asymmetric=True),
    "apriltag": apriltag_target("tag36h11", [(3, 0.08, SE3.identity()), (4, 0.08, SE3.identity())]),
    "led": led_target([[0, 0, 0], [0.05, 0.02, 0]]),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_shapes_lie_on_the_page(kind):
    """Shapes keep 8 mm from the border and do not reach the ruler."""
    for page in printed_pages(SHAPES[kind], "title"):
        width, height = page.size_mm
        ends = np.concatenate([page.rectangles[:, :2], page.rectangles[:, 2:], page.discs[:, :2], page.rings[:, :2]])
        assert len(ends)
        assert ends.min() >= 8
        assert np.all(ends[:, 0] <= width - 8)
        assert np.all(ends[:, 1] <= height - 20)


def test_printed_squares_have_requested_size():
    """The corners of the printed squares are multiples of 30 mm apart, to a micrometre."""
    (page,) = printed_pages(SHAPES["charuco"], "title")
    squares = page.rectangles[np.isclose(page.rectangles[:, 2] - page.rectangles[:, 0], 30.0, atol=1e-3)]
    assert len(squares) == 18
    corners = np.unique(squares[:, :2].round(6), axis=0)
    pitch = (corners - corners[0])[:, 0]
    np.testing.assert_allclose(pitch / 30, np.round(pitch / 30), atol=1e-6)


def test_one_svg_unit_is_a_millimetre():
    """The view box of the drawing is its size in mm, and the ruler is 100 mm long."""
    (page,) = printed_pages(SHAPES["charuco"], "a < b")
    svg = ElementTree.fromstring(page_svg(page))
    assert svg.get("viewBox") == "0 0 210.0 297.0"
    assert (svg.get("width"), svg.get("height")) == ("210.0mm", "297.0mm")
    ruler = page.lines[0]
    assert ruler[2] - ruler[0] == 100.0


def test_pdf_has_true_size_and_one_page_per_tag(tmp_path: Path):
    """An A4 page is 595.28 x 841.89 points, and two tags make two pages."""
    (written,) = write_pages(printed_pages(SHAPES["apriltag"], "tags"), tmp_path / "tags.pdf")
    boxes = re.findall(rb"/MediaBox\[0 0 ([\d.]+) ([\d.]+)\]", written.read_bytes())
    assert len(boxes) == 2
    np.testing.assert_allclose([float(v) for v in boxes[0]], [595.28, 841.89], atol=0.01)


def test_svg_files_are_numbered_and_png_is_refused(tmp_path: Path):
    """Each tag has its own numbered SVG file. A .png is refused with a message that lists the supported formats."""
    pages = printed_pages(SHAPES["apriltag"], "tags")
    assert [p.name for p in write_pages(pages, tmp_path / "tags.svg")] == ["tags_0.svg", "tags_1.svg"]
    with pytest.raises(InputError, match=r"expected .pdf or .svg"):
        write_pages(pages, tmp_path / "tags.png")


def test_non_planar_template_is_refused():
    """Points that are not in a plane cannot be drawn on paper."""
    with pytest.raises(InputError, match="z must be 0"):
        printed_pages(points_target([[0, 0, 0], [0, 0, 0.1]]), "title")


def test_page_has_horizontal_and_vertical_rulers():
    """Each of the two rulers is 100 mm long, clear of the board."""
    (page,) = printed_pages(SHAPES["charuco"], "title")
    lengths = page.lines[:, 2:] - page.lines[:, :2]
    assert [100.0, 0.0] in lengths.tolist()
    upright = page.lines[lengths[:, 1] == -100.0][0]
    assert upright[0] - 4 > page.rectangles[:, 2].max()


def test_horizontal_ruler_has_tick_every_centimetre():
    """The ticks at the ends and the middle of a ruler are longer; none is longer than 4 mm."""
    (page,) = printed_pages(SHAPES["charuco"], "title")
    x, y, end, _ = page.lines[0]
    ticks = [line for line in page.lines if line[1] == y and x <= line[0] == line[2] <= end]
    lengths = {round(float(line[0] - x)): float(line[1] - line[3]) for line in ticks}
    assert lengths == {mm: 4.0 if mm in (0, 50, 100) else 2.5 for mm in range(0, 101, 10)}


def test_cut_marks_are_at_sheet_corners():
    """Two cut marks are beside each corner, outside of the sheet. The sheet's size is stated above the ruler."""
    (page,) = printed_pages(SHAPES["charuco"], "title")
    x, y = (210 - 14) / 2, (297 - 22) / 2
    low, high = np.array([x - 90, y - 120]), np.array([x + 90, y + 120])
    marks = page.lines[np.isclose(np.abs(page.lines[:, 2:] - page.lines[:, :2]).sum(1), 4.0)]
    ends = marks.reshape(-1, 2)
    for corner in (low, high, [low[0], high[1]], [high[0], low[1]]):
        assert np.sum(np.isclose(np.abs(ends - corner).min(1), 0) & (np.abs(ends - corner).max(1) < 6)) == 4
    assert [text for *_, text in page.texts][2] == "between the cut marks 180 x 240 mm; square 30 mm"


@pytest.mark.parametrize("kind", ["charuco", "chessboard", "circles", "apriltag"])
def test_printed_axes_are_those_of_the_target(kind):
    """The points of the target have the coordinates that the printed arrows define."""
    target = SHAPES[kind]
    page, sheet = printed_pages(target, "title")[0], target.sheets[0]
    arrows = page.lines[np.isclose(np.linalg.norm(page.lines[:, 2:] - page.lines[:, :2], axis=1), 10.0)]
    names = [next(each[:2] for each in page.texts if each[2] == name) for name in "xy"]
    x, y = (min(arrows, key=lambda line, at=at: np.hypot(*(line[2:] - at))) for at in names)
    along = [(line[2:] - line[:2]) / 10 for line in (x, y)]
    across = int(np.argmax(np.abs(along[0])))
    origin = np.array([x[0], y[1]]) if across == 0 else np.array([y[0], x[1]])
    shift = (np.array(page.size_mm) - [14, 22] - 1e3 * sheet.paper[:2] - 1e3 * sheet.paper[2:]) / 2
    sheet_from_target = sheet.target_from_sheet.inverse()
    for point in target.points[:4]:
        by_arrows = origin + 1e3 * (point[0] * along[0] + point[1] * along[1])
        np.testing.assert_allclose(by_arrows, 1e3 * (sheet_from_target @ point)[:2] + shift, atol=1e-6)


def test_arrow_heads_are_symmetric():
    """Two lines lead back from each tip, symmetric about the axis."""
    page = printed_pages(SHAPES["chessboard"], "title")[0]
    arrows = page.lines[np.isclose(np.linalg.norm(page.lines[:, 2:] - page.lines[:, :2], axis=1), 10.0)]
    assert len(arrows) == 2
    for start, tip in arrows.reshape(-1, 2, 2):
        back = page.lines[np.all(page.lines[:, :2] == tip, axis=1)][:, 2:] - tip
        assert len(back) == 2
        np.testing.assert_allclose(back.sum(0) / np.linalg.norm(back.sum(0)), (start - tip) / 10, atol=1e-9)


@pytest.mark.parametrize(("paper", "pitch_mm"), [("A4", 30), ("letter", 30), ("A3", 44)])
def test_largest_pitch_fits_on_paper(paper, pitch_mm):
    """The largest pitch is a whole number of millimetres; a pitch larger by 1 mm is refused."""
    assert largest_pitch_mm(SHAPES["charuco"], paper) == pitch_mm
    fitting, larger = (
        charuco_target((5, 7), 1e-3 * size, 0.75e-3 * size, "DICT_4X4_50") for size in (pitch_mm, pitch_mm + 1)
    )
    assert printed_pages(fitting, "title", paper)[0].paper == paper
    with pytest.raises(InputError, match=f"do not fit on {paper}"):
        printed_pages(larger, "title", paper)


LEDS = led_target([[0, 0, 0], [0.05, 0.02, 0], [0.05, -0.03, 0]])


def test_template_has_cross_and_ring_per_point():
    """Crosses of 16 mm about rings of 5 mm are as far apart as the points, each with its number beside it."""
    (page,) = printed_pages(LEDS, "title")
    np.testing.assert_allclose(page.rings[:, 2], 2.5)
    np.testing.assert_allclose(page.rings[:, :2] - page.rings[0, :2], 1e3 * LEDS.points[:, :2], atol=1e-9)
    assert len(page.rectangles) == len(page.discs) == 0
    for k, (x, y, _) in enumerate(page.rings):
        crosses = page.lines[np.all(np.isclose((page.lines[:, :2] + page.lines[:, 2:]) / 2, [x, y]), axis=1)]
        assert sorted((crosses[:, 2:] - crosses[:, :2]).round(9).tolist()) == [[0, 16], [16, 0]]
        (number,) = (text for text in page.texts if text[2] == str(k))
        assert 2.5 < np.hypot(number[0] - x, number[1] - y) < 8
        assert number[0] > x
        assert number[1] < y
    assert page.texts[2][2] == "a cross where each point goes"


def test_template_accepts_points_within_one_micrometre():
    """Points of a template may be 0.9 um off the plane, but not 1.1 um."""
    for height, fits in ((0.9e-6, True), (-0.9e-6, True), (1.1e-6, False), (-1.1e-6, False)):
        target = points_target([[0, 0, 0], [0, 0.05, height]])
        if fits:
            assert len(printed_pages(target, "title")) == 1
        else:
            with pytest.raises(InputError, match="z must be 0"):
                printed_pages(target, "title")


@pytest.mark.parametrize("kind", SHAPES)
def test_shapes_keep_clear_of_border_and_rulers(kind):
    """Shapes are at least 8 mm from the border.

    They are 22 mm from the right edge with its ruler, and 30 mm from the lower edge with its texts.
    """
    for page in printed_pages(SHAPES[kind], "title"):
        low, high = _extent(page)
        width, height = page.size_mm
        if kind != "led":  # its numbers and crosses have their own margin
            assert low[0] >= 8
            assert low[1] >= 8
        assert np.all(high <= np.array([width - 22, height - 30]) + 1e-6)


def _extent(page):
    shapes = [page.rectangles[:, :2], page.rectangles[:, 2:]]
    round_ones = [
        np.empty((0, 2)),
        *(each[:, :2] + side * each[:, 2:] for each in (page.discs, page.rings) for side in (-1, 1)),
    ]
    every = np.concatenate([*shapes, *round_ones])
    return every.min(0), every.max(0)


def test_texts_and_rulers_do_not_overlap():
    """Texts and rulers are on the page and clear of one another.

    The advice is below the ruler, title and sizes are above its ticks.
    """
    (page,) = printed_pages(SHAPES["charuco"], "title")
    width, height = page.size_mm
    x, y, end, _ = page.lines[0]
    (advice_x, advice_y, advice), (title_x, title_y, title), (check_x, check_y, _) = page.texts[:3]
    assert advice.startswith("both rulers are 100 mm")
    assert title == "title"
    assert x == advice_x == title_x == check_x
    assert y + 3.2 < advice_y < height - 8 + 3.2
    assert check_y < y - 4
    assert title_y < check_y - 3.2
    assert title_y - 3.2 > page.rectangles[:, 3].max()
    assert 8 < x < end < width - 8
    upright = page.lines[1]
    assert upright[0] == upright[2] < width - 8
    assert upright[0] > end
    assert upright[1] == y


def test_vertical_ruler_has_same_ticks():
    """The ticks of the vertical ruler are at its left, longer at the ends and the middle."""
    (page,) = printed_pages(SHAPES["charuco"], "title")
    x, y, _, end = page.lines[1]
    ticks = [line for line in page.lines if line[0] == x and end <= line[1] == line[3] <= y]
    lengths = {round(float(y - line[1])): float(line[0] - line[2]) for line in ticks}
    assert lengths == {mm: 4.0 if mm in (0, 50, 100) else 2.5 for mm in range(0, 101, 10)}


def test_printed_axes_lie_beside_the_sheet():
    """The axes are arrows with a bar at their start, clear of the squares, with names beyond their tips."""
    (page,) = printed_pages(SHAPES["charuco"], "title")
    arrows = page.lines[np.isclose(np.linalg.norm(page.lines[:, 2:] - page.lines[:, :2], axis=1), 10.0)]
    names = {text: np.array([x, y]) for x, y, text in page.texts if text in ("x", "y")}
    sheet = np.array([(210 - 14) / 2 - 90, (297 - 22) / 2 - 120])
    assert len(arrows) == 2
    for name, line in zip("xy", arrows, strict=True):
        start, tip = line[:2], line[2:]
        along = (tip - start) / 10
        side = int(np.argmin(np.abs(along)))
        assert sheet[side] - 5 < start[side] < sheet[side] - 1
        assert 1 < along @ (names[name] - tip) < 3
        bars = page.lines[np.all(np.isclose((page.lines[:, :2] + page.lines[:, 2:]) / 2, start), axis=1)]
        (bar,) = bars[:, 2:] - bars[:, :2]
        assert np.abs(bar).tolist() == [2.0 * (side == 0), 2.0 * (side == 1)]
        barbs = page.lines[np.all(page.lines[:, :2] == tip, axis=1)][:, 2:] - tip
        np.testing.assert_allclose(barbs @ along, [-1.5, -1.5])
        assert sorted(barbs[:, side].tolist()) == [-1.0, 1.0]


def test_cut_marks_are_clear_of_the_sheet():
    """Cut marks begin 1.5 mm outside of the sheet, so that none is left on the board."""
    (page,) = printed_pages(SHAPES["charuco"], "title")
    marks = page.lines[np.isclose(np.abs(page.lines[:, 2:] - page.lines[:, :2]).sum(1), 4.0)]
    board = np.array([(210 - 14) / 2, (297 - 22) / 2])
    outside = np.abs(marks.reshape(-1, 2, 2) - board) - [90, 120]
    outwards = outside.max(axis=2)
    ticks = len(marks) - np.sum(np.all(np.isclose(np.sort(outwards, axis=1), [1.5, 5.5]), axis=1))
    assert ticks == 6


def test_smallest_fitting_paper_is_chosen():
    """Papers are tried from A4 upwards, portrait first.

    A larger target than A0 has a page of its own, of whole millimetres and with room for the ruler.
    """
    for size_mm, name, shape in (
        ((180, 259), "A4", (210, 297)),
        ((181, 100), "A4", (297, 210)),
        ((180, 260), "A3", (297, 420)),
        ((800, 1150), "A0", (841, 1189)),
        ((811.5, 1160), "custom", (842, 1198)),
        ((3, 1200), "custom", (140, 1238)),
    ):
        width, height = (1e-3 * side - 0.032 for side in size_mm)
        (page,) = printed_pages(points_target([[0, 0, 0], [width, height, 0]]), "title")
        assert (page.paper, tuple(page.size_mm)) == (name, shape), size_mm


def test_single_page_keeps_its_file_name(tmp_path: Path):
    """Only several pages have numbers in their file names."""
    assert [p.name for p in write_pages(printed_pages(LEDS, "leds"), tmp_path / "leds.svg")] == ["leds.svg"]


def test_pdf_contains_all_shapes_of_the_page(tmp_path: Path):
    """Rectangles and discs are filled, lines and rings are strokes of 0.15 mm, and texts are 3.2 mm high."""
    for kind in ("circles", "led", "charuco"):
        pages = printed_pages(SHAPES[kind], "title")
        (written,) = write_pages(pages, tmp_path / f"{kind}.pdf")
        (stream,) = re.findall(rb"stream\n(.*?)\nendstream", written.read_bytes(), re.DOTALL)
        drawn = zlib.decompress(stream).decode()
        (page,) = pages
        assert drawn.count(" re f") == len(page.rectangles)
        assert drawn.count(" h f") == len(page.discs)
        assert drawn.count(" l S") == len(page.lines)
        assert drawn.count(" h S") == len(page.rings)
        assert drawn.count("/F1 3.2 Tf") == len(page.texts)
        assert "\n0.15 w\n" in drawn
