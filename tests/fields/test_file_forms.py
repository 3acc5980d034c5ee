"""Tests of values that files hold in another form: round trips, and limits in the file's units."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from basecal.fields.file_forms import (
    Covariance,
    ErrorInDeg,
    ErrorInMm,
    Length,
    Number,
    Pose,
    Seconds,
    Sigma,
    Vector3,
    Whole,
    WrittenPose,
    array_form,
    as_written,
    pose_data,
)
from basecal.geometry import SE3, Array

IN_MM = Annotated[Array, array_form(list[Length], 1e3)]


@pytest.mark.parametrize(
    ("form", "written", "value"),
    [
        (ErrorInMm, 2.0, 0.002),
        (ErrorInMm, None, None),
        (ErrorInDeg, 180.0, np.pi),
        (Vector3, [1.0, 2.0, 3.0], np.array([1.0, 2, 3])),
        (IN_MM, [1.0, 500.0], np.array([0.001, 0.5])),
        (Covariance, [[2.0, 1.0], [1.0, 2.0]], np.array([[2.0, 1], [1, 2]])),
    ],
)
def test_units_and_arrays(form: Any, written: Any, value: Any) -> None:
    """Lengths, angles and arrays are read from a file's units and written again unchanged."""
    adapter = TypeAdapter(form)
    found = adapter.validate_python(written)
    assert found is None if value is None else np.allclose(found, value, rtol=1e-15)
    again = adapter.dump_python(found)
    assert again is None if written is None else np.allclose(again, written, rtol=1e-15)


@pytest.mark.parametrize(
    ("form", "written", "words"),
    [
        (ErrorInMm, -1.0, "greater than or equal to 0"),
        (Whole, True, "valid integer"),
        (Whole, 1.0, "valid integer"),
        (Vector3, [1.0, 2.0], "at least 3 items"),
        (Vector3, [1.0, 2.0, 1e10], "less than or equal to 1000000000"),
        (Covariance, [[1.0, 2.0]], "expected a square, got 1 row of 2"),
        (Covariance, [[1.0, 0.0], [0.0, -1.0]], "row 1 holds .* a variance below 0"),
        (Covariance, [[1e151]], "row 0 holds a number beyond"),
        (Pose, {"t_m": [0.0] * 3, "q_xyzw": [0.0, 0, 0, 2]}, "norm 2"),
    ],
)
def test_limits_are_checked_in_file_units(form: Any, written: Any, words: str) -> None:
    """Limits are checked in the unit of the file, before conversion."""
    with pytest.raises(ValidationError, match=words):
        TypeAdapter(form).validate_python(written)


def test_null_in_matrix_becomes_nan() -> None:
    """A null in a matrix is read as NaN, and the matrix is read-only."""
    found = TypeAdapter(Covariance).validate_python([[None]])
    assert np.isnan(found).all()
    assert not found.flags.writeable


def test_pose_round_trip() -> None:
    """A pose is written as a position and a quaternion without negative zeros, and read back the same."""
    pose = SE3.from_rotvec([0.1, -0.2, 0.3], [1.0, 2.0, -0.0])
    data = pose_data(pose)
    assert str(data["t_m"]) == "[1.0, 2.0, 0.0]"
    np.testing.assert_allclose(WrittenPose.model_validate(data).transform().matrix, pose.matrix, atol=1e-15)
    np.testing.assert_allclose(TypeAdapter(Pose).validate_python(data).matrix, pose.matrix, atol=1e-15)


def test_custom_file_form() -> None:
    """A custom form converts between a word in the file and any value in memory."""
    form = Annotated[bool, as_written(str, lambda word: word == "yes", lambda value: "yes" if value else "no")]
    adapter = TypeAdapter(form)
    assert [adapter.validate_python(word) for word in ("yes", "no")] == [True, False]
    assert [adapter.dump_python(value) for value in (True, False)] == ["yes", "no"]


@pytest.mark.parametrize(
    ("form", "taken", "refused"),
    [
        (Sigma, [0.0, 1e-9, 0.5, 1e150], [-1e-9, 1e151, "1", True]),
        (Length, [0.0, 0.5, 1e9], [-1e-9, 1.1e9]),
        (Number, [-1e9, 0.0, 1e9], [-1.1e9, 1.1e9]),
        (Seconds, [-1e12, 0.0, 1e12], [-1.1e12, 1.1e12]),
        (ErrorInMm, [0.0, 1e150, None], [-1e-9, 1e151]),
        (Covariance, [[[0.0]], [[1e150]], []], [[[-1e-9]], [[1.1e150]], [[1.0], [2.0, 3.0]]]),
    ],
)
def test_numbers_are_accepted_up_to_limits(form: Any, taken: list[Any], refused: list[Any]) -> None:
    """Numbers just within their limits are accepted; numbers just beyond are refused."""
    adapter = TypeAdapter(form)
    for value in taken:
        adapter.validate_python(value)
    for value in refused:
        with pytest.raises(ValidationError):
            adapter.validate_python(value)


@pytest.mark.parametrize(
    "written",
    [
        {"t_m": [0.0, 0.0, float("nan")], "q_xyzw": [0.0, 0.0, 0.0, 1.0]},
        {"t_m": [0.0, 0.0, 0.0], "q_xyzw": [0.0, 0.0, float("nan"), 1.0]},
        {"t_m": [0.0, 0.0], "q_xyzw": [0.0, 0.0, 0.0, 1.0]},
        {"t_m": [0.0, 0.0, 0.0], "q_xyzw": [0.0, 0.0, 1.0]},
        {"t_m": [0.0, 0.0, 0.0], "q_xyzw": [0.0, 0.0, 0.0, 0.0, 1.0]},
    ],
)
def test_written_pose_has_three_and_four_finite_numbers(written: Any) -> None:
    """A written pose needs three finite numbers of position and four of the quaternion."""
    with pytest.raises(ValidationError):
        WrittenPose.model_validate(written)


def test_negative_zeros_are_never_written() -> None:
    """Zeros of quaternions and arrays are written without sign, whatever their sign in memory."""
    turned = SE3.from_rotvec([0.0, 0.0, -3.0], [-0.0, 0.0, 1.0])
    assert np.signbit(turned.quaternion).tolist() == [True, True, True, False]
    data = pose_data(turned)
    assert np.signbit(data["q_xyzw"]).tolist() == [False, False, True, False]
    assert np.signbit(data["t_m"]).tolist() == [False, False, False]
    for form in (IN_MM, Covariance):
        assert not np.signbit(TypeAdapter(form).dump_python(np.full((1, 1), -0.0))).any()
