"""Tests of separating a null space into translations, rotations, lenses and joints, with coupled transforms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.effects import deflection, joint_offsets, link_parameters
from basecal.estimation.observability.null_space import orthonormal_rows, separate_null_space, separate_twists
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.problem.robot_parameters import robot_model
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate
from basecal.simulation.arms import six_axis

BASE, CAMERA, BOARD = "eye_base_from_hand_base", "eye_flange_from_wrist", "hand_flange_from_board"
OFFSETS, BENDS, LINKS = "hand_joint_offsets", "hand_deflection", "hand_link_parameters"
X, Y, Z, RX, RY, RZ = np.eye(6)


@pytest.fixture(scope="module")
def problem():
    """Three transforms, a lens, and four offsets, six compliances and 18 link parameters of the hand."""
    made = simulate(Scenario(samples=5, intrinsics="free"), 0)
    arm, ends, joints = six_axis(), (True, True), np.random.default_rng(0).uniform(-2, 2, (30, 6))
    bends = deflection.Stated(status="prior", sigma_rad_per_nm=1e-3)
    free = {"joint_offsets": joint_offsets.Stated(status="free"), "deflection": bends}
    model = robot_model("hand", arm, free, joints, ends)
    links = robot_model("hand", arm, {"link_parameters": link_parameters.Stated(status="free")}, joints, ends)
    both = replace(model, columns={**model.columns, **links.columns})
    return build_problem(made.cell, made.recording)[0].with_models({"hand": both})


def separate_directions(problem, directions, at=None, scale=None):
    """Separate directions given by name, mixed by a random rotation."""
    vectors = np.zeros((problem.width, len(directions)))
    for k, direction in enumerate(directions):
        for name, values in direction.items():
            vectors[problem.columns[name], k] = values
    count = len(directions)
    mix = np.linalg.qr(np.random.default_rng(1).standard_normal((count, count)))[0]
    transforms = {**dict.fromkeys(problem.unknowns, SE3.identity()), **(at or {})}
    scale = np.ones(problem.width) if scale is None else scale
    found = separate_null_space(problem, State(transforms, {}, np.zeros((0, 6))), np.linalg.qr(vectors)[0] @ mix, scale)
    return [(d.kind, d.names, d) for d in found]


def test_empty_null_space_has_no_directions(problem):
    """Without null vectors there is no direction."""
    assert (
        separate_null_space(
            problem, State({}, {}, np.zeros((0, 6))), np.zeros((problem.width, 0)), np.ones(problem.width)
        )
        == ()
    )


def test_coupled_transforms_are_named_by_their_share(problem):
    """A mount that moves 0.4 of the base is named beside it, one that moves 0.2 is not."""
    ((kind, names, _),) = separate_directions(problem, [{BASE: Z, BOARD: 0.4 * Z, CAMERA: 0.2 * Z}])
    assert (kind, names) == ("translation", (BASE, BOARD))
    ((kind, names, _),) = separate_directions(problem, [{BASE: RZ, CAMERA: 0.4 * RX}])
    assert (kind, names) == ("rotation", (BASE, CAMERA))


def test_base_is_named_before_mounts(problem):
    """A base is first if it moves at least half of the largest motion, else the largest is first."""
    first = next(n for n in problem.columns if n in problem.unknowns)
    other = next(n for n in problem.columns if n in problem.unknowns and n != first)
    assert separate_directions(problem, [{first: 0.55 * X, other: X}])[0][1] == (first, other)
    assert separate_directions(problem, [{first: 0.45 * X, other: X}])[0][1] == (other, first)


def test_rotations_are_twists_in_the_parent_in_metres(problem):
    """A base 2 m along x that rotates about its own z moves about the line through it. Scales are included."""
    scale = np.ones(problem.width)
    scale[problem.columns[BASE]] = [0.5, 0.5, 0.5, 1, 1, 1]
    at = {BASE: SE3(np.eye(3), np.array([2.0, 0, 0]))}
    ((_, _, found),) = separate_directions(problem, [{BASE: RZ}], at, scale)
    np.testing.assert_allclose(
        found.twists_in_parent / found.twists_in_parent[0, 5], [[0, -2.0, 0, 0, 0, 1]], atol=1e-12
    )
    ((_, _, found),) = separate_directions(
        problem, [{BASE: Y}], {BASE: SE3.from_rotvec([0, 0, np.pi / 2], [0.0, 0, 0])}, scale
    )
    np.testing.assert_allclose(np.abs(found.twists_in_parent), [X], atol=1e-12)


def test_three_rotations_are_merged_and_two_are_not(problem):
    """Any rotation is one direction, and single axes are separate directions."""
    (all_, *none) = separate_directions(problem, [{BASE: RX}, {BASE: RY}, {BASE: RZ}])
    assert (none, all_[2].twists_in_parent.shape) == ([], (3, 6))
    two = separate_directions(problem, [{BASE: RX}, {BASE: RY}])
    assert [d.twists_in_parent.shape for _, _, d in two] == [(1, 6), (1, 6)]


def test_translations_of_one_frame_are_merged(problem):
    """Two shifts of the base span a plane: two orthonormal rows."""
    ((kind, _, found),) = separate_directions(problem, [{BASE: X}, {BASE: 3 * X + Y}])
    assert kind == "translation"
    np.testing.assert_allclose(found.twists_in_parent @ found.twists_in_parent.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(found.twists_in_parent[:, 2:], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "row", "kind", "joint"),
    [
        (OFFSETS, 0, "robot parameters", 1),
        (OFFSETS, 3, "robot parameters", 4),
        (BENDS, 5, "robot parameters", 5),
        (LINKS, 7, "robot parameters", None),
        ("wrist", 5, "lens", None),
    ],
)
def test_robots_and_lenses_are_identified_by_the_largest_motion(problem, name, row, kind, joint):
    """Joints are counted among the free offsets with a column, and coupled transforms are named afterwards."""
    width = problem.columns[name].stop - problem.columns[name].start
    ((found, names, direction),) = separate_directions(problem, [{name: np.eye(width)[row], BASE: 0.5 * RZ}])
    assert (found, names, direction.joint) == (kind, (name, BASE), joint)
    assert direction.twists_in_parent.shape == (0, 6)
    assert (direction.robot, direction.parameters) == (
        ("", "") if kind == "lens" else ("hand", name.removeprefix("hand_"))
    )
    assert direction.joint_name == ("" if joint is None else six_axis().joint_names[joint])


def test_lens_directions_come_first_and_are_separated(problem):
    """A lens and a shift of the base, arbitrarily mixed, are separated, with the lens first."""
    kinds = [kind for kind, _, _ in separate_directions(problem, [{BASE: X}, {"wrist": np.eye(9)[4]}])]
    assert kinds == ["lens", "translation"]


def test_small_rows_are_left_out():
    """A row of a tenth of the largest adds no direction, one of three tenths does."""
    assert orthonormal_rows(np.array([[1.0, 0, 0], [0, 0.1, 0]])).shape == (1, 3)
    found = orthonormal_rows(np.array([[1.0, 0, 0], [0, 0.3, 0]]))
    np.testing.assert_allclose(found @ found.T, np.eye(2), atol=1e-12)


def test_twists_are_separated_into_translations_and_rotations():
    """A shift along z and a rotation about a line 1 m off are separated from a mixture.

    Shifts alone leave no rotation.
    """
    turn = np.concatenate([np.cross([1.0, 0, 0], [0, 0, 1.0]), [0, 0, 1.0]])
    shifts, turns = separate_twists(np.stack([Z + turn, Z - turn]))
    np.testing.assert_allclose(np.abs(shifts), [[0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(turns[0] / turns[0, 5], turn, atol=1e-12)
    shifts, turns = separate_twists(np.stack([X, Y]))
    assert (shifts.shape, turns.shape) == ((2, 3), (0, 6))
    shifts, turns = separate_twists(RZ[None])
    assert (shifts.shape, turns.shape) == ((0, 3), (1, 6))


@pytest.mark.parametrize("axis", [RX, RY, RZ])
def test_rotation_about_any_axis_has_no_translation(axis):
    """The separation of a rotation about x, y or z leaves no shift."""
    shifts, turns = separate_twists(axis[None])
    assert shifts.shape == (0, 3)
    np.testing.assert_allclose(np.abs(turns), [axis], atol=1e-12)


def test_transforms_coupled_through_a_third_are_one_cluster():
    """Transforms that share no direction are grouped if each is coupled with another mount.

    An independent transform is separate.
    """
    made = simulate(Scenario(samples=5, layout="two_cameras"), 0)
    problem, _ = build_problem(made.cell, made.recording)
    names = [name for name in problem.columns if name in problem.unknowns]
    assert len(names) >= 4
    first, second, third, fourth = names[:4]
    found = separate_directions(problem, [{first: X, third: X}, {second: Y, third: Y}, {fourth: Z}])
    clusters = {frozenset(moved) for _, moved, _ in found}
    assert frozenset({fourth}) in clusters
    assert all(fourth not in moved for moved in clusters if len(moved) > 1)
    assert {name for moved in clusters for name in moved} == set(names[:4])
    assert sum(len(of.twists_in_parent) for _, _, of in found) == 3
