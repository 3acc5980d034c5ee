"""Read-only copies."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry.array import read_only, read_only_ids, to_back, to_front, with_last_axis


def test_copies_are_read_only_and_apart():
    """A copy cannot be written, and what is written into the original later does not reach it."""
    for make, kind in ((read_only, np.float64), (read_only_ids, np.int64)):
        given = np.array([1, 2, 3], dtype=kind)
        made = make(given)
        given[0] = 9
        assert made.tolist() == [1, 2, 3]
        assert made.dtype == kind
        with pytest.raises(ValueError, match="read-only"):
            made[0] = 0


@pytest.mark.parametrize(
    ("values", "shape", "fits"),
    [
        (np.zeros((4, 3)), (None, 3), True),
        (np.zeros((2, 4, 3)), (None, 3), True),
        (np.zeros((3, 4)), (None, 3), False),
        (np.zeros(3), (None, 3), False),
        (np.zeros(3), (3,), True),
        (np.zeros((3, 3)), (3, 3), True),
        (np.zeros((3, 2)), (3, 3), False),
        (0.0, (), True),
    ],
)
def test_last_axes_have_their_shape(values, shape, fits):
    """Leading axes are free, the last ones as asked; an error names the array and both shapes."""
    if fits:
        assert read_only(values, shape).shape == np.shape(values)
        return
    wanted = ", ".join(map(str, shape))
    with pytest.raises(InputError) as caught:
        read_only(values, shape, "points")
    assert str(caught.value) == f"points has shape {np.shape(values)}, expected (..., {wanted})"


@pytest.mark.parametrize("axis", [-1, -2, 0, 1])
def test_an_axis_to_the_front_is_moved_there(axis):
    """As NumPy moves it, and a view of the same numbers."""
    array = np.arange(24.0).reshape(2, 3, 4)
    moved = to_front(array, axis)
    np.testing.assert_array_equal(moved, np.moveaxis(array, axis, 0))
    assert np.shares_memory(moved, array)


def test_first_axes_to_the_back_keep_their_order():
    """One or two of them, as NumPy moves them."""
    array = np.arange(24.0).reshape(2, 3, 4)
    np.testing.assert_array_equal(to_back(array), np.moveaxis(array, 0, -1))
    np.testing.assert_array_equal(to_back(array, 2), np.moveaxis(array, (0, 1), (-2, -1)))
    assert np.shares_memory(to_back(array), array)


def test_values_of_the_right_type_are_not_copied():
    """Only others are; the last axis counts alone."""
    array = np.zeros((2, 0, 3))
    assert with_last_axis(array, 3, "points") is array
    assert with_last_axis([1, 2, 3], 3, "points").dtype == np.float64
    with pytest.raises(InputError, match=r"^points has shape \(\), expected \(..., 3\)$"):
        with_last_axis(1.0, 3, "points")


def test_what_is_no_number_is_refused():
    """Text, and rows of unequal length."""
    for values in ("abc", [[1, 2], [3]], {}):
        with pytest.raises(InputError, match=r"^array is not an array of numbers, expected \(..., 3\)$"):
            read_only(values, (3,))
