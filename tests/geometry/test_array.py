"""Tests of read-only array copies and of checks of shapes."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry import SE3, Camera, PoseEstimate
from basecal.geometry.array import read_only, read_only_ids, to_back, to_front, with_last_axis


def test_copies_are_read_only_and_independent():
    """A copy cannot be written, and later changes of the original do not reach it."""
    for make, kind in ((read_only, np.float64), (read_only_ids, np.int64)):
        given = np.array([1, 2, 3], dtype=kind)
        made = make(given)
        given[0] = 9
        assert made.tolist() == [1, 2, 3]
        assert made.dtype == kind
        with pytest.raises(ValueError, match="read-only"):
            made[0] = 0


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda noun: pickle.loads(pickle.dumps(noun))])
def test_arrays_of_copies_are_read_only(copied):
    """Arrays of transforms, estimates and cameras stay read-only in deep and in pickled copies."""
    pose = SE3.exp(np.ones(6))
    camera = Camera("pinhole", [500.0, 500.0, 320.0, 240.0, 0.0, 0.0, 0.0, 0.0])
    for noun in (pose, PoseEstimate.exact(pose), camera):
        arrays = {name: value for name, value in vars(copied(noun)).items() if isinstance(value, np.ndarray)}
        assert arrays
        for name, value in arrays.items():
            assert not value.flags.writeable
            assert np.array_equal(value, getattr(noun, name))


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
def test_last_axes_have_the_expected_shape(values, shape, fits):
    """Leading axes are free, and the last ones are as requested. An error names the array and both shapes."""
    if fits:
        assert read_only(values, shape).shape == np.shape(values)
        return
    wanted = ", ".join(map(str, shape))
    with pytest.raises(InputError) as caught:
        read_only(values, shape, "points")
    assert str(caught.value) == f"points has shape {np.shape(values)}, expected (..., {wanted})"


@pytest.mark.parametrize("axis", [-1, -2, 0, 1])
def test_to_front_moves_an_axis_to_the_front(axis):
    """The axis is moved as by NumPy, and the result is a view of the same numbers."""
    array = np.arange(24.0).reshape(2, 3, 4)
    moved = to_front(array, axis)
    np.testing.assert_array_equal(moved, np.moveaxis(array, axis, 0))
    assert np.shares_memory(moved, array)


def test_to_back_keeps_the_order_of_axes():
    """One or two first axes are moved as by NumPy."""
    array = np.arange(24.0).reshape(2, 3, 4)
    np.testing.assert_array_equal(to_back(array), np.moveaxis(array, 0, -1))
    np.testing.assert_array_equal(to_back(array, 2), np.moveaxis(array, (0, 1), (-2, -1)))
    assert np.shares_memory(to_back(array), array)


def test_arrays_of_the_right_type_are_not_copied():
    """Other values are converted, and only the last axis is checked."""
    array = np.zeros((2, 0, 3))
    assert with_last_axis(array, 3, "points") is array
    assert with_last_axis([1, 2, 3], 3, "points").dtype == np.float64
    with pytest.raises(InputError, match=r"^points has shape \(\), expected \(..., 3\)$"):
        with_last_axis(1.0, 3, "points")


def test_non_numeric_values_are_refused():
    """Text and rows of unequal length raise InputError."""
    for values in ("abc", [[1, 2], [3]], {}):
        with pytest.raises(InputError, match=r"^array is not an array of numbers, expected \(..., 3\)$"):
            read_only(values, (3,))
