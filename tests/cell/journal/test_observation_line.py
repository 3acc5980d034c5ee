"""Tests of an observation in a line, checked against the cell."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import clamp_cell, touch_cell

from basecal.cell.cell import Cell
from basecal.cell.files import cell_from_dict
from basecal.cell.journal.observation_line import UnknownPoint, observation, track_observation
from basecal.cell.journal.sample_values import FileLine
from basecal.cell.recording import CandidateObservation, PixelObservation, PointObservation, PoseObservation
from basecal.errors import DatasetError

HERE = FileLine("samples.jsonl", 4)
LENS = {"status": "fixed", "fx": 500.0, "fy": 500.0, "cx": 320.0, "cy": 240.0}
CORNERS = {"kind": "chessboard", "corners": [3, 2], "square_m": 0.03}
CELL = cell_from_dict(
    {
        "schema": "basecal/cell/1",
        "reference": "arm",
        "robots": {"arm": {}},
        "cameras": {"eye": {"on": "arm", "size_px": [640, 480], "intrinsics": LENS}, "depth": {"on": "arm"}},
        "targets": {
            "board": {"on": "world", **CORNERS},
            "light": {"on": "world", "kind": "led"},
            "object": {"on": "world"},
        },
    }
)
IDS = {"board": frozenset(range(6)), "light": frozenset({0})}


def read(cell: Cell = CELL, **written):
    return observation({"camera": "eye", **written}, "observations[0]", HERE, cell, IDS)


def test_each_observation_kind_is_read():
    """Pixels, candidates, a pose and points are read with their camera and target."""
    names, pixels = read(target="board", ids=[4, 1], pixels=[[1, 2], [3, 4]], sigma_px=0.5)
    assert names == ("eye", "board")
    assert isinstance(pixels, PixelObservation)
    assert pixels.ids.tolist() == [4, 1]
    assert pixels.pixels.tolist() == [[1, 2], [3, 4]]
    assert pixels.sigma_px.tolist() == [0.5, 0.5]
    _, spots = read(target="light", candidates=[[1, 2], [3, 4]], sigma_px=[0.1, 0.2])
    assert isinstance(spots, CandidateObservation)
    assert spots.sigma_px.tolist() == [0.1, 0.2]
    pose = {"t_m": [0, 0, 1], "q_xyzw": [0, 0, 0, 1], "sigma_t_m": 0.1, "sigma_r_rad": 0.2}
    _, seen = read(camera="depth", target="object", camera_from_target=pose)
    assert isinstance(seen, PoseObservation)
    assert seen.sigma.tolist() == [0.1] * 3 + [0.2] * 3
    _, points = read(camera="depth", target="board", ids=[5], points_in_camera_m=[[0, 0, 1]], sigma_m=0.3)
    assert isinstance(points, PointObservation)
    assert points.sigma_m.tolist() == [0.3]


@pytest.mark.parametrize(
    "written",
    [
        {"target": "board", "ids": [], "pixels": []},
        {"target": "light", "candidates": []},
        {"target": "board", "ids": [], "points_in_camera_m": []},
    ],
)
def test_empty_observation_gives_none(written):
    """Empty lists are neither an observation nor an error."""
    assert read(**written) == (("eye", written["target"]), None)


def test_led_observation_needs_no_ids():
    """A single point has only one possible id, so it may be omitted."""
    assert read(target="light", pixels=[[1, 2]])[1].ids.tolist() == [0]
    assert read(target="light", pixels=[])[1] is None
    assert np.array_equal(read(target="light", ids=[0], pixels=[[1, 2]])[1].ids, [0])


@pytest.mark.parametrize(
    ("written", "field", "message"),
    [
        ({"target": "board"}, "observations[0]", "expected exactly one of pixels, candidates, camera_from_target"),
        ({"target": "light", "pixels": [], "candidates": []}, "observations[0]", "got pixels and candidates"),
        ({"target": "light", "candidates": [], "ids": []}, "observations[0].ids", "unknown field"),
        ({"target": "bord", "pixels": []}, "observations[0].target", "did you mean 'board'"),
        ({"camera": "ear", "target": "board", "pixels": []}, "observations[0].camera", "no camera 'ear'"),
        ({"target": "object", "ids": [0], "pixels": [[1, 2]]}, "observations[0].target", "need its `kind` and shape"),
        ({"target": "board", "candidates": [[1, 2]]}, "observations[0].candidates", "for a single LED"),
        ({"camera": "depth", "target": "light", "pixels": [[1, 2]]}, "observations[0].camera", "need its size_px"),
        ({"target": "board", "pixels": [[1, 2]]}, "observations[0].ids", "missing; 'board' has several points"),
        ({"target": "board", "ids": [1], "pixels": [[1, 2], [3, 4]]}, "observations[0].ids", "1 id for 2 points"),
        (
            {"target": "light", "pixels": [[1, 2], [3, 4]]},
            "observations[0]",
            "record uncertain detections as `cand",
        ),
        ({"target": "board", "ids": [0] * 25, "pixels": [[1, 2]] * 25}, "observations[0]", "25 points, 'board' has 6"),
        ({"target": "light", "camera_from_target": {}}, "observations[0].camera_from_target", "has no orientation"),
    ],
)
def test_observations_inconsistent_with_cell_are_refused(written, field, message):
    """The error states the field and the expected value."""
    with pytest.raises(DatasetError) as caught:
        read(**written)
    assert caught.value.field == field
    assert message in caught.value.reason


@pytest.mark.parametrize(
    ("ids", "message"),
    [
        ([6], "id 6 is not on 'board', whose ids are 0 to 5"),
        ([8, 7, 1], "id 7 is not on"),
        ([3, 1, 3], "id 3 of 'board'"),
    ],
)
def test_invalid_ids_raise_unknown_point(ids, message):
    """Ids missing from the target, or repeated in one observation, drop the sample and not the file."""
    with pytest.raises(UnknownPoint, match=message):
        read(target="board", ids=ids, pixels=[[1, 2]] * len(ids))


def test_point_observations_need_no_lens():
    """A depth camera may observe 3-D points of a board or an LED without a lens."""
    assert read(camera="depth", target="light", points_in_camera_m=[[0, 0, 1]])[1].ids.tolist() == [0]


TOUCHED, HELD = touch_cell(), clamp_cell("free")


def read_touch(cell: Cell = TOUCHED, **written):
    return observation(written, "observations[0]", HERE, cell, {})


def test_touches_and_grips_are_read():
    """A tip at a mark, a tip at another tip, and a clamped part are read, each with or without sigmas."""
    names, touch = read_touch(tip="eye_tip", touch="mark_a", sigma_m=1e-4)
    assert names == ("eye_tip", "mark_a")
    assert (touch.tip, touch.mark, touch.sigma_m, touch.kind) == ("eye_tip", "mark_a", 1e-4, "touch")
    _, meeting = read_touch(tip="hand_tip", tip2="eye_tip")
    assert (meeting.tip, meeting.mark, meeting.sigma_m, meeting.kind) == ("hand_tip", "eye_tip", None, "tip2")
    _, grip = read_touch(HELD, clamp="part", sigma_m=1e-4, sigma_rad=2e-3)
    assert (grip.tip, grip.sigma_m, grip.sigma_rad, grip.kind) == ("part", 1e-4, 2e-3, "clamp")


@pytest.mark.parametrize(("written", "message"), [
    ({"tip": "eye_tip"}, "expected tip with touch or tip2, got neither"),
    ({"tip": "eye_tip", "touch": "mark_a", "tip2": "hand_tip"}, "got touch and tip2"),
    ({"tip": "eye_tip", "tip2": "eye_tip"}, "are on one robot: no pose brings them together"),
    ({"tip": "eye_tip", "touch": "mark_x"}, "mark_x"),
    ({"tip": "mark_a", "touch": "mark_a"}, "no tip 'mark_a'"),
    ({"tip": "eye_tip", "touch": "mark_a", "sigma_m": -1.0}, "sigma_m"),
    ({"clamp": "part"}, "clamp"),
])  # fmt: skip
def test_invalid_touches_are_refused(written, message):
    """The error for an invalid touch states its field and the expected value."""
    with pytest.raises(DatasetError, match=message):
        read_touch(**written)


def test_tracks_are_read():
    """Tracks need a camera with a lens and one pixel each; a repeated track is refused."""

    def tracks(**written):
        return track_observation({"camera": "eye", **written}, "tracks[0]", HERE, CELL)

    seen = tracks(tracks=[7, 3], pixels=[[1, 2], [3, 4]])
    assert (seen.camera, seen.tracks.tolist(), seen.pixels.tolist()) == ("eye", [7, 3], [[1, 2], [3, 4]])
    with pytest.raises(DatasetError, match="2 tracks for 1 pixel; expected one each"):
        tracks(tracks=[7, 3], pixels=[[1, 2]])
    with pytest.raises(DatasetError, match="a track is given twice in one image"):
        tracks(tracks=[7, 7], pixels=[[1, 2], [3, 4]])
    with pytest.raises(DatasetError, match="'depth' need its size_px and intrinsics"):
        tracks(camera="depth", tracks=[7], pixels=[[1, 2]])


@pytest.mark.parametrize("key", ["sigma_m", "sigma_rad"])
def test_touch_has_one_sigma(key):
    """The sigma is a number or a list of one; a list of two, zero and text are refused."""
    grip = read_touch(HELD, clamp="part", **{key: [2e-3]})[1]
    assert getattr(grip, key) == 2e-3
    for wrong, message in (([1e-3, 1e-3], "or 1, got 2"), (0.0, "positive"), ("thin", key)):
        with pytest.raises(DatasetError, match=message) as caught:
            read_touch(HELD, clamp="part", **{key: wrong})
        assert caught.value.field == f"observations[0].{key}"


@pytest.mark.parametrize("count", [1, 3])
def test_sigma_count_must_match_points(count):
    """A list of sigmas of another length than the points is refused."""
    with pytest.raises(DatasetError, match=f"expected one positive number or 2, got {count}"):
        read(target="board", ids=[4, 1], pixels=[[1, 2], [3, 4]], sigma_px=[0.5] * count)


def test_all_points_of_target_may_be_observed():
    """All points may be observed in any order with the ids of the line; more points than the target has are refused."""
    ids = [5, 0, 3, 1, 4, 2]
    assert read(target="board", ids=ids, pixels=[[k, k] for k in ids])[1].ids.tolist() == ids
    with pytest.raises(DatasetError, match="7 points, 'board' has 6"):
        read(target="board", ids=[*ids, 0], pixels=[[1, 2]] * 7)


def test_unknown_point_reports_observed_and_known_ids():
    """The message names the lowest id that is unknown or repeated, and the error lists observed and known ids."""
    with pytest.raises(UnknownPoint, match="id 8 is not on") as caught:
        read(target="board", ids=[9, 8, 0], pixels=[[1, 2]] * 3)
    assert (caught.value.target, caught.value.ids, caught.value.known) == ("board", {9, 8, 0}, set(range(6)))
    with pytest.raises(UnknownPoint, match="id 1 of 'board' is given twice") as caught:
        read(target="board", ids=[4, 1, 1, 4], pixels=[[1, 2]] * 4)
    assert (caught.value.ids, caught.value.known) == ({1, 4}, set(range(6)))


def test_points_need_three_numbers():
    """3-D points have three numbers, and pixels have two."""
    with pytest.raises(DatasetError, match="points_in_camera_m"):
        read(camera="depth", target="light", points_in_camera_m=[[0, 1]])
    with pytest.raises(DatasetError, match="pixels"):
        read(target="light", pixels=[[0, 1, 2]])
