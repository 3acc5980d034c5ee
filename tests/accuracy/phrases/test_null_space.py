"""Tests of the wording of null-space directions, separated into translations and rotations with their axes."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.phrases.null_space import describe_null_space, describe_twists, unobservable_clause
from basecal.estimation.observability.null_space import NullDirection, separate_null_space
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

HOME = SE3.identity()
BASE, BOARD = "eye_base_from_hand_base", "hand_flange_from_board"


@pytest.fixture(scope="module")
def problem():
    made = simulate(Scenario(samples=5, intrinsics="free"), 0)
    return build_problem(made.cell, made.recording)[0]


def state_with(problem, base: SE3) -> State:
    transforms = dict.fromkeys(problem.unknowns, SE3.identity())
    return State({**transforms, BASE: base}, {}, np.zeros((0, 6)))


def words(problem, tangents: list[dict[str, list[float]]], base: SE3 = HOME, seed: int = 0) -> list[str]:
    """Wording of directions given by name, mixed by a random rotation."""
    vectors = np.zeros((problem.width, len(tangents)))
    for k, tangent in enumerate(tangents):
        for name, values in tangent.items():
            vectors[problem.columns[name], k] = values
    mixed = np.linalg.qr(vectors)[0] @ np.linalg.qr(np.random.default_rng(seed).normal(size=(len(tangents),) * 2))[0]
    found = separate_null_space(problem, state_with(problem, base), mixed, np.ones(problem.width))
    return [describe_null_space(direction) for direction in found]


@pytest.mark.parametrize("seed", range(5))
def test_translations_are_separated_from_rotations(problem, seed):
    """A coupled translation along z and a rotation about x are described separately, however they are mixed."""
    shift = {BASE: [0, 0, 1, 0, 0, 0], BOARD: [0, 1, 0, 0, 0, 0]}
    turn = {BASE: [0, 0, 0, 1, 0, 0]}
    assert words(problem, [shift, turn], seed=seed) == [
        f"translation of hand_base along (0.00, 0.00, 1.00) in eye_base, coupled with {BOARD}",
        "rotation of hand_base about the axis through (0.00, 0.00, 0.00) m along (1.00, 0.00, 0.00) in eye_base",
    ]


def test_complete_spaces_are_one_phrase(problem):
    """Three translations are "any translation", three rotations "any rotation", two are perpendicular to the third."""
    unit = np.eye(6).tolist()
    assert words(problem, [{BASE: row} for row in unit[:3]]) == ["any translation of hand_base"]
    assert words(problem, [{BASE: row} for row in unit[:2]]) == [
        "any translation of hand_base perpendicular to (0.00, 0.00, 1.00) in eye_base"
    ]
    everything = words(problem, [{BASE: row} for row in unit])
    assert everything == ["any translation of hand_base", "any rotation of hand_base"]


def test_axes_are_in_parent_frame(problem):
    """A rotation about z of a rotated base 2 m along x is described as a line in eye_base."""
    base = SE3.from_rotvec([np.pi / 2, 0, 0], [2.0, 0, 0])
    assert words(problem, [{BASE: [0, 0, 0, 0, 0, 1]}], base) == [
        "rotation of hand_base about the axis through (2.00, 0.00, 0.00) m along (0.00, 1.00, 0.00) in eye_base"
    ]


def test_independent_directions_are_separate(problem):
    """Directions of independent unknowns are described separately; a lens is called intrinsics."""
    lens = {"wrist": [0.0] * 4 + [1.0] + [0.0] * 4}
    descriptions = words(problem, [{BASE: [1, 0, 0, 0, 0, 0]}, {BOARD: [0, 1, 0, 0, 0, 0]}, lens])
    assert descriptions == [
        "the intrinsics of wrist",
        "translation of hand_base along (1.00, 0.00, 0.00) in eye_base",
        "translation of board along (0.00, 1.00, 0.00) in hand_flange",
    ]


def test_twists_are_in_own_base_axes():
    """Twists of a base are described in its own axes.

    Here all of them, or a translation and a rotation about a line 1 m off.
    """
    assert describe_twists("hand_base", np.eye(6)) == "any translation or rotation of hand_base"
    turn = np.concatenate([np.cross([1.0, 0, 0], [0, 0, 1.0]), [0, 0, 1.0]])
    assert describe_twists("hand_base", np.array([[0, 0, 1.0, 0, 0, 0], turn])) == (
        "translation of hand_base along (0.00, 0.00, 1.00) in hand_base and "
        "rotation of hand_base about the axis through (1.00, 0.00, 0.00) m along (0.00, 0.00, 1.00) in hand_base"
    )


@pytest.mark.parametrize(
    ("parameters", "joint", "words"),
    [
        ("", None, "the intrinsics of name"),
        ("link_parameters", None, "an error of the links of hand"),
        ("joint_offsets", 2, "the offset of joint 3 of hand (elbow)"),
        ("joint_offsets", 0, "the offset of joint 1 of hand (elbow)"),
        ("deflection", 5, "the compliance of joint 6 of hand (elbow)"),
    ],
)
def test_lens_and_robot_directions_are_named(parameters, joint, words):
    """Lens and robot directions name parameter, robot and joint (counted from one), then coupled transforms."""
    none = np.zeros((0, 6))
    kind, robot = ("robot parameters", "hand") if parameters else ("lens", "")
    assert describe_null_space(NullDirection(kind, ("name",), none, robot, parameters, joint, "elbow")) == words
    several = NullDirection(kind, ("name", BASE, BOARD), none, robot, parameters, joint, "elbow")
    assert describe_null_space(several) == f"{words}, coupled with {BASE} and {BOARD}"


@pytest.mark.parametrize(("pitch", "screw"), [(0.0, ""), (0.019, ""), (0.021, ", with 0.4 mm along it per degree")])
def test_screw_is_distinguished_from_rotation(pitch, screw):
    """A screw is distinguished from a rotation from two centimetres per radian on."""
    twist = np.array([[0.0, 0.0, pitch, 0.0, 0.0, 1.0]])
    line = "rotation of hand_base about the axis through (0.00, 0.00, 0.00) m along (0.00, 0.00, 1.00) in eye_base"
    for size in (1.0, 3.0):
        assert describe_null_space(NullDirection("rotation", (BASE,), size * twist)) == line + screw


def test_unobservable_clause_has_verb_and_couplings():
    """The clause has a singular or plural verb, and the coupled transforms in parentheses."""
    assert unobservable_clause(["a"], []) == "a is unobservable"
    assert unobservable_clause(["a", "b"], ["c", "d"]) == "a and b are unobservable (coupled with c and d)"
