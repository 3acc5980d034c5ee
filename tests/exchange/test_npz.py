"""Archives of numbers by key."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange.npz import read_arrays


def test_numbers_are_read_by_key(tmp_path):
    """All of them as floats, or the one asked for; what is no number is passed over."""
    path = str(tmp_path / "a.npz")
    np.savez(path, counts=np.arange(3), values=np.ones((2, 2), np.float32), names=np.array(["a", "b"]))
    name, arrays = read_arrays(path)
    assert (name, sorted(arrays)) == (path, ["counts", "values"])
    assert {value.dtype for value in arrays.values()} == {np.dtype(np.float64)}
    name, one = read_arrays(f"{path}:counts")
    assert (name, list(one)) == (path, ["counts"])
    np.testing.assert_array_equal(one["counts"], [0, 1, 2])


def test_a_single_array_has_a_name(tmp_path):
    """Of a .npy file."""
    np.save(tmp_path / "a.npy", np.eye(2))
    np.testing.assert_array_equal(read_arrays(str(tmp_path / "a.npy"))[1]["array"], np.eye(2))


def test_a_colon_may_be_part_of_the_name(tmp_path):
    """Where such a file is there."""
    np.savez(tmp_path / "a:b.npz", x=np.ones(1))
    assert list(read_arrays(str(tmp_path / "a:b.npz"))[1]) == ["x"]


def test_what_cannot_be_read_is_said(tmp_path):
    """A key that is not there, an array of text, rubbish, pickles and missing files."""
    path = str(tmp_path / "a.npz")
    np.savez(path, x=np.ones(1), names=np.array(["a"]))
    np.save(tmp_path / "objects.npy", np.array([{}]), allow_pickle=True)
    (tmp_path / "rubbish.npz").write_bytes(b"PK rubbish")
    (tmp_path / "empty.npy").write_bytes(b"")
    for asked, said in (
        (f"{path}:y", "has no array 'y'; it holds x, names"),
        (f"{path}:names", "expected numbers"),
        (str(tmp_path / "objects.npy"), "not a NumPy archive"),
        (str(tmp_path / "rubbish.npz"), "not a NumPy archive"),
        (str(tmp_path / "empty.npy"), "not a NumPy archive"),
        (str(tmp_path / "none.npz"), "cannot be read"),
    ):
        with pytest.raises(DatasetError, match=said):
            read_arrays(asked)
