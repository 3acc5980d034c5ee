"""Recordings made in Python: what does not suit the cell is named with its sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import basecal
from basecal.cell import (
    Cell,
    CellCamera,
    CellTarget,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Recording,
    Robot,
    RobotState,
    Sample,
    Target,
    TrackObservation,
)
from basecal.cell.recording_check import check_recording
from basecal.errors import InputError
from basecal.geometry import SE3

CORNERS = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]])
CELL = Cell(
    "arm",
    {"arm": Robot("arm")},
    cameras={"wrist": CellCamera("wrist", "arm")},
    targets={"board": CellTarget("board", "world", target=Target("points", np.arange(3), CORNERS))},
)
STATE = {"arm": RobotState(SE3.identity())}
PIXELS = PixelObservation("wrist", "board", np.arange(3), np.zeros((3, 2)))
POSE = PoseObservation("wrist", "board", SE3.identity(), np.ones(6))


def recording(robots=STATE, observations=(PIXELS,), **others):
    """Sample 7 alone."""
    return Recording((Sample(7, robots=robots, observations=observations, **others),))


def test_a_sound_recording_passes():
    """Also with lists of numbers, numbers of other types, and observations in a list."""
    lists = PixelObservation("wrist", "board", [0, 2], [[1, 2], [3, 4]], [0.1, 0.2])
    points = PointObservation("wrist", "board", np.arange(3, dtype=np.uint8), CORNERS.astype(np.float32))
    assert lists.ids.dtype == np.int64
    np.testing.assert_array_equal(lists.pixels, [[1.0, 2.0], [3.0, 4.0]])
    check_recording(CELL, recording(observations=[lists, points, POSE], stamp_s=3))
    check_recording(CELL, recording(tracks=(TrackObservation("wrist", [4, 5], np.zeros((2, 2))),)))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"pixels": np.array([[0, 0], [0, np.nan], [0, 0]])}, "the pixels of board seen by wrist: NaN .* in row 1"),
        ({"pixels": np.zeros((2, 3))}, r"got shape \(2, 3\), expected an array of numbers, \(n, 2\)"),
        ({"pixels": np.zeros((2, 2))}, r"the ids of board seen by wrist: got shape \(3,\)"),
        ({"pixels": np.zeros((3, 2), dtype=complex)}, "got complex128, expected an array of numbers"),
        ({"ids": np.array([0, 1, 1])}, "hold one id twice"),
        ({"ids": np.array([0, 1, 1.5])}, "float64, expected whole numbers"),
        ({"ids": np.array([0, 1, 3])}, "id 3 is not on the points"),
        ({"sigma_px": np.array([1, 1, 0.0])}, "the sigmas of board seen by wrist are not all above zero"),
        ({"sigma_px": np.array([1, 1, np.inf])}, "the sigmas of board seen by wrist: NaN or infinity in row 2"),
        ({"camera": "wist"}, r"no camera 'wist' \(did you mean 'wrist'\?\); the cell has: wrist"),
        ({"target": "tag"}, "no target 'tag'; the cell has: board"),
    ],
)
def test_observations_are_checked(changes, words):
    """Each message begins with the number of the sample."""
    with pytest.raises(InputError, match=f"^sample 7: .*{words}"):
        check_recording(CELL, recording(observations=(replace(PIXELS, **changes),)))


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"robots": {"arm": RobotState(SE3(np.eye(3), [0, np.nan, 0]))}}, "base_from_flange of arm holds NaN"),
        ({"robots": {"arm": RobotState(SE3.identity((1,)))}}, r"a batch of shape \(1,\), expected a single pose"),
        ({"robots": {"arm": RobotState(np.eye(4))}}, "base_from_flange of arm is of type ndarray, expected SE3"),
        ({"robots": {"arm": RobotState()}}, "neither of base_from_flange and joints_rad"),
        ({"robots": {"arm": SE3.identity()}}, "the state of arm is of type SE3, expected RobotState"),
        ({"robots": {"arms": STATE["arm"]}}, "no robot 'arms' .*the cell has: arm"),
        ({"robots": {"arm": RobotState(joints_rad=[0.0, np.nan])}}, "joints_rad of arm: NaN or infinity in row 1"),
        ({"observations": PIXELS}, "the observations are of type PixelObservation, expected a tuple"),
        ({"observations": (None,)}, "an observation is of type NoneType, expected one of: PixelObservation"),
        (
            {"observations": (replace(POSE, sigma=np.ones(2)),)},
            r"got shape \(2,\), expected an array of numbers, \(6\)",
        ),
        ({"stamp_s": float("nan")}, "stamp_s: NaN or infinity"),
        ({"stamp_s": "noon"}, "stamp_s: got <U4, expected a number"),
        ({"images": {"left": "0.png"}}, "no camera 'left'"),
        ({"tracks": (TrackObservation("wrist", np.arange(3), np.zeros((2, 2))),)}, "the ids of tracks of wrist"),
    ],
)
def test_samples_are_checked(parts, words):
    """Each message begins with the number of the sample."""
    with pytest.raises(InputError, match=f"^sample 7: .*{words}"):
        check_recording(CELL, recording(**parts))


def test_lists_that_are_no_numbers_are_refused():
    """Rows of different lengths are no array."""
    with pytest.raises(InputError, match="pixels is not an array of numbers"):
        PixelObservation("wrist", "board", [0, 1], [[1, 2], [3]])


@pytest.mark.parametrize("function", [basecal.calibrate, basecal.solve, basecal.detect])
def test_public_functions_check_their_recording(function):
    """A pixel that is not a number is not taken for poses that do not converge."""
    wrong = recording(observations=(replace(PIXELS, pixels=np.full((3, 2), np.nan)),))
    with pytest.raises(InputError, match=r"^sample 7: the pixels of board seen by wrist: NaN or infinity in row 0"):
        function(CELL, wrong)
    with pytest.raises(InputError, match="samples of the recording are of type Sample, expected a tuple"):
        function(CELL, Recording(wrong.samples[0]))
    with pytest.raises(InputError, match="each of the samples is of type NoneType, expected Sample"):
        function(CELL, Recording((None,)))
