"""Tests that apply to every registered kind of target."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from basecal.cell.cell import Cell
from basecal.cell.files import cell_from_dict, cell_to_dict
from basecal.cell.format.yaml_text import parse_yaml
from basecal.cell.targets.kind import PrintSizes
from basecal.cell.targets.registry import TARGETS, TargetKindName
from basecal.exchange.importing.template import cell_text
from basecal.geometry import SE3

SIZES = PrintSizes(5, 7, 0.04, 0.03, "DICT_4X4_50", "tag36h11", 3)


def cell_with(kind: str, fields: Any) -> Cell:
    target = {"on": "world", "kind": kind, **fields}
    return cell_from_dict(
        {"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": {}}, "targets": {"it": target}}
    )


@pytest.mark.parametrize("kind", TARGETS)
def test_target_round_trip(kind: TargetKindName) -> None:
    """A target written to a cell.yaml and read back has the same points, ids and fields."""
    usual = TARGETS[kind].usual(np.random.default_rng(0))
    cell = cell_with(kind, usual.options)
    read = cell.targets["it"].target
    assert read is not None
    np.testing.assert_array_equal(read.ids, usual.ids)
    np.testing.assert_allclose(read.points, usual.points, atol=1e-15)
    assert read.options == usual.options
    assert cell_to_dict(cell)["targets"]["it"] | usual.options == cell_to_dict(cell)["targets"]["it"]


@pytest.mark.parametrize("kind", TARGETS)
def test_documented_targets_fit_in_hand(kind: TargetKindName) -> None:
    """Each target in the figures of the documentation is smaller than 0.3 m."""
    for shape in TARGETS[kind].figures.values():
        assert np.ptp(shape.points, axis=0).max() < 0.3


@pytest.mark.parametrize("kind", TARGETS)
def test_figures_of_documents_show_the_targets(kind: TargetKindName) -> None:
    """The images in the documentation are those that docs/draw_targets.py draws."""
    script = runpy.run_path(str(Path(__file__).parents[3] / "docs" / "draw_targets.py"))
    for name, shape in TARGETS[kind].figures.items():
        stored = (script["FIGURES"] / f"target_{name}.svg").read_text(encoding="utf-8")
        assert stored == script["drawn"](shape), "draw the figures anew: python docs/draw_targets.py"


@pytest.mark.parametrize("kind", TARGETS)
def test_template_gives_target_of_kind(kind: TargetKindName) -> None:
    """The template lines of a new cell.yaml give a target of the kind."""
    read = cell_from_dict(parse_yaml(cell_text(2, kind), "new").data).targets["target"].target
    assert read is not None
    assert read.kind == kind


@pytest.mark.parametrize("kind", TARGETS)
def test_printed_target_has_requested_size(kind: TargetKindName) -> None:
    """A printed board has two points at a distance of the requested square size."""
    printed = TARGETS[kind].printed
    if printed is None or not printed(SIZES):
        return
    target = cell_with(kind, printed(SIZES)).targets["it"].target
    assert target is not None
    apart = np.linalg.norm(target.points[1:] - target.points[0], axis=1)
    assert np.isclose(apart, SIZES.square_m).any()


@pytest.mark.parametrize("kind", TARGETS)
def test_points_lie_on_sheets(kind: TargetKindName) -> None:
    """Every point of a printed target lies in the plane of a sheet and on its paper."""
    usual = TARGETS[kind].usual(np.random.default_rng(0))
    if not usual.sheets:
        return
    on_paper = np.zeros(len(usual.points), dtype=bool)
    for sheet in usual.sheets:
        x, y, z = (sheet.target_from_sheet.inverse() @ usual.points).T
        left, top, right, bottom = sheet.paper
        on_paper |= (np.abs(z) < 1e-12) & (left < x) & (x < right) & (top < y) & (y < bottom)
    assert on_paper.all()


@pytest.mark.parametrize("kind", TARGETS)
def test_half_turn_symmetry_maps_points_in_reverse(kind: TargetKindName) -> None:
    """If a target has half-turn symmetry, point k moves to the place of point n - 1 - k."""
    usual = TARGETS[kind].usual(np.random.default_rng(0))
    middle = usual.points.mean(axis=0)
    turn = SE3(np.diag([-1.0, -1.0, 1.0]), middle * [2, 2, 0])
    same = np.allclose(turn @ usual.points, usual.points[::-1])
    assert same or not usual.has_half_turn_symmetry


def test_tag_corner_ids_are_point_ids() -> None:
    """The ids of tag corners are the ids of the target, each once."""
    tagged = [u for k in TARGETS if (u := TARGETS[k].usual(np.random.default_rng(0))).tags is not None]
    assert tagged
    for target in tagged:
        assert target.tags is not None
        np.testing.assert_array_equal(np.sort(target.tags.corner_ids.ravel()), target.ids)


def test_unmarked_grids_have_half_turn_symmetry() -> None:
    """Chessboards and circle grids have half-turn symmetry; every other target has distinguishable ends."""
    usual = {kind: TARGETS[kind].usual(np.random.default_rng(0)) for kind in TARGETS}
    assert {kind for kind, target in usual.items() if target.has_half_turn_symmetry} == {"chessboard", "circles"}
    measured = {kind for kind, each in TARGETS.items() if each.printed is None}
    assert {kind for kind, target in usual.items() if target.found_by is None} == measured


@pytest.mark.parametrize("kind", TARGETS)
def test_usual_sheets_are_hand_sized(kind: TargetKindName) -> None:
    """Sheets are 10 to 40 cm wide; markers lie on them without overlap."""
    for sheet in TARGETS[kind].usual(np.random.default_rng(0)).sheets:
        left, top, right, bottom = sheet.paper
        assert 0.1 < right - left < 0.4
        assert 0.1 < bottom - top < 0.4
        corners = np.array(
            [(mark.left, mark.top, mark.left + mark.size_m, mark.top + mark.size_m) for mark in sheet.markers]
        )
        for k, mark in enumerate(corners):
            assert np.all(mark[:2] >= (left, top))
            assert np.all(mark[2:] <= (right, bottom))
            others = np.delete(corners, k, axis=0)
            assert np.all(np.any((others[:, :2] >= mark[2:]) | (others[:, 2:] <= mark[:2]), axis=1))
