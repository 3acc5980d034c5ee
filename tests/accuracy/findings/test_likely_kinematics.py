"""What arms are likely built otherwise, where the covariance counts it."""

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
def test_what_is_likely_is_an_info(evidence, monkeypatch, term, code, what, entry):
    """With its size, and what to write; of what yields to gravity where that is taken to pull."""
    monkeypatch.setattr(module, "describe_gravity", lambda *_: "gravity pulls")
    (found,) = likely_kinematics(evidence(noise(term)))
    assert (found.code, found.severity, found.about) == (code, "info", ("eye", "hand"))
    assert found.message.startswith(what)
    assert entry in found.message
    assert ("gravity pulls" in found.message) == (term == "deflection")


def test_what_may_be_chance_or_is_smooth_is_none(evidence):
    """Nor where stops have nothing in common."""
    assert likely_kinematics(evidence(noise("joint_offsets", 9.0))) == []
    assert likely_kinematics(evidence(noise("smooth"))) == []
    assert likely_kinematics(evidence({"noise": SimpleNamespace(common={})})) == []


def test_it_is_told_once(evidence, monkeypatch):
    """Where a test of joints or the held-out samples say so it is left to them."""
    error = FoundEffect("bending", "deflection", "eye", False, False, None, "", np.ones(1), np.eye(1), np.zeros(6))
    assert likely_kinematics(evidence(noise("joint_offsets"), systematic_error=error)) == []
    monkeypatch.setattr(module, "robot_model", lambda _: ["finding"])
    monkeypatch.setattr(module, "describe_gravity", lambda *_: "gravity pulls")
    assert likely_kinematics(evidence(noise("link_parameters"))) == []
    assert len(likely_kinematics(evidence(noise("deflection")))) == 1
