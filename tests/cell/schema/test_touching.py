"""Tests of tips, marks and clamps in `cell.yaml`."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import (
    clamp_cell,
    clamp_lines,
    held_poses,
    lines_text,
    recorded,
    touch_cell,
    touch_data,
    touch_lines,
)

from basecal.cell.files import cell_from_dict, cell_to_dict, recording_from_text, sample_to_dict
from basecal.cell.schema.touching import MarkEntry, _is_oblique_line
from basecal.errors import DatasetError

MOUNT = {"status": "fixed", "t_m": [0, 0, 0], "q_xyzw": [0, 0, 0, 1]}
PLATE = {"points_m": {"socket_1": [0, 0, 0], "socket_2": [0.05, 0, 0]}, "sigma_m": 1e-5}


def test_plates_and_stated_marks_have_transforms():
    """A plate is a transform of its own in which its marks are placed; a single mark is placed in the world."""
    cell = touch_cell((), marks={"plate": PLATE, "alone": {"points_m": [[0.1, 0.2, 0.3]], "exact": True}, "free": {}})
    transforms = cell.transforms
    assert transforms["eye_base_from_plate"].status == "free"
    assert transforms["plate_from_socket_2"].sigma[:3] == pytest.approx([1e-5] * 3)
    assert transforms["eye_base_from_alone"].status == "fixed"
    assert transforms["eye_base_from_free"].mean is None
    assert cell_to_dict(cell_from_dict(cell_to_dict(cell))) == cell_to_dict(cell)


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"tips": {"eye_tip": {"on": "world"}}}, "no robot 'world'"),
        ({"marks": {"eye_tip": {}}}, "taken by"),
        ({"marks": {"plate": PLATE, "socket_1": {}}}, "taken by"),
        ({"marks": {"a": {"sigma_m": 1e-4}}}, "points_m, which is missing"),
        ({"marks": {"a": {"points_m": [[0, 0, 0]], "mount": MOUNT}}}, "mount is for a plate"),
        ({"marks": {"a": {"points_m": {}}}}, "a.points_m: expected at least one point"),
        ({"marks": {"a": {"points_m": []}}}, "a.points_m: expected at least one point"),
    ],
)
def test_invalid_marks_and_tips_are_refused(section, words):
    """Duplicate names, unknown carriers and sigmas without points are errors."""
    with pytest.raises(DatasetError, match=words):
        cell_from_dict({**touch_data(), **section})


@pytest.mark.parametrize("offset", [
    {"status": "prior", "t_m": [0.0, 0.01, 0.15], "sigma_t_m": 1e-3},
    {"status": "free", "guess": {"t_m": [0.0, 0.01, 0.15]}},
    {"status": "fixed", "t_m": [0.0, 0.01, 0.15]},
])  # fmt: skip
def test_offset_of_a_tip_is_a_point(offset):
    """A stated offset is written as it was read: a position without a rotation."""
    cell = touch_cell(tips={"eye_tip": {"on": "eye", "offset": offset}})
    written = cell_to_dict(cell)
    assert written["tips"] == {"eye_tip": {"on": "eye", "offset": offset}}
    assert cell_to_dict(cell_from_dict(written)) == written


def test_touches_round_trip():
    """Lines of touches of marks and of tips are read and written back unchanged."""
    for marks in (touch_data()["marks"], {}):
        cell = touch_cell(list(marks))
        lines = touch_lines(np.random.default_rng(0), 4, 1e-4, {m: np.zeros(3) for m in marks}, is_stated=True)
        read = [sample_to_dict(sample, "recording") for sample in recorded(cell, lines).samples]
        assert [line["observations"] for line in read] == [line["observations"] for line in lines]


@pytest.mark.parametrize(
    ("seen", "words"),
    [
        ('{"tip": "eye_tip"}', "expected tip with touch or tip2, got neither"),
        ('{"tip": "eye_tip", "touch": "mark_x"}', "no mark 'mark_x'"),
        ('{"tip": "eye_tip", "tip2": "eye_tip"}', "on one robot"),
    ],
)
def test_invalid_touches_are_refused(seen, words):
    """Each invalid touch is an error on one line that names the field."""
    text = f'{{"sample": 0, "observations": [{seen}]}}\n'
    with pytest.raises(DatasetError, match=words):
        recording_from_text(text.encode(), ".", touch_cell())


def test_unnamed_clamped_part_round_trip():
    """An unnamed part is called `part` and has an end on both robots.

    The cell and its samples are written back unchanged.
    """
    cell = clamp_cell("free")
    assert set(cell.transforms) == {"eye_base_from_hand_base", "eye_flange_from_part", "hand_flange_from_part_grip"}
    again = cell_to_dict(cell_from_dict(cell_to_dict(cell)))
    assert again == cell_to_dict(cell)
    assert again["clamp"] == {"part": {"robots": ["eye", "hand"], "axis": "free"}}
    recording = recorded(cell, clamp_lines(held_poses(np.random.default_rng(0), 2), sigma_m=1e-4, sigma_rad=2e-3))
    written = [sample_to_dict(sample, "recording") for sample in recording.samples]
    assert written[1]["observations"] == [{"clamp": "part", "sigma_m": 1e-4, "sigma_rad": 2e-3}]
    assert [sample_to_dict(s, "recording") for s in recorded(cell, written).samples] == written


@pytest.mark.parametrize(
    ("clamp", "words"),
    [
        ({"robots": ["eye", "eye"]}, "one twice"),
        ({"robots": ["eye"]}, "at least 2"),
        ({"robots": 2}, "expected a list, got 2"),
        ({"robots": ["eye", "arm"]}, "no robot 'arm'"),
        ({"rod": {"robots": ["eye", "hand"], "axis": "ball"}}, "axis"),
        ({"eye_tip": {"robots": ["eye", "hand"]}}, "taken by"),
        ([], "clamp"),
    ],
)
def test_invalid_clamps_are_refused(clamp, words):
    """Unknown robots, unknown axes and duplicate names are errors."""
    with pytest.raises(DatasetError, match=words):
        cell_from_dict({**touch_data(), "clamp": clamp})


def test_unknown_clamp_in_line_is_refused():
    """A line that refers to a clamp missing from the cell is an error."""
    line = {"sample": 0, "robots": {}, "observations": [{"clamp": "rod"}]}
    with pytest.raises(DatasetError, match="no clamp 'rod'"):
        recording_from_text(lines_text([line]).encode(), ".", clamp_cell("fixed"))


@pytest.mark.parametrize(
    ("points", "is_line"),
    [
        ([[0, 0, 0], [1, 1, 0]], True),
        ([[5, 3, 2], [6, 4, 2], [7, 5, 2]], True),
        ([[5, 3, 2], [6, 3, 2], [9, 3, 2]], False),
        ([[5, 3, 2], [5, 3, 4]], False),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], False),
        ([[5, 5, 5], [6, 5, 5], [5, 6, 5]], False),
        ([[0, 0, 0], [1, 1e-7, 0]], False),
        ([[0, 0, 0], [1, 1e-5, 0]], True),
    ],
)
def test_oblique_lines_of_marks_are_recognised(points, is_line):
    """Marks on a line that is not parallel to an axis are recognised anywhere, whether named or listed."""
    assert _is_oblique_line(points) == is_line
    assert _is_oblique_line({f"m{k}": point for k, point in enumerate(points)}) == is_line


def test_clamped_part_prior_is_near_flange():
    """A rigid part lies within a few decimetres of its flange, in any rotation.

    Stated marks are known to hundredths of a millimetre.
    """
    cell = clamp_cell("fixed")
    (part, *_) = [thing for thing in (*cell.cameras.values(), *cell.targets.values()) if thing.mount.status == "prior"]
    assert part.mount.sigma[:3].tolist() == [0.2] * 3
    assert np.isinf(part.mount.sigma[3:]).all()
    assert part.mount.mean.translation.tolist() == [0, 0, 0]
    (mark,) = MarkEntry(points_m=[[1.0, 2.0, 3.0]]).positions("m").values()
    assert (mark.status, mark.sigma.tolist()) == ("prior", [2e-5] * 3 + [0.0] * 3)
    (stated,) = MarkEntry(points_m=[[1.0, 2.0, 3.0]], sigma_m=1e-3).positions("m").values()
    assert stated.sigma.tolist() == [1e-3] * 3 + [0.0] * 3
    assert list(MarkEntry(points_m=[[1, 2, 3], [2, 2, 3]]).positions("m")) == ["m_0", "m_1"]
    (free,) = MarkEntry().positions("m").values()
    assert (free.status, free.mean) == ("free", None)


def test_planes_edges_and_plates_round_trip():
    """Planes, edges and plates are written and read back with their poses; clamped parts are not written as marks."""
    marks = {
        "table": {"shape": "plane", "mount": MOUNT},
        "rim": {"shape": "edge"},
        "plate": PLATE,
        "alone": {"points_m": [[0.1, 0.2, 0.3]], "exact": True},
        "free": {},
    }
    cell = touch_cell((), marks=marks)
    written = cell_to_dict(cell)["marks"]
    assert list(written) == ["plate", "table", "rim", "alone", "free"]
    assert written["table"] == {"shape": "plane", "mount": MOUNT | {"q_xyzw": [0, 0, 0, 1]}}
    assert written["rim"]["mount"] == written["plate"]["mount"] == {"status": "free"}
    again = cell_from_dict(touch_data((), marks=written))
    for name, target in cell.targets.items():
        read = again.targets[name]
        assert (read.on, read.contact, read.mount.status, read.size_sigma) == (
            target.on, target.contact, target.mount.status, target.size_sigma,
        )  # fmt: skip
    assert again.plates.keys() == cell.plates.keys() == {"plate"}
    assert "marks" not in cell_to_dict(clamp_cell("free")) or not cell_to_dict(clamp_cell("free"))["marks"]


@pytest.mark.parametrize("axis", ["fixed", "free"])
def test_clamped_part_has_no_size_error(axis):
    """The end of a clamped part on the second robot has a size sigma of zero."""
    (end,) = [target for target in clamp_cell(axis).targets.values() if target.contact is not None]
    assert (end.on, end.size_sigma) == ("hand", 0.0)
