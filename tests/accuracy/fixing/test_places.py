"""Tests of the entries of `cell.yaml` that state freed transforms and lenses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.touch_cells import touch_data

from basecal.accuracy.fixing.apply import apply_cure
from basecal.accuracy.fixing.change import Change
from basecal.accuracy.fixing.cures import Cure
from basecal.accuracy.fixing.places import free_lens_entry, free_transform_entry, transform_place
from basecal.cell import Cell, Finding
from basecal.cell.files import cell_from_dict, read_cell, write_cell
from basecal.simulation import Scenario, simulate

BOARD = simulate(Scenario(samples=1, intrinsics="prior"), 2).cell
POINT = {"status": "prior", "t_m": [0, 0, 0.1], "sigma_t_m": 1e-3}
POSE = {**POINT, "q_xyzw": [0, 0, 0, 1], "sigma_r_rad": 1e-2}


def touch_cell_with_priors() -> Cell:
    """A cell of tips and of marks of each kind, all with priors."""
    data = touch_data(("mark_a",), bases={"hand": POSE})
    data["tips"]["eye_tip"]["offset"] = POINT
    data["marks"] = {
        "mark_a": {"points_m": [[0.4, 0, 0]], "sigma_m": 1e-3},
        "plate": {"points_m": {"one": [0, 0, 0], "two": [0.2, 0, 0]}, "mount": POSE},
        "floor": {"shape": "plane", "mount": POSE},
    }
    return cell_from_dict(data)


@pytest.mark.parametrize(
    ("cell", "name", "place"),
    [
        (BOARD, "eye_base_from_hand_base", ("bases", "hand")),
        (BOARD, "eye_flange_from_wrist", ("cameras", "wrist", "mount")),
        (BOARD, "hand_flange_from_board", ("targets", "board", "mount")),
        (touch_cell_with_priors(), "eye_base_from_hand_base", ("bases", "hand")),
        (touch_cell_with_priors(), "eye_flange_from_eye_tip", ("tips", "eye_tip", "offset")),
        (touch_cell_with_priors(), "eye_base_from_plate", ("marks", "plate", "mount")),
        (touch_cell_with_priors(), "eye_base_from_floor", ("marks", "floor", "mount")),
        (touch_cell_with_priors(), "eye_base_from_mark_a", ("marks", "mark_a")),
    ],
)
def test_freed_transform_is_read_back_as_free(tmp_path, cell, name, place) -> None:
    """Each transform with its own entry has its place, and the written entry frees it alone."""
    assert transform_place(cell, name) == place
    write_cell(cell, tmp_path)
    freed = free_transform_entry(cell, name)
    assert list(freed) == [place]
    stated = read_cell(tmp_path)
    if stated.transforms[name].status != "free":
        apply_cure(tmp_path, Cure(Finding("x", "warning", (name,), "Off."), "Free it.", Change(cell=freed)))
    found = read_cell(tmp_path).transforms
    assert found[name].status == "free"
    assert {each: known.status for each, known in found.items() if each != name} == {
        each: known.status for each, known in cell.transforms.items() if each != name
    }


def test_mark_of_plate_has_no_entry() -> None:
    """A mark of a plate is a number in the plate's entry, so it has none of its own."""
    assert transform_place(touch_cell_with_priors(), "plate_from_one") is None
    assert free_transform_entry(touch_cell_with_priors(), "plate_from_one") == {}


def test_freed_lens_keeps_numbers_as_guess(tmp_path) -> None:
    """A freed lens keeps its numbers as a guess, without the sigmas that a free lens cannot have."""
    write_cell(BOARD, tmp_path)
    cure = Cure(Finding("x", "warning", ("wrist",), "Off."), "Free it.", Change(cell=free_lens_entry(BOARD, "wrist")))
    apply_cure(tmp_path, cure)
    known, lens = BOARD.cameras["wrist"].intrinsics, read_cell(tmp_path).cameras["wrist"].intrinsics
    assert (lens.status, lens.sigma) == ("free", None)
    np.testing.assert_array_equal(lens.camera.parameters, known.camera.parameters)
    fixed = replace(BOARD.cameras["wrist"], intrinsics=replace(known, status="fixed", sigma=None))
    entry = free_lens_entry(replace(BOARD, cameras={"wrist": fixed}), "wrist")
    assert entry == {("cameras", "wrist", "intrinsics", "status"): "free"}
