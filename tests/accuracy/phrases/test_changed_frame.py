"""Tests of `changed_frame`: a frame that changed between two parts of a recording."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.phrases import changed_frame as room
from basecal.accuracy.phrases.changed_frame import _find_difference, changed_frame
from basecal.cell import Recording, RobotState
from basecal.errors import NotConverged
from basecal.estimation.problem.build import build_problem
from basecal.geometry import SE3, PoseEstimate
from basecal.simulation import Scenario, SimulatedCell, simulate

SHIFT = SE3.from_rotvec([0.1, -0.2, 0.3], [0.03, 0.02, 0.12])
MADE = simulate(Scenario(samples=16), 3)


def recording(frame: str, since: int, made: SimulatedCell = MADE) -> Recording:
    """The recording of a cell with the hand's poses in another tool or base frame from a sample on."""
    samples = []
    for sample in made.recording.samples:
        pose = sample.robots["hand"].base_from_flange
        assert pose is not None
        changed = pose @ SHIFT if frame == "tool" else SHIFT @ pose
        state = RobotState(changed if sample.sample >= since else pose)
        samples.append(replace(sample, robots={**sample.robots, "hand": state}))
    return Recording(tuple(samples))


@pytest.mark.journey
@pytest.mark.parametrize(
    ("frame", "says"),
    [
        ("tool", "the poses of hand are of another tool frame, or board was mounted again: hand_flange_from_board"),
        ("base", "the poses of hand are in another base frame, or its base was moved: eye_base_from_hand_base"),
    ],
)
def test_single_changed_frame_is_named(frame: str, says: str) -> None:
    """The changed frame is named with its first sample and size; each part alone closes the loop."""
    problem, _ = build_problem(MADE.cell, recording(frame, 9))
    changed = changed_frame(problem, MADE.cell)
    assert changed is not None
    assert changed.agreeing in (tuple(range(9)), tuple(range(9, 16)))
    sentence = changed.sentence
    assert sentence.startswith(f"From sample 9 on {says} differs by ")
    millimetres = float(sentence.split(" differs by ")[1].split(" mm")[0])
    assert millimetres == pytest.approx(1e3 * np.linalg.norm(SHIFT.translation), abs=3)


@pytest.mark.journey
def test_short_or_agreeing_parts_have_no_change() -> None:
    """A part that is too short, and parts that agree, have no changed frame."""
    problem, _ = build_problem(MADE.cell, recording("tool", 14))
    assert changed_frame(problem, MADE.cell) is None
    sound, _ = build_problem(MADE.cell, MADE.recording)
    assert changed_frame(sound, MADE.cell) is None


def test_frame_unobservable_in_part_is_not_named() -> None:
    """With each arm at rest in one half, no mount is determined by both parts, so none is named."""
    made = simulate(Scenario(samples=24, arms="halves", target="pose"), 3)
    problem, _ = build_problem(made.cell, recording("tool", 12, made))
    assert changed_frame(problem, made.cell) is None


@pytest.mark.parametrize(
    ("count", "agreeing", "first"),
    [
        (7, range(3), None),
        (8, range(4), 4),
        (8, range(4, 8), 4),
        (9, range(4), 4),
        (9, range(5), 5),
        (9, range(6), None),
        (9, range(3), None),
        (12, [0, 1, 2, 3, 4, 6], None),
        (12, range(2, 8), None),
        (12, range(12), None),
    ],
)
def test_parts_have_four_samples_each(monkeypatch, count, agreeing, first) -> None:
    """Agreeing samples must be all before or all after the others, with four samples each.

    The first sample of the later part is named.
    """
    asked = []
    parts = [SimpleNamespace(state="earlier"), SimpleNamespace(state="later")]
    monkeypatch.setattr(room, "_solve_parts", lambda problem, cell, number: asked.append(number) or parts)
    monkeypatch.setattr(room, "agreeing_samples", lambda problem, states: tuple(10 + k for k in agreeing))
    monkeypatch.setattr(room, "_find_difference", lambda *given: "base")
    monkeypatch.setattr(room, "_sentence", lambda name, number, parts: f"{name} {number}")
    found = changed_frame(SimpleNamespace(samples=10 + np.arange(count)), MADE.cell)
    if first is None:
        assert found is None
    else:
        assert found == (tuple(10 + k for k in agreeing), f"base {10 + first}")
        assert asked == [10 + count // 2, 10 + first]


def part(unobservable=(), **shifts_m):
    """A solution whose transforms are shifted along x, with sigmas of a millimetre and a milliradian."""
    transforms = {
        name: PoseEstimate(SE3(np.eye(3), np.array([x, 0.0, 0.0])), 1e-6 * np.eye(6)) for name, x in shifts_m.items()
    }
    observability = SimpleNamespace(unobservable=frozenset(unobservable))
    return SimpleNamespace(transforms=transforms, observability=observability)


def test_changed_frame_must_be_clear() -> None:
    """A frame is named only if it differs by far more sigmas than any other that both parts determine."""
    assert _find_difference(part(base=0.0, mount=0.0), part(base=0.1, mount=1e-3)) == "base"
    assert _find_difference(part(base=0.0, mount=0.0), part(base=0.1, mount=-0.09)) == ""
    assert _find_difference(part(base=0.0, mount=0.0), part(["mount"], base=0.1, mount=0.09)) == "base"
    assert _find_difference(part(base=0.0), part(base=0.1)) == "base"
    assert _find_difference(part(base=0.0), part(base=1e-3)) == ""
    assert _find_difference(part(["base"], base=0.0), part(base=1e-3)) == ""


def test_parts_are_solved_before_and_after_sample(monkeypatch) -> None:
    """Parts before and after a sample are solved, the earlier first; empty groups and unsolved parts are omitted."""
    problem, _ = build_problem(MADE.cell, MADE.recording)
    parts = [room._part(problem, 5, is_later) for is_later in (False, True)]
    assert [[group.sample.tolist() for group in part.groups] for part in parts] == [
        [list(range(5))],
        [list(range(5, 16))],
    ]
    assert room._part(problem, 0, False).groups == ()

    def solve_one(part, cell):
        if part == "later":
            raise NotConverged("It does not end.")
        return f"solved {part}"

    monkeypatch.setattr(room, "_part", lambda problem, number, is_later: "later" if is_later else "earlier")
    monkeypatch.setattr(room, "solve_problem", solve_one)
    assert room._solve_parts(problem, MADE.cell, 5) == ["solved earlier"]
