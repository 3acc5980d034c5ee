"""Tests of keep-out boxes and tables in cell.yaml."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from basecal.cell.schema.keep_out import KeepOutEntry, keep_out_dict


def test_table_fills_space_below_its_height():
    """The distance of a point above a table is its height, and zero below it, however far from the base."""
    table = KeepOutEntry(table_z_m=-0.02).box("table")
    points = np.array([[0.0, 0.0, 0.5], [3.0, -2.0, 0.0], [1.0, 1.0, -0.5]])
    np.testing.assert_allclose(table.distance(points), [0.52, 0.02, 0.0], atol=1e-12)


def test_box_rotates_with_its_pose():
    """A post that lies on its side is long along x; a box survives writing and reading."""
    post = KeepOutEntry(t_m=[0.0, 0.0, 0.5], rpy_deg=[0.0, 90.0, 0.0], size_m=[0.1, 0.1, 1.0]).box("post")
    np.testing.assert_allclose(post.distance(np.array([[0.6, 0.0, 0.5], [0.0, 0.0, 0.6]])), [0.1, 0.05], atol=1e-12)
    again = KeepOutEntry(**keep_out_dict(post)).box("post")
    np.testing.assert_allclose(again.world_from_box.matrix, post.world_from_box.matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({}, "expected size_m and t_m of a box, or table_z_m"),
        ({"size_m": [0.1, 0.1, 0.1]}, "expected size_m and t_m of a box"),
        ({"table_z_m": 0.0, "size_m": [1.0, 1.0, 1.0]}, "expected table_z_m alone"),
        ({"t_m": [0.0, 0.0, 0.0], "size_m": [1.0, 0.0, 1.0]}, "three lengths above 0"),
    ],
)
def test_incomplete_keep_out_entries_are_refused(wrong, why):
    """An empty entry, a box without a position, a table with side lengths, and a box without thickness are refused."""
    with pytest.raises(ValidationError, match=why):
        KeepOutEntry(**wrong)


@pytest.mark.parametrize("height", [-0.5, 0.7])
def test_table_extends_equally_in_all_directions(height):
    """A table reaches ten metres from the base in each direction, and is as deep as wide."""
    table = KeepOutEntry(table_z_m=height).box("table")
    ways = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    np.testing.assert_allclose(table.distance(9.9 * ways + [0, 0, height - 0.1]), 0.0)
    beyond = table.distance(30.0 * ways + [0, 0, height - 0.1])
    np.testing.assert_allclose(beyond, beyond[0])
    assert beyond[0] > 10


def test_keep_out_boxes_accept_any_pose_notation():
    """A matrix, or a position with or without a rotation, is accepted.

    Negative sides and a rotation alone are refused.
    """
    matrix = np.eye(4)
    matrix[:3, 3] = [1.0, 2.0, 3.0]
    for pose in ({"matrix": matrix.tolist()}, {"t_m": [1.0, 2.0, 3.0], "q_xyzw": [0, 0, 0, 1]}):
        box = KeepOutEntry(size_m=[0.1, 0.2, 0.3], **pose).box("box")
        np.testing.assert_allclose(box.world_from_box.matrix, matrix)
        np.testing.assert_array_equal(box.size_m, [0.1, 0.2, 0.3])
    for wrong in (
        {"size_m": [0.1, 0.1, -0.1], "t_m": [0, 0, 0]},
        {"size_m": [0.1] * 3, "rpy_deg": [0, 0, 0]},
        {"table_z_m": 0.1, "t_m": [0, 0, 0]},
    ):
        with pytest.raises(ValidationError):
            KeepOutEntry(**wrong)
