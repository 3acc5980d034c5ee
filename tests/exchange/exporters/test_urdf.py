"""Tests of the export of a robot's URDF with its calibration applied."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from basecal.cell import Calibration, Cell, Robot, RobotParameters
from basecal.errors import FrameNotFound, InputError
from basecal.exchange.exporters.exporter import export
from basecal.exchange.exporters.urdf import export_text
from basecal.exchange.exports.exporter import ExportRequest
from basecal.kinematics import read_chain

DATA = Path(__file__).parents[2] / "data" / "urdf"
CHAIN = read_chain(DATA / "six_axis.urdf", "base_link", "tool0")
HAND = Robot("hand", chain=CHAIN, urdf="six_axis.urdf", base_link="base_link", flange_link="tool0")
CELL = Cell("eye", robots={"eye": Robot("eye"), "hand": HAND}, bases={}, cameras={}, targets={})
RAD = np.array([np.nan, 0.01, -0.02, 0.03, 0.0, np.nan])
OFFSETS = RobotParameters(CHAIN.joint_names, RAD, np.abs(RAD), np.isfinite(RAD))


INPUTS = {"six_axis.urdf": f"sha256:{sha256((DATA / 'six_axis.urdf').read_bytes()).hexdigest()}"}


def calibration_with(**parameters):
    of_hand = {kind: {"hand": found} for kind, found in parameters.items()}
    return Calibration("good", robot_parameters=of_hand, inputs=INPUTS)


def urdf_of(cell, folder, calibration, of):
    return export_text(ExportRequest((), (), calibration, cell, folder, of))


def flange_of(text: str, folder: Path):
    (folder / "out.urdf").write_text(text)
    return read_chain(folder / "out.urdf", "base_link", "tool0").forward(np.full(6, 0.3))


def test_urdf_contains_joint_offsets(tmp_path):
    """At the recorded joints its flange is the calibrated one; unknown offsets count as zero."""
    found = flange_of(urdf_of(CELL, DATA, calibration_with(joint_offsets=OFFSETS), "hand"), tmp_path)
    wanted = CHAIN.forward(0.3 + np.nan_to_num(RAD))
    np.testing.assert_allclose(found.matrix, wanted.matrix, atol=1e-9)


def test_folder_may_be_string():
    """A path as a string gives the same as a `Path`."""
    calibration = calibration_with(joint_offsets=OFFSETS)
    texts = [export(calibration, "urdf", robot="hand", cell=CELL, folder=folder) for folder in (str(DATA), DATA)]
    assert texts[0] == texts[1]


def test_urdf_contains_link_errors(tmp_path):
    """Link errors are applied without offsets, too."""
    tangents = 1e-3 * np.random.default_rng(0).standard_normal((7, 6))
    links = RobotParameters((), tangents, np.ones((7, 6)), np.ones((7, 6), dtype=bool))
    found = flange_of(urdf_of(CELL, DATA, calibration_with(link_parameters=links), "hand"), tmp_path)
    np.testing.assert_allclose(found.matrix, CHAIN.perturb_links(tangents).forward(np.full(6, 0.3)).matrix, atol=1e-9)


def test_impossible_urdf_exports_are_refused():
    """An unknown robot, one without a URDF, and one without calibrated parameters are errors."""
    good = calibration_with(joint_offsets=OFFSETS)
    with pytest.raises(FrameNotFound):
        urdf_of(CELL, DATA, good, "hnd")
    with pytest.raises(InputError, match="'eye' has no urdf"):
        urdf_of(CELL, DATA, good, "eye")
    for field in ("urdf", "base_link", "flange_link"):
        bare = replace(CELL, reference="hand", robots={"hand": replace(HAND, **{field: None})})
        with pytest.raises(InputError, match="'hand' has no urdf"):
            urdf_of(bare, DATA, good, "hand")
    for cell, folder in ((None, DATA), (CELL, None)):
        with pytest.raises(InputError, match="needs the cell and its folder"):
            urdf_of(cell, folder, good, "hand")
    with pytest.raises(InputError, match="choose a URDF with --robot: eye, hand"):
        urdf_of(CELL, DATA, good, None)
    with pytest.raises(InputError, match="no joint offsets of 'hand'"):
        urdf_of(CELL, DATA, Calibration("good"), "hand")


def test_urdf_comment_has_source_hash():
    """A comment has the hash of the URDF that was calibrated."""
    text = urdf_of(CELL, DATA, calibration_with(joint_offsets=OFFSETS), "hand")
    assert f"of {INPUTS['six_axis.urdf']}: joint offsets applied -->" in text


def test_corrected_urdf_is_not_corrected_again(tmp_path):
    """A URDF with the correction applied, and one with an unknown hash, are refused."""
    good = calibration_with(joint_offsets=OFFSETS)
    (tmp_path / "six_axis.urdf").write_text(urdf_of(CELL, DATA, good, "hand"))
    for calibration in (good, replace(good, inputs={})):
        with pytest.raises(InputError, match=r"six_axis\.urdf is not the file that was calibrated.*applied twice"):
            urdf_of(CELL, tmp_path, calibration, "hand")


def test_offsets_of_other_chain_are_refused():
    """Offsets do not fit if the cell now names another chain than the calibrated one."""
    short = RobotParameters(CHAIN.joint_names[:3], RAD[:3], RAD[:3], np.isfinite(RAD[:3]))
    with pytest.raises(InputError, match="3 joint offsets do not fit 6 joints"):
        urdf_of(CELL, DATA, calibration_with(joint_offsets=short), "hand")


def test_pinocchio_agrees_with_exported_urdf(tmp_path):
    """Pinocchio reads the written file with the flange of our chain with added joint offsets."""
    (tmp_path / "six_axis.urdf").write_bytes((DATA / "six_axis.urdf").read_bytes())
    (tmp_path / "out.urdf").write_text(urdf_of(CELL, tmp_path, calibration_with(joint_offsets=OFFSETS), "hand"))
    model = pinocchio.buildModelFromUrdf(str(tmp_path / "out.urdf"))
    data = model.createData()
    joints = np.array([0.3, -0.4, 0.5, 0.6, -0.7, 0.8])
    all_joints = np.zeros(model.nq)  # includes the gripper's joints
    all_joints[[model.idx_qs[model.getJointId(name)] for name in CHAIN.joint_names]] = joints
    pinocchio.framesForwardKinematics(model, data, all_joints)
    found = data.oMf[model.getFrameId("tool0")]
    expected = CHAIN.forward(joints + np.nan_to_num(RAD))
    base = data.oMf[model.getFrameId("base_link")]
    np.testing.assert_allclose((base.inverse() * found).homogeneous, expected.matrix, atol=1e-9)
