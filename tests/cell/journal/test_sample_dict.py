"""Tests of a sample converted to the data of a line."""

from __future__ import annotations

import numpy as np

from basecal.cell.journal.sample_dict import sample_to_dict
from basecal.cell.recording import (
    CandidateObservation,
    PixelObservation,
    PointObservation,
    PoseObservation,
    RobotState,
    Sample,
    TouchObservation,
)
from basecal.geometry import SE3

AT = SE3.from_rotvec([0, 0, np.pi], [1, 2, 3])
POSE = {"t_m": [1.0, 2.0, 3.0], "q_xyzw": [0.0, 0.0, 1.0, 0.0]}


def test_empty_sample_writes_only_its_number():
    """Empty fields of a sample are not written."""
    assert sample_to_dict(Sample(3), "recording") == {"sample": 3}


def test_stamps_and_robots_are_written():
    """A sample writes its time if it has one, and the pose or joints of each robot."""
    robots = {"eye": RobotState(AT), "hand": RobotState(joints_rad=np.array([0.5, -0.0])), "still": RobotState()}
    assert sample_to_dict(Sample(0, 0.0, robots), "recording") == {
        "sample": 0,
        "stamp_s": 0.0,
        "robots": {"eye": {"base_from_flange": POSE}, "hand": {"joints_rad": [0.5, 0.0]}, "still": {}},
    }


def test_image_paths_start_from_recording_folder():
    """Image paths are written relative to the folder of the recording."""
    sample = Sample(0, images={"eye": "recording/images/a.png"}, background={"eye": "other/b.png"})
    written = sample_to_dict(sample, "recording")
    assert written["images"] == {"eye": "images/a.png"}
    assert written["background"] == {"eye": "../other/b.png"}


def test_observations_are_written_by_kind():
    """Pixels and points are written with ids, candidates without, poses with sigmas; equal sigmas become one number."""
    one, two = np.array([7]), np.array([[1.0, 2.0]])
    seen = (
        PixelObservation("eye", "a", one, two, np.array([0.5])),
        PixelObservation("eye", "b", one, two),
        CandidateObservation("eye", "c", np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([0.1, 0.2])),
        PoseObservation("eye", "d", AT, np.array([1, 1, 1, 2, 2, 3.0])),
        PoseObservation("eye", "e", AT),
        PointObservation("eye", "f", one, np.array([[1.0, 2.0, 3.0]]), np.array([0.3])),
    )
    of = [{"camera": "eye", "target": name} for name in "abcdef"]
    assert sample_to_dict(Sample(0, observations=seen), "")["observations"] == [
        of[0] | {"ids": [7], "pixels": [[1.0, 2.0]], "sigma_px": 0.5},
        of[1] | {"ids": [7], "pixels": [[1.0, 2.0]]},
        of[2] | {"candidates": [[1.0, 2.0], [3.0, 4.0]], "sigma_px": [0.1, 0.2]},
        of[3] | {"camera_from_target": {**POSE, "sigma_t_m": 1.0, "sigma_r_rad": [2.0, 2.0, 3.0]}},
        of[4] | {"camera_from_target": POSE},
        of[5] | {"ids": [7], "points_in_camera_m": [[1.0, 2.0, 3.0]], "sigma_m": 0.3},
    ]


def test_touches_write_only_known_fields():
    """Touches of a mark, of another tip and of a clamped part write only the sigmas that they have."""
    touches = (
        TouchObservation("tip_a", "mark", 1e-4),
        TouchObservation("tip_a", "tip_b", kind="tip2"),
        TouchObservation("part", "part_end", 1e-4, "clamp", 2e-3),
        TouchObservation("part", "part_end", None, "clamp", 2e-3),
    )
    assert sample_to_dict(Sample(0, observations=touches), "recording")["observations"] == [
        {"touch": "mark", "tip": "tip_a", "sigma_m": 1e-4},
        {"tip2": "tip_b", "tip": "tip_a"},
        {"clamp": "part", "sigma_m": 1e-4, "sigma_rad": 2e-3},
        {"clamp": "part", "sigma_rad": 2e-3},
    ]
