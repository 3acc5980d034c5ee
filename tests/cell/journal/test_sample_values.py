"""Tests of numbers and poses of a recorded line: exact values, or an error that names the field."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.journal.sample_values import FileLine, number, numbers, pose, sigmas, vector, whole_numbers
from basecal.errors import DatasetError
from basecal.geometry import SE3

HERE = FileLine("samples.jsonl", 7)


def test_error_states_path_line_and_field():
    """Path, line and field precede the message; without a field the line alone."""
    assert str(HERE.error("robots.eye", "is wrong")) == "samples.jsonl:7: robots.eye: is wrong"
    assert str(HERE.error("", "is wrong")) == "samples.jsonl:7: is wrong"


def test_rotation_matches_quaternion(rng):
    """A recorded quaternion gives the rotation of `SE3.from_quaternion` for all four components and signs."""
    q = rng.normal(size=(50, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    for each in [*q, *np.eye(4), *-np.eye(4)]:
        t = rng.normal(size=3)
        found, sigma = pose(HERE, "p", {"t_m": t.tolist(), "q_xyzw": each.tolist()})
        expected = SE3.from_quaternion(each, t)
        np.testing.assert_allclose(found.rotation, expected.rotation, atol=1e-15)
        np.testing.assert_array_equal(found.translation, t)
        assert sigma is None


def test_rounded_quaternion_is_normalised():
    """A norm off by less than 1e-3 is rounding, and the rotation is orthonormal nevertheless."""
    found, _ = pose(HERE, "p", {"t_m": [0, 0, 0], "q_xyzw": [0, 0, 0.7075, 0.7075]})
    np.testing.assert_allclose(found.rotation @ found.rotation.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(found.rotation[:, 0], [0, 1, 0], atol=1e-15)
    for z in (0.7082, 0.706):
        with pytest.raises(DatasetError, match=r"p\.q_xyzw: has norm .*, expected 1 within 0\.001"):
            pose(HERE, "p", {"t_m": [0, 0, 0], "q_xyzw": [0, 0, z, z]})


def test_rotation_vector_and_rpy_are_read():
    """A rotation vector, or angles in degrees, give the same rotation."""
    quarter = SE3.from_rotvec([0, 0, np.pi / 2], [1, 2, 3])
    for rotation in ({"rotvec_rad": [0, 0, np.pi / 2]}, {"rpy_deg": [0, 0, 90]}):
        found, _ = pose(HERE, "p", {"t_m": [1, 2, 3], **rotation})
        np.testing.assert_allclose(found.matrix, quarter.matrix, atol=1e-12)


def test_pose_sigmas_are_six_numbers():
    """One or three sigmas of translation and of rotation are given together.

    If sigmas are not requested they are unknown fields.
    """
    written = {"t_m": [0, 0, 0], "q_xyzw": [0, 0, 0, 1], "sigma_t_m": 0.001, "sigma_r_rad": [0.1, 0.2, 0.3]}
    _, sigma = pose(HERE, "p", written, with_sigmas=True)
    np.testing.assert_array_equal(sigma, [0.001, 0.001, 0.001, 0.1, 0.2, 0.3])
    assert not sigma.flags.writeable
    with pytest.raises(DatasetError, match="go together"):
        pose(HERE, "p", {k: v for k, v in written.items() if k != "sigma_t_m"}, with_sigmas=True)
    with pytest.raises(DatasetError, match="got null"):
        pose(HERE, "p", {**written, "sigma_t_m": None}, with_sigmas=True)
    with pytest.raises(DatasetError, match="sigma_"):
        pose(HERE, "p", written)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -10.5, 10.5, "1", None, [1.0]])
def test_number_is_finite_and_within_limit(value):
    """Any other value is refused with the limit and the actual value."""
    with pytest.raises(DatasetError, match="expected a finite number within 10, got"):
        number(HERE, "x", value, 10.0)
    assert number(HERE, "x", -10, 10.0) == -10.0


@pytest.mark.parametrize(
    ("value", "columns"),
    [([1, "a"], None), ([[1, 2]], None), ([[1, 2]], 3), ([[1, 2], [1]], 2), (3.0, None), ([True, False], None)],
)
def test_list_shape_is_checked(value, columns):
    """A list of numbers, or of rows of a given length, is accepted, and no other value."""
    expected = "a list of numbers" if columns is None else f"a list of rows of {columns} numbers"
    with pytest.raises(DatasetError, match=f"x: expected {expected}, got"):
        numbers(HERE, "x", value, columns)


@pytest.mark.parametrize(
    ("value", "columns", "words"),
    [
        ([[1, 2], None], 2, "got null in row 1, counted from 0: leave that one out"),
        ([[1, 2], [3, 4], [5, None]], 2, "got [5, null] in row 2, counted from 0: leave that one out"),
        ([1.0, "0,5"], None, "got '0,5' in row 1, counted from 0"),
        ([[1, float("nan")]], 2, "[1, nan] in row 0"),
        ([1, 10**5000], None, "a huge integer in row 1"),
    ],
)
def test_first_invalid_row_is_reported(value, columns, words):
    """The error reports the first invalid row of a list."""
    with pytest.raises(DatasetError) as caught:
        numbers(HERE, "x", value, columns)
    assert words in caught.value.reason


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1.1e6, -1.1e6])
def test_list_numbers_are_finite(value):
    """NaN, infinity and numbers beyond a million are refused."""
    with pytest.raises(DatasetError, match="holds NaN, infinity or a number beyond 1e"):
        numbers(HERE, "x", [0.0, value])


def test_numbers_are_read_only_floats():
    """Integers become floats; an empty list of rows keeps its columns."""
    found = numbers(HERE, "x", [1, 2, 1_000_000])
    assert found.dtype == np.float64
    assert not found.flags.writeable
    assert numbers(HERE, "x", [], 2).shape == (0, 2)
    assert numbers(HERE, "x", [[1, 2, 3], [4, 5, 6]], 3).shape == (2, 3)


def test_ids_are_whole_numbers():
    """Ids are a list of integers, which may be empty; fractions, nested lists and plain numbers are refused."""
    assert whole_numbers(HERE, "ids", [3, 1]).tolist() == [3, 1]
    assert whole_numbers(HERE, "ids", []).dtype == np.int64
    assert not whole_numbers(HERE, "ids", [1]).flags.writeable
    for wrong in ([0.5], [[1]], 1, ["a"], [[1], [2, 3]]):
        with pytest.raises(DatasetError, match="ids: expected a list of whole numbers, got"):
            whole_numbers(HERE, "ids", wrong)


def test_sigmas_are_scalar_or_one_per_point():
    """A single sigma applies to all; None is unstated; a wrong count and zero are refused."""
    assert sigmas(HERE, "s", None, 3) is None
    np.testing.assert_array_equal(sigmas(HERE, "s", 0.5, 3), [0.5, 0.5, 0.5])
    np.testing.assert_array_equal(sigmas(HERE, "s", [1, 2], 2), [1.0, 2.0])
    with pytest.raises(DatasetError, match="expected one positive number or 3, got 2"):
        sigmas(HERE, "s", [1, 2], 3)
    for zero in (0.0, [1.0, 0.0, 1.0], -1.0):
        with pytest.raises(DatasetError, match="expected positive numbers"):
            sigmas(HERE, "s", zero, 3)


@pytest.mark.parametrize("value", [[1, 2], [1, 2, 3, 4], "abc", [1, 2, None], [1, 2, float("nan")], [1, 2, -1.1e6]])
def test_vector_has_exact_length(value):
    """A vector has exactly the expected count of finite numbers within a million."""
    with pytest.raises(DatasetError, match=r"v: expected 3 (finite )?numbers"):
        vector(HERE, "v", value, 3)
    assert vector(HERE, "v", [1, -1e6, 1e6], 3) == [1, -1e6, 1e6]


def test_unknown_names_list_known_ones():
    """An unknown robot, camera or field is refused with the known names and the nearest of them."""
    assert HERE.name("eye", "robots", "robot", {"eye": 1}) == "eye"
    with pytest.raises(DatasetError, match=r"no robot .*eve.*did you mean 'eye'.*cell\.yaml has: eye, hand"):
        HERE.name("eve", "robots", "robot", {"eye": 1, "hand": 2})
    with pytest.raises(DatasetError, match=r"cell\.yaml has: none"):
        HERE.name(3, "robots", "robot", {})
    with pytest.raises(
        DatasetError, match=r"robots\.pos: unknown field \(did you mean 'pose'\?\); known: pose, joints"
    ):
        HERE.mapping({"pos": 1}, "robots", ("pose", "joints"))
    with pytest.raises(DatasetError, match=r"7: pos: unknown field"):
        HERE.mapping({"pos": 1}, "", ("pose",))
    with pytest.raises(DatasetError, match="expected an object"):
        HERE.mapping([1], "robots")
    assert HERE.mapping({"any": 1}, "robots") == {"any": 1}


def test_long_row_is_reported_by_its_length():
    """A row of up to sixty characters is reported as written, a longer one as a list with its length."""
    short_row, long_row = [1] * 20, [1] * 21  # three characters per item, except the first and the last
    for row, reported in ((short_row, str(short_row)), (long_row, "a list of 21")):
        with pytest.raises(DatasetError) as caught:
            numbers(FileLine("samples.jsonl", 3), "pixels", [[1, 2], row], 2)
        assert str(caught.value) == (
            f"samples.jsonl:3: pixels: expected a list of rows of 2 numbers, got {reported} in row 1, counted from 0"
        )
