"""Tests of bounding boxes of mesh files."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.kinematics.mesh import mesh_bounds, mesh_triangles
from shared.bodies import binary_stl, obj, text_stl

TRIANGLES = np.random.default_rng(0).uniform(-300, 700, (40, 3, 3))


@pytest.mark.parametrize(("write", "name"), [(binary_stl, "a.STL"), (text_stl, "a.stl"), (obj, "a.obj")])
def test_all_mesh_formats_have_the_same_box(tmp_path, write, name):
    """The box has the least and largest coordinates of the vertices, and normals do not count."""
    (tmp_path / name).write_bytes(write(TRIANGLES))
    want = np.stack([TRIANGLES.min((0, 1)), TRIANGLES.max((0, 1))])
    np.testing.assert_allclose(mesh_bounds(tmp_path / name), want, rtol=2e-7)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"<COLLADA/>",
        b"v 1 2 nan\n",
        b"v 1 2 three\n",
        binary_stl(np.zeros((0, 3, 3))),
        binary_stl(np.full((1, 3, 3), np.inf)),
        binary_stl(TRIANGLES)[:-1],
    ],
    ids=["empty", "collada", "nan", "a word", "no triangle", "infinite", "cut off"],
)
def test_invalid_meshes_are_refused(tmp_path, data):
    """A file without vertices, or with a non-finite one, raises an error that names the file."""
    path = tmp_path / "arm.stl"
    path.write_bytes(data)
    with pytest.raises(DatasetError, match=r"arm\.stl.*expected finite vertices of an STL or OBJ file"):
        mesh_bounds(path)


@pytest.mark.parametrize(("face", "rows"), [("1 2 3", [0, 1, 2]), ("-3 -2 -1", [0, 1, 2]), ("3 -3 2", [2, 0, 1])])
def test_face_indices_count_from_one_or_from_the_end(tmp_path, face, rows):
    """Indices beyond either end, and zero, are refused."""
    path = tmp_path / "arm.obj"
    points = np.arange(9.0).reshape(3, 3)
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in points)
    path.write_text(f"{text}f {face}\n")
    np.testing.assert_array_equal(mesh_triangles(path), [points[rows]])
    for other in ("0 1 2", "1 2 4", "1 2 -4"):
        path.write_text(f"{text}f {other}\n")
        with pytest.raises(DatasetError, match="vertices 1 to 3"):
            mesh_triangles(path)


@pytest.mark.parametrize(("vertices", "triangles"), [(1, 0), (3, 1), (5, 1), (6, 2), (8, 2)])
def test_vertices_without_faces_are_consecutive_triangles(tmp_path, vertices, triangles):
    """Vertices left over at the end are ignored."""
    points = np.arange(3.0 * vertices).reshape(-1, 3)
    path = tmp_path / "arm.stl"
    path.write_text("".join(f"vertex {x} {y} {z}\n" for x, y, z in points))
    np.testing.assert_array_equal(mesh_triangles(path), points[: 3 * triangles].reshape(-1, 3, 3))


def test_text_stl_with_the_length_of_a_binary_file(tmp_path):
    """Only a matching number of triangles in the header makes a file binary."""
    path, text = tmp_path / "arm.stl", text_stl(TRIANGLES[:3])
    path.write_bytes(text + b"\n" * (-(len(text) - 84) % 50))
    np.testing.assert_allclose(mesh_triangles(path), TRIANGLES[:3], rtol=1e-6)
