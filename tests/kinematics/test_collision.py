"""Tests of capsules that enclose the bodies of links."""

from __future__ import annotations

from xml.etree.ElementTree import fromstring

import numpy as np
import pytest

from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.kinematics import parse_chain, read_chain
from basecal.kinematics.collision import Collision, body_capsules, box_capsules, mesh_file
from basecal.kinematics.mesh import mesh_bounds
from shared.bodies import SIX_AXIS, arm_with_bodies, binary_stl, body

RNG = np.random.default_rng(3)
PLACED = SE3.from_rotvec([0.4, -1.0, 0.3], [0.2, 0.1, -0.3])


def depth(capsules, points):
    """The depth of points, (n, 3), within the capsules, sampled along each segment, (n,)."""
    shares = np.linspace(0, 1, 400)[:, None]
    along = capsules.ends[:, :1] + shares * (capsules.ends[:, 1:] - capsules.ends[:, :1])
    far = np.linalg.norm(points[:, None, None] - along, axis=-1).min(-1)
    return (capsules.radius + capsules.padding - far).max(-1)


def collision(text, folder, frame_from_link=PLACED):
    """A body of link 'arm'."""
    return Collision("arm", 2, frame_from_link, fromstring(text), folder / "arm.urdf", folder)


def origin_of(_):
    """The pose that `body` writes."""
    return SE3.from_rpy([0.3, -0.2, 0.5], [0.02, -0.03, 0.1])


@pytest.mark.parametrize("size", [(0.5, 0.12, 0.15), (0.05, 0.05, 0.05), (0.0, 0.3, 0.2), (2.0, 3.0, 0.1), (0, 0, 0)])
def test_capsules_enclose_a_box_tightly(size):
    """All points of the box are inside, and the radius is at most the half diagonal of a rod's section."""
    bounds = np.array([np.full(3, -0.1), np.array(size) - 0.1])
    capsules = box_capsules(1, PLACED, bounds)
    corners = np.stack(np.meshgrid(*bounds.T, indexing="ij"), -1).reshape(-1, 3)
    inside = np.concatenate([corners, RNG.uniform(*bounds, (300, 3))])
    assert depth(capsules, PLACED @ inside).min() > -1e-4
    assert set(capsules.frame) == {1}
    assert capsules.radius.max() <= max(0.5 * np.hypot(0.08, 0.08), 0.5 * np.hypot(*sorted(size)[:2]) / 1.4) + 1e-9


def test_large_box_has_few_capsules():
    """A box has at most eight capsules across either side, though each is wider than a rod then."""
    assert len(box_capsules(1, PLACED, np.array([np.zeros(3), np.full(3, 3.0)])).radius) == 64


def test_capsules_enclose_primitive_shapes(tmp_path):
    """Points of a cylinder, a sphere and a box at their URDF pose are inside."""
    angle, share = RNG.uniform(0, 2 * np.pi, 500), RNG.uniform(-1, 1, (500, 1))
    around = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(500)])
    ball = RNG.standard_normal((500, 3))
    points = {
        '<cylinder radius="0.06" length="0.4"/>': 0.06 * around + 0.2 * share * [0, 0, 1],
        '<sphere radius="0.1"/>': 0.1 * ball / np.linalg.norm(ball, axis=-1, keepdims=True),
        '<box size="0.1 0.3 0.2"/>': RNG.uniform(-0.5, 0.5, (500, 3)) * [0.1, 0.3, 0.2],
    }
    for shape, in_shape in points.items():
        capsules = body_capsules(collision(body(shape), tmp_path))
        deep = depth(capsules, PLACED @ origin_of(shape) @ in_shape)
        assert deep.min() > -1e-4, shape


def test_mesh_scale_and_package_are_applied(tmp_path):
    """A mesh below the URDF's folder, with or without its package name, is enclosed with its scale, mirrored too."""
    cell = arm_with_bodies(tmp_path).parent
    bounds = mesh_bounds(cell / "meshes/upper.stl") * [0.001, 0.001, -0.002]
    inside = RNG.uniform(bounds.min(0), bounds.max(0), (300, 3))
    for name in ("package://arm_description/meshes/upper.stl", "meshes/upper.stl", "package://meshes/upper.stl"):
        text = body(f'<mesh filename="{name}" scale="0.001 0.001 -0.002"/>')
        assert depth(body_capsules(collision(text, cell)), PLACED @ origin_of(text) @ inside).min() > -1e-4


@pytest.mark.parametrize("name", ["package://other/none.stl", "../outside.stl", "inside.stl", "", "a" * 5000])
def test_meshes_outside_the_cell_folder_are_refused(tmp_path, name):
    """A missing mesh, one above the cell, or a link to the outside is an error that names the mesh."""
    cell = arm_with_bodies(tmp_path).parent
    (tmp_path / "outside.stl").write_bytes((cell / "meshes/upper.stl").read_bytes())
    (cell / "inside.stl").symlink_to(tmp_path / "outside.stl")
    with pytest.raises(InputError, match="is not in the cell's folder; copy it there"):
        body_capsules(collision(body(f'<mesh filename="{name}"/>'), cell))


@pytest.mark.parametrize("shape", ["", "<box/>", '<box size="1 2"/>', '<sphere radius="nan"/>', "<cylinder/>"])
def test_unreadable_bodies_are_refused(tmp_path, shape):
    """A body without a shape, or with missing or non-finite numbers, raises InputError."""
    with pytest.raises(InputError, match="<collision> has"):
        body_capsules(collision(body(shape), tmp_path))


def test_bodies_follow_the_joint_above(tmp_path):
    """Bodies of the base are fixed, and sliding fingers follow the last joint.

    A chain from text alone has no bodies.
    """
    path = arm_with_bodies(tmp_path)
    frames = {each.link: each.frame for each in read_chain(path, "base_link", "tool0").collisions}
    want = {"base_link": 0, "shoulder": 1, "upper_arm": 2, "forearm": 3, "wrist_1": 4, "wrist_3": 6, "left_finger": 6}
    assert frames == want
    part = {each.link: each.frame for each in read_chain(path, "upper_arm", "wrist_2").collisions}
    assert part == {"upper_arm": 0, "forearm": 1, "wrist_1": 2, "wrist_3": 3, "left_finger": 3}
    assert parse_chain(path.read_text(), "base_link", "tool0").collisions == ()


def test_bodies_of_another_arm_are_excluded(tmp_path):
    """A body behind another turning joint is excluded, because its pose is unknown."""
    other = '<link name="other"><collision><geometry><box size="1 1 1"/></geometry></collision></link>'
    turning = '<joint name="other_pan" type="revolute"><parent link="{}"/><child link="other"/></joint>'
    for parent, kept in (("base_link", False), ("upper_arm", False), ("tool0", True)):
        text = SIX_AXIS.read_text().replace("</robot>", other + turning.format(parent) + "</robot>")
        (tmp_path / "two.urdf").write_text(text)
        found = read_chain(tmp_path / "two.urdf", "base_link", "tool0").collisions
        assert [each.link for each in found] == ["other"] * kept


@pytest.mark.parametrize(
    ("shape", "half", "radius"),
    [
        ('<cylinder radius="0.06" length="0.4"/>', [0, 0, 0.2], 0.06),
        ('<cylinder radius="-0.06" length="0.4"/>', [0, 0, 0.2], 0.06),
        ('<sphere radius="0.1"/>', [0, 0, 0], 0.1),
        ('<box size="0.06 0.3 0.08"/>', [0, 0.15, 0], 0.05),
        ('<box size="0.06 0.08 -0.3"/>', [0, 0, 0.15], 0.05),
    ],
)
def test_slender_shapes_are_one_capsule(tmp_path, shape, half, radius):
    """The capsule's segment is as long as the shape, its radius reaches the edges, and it has no padding."""
    found = body_capsules(collision(body(shape), tmp_path))
    assert found.frame.tolist() == [2]
    np.testing.assert_allclose(found.radius, radius)
    np.testing.assert_array_equal(found.padding, 0)
    np.testing.assert_allclose(found.ends[0], PLACED @ origin_of(shape) @ np.outer([-1, 1], half), atol=1e-12)


def test_numbers_of_shapes_are_bounded(tmp_path):
    """Numbers up to 1000 are accepted, as many as the shape has. Padding is that of the caller."""
    assert body_capsules(collision(body('<sphere radius="1000"/>'), tmp_path)).radius == 1000
    for radius in ("1001", "-1001", "1 2", "", "inf", "wide"):
        with pytest.raises(InputError, match="expected finite numbers: 1"):
            body_capsules(collision(body(f'<sphere radius="{radius}"/>'), tmp_path))
    np.testing.assert_array_equal(box_capsules(1, PLACED, np.array([np.zeros(3), np.ones(3)]), 0.1).padding, 0.1)


def test_wide_box_is_filled_by_parallel_rods():
    """Rods run along the longest side, one for each 8 cm across, at most eight."""
    capsules = box_capsules(3, SE3.identity(), np.array([[0.0, 0.0, 0.0], [0.1, 0.4, 0.24]]), 0.01)
    middles = [[x, 0.2, z] for x in (0.025, 0.075) for z in (0.04, 0.12, 0.2)]
    np.testing.assert_allclose(capsules.ends.mean(1), middles)
    np.testing.assert_allclose(capsules.ends[:, 1] - capsules.ends[:, 0], [[0, 0.4, 0]] * 6, atol=1e-15)
    np.testing.assert_allclose(capsules.radius, np.hypot(0.025, 0.04))
    assert capsules.frame.tolist() == [3] * 6
    assert capsules.padding.tolist() == [0.01] * 6
    assert box_capsules(0, SE3.identity(), np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]])).padding.tolist() == [0.0] * 8


@pytest.mark.parametrize("name", ["package://arm/parts/a.stl", "arm/parts/a.stl", "file://parts/a.stl", "parts/a.stl"])
def test_mesh_is_found_by_its_folders(tmp_path, name):
    """A mesh is found beside the URDF or above it, and only the package's name is dropped from its path."""
    (tmp_path / "urdf").mkdir()
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a.stl").write_bytes(binary_stl(np.zeros((1, 3, 3))))
    if "arm" in name:
        (tmp_path / "urdf" / "a.stl").write_bytes(binary_stl(np.ones((1, 3, 3))))
    shape = fromstring(f'<mesh filename="{name}"/>')
    of = Collision("arm", 2, PLACED, shape, tmp_path / "urdf" / "arm.urdf", tmp_path)
    assert mesh_file(shape, of) == (tmp_path / "parts" / "a.stl").resolve()


def test_scaled_mesh_is_enclosed_tightly(tmp_path):
    """A mesh box in millimetres has a capsule in metres, mirrored if the scale is negative."""
    corners = np.array([[[0, 0, 0], [100, 20, 0], [400, 0, 40]]], dtype=float)
    (tmp_path / "a.stl").write_bytes(binary_stl(corners))
    text = body('<mesh filename="a.stl" scale="0.001 0.002 -0.001"/>', "")
    found = body_capsules(collision(text, tmp_path, SE3.identity()))
    np.testing.assert_allclose(found.ends, [[[0, 0.02, -0.02], [0.4, 0.02, -0.02]]], atol=1e-9)
    np.testing.assert_allclose(found.radius, np.hypot(0.02, 0.02))
