"""Tests of surfaces of bodies for drawing."""

from __future__ import annotations

from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

from basecal.errors import BasecalError
from basecal.geometry import SE3
from basecal.kinematics import read_chain
from basecal.kinematics.collision import Collision
from basecal.kinematics.mesh import mesh_triangles
from basecal.kinematics.surface import body_surface
from shared.bodies import arm_with_bodies, binary_stl, body, obj, text_stl

PLACED = SE3.from_rotvec([0.4, -1.0, 0.3], [0.2, 0.1, -0.3])
ORIGIN = '<origin xyz="0 0 0"/>'


def collision(shape, folder):
    return Collision("arm", 2, PLACED, fromstring(body(shape, ORIGIN)), folder / "arm.urdf", folder)


def sphere(radius_m, count=60):
    """A fine sphere as triangles, (n, 3, 3) [m]."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, count), np.linspace(0, np.pi, count), indexing="ij")
    at = radius_m * np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], -1)
    corners = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    half = [np.stack([corners[i] for i in of], axis=2) for of in ((0, 1, 2), (0, 2, 3))]
    return np.concatenate(half).reshape(-1, 3, 3)


@pytest.mark.parametrize(
    ("shape", "area_m2", "share"),
    [
        ('<box size="0.1 0.3 0.2"/>', 2 * (0.03 + 0.02 + 0.06), 1e-9),
        ('<cylinder radius="0.06" length="0.4"/>', 2 * np.pi * 0.06 * 0.46, 0.04),
        ('<sphere radius="0.1"/>', 4 * np.pi * 0.01, 0.06),
    ],
)
def test_shapes_have_their_surface_area(tmp_path, shape, area_m2, share):
    """At most 250 triangles give the area or slightly less, at the URDF pose in the frame of the body."""
    frame, points, triangles = body_surface(collision(shape, tmp_path))
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1).sum() / 2
    assert frame == 2
    assert len(triangles) <= 250
    assert area_m2 * (1 - share) <= area <= area_m2 * (1 + 1e-9)
    np.testing.assert_allclose(points.mean(0), PLACED.translation, atol=1e-9)


@pytest.mark.parametrize(("write", "name"), [(binary_stl, "a.stl"), (text_stl, "b.stl"), (obj, "c.obj")])
def test_fine_meshes_are_simplified(tmp_path, write, name):
    """In all file formats, a sphere of 6,962 triangles keeps its radius with less than a quarter of them."""
    whole = sphere(0.1)
    (tmp_path / name).write_bytes(write(1e3 * whole))
    np.testing.assert_allclose(mesh_triangles(tmp_path / name), 1e3 * whole, rtol=1e-6, atol=1e-5)
    _, points, triangles = body_surface(collision(f'<mesh filename="{name}" scale="0.001 0.001 0.001"/>', tmp_path))
    assert 200 < len(triangles) < 0.25 * len(whole)
    assert np.all(triangles != np.roll(triangles, 1, axis=1))
    assert len(np.unique(np.sort(triangles, axis=1), axis=0)) == len(triangles)
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=-1).sum() / 2
    assert 0.8 < area / (4 * np.pi * 0.01) < 1.05
    far = np.linalg.norm(PLACED.inverse() @ points, axis=-1)
    assert 0.088 < far.min() <= far.max() < 0.1001


def test_simplification_is_independent_of_the_origin(tmp_path):
    """A sphere shifted by 0.137 m has the same triangles, and points shifted as far."""
    surfaces = []
    for name, shift in (("a.stl", 0.0), ("b.stl", 0.137)):
        (tmp_path / name).write_bytes(binary_stl(sphere(0.125, 24) + shift))
        surfaces.append(body_surface(collision(f'<mesh filename="{name}"/>', tmp_path)))
    (_, here, triangles), (_, there, others) = surfaces
    np.testing.assert_array_equal(others, triangles)
    np.testing.assert_allclose(there - here, np.tile(PLACED.rotation @ np.full(3, 0.137), (len(here), 1)), atol=1e-6)


def test_obj_faces_with_many_corners_are_triangulated(tmp_path):
    """Faces are cut into triangles, negative indices count from the end, and missing indices are refused."""
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    path = tmp_path / "a.obj"
    path.write_text(corners + "f 1/1/1 2//2 3 -1\n")
    assert mesh_triangles(path).tolist() == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
    path.write_text(corners + "f 1 2 5\n")
    with pytest.raises(BasecalError, match=r"a\.obj.*vertices 1 to 4"):
        mesh_triangles(path)


@pytest.mark.parametrize("shape", ["", '<sphere radius="0"/>', '<box size="1 2"/>', '<mesh filename="../a.stl"/>'])
def test_invalid_bodies_are_refused(tmp_path, shape):
    """A body without a shape, a size or a volume, or with a mesh outside of the folder, is refused."""
    with pytest.raises(BasecalError):
        body_surface(collision(shape, tmp_path))


def test_arm_surfaces_cover_all_bodies(tmp_path):
    """Each surface is in the frame of its collision element."""
    chain = read_chain(arm_with_bodies(tmp_path), "base_link", "wrist_3")
    surfaces = [body_surface(each) for each in chain.collisions]
    assert [each.frame for each in surfaces] == [each.frame for each in chain.collisions]
    assert len(surfaces) == 7
