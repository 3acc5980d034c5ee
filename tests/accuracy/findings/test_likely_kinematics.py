"""Tests of likely kinematic errors that the covariance includes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.findings import likely_kinematics as module
from basecal.accuracy.findings.likely_kinematics import likely_kinematics
from basecal.effects.faces.effect import FoundEffect

SIGMAS = {"eye": np.array([5e-4, 1e-3]), "hand": np.array([1e-4, 2e-3])}


def noise(term, gain=30.0):
    return {
        "noise": SimpleNamespace(
            common={term: SIGMAS}, plain_minus_2_log_evidence=100.0, minus_2_log_evidence=100.0 - gain
        )
    }


OF = "of eye and hand"


@pytest.mark.parametrize(
    ("term", "code", "what", "entry"),
    [
        ("joint_offsets", "robot-model", f"Joints {OF} likely have offsets of 0.11 deg", "joint_offsets: {status: pr"),
        ("link_parameters", "robot-model", f"Links {OF} likely differ from the URDF by 0.50 mm", "link_parameters: {s"),
        ("deflection", "deflection", f"Joints {OF} likely yield to the weight of the links by 0.11", "deflection: {st"),
    ],
)
def test_likely_kinematic_error_is_info(evidence, monkeypatch, term, code, what, entry):
    """A likely kinematic error is an info with its size and the entry to write.

    For deflection it states the assumed direction of gravity.
    """
    monkeypatch.setattr(module, "describe_gravity", lambda *_: "gravity pulls")
    (found,) = likely_kinematics(evidence(noise(term)))
    assert (found.code, found.severity, found.about) == (code, "info", ("eye", "hand"))
    assert found.message.startswith(what)
    assert entry in found.message
    assert ("gravity pulls" in found.message) == (term == "deflection")


def test_chance_and_smooth_errors_give_no_finding(evidence):
    """Errors that may be chance, smooth errors, and stops without a shared error give no finding."""
    assert likely_kinematics(evidence(noise("joint_offsets", 9.0))) == []
    assert likely_kinematics(evidence(noise("smooth"))) == []
    assert likely_kinematics(evidence({"noise": SimpleNamespace(common={})})) == []


def test_kinematic_error_is_reported_once(evidence, monkeypatch):
    """A kinematic error is not repeated if a joint test or the robot-model finding reports it."""
    error = FoundEffect("bending", "deflection", "eye", False, False, None, "", np.ones(1), np.eye(1), np.zeros(6))
    assert likely_kinematics(evidence(noise("joint_offsets"), systematic_error=error)) == []
    monkeypatch.setattr(module, "robot_model", lambda _: ["finding"])
    monkeypatch.setattr(module, "describe_gravity", lambda *_: "gravity pulls")
    assert likely_kinematics(evidence(noise("link_parameters"))) == []
    assert len(likely_kinematics(evidence(noise("deflection")))) == 1
