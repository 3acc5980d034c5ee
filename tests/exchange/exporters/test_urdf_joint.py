"""Tests of the export of a joint origin in a URDF."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from basecal.errors import InputError
from basecal.exchange.exporters.urdf_joint import export_text
from export_example import BASE, MOUNT, POSE, wanted

SCENE = """<robot name="scene"><link name="table"/><link name="left base's"/><link name="right_base"/>
  <joint name="left" type="fixed"><parent link="table"/><child link="left base's"/><origin xyz="0 0.5 0"/></joint>
  <joint name="right" type="fixed"><parent link="table"/><child link="right_base"/></joint>
</robot>"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.urdf"
    path.write_text(SCENE)
    return path


def test_joint_origin_places_base(scene):
    """The transform holds between the links that the cell's `frames` name; a comment has its provenance."""
    text = export_text(replace(wanted(BASE), urdfs=(scene,), joint="right"))
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    left, right = (data.oMf[model.getFrameId(name)].homogeneous for name in ("left base's", "right_base"))
    np.testing.assert_allclose(np.linalg.inv(left) @ right, POSE.matrix, atol=1e-12)
    assert "20260102T030405Z" in text


def test_missing_inputs_are_reported(scene):
    """No URDF, several transforms, an unnamed joint, and links with other names are errors."""
    both = (*wanted(BASE).transforms, *wanted(MOUNT).transforms)
    for given, message in (
        (wanted(BASE), "expected one --urdf FILE, 0 were given"),
        (replace(wanted(BASE), transforms=both, urdfs=(scene,)), "choose one with --transform"),
        (replace(wanted(BASE), urdfs=(scene,)), "choose one with --joint"),
        (replace(wanted(BASE, cell=None), urdfs=(scene,)), "no 'eye_base'.*links are named by `frames"),
    ):
        with pytest.raises(InputError, match=message):
            export_text(given)
