"""Tests of the wording of robot motion, and of the advice to add motion."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.motion_cells import arm

from basecal.accuracy.phrases.robot_motion import (
    advise_motion,
    advise_observability,
    describe_motion,
    describe_poor_motions,
    has_little_rotation,
)
from basecal.cell import Recording, Robot, Target
from basecal.estimation.observability.motions import Motion, motions
from basecal.estimation.problem.build import build_problem
from basecal.simulation import Scenario, simulate

BASE, CAMERA, BOARD = "eye_base_from_hand_base", "eye_flange_from_wrist", "hand_flange_from_board"


def make_motion(*turn_rad, robot="hand", travel=1.0, samples=20, orientations=3, axis=(0.0, 0.0, 1.0)):
    """A motion with these rotations about its first axis and two others."""
    axes = np.eye(3)
    axes[:, 0] = axis
    turns = np.array([*turn_rad, 0.0, 0.0, 0.0][:3])
    return Motion(robot, samples, travel, turns, axes, orientations, np.zeros((0, 6)))


@pytest.fixture(scope="module")
def made():
    return simulate(Scenario(samples=5), 0)


@pytest.fixture(scope="module")
def problem(made):
    return build_problem(made.cell, made.recording)[0]


@pytest.mark.parametrize(("turn", "poor"), [(0.149, True), (0.151, False)])
def test_second_axis_needs_minimum_rotation(turn, poor):
    """A second axis counts from a rotation of 0.15 rad on."""
    assert has_little_rotation(make_motion(0.5, turn)) is poor


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (make_motion(0.0, travel=0.0), "hand never moves in 20 samples"),
        (make_motion(0.0, travel=0.0, samples=1), "hand never moves in 1 sample"),
        (make_motion(0.0), "hand only translates"),
        (make_motion(2e-3), "hand only translates, it rotates by at most 0.11 deg"),
        (make_motion(8e-5), "hand only translates"),
        (make_motion(0.5, 0.0, orientations=2), "hand has two orientations only"),
        (make_motion(0.5, 0.0), "hand rotates about one axis, along (0.00, 0.00, 1.00) in hand_base"),
        (
            make_motion(0.5, 0.0, axis=(-4e-3, 4e-3, 1)),
            "hand rotates about one axis, along (0.00, 0.00, 1.00) in hand_base",
        ),
        (
            make_motion(0.5, 0.0, axis=(0.6, 0.0, -0.8)),
            "hand rotates about one axis, along (-0.60, 0.00, 0.80) in hand_base",
        ),
        (
            make_motion(0.5, 5e-3),
            "hand rotates about one axis, along (0.00, 0.00, 1.00) in hand_base, "
            "and by at most 0.29 deg about any other",
        ),
        (
            make_motion(0.5, 0.1),
            "hand rotates mostly about one axis, along (0.00, 0.00, 1.00) in hand_base, "
            "and by at most 5.73 deg about any other",
        ),
        (make_motion(0.5, 0.2), "hand rotates by up to 29 deg, and 11 deg about a second axis"),
    ],
)
def test_wording_of_motions(motion, words):
    """Motions are described from rest to rotation about two axes."""
    assert describe_motion(motion) == words


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (make_motion(0.0, travel=0.0), "Move hand, and rotate it about two axes that are not parallel"),
        (make_motion(0.0), "Add poses that rotate hand about two axes that are not parallel"),
        (make_motion(0.14, 0.1), "Rotate hand further, by 30 deg and more, about two axes that are not parallel"),
        (make_motion(0.16, 0.1), "Add poses that rotate hand by 30 deg and more about another axis"),
    ],
)
def test_advice_names_motion_or_mount(made, problem, motion, words):
    """The advice names the motion to record, or the carried mount to state if it is not fixed."""
    assert advise_motion(made.cell, problem, motion) == f"{words}, or state {BOARD} as a prior or fixed."
    fixed = replace(problem, unknowns={**problem.unknowns, BOARD: replace(problem.unknowns[BOARD], status="fixed")})
    assert advise_motion(made.cell, fixed, motion) == f"{words}."


@pytest.mark.parametrize(("axes", "parallel"), [("zzz", True), ("zyz", False), ("zxz", False)])
def test_parallel_axes_get_no_rotation_advice(made, problem, axes, parallel):
    """An arm with parallel axes is advised to state a known transform, unless it is at rest."""
    hand = replace(made.cell.robots["hand"], chain=arm(*axes))
    cell = replace(made.cell, robots={**made.cell.robots, "hand": hand})
    advice = advise_motion(cell, problem, make_motion(0.5, 0.0))
    assert ("all joint axes of hand are parallel" in advice) == parallel
    assert f"tate {BOARD} as a prior or fixed" in advice
    assert advise_motion(cell, problem, make_motion(0.0, travel=0.0)).startswith("Move hand")
    assert advise_motion(cell, problem, make_motion(0.0)).startswith("Add poses that rotate hand about two axes")
    fixed = replace(problem, unknowns={**problem.unknowns, BOARD: replace(problem.unknowns[BOARD], status="fixed")})
    if parallel:
        assert f"State {BASE} as a prior or fixed" in advise_motion(cell, fixed, make_motion(0.5, 0.0))


def test_cause_is_poor_motion_of_unobservable_transform(made, problem):
    """The cause is the poor motion of the involved robots, with shared advice for several; else it is the views."""
    good, poor, eye = make_motion(0.9, 0.9, robot="eye"), make_motion(0.0), make_motion(0.0, robot="eye")

    def cause(names, *of):
        return advise_observability(made.cell, problem, {m.robot: m for m in of}, names)

    one = cause([BASE], good, poor)
    assert one == ((advise_motion(made.cell, problem, poor),), "hand only translates.")
    both = cause([BASE], eye, poor)
    do = f"Rotate each about two axes that are not parallel, or state {CAMERA} and {BOARD} as a prior or fixed."
    assert both == ((do,), "eye only translates, and hand only translates.")
    assert cause([BOARD, BASE], eye, poor) == one
    assert cause([CAMERA], good, poor)[1].startswith("The views are too few or too similar")
    assert cause([BASE], good, make_motion(0.9, 0.9))[1].startswith("The views are too few or too similar")


def test_missing_views_are_cause(made):
    """Missing views are the cause for a robot without views, and for bases unrelated to the reference."""
    third = {**made.cell.robots, "third": Robot("third")}

    def cause(cell, *names):
        return advise_observability(cell, build_problem(cell, made.recording)[0], {}, names)

    unseen = "eye_base_from_third_base"
    do, why = cause(replace(made.cell, robots=third), unseen)
    assert why == f"No view depends on {unseen}."
    assert do == ("Record views that depend on it, or state it as fixed.",)
    bases = "third_base_from_eye_base", "third_base_from_hand_base"
    do, why = cause(replace(made.cell, robots=third, reference="third", bases={}), *bases)
    assert why == "No view relates eye_base and hand_base to third_base."
    assert do == (f"Record views that relate them to third_base, or state {bases[0]} as a prior or fixed.",)


@pytest.mark.parametrize(("points", "is_cause"), [(1, False), (2, True), (4, True), (5, False)])
def test_collinear_points_are_cause_of_rotation(points, is_cause):
    """Points on one line are the cause of an unobservable rotation, e.g. a single row of a board."""
    shape = Target("points", np.arange(5), 0.05 * np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [0, 1, 0]]))
    seen = simulate(Scenario(samples=5, target="points", board=shape), 0)
    samples = (
        replace(s, observations=tuple(replace(o, ids=o.ids[:points], pixels=o.pixels[:points]) for o in s.observations))
        for s in seen.recording.samples
    )
    problem = build_problem(seen.cell, Recording(tuple(samples)))[0]
    do, why = advise_observability(seen.cell, problem, {}, (BOARD,))
    assert (why == "All observed points of board are on one line.") is is_cause
    assert do[0].startswith("Add a point beside the line") is is_cause


def test_poor_motions_of_recording():
    """Robots that hardly rotate about a second axis are described; well-moving ones are not."""
    still = simulate(Scenario(samples=8, arms="hand_still"), 0)
    problem, _ = build_problem(still.cell, still.recording)
    assert describe_poor_motions(problem) == "hand never moves in 8 samples"
    free = simulate(Scenario(samples=20), 0)
    assert describe_poor_motions(build_problem(free.cell, free.recording)[0]) == ""
    assert set(motions(problem)) == {"eye", "hand"}


def test_robot_without_kinematics_has_no_parallel_axes(made, problem):
    """A robot recorded by poses may rotate freely, so it gets motion advice."""
    cell = SimpleNamespace(robots={"hand": SimpleNamespace(chain=None)})
    assert advise_motion(cell, problem, make_motion(0.5, 0.0)).startswith("Add poses")


def test_fixed_mount_is_not_requested():
    """For two arms that each rotate about one axis, only the free mount is advised to be stated."""
    known = simulate(Scenario(samples=5, camera_mount="fixed"), 0)
    problem = build_problem(known.cell, known.recording)[0]
    both = {"eye": make_motion(0.5, robot="eye"), "hand": make_motion(0.5, 0.01)}
    do, why = advise_observability(known.cell, problem, both, (BASE,))
    assert do == (f"Rotate each about two axes that are not parallel, or state {BOARD} as a prior or fixed.",)
    assert why == (
        "eye rotates about one axis, along (0.00, 0.00, 1.00) in eye_base, and hand rotates mostly about one axis, "
        "along (0.00, 0.00, 1.00) in hand_base, and by at most 0.57 deg about any other."
    )
