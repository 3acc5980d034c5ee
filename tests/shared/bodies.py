"""An arm whose links have bodies, as a URDF with meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
SIX_AXIS = Path(__file__).parents[1] / "data/urdf/six_axis.urdf"
BODIES = {
    "base_link": '<box size="0.2 0.3 0.1"/>',
    "shoulder": '<box size="0.12 0.14 0.2"/>',
    "upper_arm": '<mesh filename="package://arm_description/meshes/upper.stl" scale="0.001 0.001 -0.001"/>',
    "forearm": '<cylinder radius="0.05" length="0.4"/>',
    "wrist_1": '<sphere radius="0.07"/>',
    "wrist_3": '<mesh filename="package://arm_description/meshes/wrist.obj"/>',
    "left_finger": '<box size="0.02 0.03 0.1"/>',
}


def body(shape, origin='<origin xyz="0.02 -0.03 0.1" rpy="0.3 -0.2 0.5"/>'):
    """A <collision> element."""
    return f"<collision>{origin}<geometry>{shape}</geometry></collision>"


def binary_stl(triangles):
    """Triangles, (n, 3, 3), as a binary STL."""
    rows = np.zeros(len(triangles), TRIANGLE)
    rows["corners"] = triangles
    return b"solid of eighty bytes".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes()


def text_stl(triangles):
    """Triangles as an STL of text."""
    facets = "".join(
        f"facet normal 0 0 0\n outer loop\n{''.join(f'  vertex {x:e} {y:e} {z:e}{chr(10)}' for x, y, z in corners)}"
        " endloop\nendfacet\n"
        for corners in triangles
    )
    return f"solid arm\n{facets}endsolid arm\n".encode()


def obj(triangles):
    """Triangles as an OBJ with normals."""
    rows = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\nvn 9 9 9\n" for x, y, z in np.reshape(triangles, (-1, 3)))
    return (rows + "".join(f"f {k} {k + 1} {k + 2}\n" for k in range(1, 3 * len(triangles), 3))).encode()


def arm_with_bodies(folder, bodies=BODIES):
    """Write the six-axis arm with bodies and its meshes into a folder named like its package, and return the path."""
    folder = folder / "arm_description"
    rng = np.random.default_rng(5)
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    size_m = np.array([0.5, 0.12, 0.15])
    (folder / "meshes/upper.stl").write_bytes(binary_stl(1e3 * size_m * rng.uniform(-0.5, 0.5, (200, 3, 3))))
    (folder / "meshes/wrist.obj").write_bytes(obj(0.1 * rng.standard_normal((60, 3, 3)) / 3))
    text = SIX_AXIS.read_text()
    for link, shape in bodies.items():
        assert f'<link name="{link}"/>' in text
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{body(shape)}</link>')
    path = folder / "arm.urdf"
    path.write_text(text)
    return path
