"""Tests of `impossible_input` and `impossible_answer` at their limits."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.pose_problem import pose_problem
from tests.shared.declared import declared
from tests.shared.rewriting import resized, scaled, with_joints, with_points, with_robots, with_targets

from basecal.accuracy.input_check.plausibility import (
    impossible_answer,
    impossible_input,
    impossible_reading,
    likely_unit,
)
from basecal.cell import (
    Cell,
    CellCamera,
    CellTarget,
    PointObservation,
    PoseObservation,
    Recording,
    Robot,
    RobotState,
    Sample,
    Unknown,
)
from basecal.cell.targets.points import points_target
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

BASE, CAMERA, BOARD = "eye_base_from_hand_base", "eye_flange_from_wrist", "eye_base_from_board"


def at(x=0.0, z=0.0):
    return SE3(np.eye(3), np.array([x, 0.0, z]))


def find_impossible_input(robots=(), observations=((),), size=0.2, chain=None):
    cell = Cell(
        "eye",
        {"eye": Robot("eye", chain=chain)},
        cameras={"wrist": CellCamera("wrist", "eye")},
        targets={"board": CellTarget("board", "world", target=points_target([[0, 0, 0], [size, 0, 0]]))},
    )
    samples = [Sample(k, robots={"eye": state}) for k, state in enumerate(robots)]
    samples += [Sample(100 + k, observations=tuple(seen)) for k, seen in enumerate(observations)]
    return impossible_input(cell, Recording(tuple(samples)))


@pytest.mark.parametrize(("far", "found"), [(0.019, True), (0.021, False), (4.9, False), (5.1, True)])
def test_reach_limits_of_flange(far, found):
    """The farthest flange must be 2 cm to 5 m from its base; nearer poses have no effect."""
    assert find_impossible_input([RobotState(at(far)), RobotState(at(far))]) == (
        (f"flange of eye {far:.3g} m",) if found else ()
    )


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        ([0.0, 1.09], ""),
        ([0.0, 1.11], "a joint of eye 0.11 rad beyond its limit"),
        ([-1.09, 0.0], ""),
        ([-1.11, 0.0], "a joint of eye 0.11 rad beyond its limit"),
        ([0.0, -6.9], "a joint of eye 5.9 rad beyond its limit"),
        ([0.0, -7.0], "a joint of eye at 7 rad"),
    ],
)
def test_joint_limits_have_tolerance(joints, words):
    """Joints must be within 0.1 rad of limits of 1 rad, and within 2.2 half turns whatever the limits."""
    chain = SimpleNamespace(lower=-np.ones(2), upper=np.ones(2))
    states = [RobotState(joints_rad=np.zeros(2)), RobotState(joints_rad=np.array(joints))]
    assert find_impossible_input(states, chain=chain) == ((words,) if words else ())
    assert find_impossible_input(states) == ()


def seen_points(z=1.0):
    return PointObservation("wrist", "board", np.array([0]), np.array([[0.0, 0.0, z]]))


@pytest.mark.parametrize(("size", "found"), [(1.9e-3, True), (2.1e-3, False), (4.9, False), (5.1, True)])
def test_size_limits_of_targets(size, found):
    """Targets whose points are seen must be 2 mm to 5 m large."""
    assert find_impossible_input(observations=[[seen_points()]], size=size) == (
        (f"size of board {size:.3g} m",) if found else ()
    )
    assert find_impossible_input(observations=[[PoseObservation("wrist", "board", at(z=1.0))]], size=size) == ()


def test_target_without_extent_has_no_size_limit():
    """A single point and a seen target without a statement have no size.

    A target far from its origin has its extent.
    """
    cell = Cell("eye", {"eye": Robot("eye")}, cameras={"wrist": CellCamera("wrist", "eye")}, targets={
        name: CellTarget(name, "world", target=of)
        for name, of in (("light", points_target([[0, 0, 0]])), ("bare", None), ("far", points_target(
            [[0, 0, 9.0], [0.1, 0, 9.0]]
        )))
    })  # fmt: skip
    seen = [replace(seen_points(0.5), target=name) for name in ("light", "bare", "far")]
    assert impossible_input(cell, Recording((Sample(0, observations=tuple(seen)),))) == ()


@pytest.mark.parametrize(("distance", "found"), [(0.019, True), (0.021, False), (19.9, False), (20.1, True)])
@pytest.mark.parametrize("kind", ["pose", "points"])
def test_distance_limits_of_targets(kind, distance, found):
    """The median distance of a target over its views must be 2 cm to 20 m."""
    one = [PoseObservation("wrist", "board", at(z=distance))] if kind == "pose" else [seen_points(distance)]
    far = [seen_points(1e3)]
    words = (f"distance to the target {distance:.3g} m",) if found else ()
    assert find_impossible_input(observations=[one, one, far]) == words


@pytest.mark.parametrize(("behind", "found"), [(4, False), (5, True)])
def test_targets_behind_camera_are_impossible(behind, found):
    """Targets are reported as behind the camera if more than four fifths of the views are."""
    views = [[seen_points(-0.5 if k < behind else 0.5)] for k in range(5)]
    assert find_impossible_input(observations=views) == (("targets behind the camera",) if found else ())


def find_impossible_answer(status="free", on="hand", chain=None, more=(), **places):
    cell = Cell(
        "eye",
        {"eye": Robot("eye"), "hand": Robot("hand", chain=chain), **{name: Robot(name) for name in more}},
        bases={"hand": Unknown(status), **dict.fromkeys(more, Unknown("fixed"))},
        cameras={"wrist": CellCamera("wrist", "eye")},
        targets={"board": CellTarget("board", on)},
    )
    usual = {BASE: at(1.0), CAMERA: at(0.1), cell.mount_name("board"): at(0.1)}
    problem, state = pose_problem(np.zeros((2, 6)), np.ones(6))
    state.transforms["eye_base_from_target"] = at(z=1.0)
    transforms = {**usual, **places}
    views = SimpleNamespace(transforms=transforms, camera_from_target=state.camera_from_target)
    solved = SimpleNamespace(groups=problem.groups, stops=problem.stops, columns=dict.fromkeys(transforms))
    return impossible_answer(cell, SimpleNamespace(solution=SimpleNamespace(state=views, problem=solved)))


@pytest.mark.parametrize(("far", "found"), [(0.019, True), (0.021, False), (19.9, False), (20.1, True)])
def test_distance_limits_of_bases(far, found):
    """Bases that are not fixed must be 2 cm to 20 m apart."""
    assert find_impossible_answer(**{BASE: at(far)}) == ((f"{BASE} {far:.3g} m",) if found else ())
    assert find_impossible_answer("fixed", **{BASE: at(far)}) == ()


@pytest.mark.parametrize(("far", "found"), [(19.9, False), (20.1, True)])
def test_base_distance_uses_nearest_base(far, found):
    """The distance of a base is to the nearest other base, not the reference: a long row of arms exceeds any limit."""
    places = {BASE: at(300.0 + far), "eye_base_from_next_base": at(300.0), "eye_base_from_last_base": at(0.0)}
    assert find_impossible_answer(more=("next", "last"), **places) == ((f"{BASE} {300 + far:.3g} m",) if found else ())


@pytest.mark.parametrize(("far", "found"), [(0.0, False), (20.1, True)])
def test_bases_of_kinematic_chains_may_coincide(far, found):
    """Bases of arms with kinematic chains may coincide: two chains may begin at one link."""
    assert find_impossible_answer(chain=SimpleNamespace(), **{BASE: at(far)}) == (
        (f"{BASE} {far:.3g} m",) if found else ()
    )


@pytest.mark.parametrize(("far", "found"), [(0.0, False), (1.9, False), (2.1, True)])
def test_length_limits_of_mounts(far, found):
    """Mounts may be up to 2 m on a flange and up to 20 m on the world."""
    assert find_impossible_answer(**{CAMERA: at(far)}) == ((f"{CAMERA} {far:.3g} m",) if found else ())
    assert find_impossible_answer(on="world", **{BOARD: at(10 * far)}) == (
        (f"{BOARD} {10 * far:.3g} m",) if found else ()
    )


@pytest.mark.parametrize("target", ["pose", "points3d", "charuco"])
@pytest.mark.parametrize("factor", [1.0, 1e3])
def test_reading_has_same_limits_as_recording(target, factor):
    """A reading is held to the limits of its recording, whichever quantity is a thousand times too large."""
    made = simulate(Scenario(samples=5, target=target), 0)
    pairs = [
        (made.cell, with_robots(made.recording, {"eye": scaled(factor)})),
        (resized(made.cell, {"board": factor}) if target != "pose" else made.cell, made.recording),
        (made.cell, with_points(made.recording, -factor)),
    ]
    if target == "pose":
        pairs.append((made.cell, with_targets(made.recording, scaled(factor))))
    for cell, recording in pairs:
        assert impossible_reading(declared(cell, recording)) == impossible_input(cell, recording)


def test_joints_of_reading_have_same_limits():
    """Joints ten times too large are beyond their limits in a reading as in a recording."""
    made = simulate(Scenario(samples=5, joints=True), 0)
    far = with_joints(made.recording, "eye", 10.0)
    assert impossible_reading(declared(made.cell, far)) == impossible_input(made.cell, far) != ()


@pytest.mark.parametrize(
    ("length", "unit", "advice"),
    [
        (600.0, "millimetres", "Divide lengths by 1000 to convert them to metres."),
        (251.0, "millimetres", "Divide lengths by 1000 to convert them to metres."),
        (240.0, "another unit", "Convert lengths to metres: 240 mm are 0.24 m, 240 cm are 2.4 m."),
        (60.0, "another unit", "Convert lengths to metres: 60 mm are 0.06 m, 60 cm are 0.6 m, 60 inch are 1.5 m."),
        (19e3, "millimetres", "Divide lengths by 1000 to convert them to metres."),
        (21e3, "another unit", "State lengths in metres."),
    ],
)
def test_likely_unit_depends_on_usual_length(length, unit, advice):
    """The likely unit is one in which the length is usual, here up to 2.5 m; beyond 20 m of millimetres none is."""
    assert likely_unit(length, 2.5) == (unit, advice)
