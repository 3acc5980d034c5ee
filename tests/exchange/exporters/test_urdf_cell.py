"""Tests of the export of one URDF with all robots."""

from __future__ import annotations

import re
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from basecal.cell import Calibration, Cell, Robot, RobotParameters
from basecal.errors import InputError
from basecal.exchange.exporters import urdf
from basecal.exchange.exporters.urdf_cell import export_text
from basecal.exchange.exports.exporter import ExportRequest
from basecal.kinematics import read_chain
from export_example import CALIBRATION, POSE

DATA = Path(__file__).parents[2] / "data" / "urdf"
EYE = Robot("eye", urdf="six_axis.urdf", base_link="base_link", flange_link="tool0")
HAND = Robot("hand", frames={"base": "base_link"})
CELL = Cell("eye", robots={"eye": EYE, "hand": HAND})
BOTH = (DATA / "six_axis.urdf", DATA / "six_axis.urdf")


def relative_pose(text: str, parent: str, child: str):
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, pinocchio.neutral(model))
    first, second = (data.oMf[model.getFrameId(link)].homogeneous for link in (parent, child))
    return np.linalg.inv(first) @ second


def test_robots_have_calibrated_poses():
    """The given URDFs are used; the base is the link that the cell names, or else the root."""
    text = export_text(ExportRequest((), ("made by",), CALIBRATION, CELL, DATA, urdfs=BOTH))
    np.testing.assert_allclose(relative_pose(text, "eye_base_link", "hand_base_link"), POSE.matrix, atol=1e-12)
    assert "<!-- made by -->" in text
    assert "<!-- hand: six_axis.urdf, its base is the link base_link -->" in text
    nameless = replace(CELL, robots={"eye": EYE, "hand": Robot("hand")})
    text = export_text(ExportRequest((), (), CALIBRATION, nameless, DATA, urdfs=BOTH))
    np.testing.assert_allclose(relative_pose(text, "eye_base_link", "hand_world"), POSE.matrix, atol=1e-12)


def test_urdf_of_two_robots_is_refused(tmp_path):
    """A URDF that holds both robots would be merged twice; the error names the export for it."""
    other = re.sub(r'(name|link)="([^"]+)"', r'\1="left_\2"', BOTH[0].read_text())
    arms = [re.sub(r"</?robot.*?>|<\?.*?\?>", "", text) for text in (BOTH[0].read_text(), other)]
    top = '<joint name="j" type="fixed"><parent link="world"/><child link="left_world"/></joint>'
    (tmp_path / "scene.urdf").write_text(f'<robot name="scene">{"".join(arms)}{top}</robot>')
    eye = replace(EYE, urdf="scene.urdf")
    hand = replace(eye, name="hand", base_link="left_base_link", flange_link="left_tool0")
    with pytest.raises(InputError, match=r"holds both eye and hand: with --to urdf_joint --urdf \S+scene\.urdf"):
        export_text(ExportRequest((), (), CALIBRATION, replace(CELL, robots={"eye": eye, "hand": hand}), tmp_path))
    below = replace(EYE, name="hand", flange_link="forearm")  # a part of the same arm, which is merged twice
    cell = replace(CELL, robots={"eye": EYE, "hand": below})
    assert "hand_base_link" in export_text(ExportRequest((), (), CALIBRATION, cell, DATA))


def test_urdfs_of_cell_are_default():
    """Without given URDFs those in the cell's folder are used."""
    own = replace(CELL, robots={"eye": EYE, "hand": replace(EYE, name="hand")})
    text = export_text(ExportRequest((), (), CALIBRATION, own, DATA))
    np.testing.assert_allclose(relative_pose(text, "eye_base_link", "hand_base_link"), POSE.matrix, atol=1e-12)


def test_cell_urdf_contains_bases_and_corrections(tmp_path):
    """The cell's own URDFs get the calibrated joints. For given ones a comment states that they are uncorrected."""
    own = replace(CELL, robots={"eye": EYE, "hand": replace(EYE, name="hand")})
    chain = read_chain(BOTH[0], "base_link", "tool0")
    turns = np.array([0.0, 0.01, -0.02, 0.03, 0.0, 0.0])
    offsets = RobotParameters(chain.joint_names, turns, np.full(6, 1e-3), np.ones(6, dtype=bool))
    source = f"sha256:{sha256(BOTH[0].read_bytes()).hexdigest()}"
    found = replace(
        CALIBRATION, robot_parameters={"joint_offsets": {"hand": offsets}}, inputs={"six_axis.urdf": source}
    )
    text = export_text(ExportRequest((), (), found, own, DATA))
    assert "its base is the link base_link; joint offsets applied -->" in text
    np.testing.assert_allclose(
        relative_pose(text, "hand_base_link", "hand_tool0"), chain.forward(turns).matrix, atol=1e-9
    )
    np.testing.assert_allclose(
        relative_pose(text, "eye_base_link", "eye_tool0"), chain.forward(0 * turns).matrix, atol=1e-9
    )
    np.testing.assert_allclose(relative_pose(text, "eye_base_link", "hand_base_link"), POSE.matrix, atol=1e-12)
    given = export_text(ExportRequest((), (), found, own, DATA, urdfs=BOTH))
    assert "; joint offsets are not in it -->" in given
    np.testing.assert_allclose(
        relative_pose(given, "hand_base_link", "hand_tool0"), chain.forward(0 * turns).matrix, atol=1e-9
    )
    corrected = tmp_path / "corrected.urdf"
    corrected.write_text(urdf.export_text(ExportRequest((), (), found, own, DATA, robot="hand")))
    given = export_text(ExportRequest((), (), found, own, DATA, urdfs=(BOTH[0], corrected)))
    assert "corrected.urdf, its base is the link base_link; joint offsets applied -->" in given


def test_missing_inputs_are_reported():
    """A missing URDF, an unknown base of a robot, and a missing cell are errors."""
    with pytest.raises(InputError, match="1 URDF for 2 robots: give one each, --urdf for eye, hand"):
        export_text(ExportRequest((), (), CALIBRATION, CELL, DATA))
    with pytest.raises(InputError, match="the pose of 'hand' is unknown: there is no eye_base_from_hand_base"):
        export_text(ExportRequest((), (), Calibration("good"), CELL, DATA, urdfs=BOTH))
    with pytest.raises(InputError, match="needs the cell and its folder"):
        export_text(ExportRequest((), (), CALIBRATION))
