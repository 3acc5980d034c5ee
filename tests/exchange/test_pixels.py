"""Files of detected points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange.pixels import read_pixels

CSV = "sample,id,u,v\n2,5,1.5,2.5\n0,3,10,20\n2,1,3,4\n"


def test_points_go_to_their_samples(tmp_path: Path) -> None:
    """Rows in any order give each sample its points, in the order of the ids."""
    (tmp_path / "a.csv").write_text(CSV)
    views = read_pixels(tmp_path / "a.csv")
    assert list(views) == [0, 2]
    np.testing.assert_array_equal(views[2][0], [1, 5])
    np.testing.assert_array_equal(views[2][1], [[3, 4], [1.5, 2.5]])


def test_archives_give_the_same(tmp_path: Path) -> None:
    """Columns u and v apart or as one array of pixels read alike, under both spellings of the names."""
    columns = {"sample": np.array([0, 0]), "id": np.array([1, 0])}
    np.savez(tmp_path / "apart.npz", **columns, u=np.array([1.0, 2.0]), v=np.array([3.0, 4.0]))
    np.savez(
        tmp_path / "one.npz", samples=columns["sample"], ids=columns["id"], pixels=np.array([[1.0, 3.0], [2.0, 4.0]])
    )
    for name in ("apart.npz", "one.npz"):
        ids, pixels = read_pixels(tmp_path / name)[0]
        np.testing.assert_array_equal(ids, [0, 1])
        np.testing.assert_array_equal(pixels, [[2, 4], [1, 3]])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sample,id,u\n0,0,1\n", "has no v"),
        ("sample,id,u,v\n0,0.5,1,1\n", "whole number"),
        ("sample,id,u,v\n-1,0,1,1\n", "whole number"),
        ("sample,id,u,v\n0,4,1,1\n0,4,2,2\n", "sample 0 has id 4 twice"),
        ("sample,id,u,v\n0,4,nan,1\n", "not finite"),
    ],
)
def test_bad_csv(tmp_path: Path, text: str, said: str) -> None:
    """What is wrong with a table of points is said with its file."""
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(DatasetError, match=said):
        read_pixels(tmp_path / "a.csv")


def test_bad_archives(tmp_path: Path) -> None:
    """Arrays of different length, other shapes and NaN are refused by name."""
    two = np.array([0, 1])
    np.savez(tmp_path / "length.npz", sample=two, id=two, u=np.zeros(3), v=np.zeros(3))
    np.savez(tmp_path / "shape.npz", sample=two, id=two, pixels=np.zeros((2, 3)))
    np.savez(tmp_path / "nan.npz", sample=two, id=two, pixels=np.full((2, 2), np.nan))
    for name, said in [
        ("length.npz", "u: has shape"),
        ("shape.npz", r"expected \(n, 2\)"),
        ("nan.npz", "row 0 is not finite"),
    ]:
        with pytest.raises(DatasetError, match=said):
            read_pixels(tmp_path / name)
