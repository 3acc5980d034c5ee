"""Tests of the finding `robot-model`: robot parameters to free, and the gain."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.cross_validation.robot_model_selection import Candidate
from basecal.accuracy.findings import robot_model as module
from basecal.accuracy.findings.robot_model import robot_model, robot_model_findings
from basecal.effects.faces.effect import FoundEffect


def candidate(kind="none", robots=("arm",), joint=None, error_m=None, rms=1.0):
    return Candidate(kind, robots, joint, np.zeros(0), error_m, rms)


NONE = candidate(error_m=4e-3, rms=2.5)


def choice(chosen, better=None, none=NONE, robots=()):
    state = SimpleNamespace(robots=dict(enumerate(robots)))
    return SimpleNamespace(
        chosen=chosen, better=better, candidates=(none, chosen), solution=SimpleNamespace(state=state)
    )


@pytest.fixture(autouse=True)
def offsets(monkeypatch):
    """Offsets of two robots: joint 2 of `hand` is the clearest in sigmas; unobservable ones do not count."""
    found = {
        "arm": SimpleNamespace(
            values=np.array([0.02, 9.0]), sigma=np.array([0.01, 1e-3]), seen=np.array([True, False])
        ),
        "hand": SimpleNamespace(values=np.array([0.01, -0.01]), sigma=np.full(2, [0.01, 0.002]), seen=np.ones(2, bool)),
    }
    monkeypatch.setattr(module, "robot_parameters", lambda _: {"joint_offsets": found})
    return found


def test_robots_as_stated_give_no_finding(evidence):
    """Robots as stated give no finding, nor does a missing choice."""
    assert robot_model(evidence()) == []
    assert robot_model(evidence(robot_model=choice(NONE))) == []


def test_uncertain_robot_model_is_info():
    """A better model that too few samples confirm is an info about its robots."""
    (found,) = robot_model_findings(choice(NONE, candidate("joint", joint=2, error_m=1e-3)))
    assert (found.severity, found.about) == ("info", ("arm",))
    words = (
        "Freeing the offset of joint 3 of arm may lower the cross-validation error from 4.0 to 1.0 mm rms. There are "
        "too few samples"
    )
    assert found.message.startswith(words)


def test_helpful_offsets_are_warning():
    """Helpful offsets are a warning with the clearest offset and the entry to write."""
    (found,) = robot_model_findings(choice(candidate("offsets", ("arm", "hand"), error_m=2e-3)))
    assert (found.severity, found.about) == ("warning", ("arm", "hand"))
    gain, entry = f"{found.what} {found.why}", *found.do
    assert gain.startswith(
        "Freeing the joint offsets of arm and hand lowers the cross-validation error from 4.0 to 2.0 mm"
    )
    assert gain.endswith("The clearest offset, of joint 2 of hand, is -0.57 ± 0.11 deg.")
    assert entry == "Write `joint_offsets: {status: prior, sigma_rad: 0.02}` at arm and hand in cell.yaml."


def test_single_joint_states_its_offset(offsets):
    """A single joint states its offset, or that no single offset stands out."""
    (found,) = robot_model_findings(choice(candidate("joint", joint=1), none=candidate(rms=2.5)))
    assert "from 2.5 to 1.0 sigmas rms. Its offset is -0.57 ± 0.11 deg" in found.message
    for each in offsets.values():
        each.seen[:] = False
    (found,) = robot_model_findings(choice(candidate("joint", joint=1)))
    assert "No single offset stands out." in found.message


def test_helpful_links_state_worst_link():
    """Helpful links state the worst link of any robot and both entries to write. An undecided better model is named."""
    links = np.zeros((3, 6))
    links[1], links[2] = [3e-3, 4e-3, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0.01]
    robots = [SimpleNamespace(kind_values={"link_parameters": each}.get) for each in (np.zeros((2, 6)), links)]
    (found,) = robot_model_findings(choice(candidate("links"), candidate("offsets", ("hand",)), robots=robots))
    assert "Links are off by up to 5.0 mm and 0.57 deg" in found.message
    assert "Whether freeing the joint offsets of hand helps more is undecided" in found.message
    assert "and `link_parameters: {status: prior, sigma_rad: 0.002, sigma_m: 0.001}` at arm in" in found.message


def make_effect(effect, about="hand", is_certain=True, alternatives=()):
    size = np.array([0.004])
    return FoundEffect(
        effect, "", about, False, False, None, "", size, np.eye(1), size, 1, is_certain, alternatives=alternatives
    )


@pytest.mark.parametrize(("other", "chosen", "is_left_out"), [
    (make_effect("gear_ratio"), "joint", True),
    (make_effect("gear_ratio"), "links", False),
    (make_effect("gear_ratio", "arm"), "joint", False),
    (make_effect("gear_ratio", is_certain=False), "offsets", False),
    (make_effect("gear_ratio", alternatives=(make_effect("joint_offsets"),)), "joint", False),
    (make_effect("joint_offsets"), "joint", False),
    (make_effect("step"), "joint", False),
    (None, "joint", False),
])  # fmt: skip
def test_offsets_that_imitate_other_effect_are_omitted(evidence, other, chosen, is_left_out):
    """Offsets are omitted if a certain effect of the same joints, distinguishable from an offset, explains them."""
    arm = SimpleNamespace(kind_values=lambda _: np.zeros((7, 6)))
    chosen_model = choice(candidate(chosen, ("hand",), 1, error_m=2e-3), robots=(arm,))
    made = evidence(robot_model=chosen_model, systematic_error=other)
    assert (robot_model(made) == []) == is_left_out
