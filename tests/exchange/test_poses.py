"""Tests of pose files: valid ones, and errors for invalid ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from basecal.errors import DatasetError, InputError
from basecal.exchange import poses as poses_module
from basecal.exchange.controller_poses import read_poses
from basecal.exchange.poses import unit_length_m
from basecal.geometry import SE3


def draw_poses(count: int = 4) -> SE3:
    return SE3.exp(np.random.default_rng(5).normal(size=(count, 6)))


def as_text(matrices: np.ndarray, separator: str = " ") -> str:
    return "\n".join(separator.join(f"{value:.12f}" for value in row) for row in matrices.reshape(-1, 4)) + "\n"


def as_csv(poses: SE3, header: str = "x,y,z,qx,qy,qz,qw") -> str:
    rows = np.concatenate([poses.translation, poses.quaternion], axis=1)
    return "\n".join([header, *(",".join(f"{value:.15g}" for value in row) for row in rows)]) + "\n"


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("separator", [" ", ", ", "\t", ","])
def test_stacked_text_matrices_are_read(tmp_path: Path, separator: str) -> None:
    """Stacked 4x4 text gives the poses that were written, whatever separates the numbers."""
    poses = draw_poses()
    stream = read_poses(write(tmp_path, "a.txt", "# robot\n\n" + as_text(poses.matrix, separator)), "m")
    np.testing.assert_allclose(stream.poses.matrix, poses.matrix, atol=1e-11)


def test_length_unit_scales_translations_only(tmp_path: Path) -> None:
    """The length unit scales translations and leaves rotations unchanged."""
    poses = draw_poses()
    path = write(tmp_path, "a.txt", as_text(poses.matrix))
    metres, millimetres = read_poses(path, "m").poses, read_poses(path, "mm").poses
    np.testing.assert_allclose(millimetres.translation * 1000, metres.translation, rtol=1e-12)
    np.testing.assert_array_equal(millimetres.rotation, metres.rotation)


def test_pose_archives_are_read(tmp_path: Path) -> None:
    """An array of a .npz by its key, its only array without a key, and a .npy give the same poses."""
    poses = draw_poses()
    np.savez(tmp_path / "two.npz", a=poses.matrix, other=np.zeros(3))
    np.savez(tmp_path / "one.npz", a=poses.matrix)
    np.save(tmp_path / "bare.npy", poses.matrix)
    for name in ("two.npz:a", "one.npz", "one.npz:a", "bare.npy"):
        np.testing.assert_allclose(read_poses(str(tmp_path / name), "m").poses.matrix, poses.matrix, atol=1e-12)


@pytest.mark.parametrize("header", ["x,y,z,qx,qy,qz,qw", "# T_X, t_y, tz, q_x, q_y, q_z, qw"])
def test_quaternion_csv_is_read(tmp_path: Path, header: str) -> None:
    """Columns are found by their names and the usual aliases."""
    poses = draw_poses()
    stream = read_poses(write(tmp_path, "a.csv", as_csv(poses, header)), "m")
    np.testing.assert_allclose(stream.poses.matrix, poses.matrix, atol=1e-12)
    assert stream.stamps_s is None


def test_csv_column_order_follows_header(tmp_path: Path) -> None:
    """The header, not the order, determines the columns; a stamp is kept."""
    text = "qw,qx,qy,qz,z,y,x,stamp_s\n1,0,0,0,3,2,1,12.5\n"
    stream = read_poses(write(tmp_path, "a.csv", text), "mm")
    np.testing.assert_allclose(stream.poses.translation, [[1e-3, 2e-3, 3e-3]])
    assert stream.stamps_s is not None
    np.testing.assert_array_equal(stream.stamps_s, [12.5])


def test_matrix_csv_is_read(tmp_path: Path) -> None:
    """Columns m00 to m23 give the poses that were written."""
    poses = draw_poses()
    header = ",".join(f"m{row}{column}" for row in range(3) for column in range(4))
    rows = [",".join(f"{value:.15g}" for value in matrix[:3].ravel()) for matrix in poses.matrix]
    stream = read_poses(write(tmp_path, "a.csv", "\n".join([header, *rows])), "m")
    np.testing.assert_allclose(stream.poses.matrix, poses.matrix, atol=1e-12)


BOTTOM = "0 0 0 1"


@pytest.mark.parametrize(
    ("name", "text", "line", "message"),
    [
        ("a.txt", "1 0 0 0\n0 1 0 0\n0 0 1\n" + BOTTOM, 3, "rows of 4"),
        ("a.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n", None, "3 rows"),
        ("a.txt", "", None, "no row of numbers, expected m00"),
        ("a.txt", f"1 0 0 0\n0 1 0 0\n0 0 one 0\n{BOTTOM}", 3, "not a row of numbers"),
        ("a.txt", f"1 0 0 0\n0 1 0 0\n0 0 1 nan\n{BOTTOM}", 1, "NaN"),
        ("a.txt", f"# one\n2 0 0 0\n0 2 0 0\n0 0 2 0\n{BOTTOM}", 2, "not a rotation"),
        ("a.txt", f"1 0 0 0\n0 1 0 0\n0 0 -1 0\n{BOTTOM}", 1, "not a rotation"),
        ("a.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 2", 1, "last row"),
        ("a.csv", "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,1\n0,0,0,1,1,0,0\n", 3, "norm"),
        ("a.csv", "x,y,z,qx,qy,qz\n0,0,0,0,0,0\n", None, "no column 'qw'"),
        ("a.csv", "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,1\n", 2, "is empty in this row"),
        ("a.csv", "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,inf,1\n", 2, "not finite"),
        ("a.csv", "x,y,z,qx,qy,qz,qw\n0,0,0,0,0,?,1\n", 2, "'?' is not a number"),
        ("a.csv", "x,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n", None, "names the column 'x' twice"),
        ("a.csv", "x_mm,y_mm,z_mm,qx,qy,qz,qw\n0,0,0,0,0,0,1\n", None, "is mm, but another is expected"),
        ("a.csv", "x,y,z,qx,qy,qz,qw\n", None, "no row of numbers"),
        ("a.csv", "", None, "no row of numbers"),
    ],
)
def test_invalid_text_error_has_file_and_line(
    tmp_path: Path, name: str, text: str, line: int | None, message: str
) -> None:
    """Any fault is reported on one line with the file, the line and what was expected."""
    path = write(tmp_path, name, text)
    with pytest.raises(DatasetError, match=message.replace("?", r"\?")) as caught:
        read_poses(path, "m")
    assert caught.value.line == line
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_invalid_pose_archives_are_reported(tmp_path: Path) -> None:
    """A wrong key, shape, type or file is reported with the existing keys and the number of the matrix."""
    bent = draw_poses().matrix
    bent[2, 0, 0] += 0.1
    np.savez(tmp_path / "a.npz", good=draw_poses().matrix, bent=bent, flat=np.zeros(3), words=np.array(["a"]))
    (tmp_path / "rubbish.npz").write_bytes(b"\x00\x01rubbish")
    np.savez(tmp_path / "objects.npz", a=np.array([None, {}], dtype=object))
    for name, message in [
        ("a.npz", "choose one as"),
        ("a.npz:goood", "it holds good, bent"),
        ("a.npz:bent", "matrix 2"),
        ("a.npz:flat", r"expected \(n, 4, 4\)"),
        ("a.npz:words", "expected numbers"),
        ("rubbish.npz", "not a NumPy archive"),
        ("objects.npz", "not a NumPy archive of numbers"),
        ("absent.npz", "cannot be read"),
        ("absent.txt", "cannot be read"),
        ("absent.csv", "cannot be read"),
    ]:
        with pytest.raises(DatasetError, match=message):
            read_poses(str(tmp_path / name), "m")


def test_binary_pose_file_is_refused(tmp_path: Path) -> None:
    """Bytes that are not text are refused."""
    for name in ("a.txt", "a.csv"):
        (tmp_path / name).write_bytes(b"\x89\xff\x00\x80")
        with pytest.raises(DatasetError, match="not text"):
            read_poses(tmp_path / name, "m")


def test_implausible_translation_is_refused(tmp_path):
    """A translation that `calibrate` would refuse is refused on reading."""
    pose = np.eye(4)
    pose[0, 3] = 1e7
    np.savetxt(tmp_path / "a.txt", pose)
    with pytest.raises(DatasetError, match=r"a\.txt:1: a translation is beyond 1e\+06: is this the length unit\?"):
        read_poses(tmp_path / "a.txt", "m")


@pytest.mark.parametrize(
    ("row", "message"), [("2 0 0 0", "not a rotation"), ("1 0 0 2e6", "a translation is beyond 1e\\+06")]
)
def test_matrix_error_has_first_line(tmp_path: Path, row: str, message: str) -> None:
    """The line is the first of the matrix, with comments and empty lines counted.

    In an archive the matrix has its number.
    """
    rest = f"0 1 0 0\n0 0 1 0\n{BOTTOM}\n"
    path = write(tmp_path, "a.txt", f"# one\n1 0 0 -1e6\n{rest}\n# two\n{row}\n{rest}")
    with pytest.raises(DatasetError, match=message) as caught:
        read_poses(path, "m")
    assert caught.value.line == 8
    second = np.eye(4)
    second[0] = [float(word) for word in row.split()]
    np.save(tmp_path / "a.npy", np.stack([np.eye(4), second]))
    with pytest.raises(DatasetError, match=f"matrix 1: .*{message}"):
        read_poses(tmp_path / "a.npy", "m")


@pytest.mark.parametrize("count", [2, 3])
def test_pose_count_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """A file may have as many poses as a recording, and one more is refused."""
    monkeypatch.setattr(poses_module, "MOST_SAMPLES", 2)
    path = write(tmp_path, "a.txt", as_text(draw_poses(count).matrix))
    if count == 2:
        assert len(read_poses(path, "m").poses) == 2
    else:
        with pytest.raises(DatasetError, match="3 poses, expected at most 2"):
            read_poses(path, "m")


@pytest.mark.parametrize("shape", [(0, 4, 4), (4, 4), (2, 3, 4), (2, 4, 3)])
def test_pose_arrays_need_matrix_shape(tmp_path: Path, shape: tuple[int, ...]) -> None:
    """At least one 4x4 matrix is needed; the error states the actual shape."""
    np.savez(tmp_path / "a.npz", key=np.zeros(shape))
    with pytest.raises(DatasetError, match=r"key: has shape \(.*\), expected \(n, 4, 4\)"):
        read_poses(f"{tmp_path / 'a.npz'}:key", "m")


def test_length_units() -> None:
    """The units m, mm and inch are converted to metres; another name is refused with the list."""
    assert [unit_length_m(name) for name in ("m", "mm", "inch")] == [1.0, 1e-3, 0.0254]
    with pytest.raises(InputError, match="length unit 'cm': expected one of m, mm, inch"):
        unit_length_m("cm")
