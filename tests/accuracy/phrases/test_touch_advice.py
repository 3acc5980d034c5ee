"""Which mark to touch next."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import BASE, MARKS, recorded, touch_cell, touch_lines

from basecal.accuracy.phrases.touch_advice import touch_advice
from basecal.cell import Unknown
from basecal.estimation.observability.null_space import NullDirection
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3

AXES = np.eye(3)


@pytest.mark.parametrize(
    ("names", "twists", "words"),
    [
        (["mark_a", "mark_b"], "line", "A third mark at least 0.3 m off the line through mark_a and mark_b fixes"),
        (
            ["mark_a", "mark_b", "mark_c"],
            "line",
            "A further mark at least 0.3 m off the line through mark_a and mark_b",
        ),
        (["mark_a"], "all", "Touch three marks, 0.3 m apart and not on one line, with eye_tip and hand_tip."),
    ],
)
def test_the_next_mark(names, twists, words):
    """Off the line that is the axis, where two marks are on it; else three marks."""
    marks = {name: MARKS[name] for name in names}
    cell = touch_cell(names)
    problem, _ = build_problem(cell, recorded(cell, touch_lines(np.random.default_rng(0), 12, 0.0, marks)))
    known = {f"eye_base_from_{name}": SE3(AXES, at) for name, at in marks.items()}
    state = State({**dict.fromkeys(problem.unknowns, SE3.identity()), **known}, {}, np.zeros((0, 6)))
    axis = (MARKS["mark_b"] - MARKS["mark_a"]) / np.linalg.norm(MARKS["mark_b"] - MARKS["mark_a"])
    rotations = axis[None] if twists == "line" else AXES
    space = np.hstack([np.cross(MARKS["mark_a"], rotations), rotations])
    found = touch_advice(cell, problem, state, NullDirection("rotation", (BASE,), space))
    assert found is not None
    assert found[0][0].startswith(words)


def test_a_mark_beside_the_axis_is_not_on_the_line():
    """One that holds nothing, as a single arm touched it: the line is through the two marks on the axis."""
    names = ["mark_c", "mark_a", "mark_b"]
    cell = touch_cell(names)
    lines = touch_lines(np.random.default_rng(0), 12, 0.0, {name: MARKS[name] for name in names})
    problem, _ = build_problem(cell, recorded(cell, lines))
    known = {f"eye_base_from_{name}": SE3(AXES, MARKS[name]) for name in names}
    state = State({**dict.fromkeys(problem.unknowns, SE3.identity()), **known}, {}, np.zeros((0, 6)))
    axis = MARKS["mark_c"] - MARKS["mark_b"]
    axis = (axis / np.linalg.norm(axis))[None]
    space = np.hstack([np.cross(MARKS["mark_b"], axis), axis])
    found = touch_advice(cell, problem, state, NullDirection("rotation", (BASE,), space))
    assert found is not None
    assert "0.3 m off the line through mark_b and mark_c" in found[0][0]


def test_other_directions_are_not_of_touches():
    """A translation, and a mount on a flange, are left to the motion of robots."""
    cell = touch_cell(["mark_a"]).with_transform(BASE, Unknown())
    lines = touch_lines(np.random.default_rng(0), 12, 0.0, {"mark_a": MARKS["mark_a"]})
    problem, _ = build_problem(cell, recorded(cell, lines))
    state = State(dict.fromkeys(problem.unknowns, SE3.identity()), {}, np.zeros((0, 6)))
    for kind, name in (("translation", BASE), ("rotation", "eye_flange_from_eye_tip")):
        assert touch_advice(cell, problem, state, NullDirection(kind, (name,), np.zeros((1, 6)))) is None
