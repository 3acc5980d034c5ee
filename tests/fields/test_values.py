"""Tests of numbers, sigmas and poses in `cell.yaml`."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from basecal.fields import values
from basecal.fields.values import Mount, PointMount, PoseEntry, check_full_pose, pose_se3
from basecal.geometry import SE3

Q = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
QUARTER = SE3.from_rotvec([0, 0, np.pi / 2], [1.0, 2.0, 3.0])
SIGMAS = {"sigma_t_m": 0.1, "sigma_r_rad": 0.2}


def read(kind, value):
    return TypeAdapter(kind).validate_python(value)


@pytest.mark.parametrize(
    ("kind", "value", "found"),
    [
        (values.Sigma, 1e-12, 1e-12),
        (values.Sigma, 1000000, 1e6),
        (values.Sigma2, 0.5, [0.5, 0.5]),
        (values.Sigma3, [1, 2, 3], [1.0, 2.0, 3.0]),
        (values.Sigmas, 2, [2.0]),
        (values.Sigmas, [1, 2], [1.0, 2.0]),
        (values.Number, -1e6, -1e6),
        (values.Length, 1e3, 1e3),
        (values.Length, 1e-6, 1e-6),
        (values.Pixels, 1e6, 1e6),
        (values.ImageSize, [1, 100_000], [1, 100_000]),
        (values.Squares, [3, 1000], [3, 1000]),
        (values.Corners, [2, 1000], [2, 1000]),
        (values.PathText, "a/b c.png", "a/b c.png"),
    ],
)
def test_values_within_limits_are_accepted(kind, value, found):
    """Values up to and including their limits are accepted."""
    assert read(kind, value) == found


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        *((values.Sigma, wrong) for wrong in (0, -1.0, 0.9e-12, 1.1e6, True, "1", None, float("nan"))),
        *((values.Sigma2, wrong) for wrong in ([1.0], [1, 2, 3], [1, 0], [], "a")),
        *((values.Sigma3, wrong) for wrong in ([1, 2], [1, 2, -3])),
        *((values.Sigmas, wrong) for wrong in ([], [0.0], 0)),
        *((values.Number, wrong) for wrong in (1.1e6, -1.1e6)),
        *((values.Length, wrong) for wrong in (0, -1.0, 1e-320, 0.9e-6, 1.1e3)),
        *((values.Pixels, wrong) for wrong in (0, -1.0, 1.1e6)),
        *((values.Vector, wrong) for wrong in ([1, 2], [1, 2, 3, 4])),
        *((values.ImageSize, wrong) for wrong in ([0, 5], [100_001, 5], [5], [5, 5, 5])),
        *((values.Squares, wrong) for wrong in ([2, 5], [5, 1001])),
        *((values.Corners, wrong) for wrong in ([1, 5], [5, 1001])),
        *((values.PathText, wrong) for wrong in ("", "a\0b")),
    ],
)
def test_values_beyond_limits_are_refused(kind, value):
    """Values just beyond their limits, and of a wrong type or count, are refused."""
    with pytest.raises(ValidationError):
        read(kind, value)


@pytest.mark.parametrize(
    ("kind", "message"), [(values.Sigma3, "one positive number or 3 of them"), (values.Sigmas, "or a list of them")]
)
def test_error_states_accepted_number_of_sigmas(kind, message):
    """The error states that one sigma for all or a given number of them is accepted."""
    with pytest.raises(ValidationError, match=message):
        read(kind, [1, -1])


@pytest.mark.parametrize(
    "entry",
    [
        {"t_m": [1, 2, 3], "q_xyzw": Q},
        {"t_m": [1, 2, 3], "rotvec_rad": [0, 0, np.pi / 2]},
        {"t_m": [1, 2, 3], "rpy_deg": [0, 0, 90]},
        {"matrix": QUARTER.matrix.tolist()},
    ],
)
def test_all_rotation_notations_give_same_pose(entry):
    """A quaternion, a rotation vector, roll-pitch-yaw angles and a matrix give the same pose."""
    found = pose_se3(check_full_pose(PoseEntry.model_validate(entry)))
    np.testing.assert_allclose(found.matrix, QUARTER.matrix, atol=1e-15)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"t_m": [1, 2, 3]}, "exactly one of q_xyzw, rotvec_rad, rpy_deg, or a 4x4 matrix; got t_m"),
        ({"q_xyzw": Q}, "got q_xyzw"),
        ({}, "got neither"),
        ({"t_m": [1, 2, 3], "q_xyzw": Q, "rpy_deg": [0, 0, 0]}, "got t_m, q_xyzw, rpy_deg"),
        ({"t_m": [1, 2, 3], "matrix": np.eye(4).tolist()}, "expected `matrix` alone"),
    ],
)
def test_pose_needs_position_and_one_rotation(entry, message):
    """A pose takes one position and exactly one rotation, neither less nor more."""
    with pytest.raises(ValueError, match=message):
        check_full_pose(PoseEntry.model_validate(entry))


def test_invalid_rotations_are_refused():
    """A quaternion far from unit length and a matrix that is not a rotation are refused on reading."""
    for entry in ({"q_xyzw": [1.0, 1.0, 0.0, 0.0]}, {"matrix": (2 * np.eye(4)).tolist()}):
        with pytest.raises(ValidationError):
            PoseEntry.model_validate(entry)


@pytest.mark.parametrize(
    "entry",
    [
        None,
        {},
        {"guess": {"t_m": [1, 2, 3], "q_xyzw": Q}},
        {"status": "fixed", "t_m": [1, 2, 3], "q_xyzw": Q},
        {"status": "prior", "t_m": [1, 2, 3], "q_xyzw": Q, **SIGMAS},
    ],
)
def test_mount_statuses_are_read(entry):
    """A mount is free with or without a guess, fixed with a pose, or a prior with its sigmas."""
    assert read(Mount, entry).status == (entry or {}).get("status", "free")


POSE = {"t_m": [1, 2, 3], "q_xyzw": Q}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (POSE, "status free takes no pose"),
        ({"guess": {"t_m": [1, 2, 3]}}, "exactly one of"),
        ({"status": "fixed"}, "got neither"),
        ({"status": "fixed", **POSE, **SIGMAS}, "with status fixed has none: remove sigma_r_rad, sigma_t_m"),
        ({"status": "free", "sigma_t_m": 0.1}, "with status free has none: remove sigma_t_m"),
        ({"status": "prior", **POSE, "sigma_t_m": 0.1}, "status prior needs sigma_r_rad"),
        ({"status": "prior", **POSE}, "status prior needs sigma_r_rad, sigma_t_m"),
        ({"status": "prior", "guess": POSE, **SIGMAS}, "status prior takes no guess"),
    ],
)
def test_mount_fields_match_status(entry, message):
    """A mount with fields that its status does not take is refused."""
    with pytest.raises(ValidationError, match=message):
        read(Mount, entry)


def test_point_mount_takes_no_rotation():
    """The mount of a point has a position and its sigma; at most an identity rotation is accepted beside it."""
    assert read(PointMount, {"status": "prior", "t_m": [1, 2, 3], "sigma_t_m": 0.1}).sigma_t_m == [0.1] * 3
    assert read(PointMount, {"status": "fixed", "t_m": [1, 2, 3], "q_xyzw": [0, 0, 0, 1]}).status == "fixed"
    assert read(PointMount, {"guess": {"t_m": [1, 2, 3]}}).status == "free"
    for entry, message in (
        ({"status": "fixed"}, "expected t_m, the position of the point"),
        ({"status": "fixed", **POSE}, "a single point has no rotation; give t_m alone"),
        ({"status": "prior", "t_m": [1, 2, 3], **SIGMAS}, "of a single point has no rotation: remove sigma_r_rad"),
        ({"guess": {}}, "expected t_m"),
    ):
        with pytest.raises(ValidationError, match=message):
            read(PointMount, entry)


def test_unknown_name_lists_known_names():
    """An unknown name is reported with the nearest and all known names; a long name is shortened to its beginning."""
    kind = Annotated[str, values.known_name_validator("lens", ("pinhole", "fisheye"))]
    assert read(kind, "fisheye") == "fisheye"
    with pytest.raises(ValidationError, match=r"no lens 'fisheyes'.*fisheye.*; there are: pinhole, fisheye"):
        read(kind, "fisheyes")
    with pytest.raises(ValidationError) as caught:
        read(kind, "x" * 1000)
    assert f"no lens '{'x' * 60}'; there are" in str(caught.value)


def test_rotation_vector_beyond_full_turn_is_refused():
    """A rotation vector slightly longer than a full turn is refused as degrees.

    A full turn as rounded in writing is accepted in any direction.
    """
    turn = 2 * np.pi
    for taken in ([0.0, 0.0, 6.2832], [0.0, -turn, 0.0], [turn * 0.6, turn * 0.8, 0.0]):
        assert PoseEntry.model_validate({"rotvec_rad": taken}).rotvec_rad == taken
    for wrong in ([6.3, 0.0, 0.0], [4.0, 4.0, 4.0], [0.0, 0.0, 90.0]):
        with pytest.raises(ValidationError, match=r"is longer than a turn, 6.28 rad: it looks like degrees"):
            PoseEntry.model_validate({"rotvec_rad": wrong})
    assert PoseEntry.model_validate({"rotvec_rad": None}).rotvec_rad is None


@pytest.mark.parametrize(
    "entry",
    [
        {"t_m": ["1", 2, 3]},
        {"t_m": [float("nan"), 0.0, 0.0]},
        {"t_m": [0.0, 0.0, 1.1e6]},
        {"t": [1, 2, 3]},
        {"q_xyzw": [0, 0, 1]},
        {"matrix": np.eye(4)[:3].tolist()},
        {"matrix": [*np.eye(4).tolist(), [0, 0, 0, 1]]},
        {"matrix": np.eye(4)[:, :3].tolist()},
    ],
)
def test_pose_entries_take_known_numeric_fields_only(entry):
    """Text for a number, an unknown field, and more or fewer numbers than a notation has are refused."""
    with pytest.raises(ValidationError):
        PoseEntry.model_validate(entry)


def test_pose_may_lack_rotation_or_position():
    """A position alone gives a pose without rotation; a rotation alone has no position."""
    np.testing.assert_array_equal(pose_se3(PoseEntry(t_m=[1.0, 2.0, 3.0])).matrix[:3], np.c_[np.eye(3), [1, 2, 3]])
    for entry in ({"rotvec_rad": [0, 0, np.pi / 2]}, {"rpy_deg": [0, 0, 90]}):
        with pytest.raises(ValueError, match="shape"):
            pose_se3(PoseEntry.model_validate(entry))


def test_tiny_rotation_of_point_is_ignored():
    """A rotation beside a point counts as rounding up to the digits that it is written with."""
    for turn, taken in ((5e-10, True), (5e-9, False)):
        entry = {"status": "fixed", "t_m": [1, 2, 3], "rotvec_rad": [0, 0, turn]}
        if taken:
            assert read(PointMount, entry).status == "fixed"
        else:
            with pytest.raises(ValidationError, match="a single point has no rotation"):
                read(PointMount, entry)
