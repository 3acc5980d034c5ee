"""Tests of the export of USD stages."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from basecal.errors import MissingExtra
from basecal.exchange.exporters.usd import export_text
from export_example import BASE, CELL, MOUNT, all_poses, wanted


def stage_of(text):
    from pxr import Sdf, Usd

    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(text)
    return Usd.Stage.Open(layer)


@pytest.mark.parametrize("name", all_poses())
def test_usd_frame_has_exported_pose(name):
    """The frame has the pose to 1e-12; USD has row vectors, so its matrices are transposed."""
    from pxr import Usd, UsdGeom

    (one,) = wanted(name).transforms
    stage = stage_of(export_text(wanted(name)))
    root = stage.GetDefaultPrim()
    (child,) = root.GetChildren()
    whole = np.array(UsdGeom.Xformable(child).ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T
    np.testing.assert_allclose(whole, one.estimate.mean.matrix, atol=1e-12)
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z


def test_usd_frame_names_are_valid():
    """Characters that USD does not allow in a name become underscores."""
    stage = stage_of(export_text(wanted(BASE)))
    assert [prim.GetName() for prim in stage.Traverse()] == ["left_base_s", "right_base"]


def test_colliding_usd_names_use_cell_names():
    """Before, two frames that differ only in invalid characters were one prim."""
    names = {"eye": {"base": "left/base"}, "hand": {"base": "left_base"}}
    robots = {name: replace(robot, frames=names[name]) for name, robot in CELL.robots.items()}
    stage = stage_of(export_text(wanted(BASE, cell=replace(CELL, robots=robots))))
    assert [prim.GetName() for prim in stage.Traverse()] == ["eye_base", "hand_base"]


def test_several_transforms_are_one_stage():
    """Each transform is a tree of its own in one stage."""
    several = tuple(wanted(name).transforms[0] for name in (BASE, MOUNT))
    stage = stage_of(export_text(replace(wanted(), transforms=several)))  # its prims are invalid after its deletion
    assert len(list(stage.Traverse())) == 4


def test_missing_usd_library_names_extra(monkeypatch):
    """The error names the command to install it, instead of Python's ImportError."""
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(MissingExtra, match=r"pip install 'basecal\[usd\]'"):
        export_text(wanted())
