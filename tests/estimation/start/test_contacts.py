"""Tests of start states of planes, edges and hinges."""

from __future__ import annotations

import numpy as np
import pytest
from tests.touch_cells import (
    BASE,
    SURFACES,
    TIPS,
    TRUTH,
    clamp_cell,
    clamp_lines,
    held_poses,
    recorded,
    surface_cell,
    surface_lines,
)

from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.solve import solve
from basecal.estimation.start import contacts
from basecal.estimation.start.contacts import place_contacts, rigid_part_mounts, rotated_base_states, without_contacts
from basecal.estimation.start.first_state import first_state
from basecal.estimation.start.rotation_search import icosahedral_rotations
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3

SHAPES = [
    {"floor": "plane", "wall": "plane", "side": "plane"},
    {"floor": "plane", "mark_a": "point", "mark_b": "point"},
    {"wall": "edge", "side": "edge", "floor": "plane"},
]


@pytest.mark.journey
@pytest.mark.parametrize("shapes", SHAPES)
def test_bases_are_found_by_planes_and_edges(shapes):
    """Exact touches of surfaces at unknown places give the true base without a guess."""
    cell = surface_cell(shapes)
    found = solve(cell, recorded(cell, surface_lines(np.random.default_rng(0), 60, 1e-6, shapes)))
    assert np.abs((found.state.transforms[BASE].inverse() @ TRUTH).log()).max() < 1e-4


def test_both_ends_of_a_hinge_are_parallel():
    """In the first state, z of both ends has the same direction at every sample, within 0.3 rad."""
    cell = clamp_cell("free")
    lines = clamp_lines(held_poses(np.random.default_rng(0), 20, 0.0, 0.0, is_hinge=True))
    problem, _ = build_problem(cell, recorded(cell, lines))
    state = first_state(problem, cell, thorough=False)
    for group in problem.groups:
        axes = state.camera_from_target(group, problem.stops).rotation[..., 2]
        assert np.all(axes[:, 2] > np.cos(0.3))


def problem_of_touches(shapes, count=60):
    """The problem of exact touches, and the true transforms of bases and tips."""
    cell = surface_cell(shapes)
    problem, _ = build_problem(cell, recorded(cell, surface_lines(np.random.default_rng(0), count, 0.0, shapes)))
    tips = {f"{robot}_flange_from_{robot}_tip": SE3(np.eye(3), tip) for robot, tip in TIPS.items()}
    return problem, {BASE: TRUTH, **tips}


@pytest.mark.parametrize("shapes", [{"floor": "plane", "wall": "plane"}, {"floor": "edge", "wall": "edge"}])
def test_surfaces_are_at_their_touches(shapes):
    """The normal of a plane and the direction of an edge are z, and the origin is in the middle of the touches."""
    problem, transforms = problem_of_touches(shapes)
    placed = place_contacts(problem, transforms)
    assert set(placed) == {f"eye_base_from_{name}" for name in shapes}
    for name in shapes:
        found = placed[f"eye_base_from_{name}"]
        off = SURFACES[name].inverse() @ found
        assert abs(off.rotation[2, 2]) == pytest.approx(1.0, abs=1e-6)
        assert np.linalg.det(found.rotation) == pytest.approx(1.0)
        across = [2] if shapes[name] == "plane" else [0, 1]
        np.testing.assert_allclose(off.translation[across], 0.0, atol=1e-6)
        assert 1e-3 < np.linalg.norm(off.translation) < 0.1


def test_touches_of_the_reference_have_priority():
    """A wrong base has no effect on a surface that the reference touched as well."""
    problem, transforms = problem_of_touches({"floor": "plane"})
    wrong = {**transforms, BASE: TRUTH @ SE3.exp([0.3, 0.1, 0.2, 0.1, 0.4, 0.2])}
    right, found = (place_contacts(problem, each)["eye_base_from_floor"] for each in (transforms, wrong))
    np.testing.assert_array_equal(found.matrix, right.matrix)
    by_hand = problem.with_groups([g for g in problem.groups if g.eye.base is not None])
    alone = place_contacts(by_hand, transforms)["eye_base_from_floor"]
    assert abs((SURFACES["floor"].inverse() @ alone).translation[2]) < 1e-6


def test_bases_are_rotated_about_the_middle_of_their_flanges():
    """All rotations of the icosahedron are tried, together with surfaces.

    Known transforms are unchanged, and known bases are not rotated.
    """
    problem, transforms = problem_of_touches({"floor": "plane", "wall": "plane"})
    state = State({**transforms, **place_contacts(problem, transforms)}, {}, np.zeros((len(problem.stops), 6)))
    starts = list(rotated_base_states(problem, state, {"eye_base_from_wall"}))
    assert len(starts) == len(list(icosahedral_rotations())) == 60
    flanges = np.concatenate([(TRUTH @ g.eye.base_from_flange).translation for g in problem.groups if g.eye.base])
    for start in starts:
        turn = start.transforms[BASE] @ TRUTH.inverse()
        np.testing.assert_allclose(turn @ flanges.mean(0), flanges.mean(0), atol=1e-9)
        assert start.transforms["eye_base_from_wall"] is state.transforms["eye_base_from_wall"]
        moved = place_contacts(problem, start.transforms)["eye_base_from_floor"]
        np.testing.assert_array_equal(start.transforms["eye_base_from_floor"].matrix, moved.matrix)
    assert any(np.allclose(start.transforms[BASE].matrix, TRUTH.matrix) for start in starts)
    turns = {tuple(np.round(start.transforms[BASE].rotation.ravel(), 6)) for start in starts}
    assert len(turns) == 60
    assert list(rotated_base_states(problem, state, {BASE})) == []


def problem_of_held_part(axis):
    """The problem of a part that both arms hold exactly."""
    cell = clamp_cell(axis)
    lines = clamp_lines(held_poses(np.random.default_rng(1), 12, 0.0, 0.0, is_hinge=axis == "free"))
    problem, _ = build_problem(cell, recorded(cell, lines))
    return problem


def test_held_part_is_halfway_between_the_flanges():
    """Both ends are at one place, halfway from one flange to the other, with the axes of the eye's flange."""
    problem = problem_of_held_part("fixed")
    ((name, start),) = rigid_part_mounts(problem).items()
    assert (name, start.matrix.tolist()) == ("eye_flange_from_part", np.eye(4).tolist())
    hand_from_eye = SE3.exp([0.2, -0.1, 0.4, 0.3, 0.2, 0.1])
    placed = place_contacts(problem, {"hand_flange_from_part_grip": hand_from_eye})
    eye, hand = placed["eye_flange_from_part"], placed["hand_flange_from_part_grip"]
    np.testing.assert_allclose((hand @ eye.inverse()).matrix, hand_from_eye.matrix, atol=1e-12)
    np.testing.assert_array_equal(eye.rotation, np.eye(3))
    ends = np.linalg.norm(eye.translation), np.linalg.norm(hand.translation)
    assert ends == pytest.approx([np.linalg.norm(hand_from_eye.translation) / 2] * 2)


def test_hinge_axis_is_where_flanges_stay_parallel():
    """With the true base, z of both mounts is one direction in all samples, and their origins are unchanged."""
    problem = problem_of_held_part("free")
    (group, _) = problem.groups
    transforms = {
        BASE: TRUTH,
        group.eye.mount: SE3(np.eye(3), TIPS["eye"]),
        group.hand.mount: SE3(np.eye(3), TIPS["hand"]),
    }
    placed = place_contacts(problem, transforms)
    assert set(placed) == {group.eye.mount, group.hand.mount}
    for name, at in placed.items():
        np.testing.assert_array_equal(at.translation, transforms[name].translation)
        np.testing.assert_allclose(at.rotation @ at.rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(at.rotation) == pytest.approx(1.0)
    one = group.eye.base_from_flange.rotation @ placed[group.eye.mount].rotation[:, 2]
    other = TRUTH.rotation @ group.hand.base_from_flange.rotation @ placed[group.hand.mount].rotation[:, 2, None]
    np.testing.assert_allclose(one, other[..., 0], atol=1e-6)


def test_contacts_are_excluded_from_the_first_problem():
    """A grip of a rigid part is a pose at the identity, alone for its part.

    Hinges become points, and surfaces are removed.
    """
    (pose,) = without_contacts(problem_of_held_part("fixed")).groups
    assert isinstance(pose.measurement, PoseMeasurement)
    np.testing.assert_array_equal(pose.measurement.measured_camera_from_target.matrix, np.tile(np.eye(4), (12, 1, 1)))
    hinged = problem_of_held_part("free")
    points = without_contacts(hinged)
    assert [type(g.measurement).__name__ for g in points.groups] == ["TouchMeasurement"]
    assert points.point_mounts == {hinged.groups[0].eye.mount, hinged.groups[0].hand.mount}
    assert rigid_part_mounts(hinged) == {}
    mixed, _ = problem_of_touches({"floor": "plane", "mark_a": "point"})
    left = without_contacts(mixed)
    assert {g.target for g in left.groups} == {"mark_a"}
    assert without_contacts(left) is left


@pytest.mark.parametrize("axis", [*np.eye(3), -np.eye(3)[2], np.array([0.6, 0.0, -0.8]), np.array([0.48, 0.6, 0.64])])
def test_z_rotation_maps_z_to_a_direction(axis):
    """The z axis of the rotation is the given direction, and the rotation is right-handed."""
    rotation = contacts._z_rotation(axis)
    np.testing.assert_allclose(rotation[:, 2], axis)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
