"""Tests of the export of MuJoCo models."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from basecal.exchange.exporters.mujoco import export_text
from export_example import BASE, CELL, FIXED, MOUNT, all_poses, wanted


def pose_in(data, model, child):
    """`world_from_child` as MuJoCo computes it."""
    body = model.body(child).id
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return whole


@pytest.mark.parametrize("name", all_poses())
def test_mujoco_frame_has_exported_pose(name):
    """MuJoCo's frame has the pose to 1e-12; the parent is at its origin."""
    (one,) = wanted(name).transforms
    model = mujoco.MjModel.from_xml_string(export_text(wanted(name)))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(pose_in(data, model, one.parent), np.eye(4), atol=1e-15)
    np.testing.assert_allclose(pose_in(data, model, one.child), one.estimate.mean.matrix, atol=1e-12)


def test_several_transforms_are_one_model():
    """Each frame is in its own tree of one model."""
    several = tuple(wanted(name).transforms[0] for name in (BASE, MOUNT, FIXED))
    model = mujoco.MjModel.from_xml_string(export_text(replace(wanted(), transforms=several)))
    assert model.nbody == 1 + 6


def test_double_hyphens_in_comments_are_separated():
    """XML forbids two hyphens in a comment."""
    mujoco.MjModel.from_xml_string(export_text(replace(wanted(), remarks=("a -- b --- c-",))))


@pytest.mark.parametrize("robot", ["eye", "hand"])
def test_frame_called_world_keeps_cell_name(robot: str) -> None:
    """MuJoCo already has a body called world."""
    named = replace(CELL, robots={**CELL.robots, robot: replace(CELL.robots[robot], frames={"base": "world"})})
    (one,) = wanted(BASE, cell=named).transforms
    assert "world" in (one.parent, one.child)
    model = mujoco.MjModel.from_xml_string(export_text(wanted(BASE, cell=named)))
    assert f"{robot}_base" in [model.body(k).name for k in range(model.nbody)]
