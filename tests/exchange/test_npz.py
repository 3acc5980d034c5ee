"""Tests of NumPy archives of numbers."""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange import npz
from basecal.exchange.npz import read_arrays


def test_arrays_are_read_by_key(tmp_path):
    """All numeric arrays are read as floats, or the requested one; other arrays are skipped."""
    path = str(tmp_path / "a.npz")
    np.savez(path, counts=np.arange(3), values=np.ones((2, 2), np.float32), names=np.array(["a", "b"]))
    name, arrays = read_arrays(path)
    assert (name, sorted(arrays)) == (path, ["counts", "values"])
    assert {value.dtype for value in arrays.values()} == {np.dtype(np.float64)}
    name, one = read_arrays(f"{path}:counts")
    assert (name, list(one)) == (path, ["counts"])
    np.testing.assert_array_equal(one["counts"], [0, 1, 2])


def test_npy_array_has_default_name(tmp_path):
    """The array of a .npy file is called `array`."""
    np.save(tmp_path / "a.npy", np.eye(2))
    np.testing.assert_array_equal(read_arrays(str(tmp_path / "a.npy"))[1]["array"], np.eye(2))


def test_colon_may_be_part_of_file_name(tmp_path):
    """A colon belongs to the file name if such a file exists."""
    np.savez(tmp_path / "a:b.npz", x=np.ones(1))
    assert list(read_arrays(str(tmp_path / "a:b.npz"))[1]) == ["x"]


def test_unreadable_archives_are_reported(tmp_path):
    """A missing key, an array of text, damaged data, pickles and missing files are errors."""
    path = str(tmp_path / "a.npz")
    np.savez(path, x=np.ones(1), names=np.array(["a"]))
    np.save(tmp_path / "objects.npy", np.array([{}]), allow_pickle=True)
    (tmp_path / "rubbish.npz").write_bytes(b"PK rubbish")
    (tmp_path / "empty.npy").write_bytes(b"")
    for asked, message in (
        (f"{path}:y", "has no array 'y'; it holds x, names"),
        (f"{path}:names", "expected numbers"),
        (str(tmp_path / "objects.npy"), "not a NumPy archive"),
        (str(tmp_path / "rubbish.npz"), "not a NumPy archive"),
        (str(tmp_path / "empty.npy"), "not a NumPy archive"),
        (str(tmp_path / "none.npz"), "cannot be read"),
    ):
        with pytest.raises(DatasetError, match=message):
            read_arrays(asked)


def npy_bytes(shape: str, data: bytes = b"", dtype: str = "<f8") -> bytes:
    """Return a .npy file with a custom header."""
    header = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + data


@pytest.mark.parametrize(
    "shape",
    ["(1000000000000,)", "(-1,)", "(3,)", "(99999999999999999999, 9999999999)", "(1e3,)", "[2]", "(3", "()" * 2000],
)
def test_oversized_headers_use_no_memory(tmp_path, shape):
    """A huge, negative or malformed shape is an error without memory use or traceback."""
    path = tmp_path / "a.npy"
    path.write_bytes(npy_bytes(shape, bytes(16)))
    with pytest.raises(DatasetError, match=r"a\.npy: array: "):
        read_arrays(str(path))


def write_zip(path, name="a.npy", data=b"", method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", method) as archive:
        archive.writestr(name, data)
    return str(path)


def test_corrupt_archives_are_refused(tmp_path):
    """Encrypted archives, unknown methods, truncated files and wrong checksums are refused."""
    path = tmp_path / "a.npz"
    good = Path(write_zip(path, data=npy_bytes("(2,)", bytes(16)))).read_bytes()
    at_local, at_central = good.index(b"PK\x03\x04"), good.index(b"PK\x01\x02")
    damages = {"encrypted": (6, 8, b"\x01"), "method": (8, 10, b"\x63"), "sum": (14, 16, b"\x13\x37")}
    for local, central, value in damages.values():
        data = bytearray(good)
        for at in (at_local + local, at_central + central):
            data[at : at + len(value)] = value
        path.write_bytes(bytes(data))
        with pytest.raises(DatasetError, match="not a NumPy archive of numbers"):
            read_arrays(str(path))
    path.write_bytes(good[:-30])
    with pytest.raises(DatasetError, match="not a NumPy archive of numbers"):
        read_arrays(str(path))


def test_file_over_256_mb_is_refused(tmp_path):
    """A file of more than 256 MB is refused by its size."""
    with (tmp_path / "a.npz").open("wb") as file:
        file.truncate(2**28 + 1)
    with pytest.raises(DatasetError, match="256 MB"):
        read_arrays(str(tmp_path / "a.npz"))


def test_unpacked_size_is_limited(tmp_path, monkeypatch):
    """Archives that unpack to more than any recording are not unpacked, except for one requested smaller array."""
    monkeypatch.setattr(npz, "LARGEST_BYTES", 10_000)
    path = tmp_path / "a.npz"
    np.savez_compressed(path, small=np.ones(3), bomb=np.zeros(100_000))
    with pytest.raises(DatasetError, match="unpacks to more than"):
        read_arrays(str(path))
    np.testing.assert_array_equal(read_arrays(f"{path}:small")[1]["small"], np.ones(3))
    with pytest.raises(DatasetError, match="unpacks to more than"):
        read_arrays(f"{path}:bomb")
    monkeypatch.setattr(npz, "_MOST_ARRAYS", 1)
    with pytest.raises(DatasetError, match="not a NumPy archive"):
        read_arrays(f"{path}:small")


def test_truncated_arrays_are_refused(tmp_path):
    """A file truncated in the middle of a number is refused, too."""
    path = tmp_path / "a.npy"
    np.save(path, np.ones(4))
    path.write_bytes(path.read_bytes()[:-13])
    with pytest.raises(DatasetError, match=r"does not match 147 bytes|is cut off"):
        read_arrays(str(path))


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["<i2", "u1", ">f4", "<f8"])
def test_arrays_keep_shape_and_values(tmp_path, order, dtype):
    """Integers and floats are read by rows or by columns, in any byte order."""
    values = np.arange(24).reshape(2, 3, 4).astype(dtype)
    np.save(tmp_path / "a.npy", np.asarray(values, order=order))
    np.testing.assert_array_equal(read_arrays(str(tmp_path / "a.npy"))[1]["array"], np.arange(24).reshape(2, 3, 4))


@pytest.mark.parametrize("dtype", ["<c8", "|b1", "<U3", "<M8[s]"])
def test_non_numeric_arrays_are_refused(tmp_path, dtype):
    """The error names the type if that array is requested; otherwise the other arrays are read."""
    np.savez(tmp_path / "a.npz", x=np.ones(1), odd=np.zeros(2, dtype=dtype))
    assert list(read_arrays(str(tmp_path / "a.npz"))[1]) == ["x"]
    with pytest.raises(DatasetError, match=r"odd: not a NumPy archive of numbers: holds .*, expected numbers"):
        read_arrays(f"{tmp_path / 'a.npz'}:odd")


def test_npy_version_2_headers_are_read(tmp_path):
    """Version 2 headers with a four-byte length are read, also for empty arrays and single numbers."""
    for array in (np.float64(3.0), np.zeros((0, 3)), np.ones(2)):
        with (tmp_path / "a.npy").open("wb") as file:
            np.lib.format.write_array(file, np.asarray(array), version=(2, 0))
        found = read_arrays(str(tmp_path / "a.npy"))[1]["array"]
        assert found.shape == np.shape(array)
        np.testing.assert_array_equal(found, array)


def test_archive_size_limit_includes_headers(tmp_path, monkeypatch):
    """An archive at the limit is read; one byte more is refused."""
    path = tmp_path / "a.npz"
    np.savez_compressed(path, x=np.ones(1000))
    size = 8128
    monkeypatch.setattr(npz, "LARGEST_BYTES", size)
    assert len(read_arrays(str(path))[1]["x"]) == 1000
    monkeypatch.setattr(npz, "LARGEST_BYTES", size - 1)
    with pytest.raises(DatasetError, match="unpacks to more than"):
        read_arrays(str(path))


@pytest.mark.parametrize("dtype", ["<f8", "<i2", "|u1"])
def test_header_must_match_file_size(tmp_path, dtype):
    """The size must match the bytes of the type; one number more is refused with the shape."""
    path, size = tmp_path / "a.npy", np.dtype(dtype).itemsize
    path.write_bytes(npy_bytes("(2, 3)", bytes(6 * size), dtype))
    assert read_arrays(str(path))[1]["array"].shape == (2, 3)
    for count, message in ((7, "is cut off"), (7 + 128 // size, r"a header of shape .* does not match")):
        path.write_bytes(npy_bytes(f"({count},)", bytes(6 * size), dtype))
        with pytest.raises(DatasetError, match=message):
            read_arrays(str(path))
