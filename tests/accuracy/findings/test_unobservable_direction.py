"""Tests of `unobservable-direction`: wording for each degenerate motion, and good verdicts for general motion."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.motion_cells import (
    ONE_AXIS,
    PLANAR,
    SCARA,
    SHIFTS,
    recorded,
    recorded_arm,
    still,
    wobbling,
)
from tests.touch_cells import MARKS, touch_cell, touch_lines
from tests.touch_cells import recorded as touched

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.findings import unobservable_direction
from basecal.accuracy.findings.unobservable_direction import touch_advice, unobservable_by_poses
from basecal.cell import Calibration, Recording, RobotState, Unknown
from basecal.estimation.observability.null_space import NullDirection
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.estimation.settings import DEFAULT, Settings
from basecal.estimation.solve import solve_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, SimulatedCell, simulate
from quick import quick

BASE, CAMERA, BOARD = "eye_base_from_hand_base", "eye_flange_from_wrist", "hand_flange_from_board"
SEEN = {"charuco": Scenario(samples=20), "led": Scenario(samples=30, target="led")}


def findings(calibration: Calibration, code: str) -> str:
    return " | ".join(f.message for f in calibration.findings if f.code == code)


EXACT = Settings(robot_noise="stated")  # robot motion is independent of robot noise


def calibrate_cell(made: SimulatedCell, settings: Settings = EXACT) -> Calibration:
    return calibrate(made.cell, made.recording, settings)


@pytest.mark.journey
@pytest.mark.parametrize("target", quick(SEEN, ["charuco"]))
def test_general_motion_is_good(target):
    """Both arms that rotate about every axis give the verdict good, for each target."""
    assert calibrate_cell(recorded(SEEN[target], 3), DEFAULT).verdict == "good"


DEGENERATE = {
    "shifts": (
        SHIFTS,
        f"ny translation of hand_base is unobservable (coupled with {BOARD}). hand only translates",
    ),
    "scara": (SCARA, "hand rotates about one axis, along (0.48, -0.60, 0.64) in hand_base"),
    "planar": (PLANAR, "hand rotates about one axis, along (0.48, -0.60, 0.64) in hand_base"),
    "one line": (ONE_AXIS, "otation of hand_base about the axis through"),
    "still": (
        still,
        f"any rotation of hand_base are unobservable (coupled with {BOARD}). hand never moves in",
    ),
}


@pytest.mark.journey
@pytest.mark.parametrize("wobble", [0.0, 1e-3])
@pytest.mark.parametrize("target", [pytest.param(t, marks=[pytest.mark.slow] * (t == "led")) for t in SEEN])
@pytest.mark.parametrize("kind", DEGENERATE)
def test_insufficient_hand_motion_is_refused(kind, target, wobble):
    """Insufficient hand motion is refused with the motion and the directions that it hides.

    Hidden transforms have no estimate; the still hand's noise is estimated.
    """
    move, message = DEGENERATE[kind]
    made = recorded(SEEN[target], 3, hand=wobbling(move, wobble) if wobble else move)
    found = calibrate_cell(made, DEFAULT if kind == "still" else EXACT)
    assert found.verdict == "refused"
    assert BASE not in found.transforms
    assert BOARD not in found.transforms
    assert "tate hand_flange_from_board as a prior or fixed" in findings(found, "unobservable-direction")
    if not wobble:
        # An LED on the axis of rotation, or in a hand at rest, never moves. That hides all rotations of the base,
        # coupled with a point or alone, and there may be no optimum.
        message = "ny rotation of hand_base" if target == "led" and kind in ("one line", "still") else message
        assert message in findings(found, "unobservable-direction")
        assert set(found.transforms) <= {CAMERA}


def test_hidden_axis_is_in_eye_base():
    """The translation that a planar hand hides is along its axis, in the eye's base frame."""
    made = recorded(SEEN["charuco"], 3, hand=SCARA)
    axis = made.truth[BASE].rotation @ np.array([0.48, -0.6, 0.64])
    axis *= np.sign(axis[np.argmax(np.abs(axis))])
    (unobservable,) = calibrate_cell(made).unobservable
    stated_axis = np.array([float(v) for v in unobservable.split("(")[1].split(")")[0].split(",")])
    np.testing.assert_allclose(stated_axis, axis, atol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["shifts", "scara"])
@pytest.mark.parametrize("stated", [True, False])
def test_pose_noise_is_no_motion(kind, stated):
    """Poses that rotate only by noise give no estimate, though pixels seem to determine the hidden direction."""
    move = DEGENERATE[kind][0]
    for seed in range(2):
        made = recorded(Scenario(samples=30), seed, hand=move)
        rng = np.random.default_rng(seed)
        samples = []
        for s in made.recording.samples:
            off = SE3.exp(rng.standard_normal(6) * 3e-4)
            hand = RobotState(s.robots["hand"].base_from_flange @ off)
            samples.append(replace(s, robots={**s.robots, "hand": hand}))
        noise = np.full(6, 3e-4) if stated else None
        robots = {**made.cell.robots, "hand": replace(made.cell.robots["hand"], noise=noise)}
        cell = replace(made.cell, robots=robots, pixel_px=0.2 if stated else None)
        found = calibrate(cell, Recording(tuple(samples)))
        assert found.verdict == "refused"
        assert BASE not in found.transforms
        assert "hand" in findings(found, "unobservable-direction")


def test_both_arms_are_named():
    """If both arms only translate, both are named once, and no transform is estimated."""
    found = calibrate_cell(recorded(SEEN["charuco"], 3, eye=SHIFTS, hand=SHIFTS))
    message = findings(found, "unobservable-direction")
    assert "eye only translates" in message
    assert "hand only translates" in message
    assert not found.transforms


def test_still_led_leaves_rotations_unobservable():
    """A still LED with a known offset shows its position, but leaves rotations of the base about it unobservable."""
    found = calibrate_cell(recorded(replace(SEEN["led"], target_mount="fixed"), 3, hand=still))
    assert found.unobservable == ("any rotation of hand_base",)
    assert "hand never moves in 30 samples. Move hand" in findings(found, "unobservable-direction")


@pytest.mark.journey
def test_translated_led_with_known_mounts_is_observable():
    """Translations alone are enough if both mounts are known, as in the paper.

    The convention of the still eye's pose stays ambiguous.
    """
    known = replace(SEEN["led"], camera_mount="fixed", target_mount="fixed")
    found = calibrate_cell(recorded(known, 3, eye=still, hand=SHIFTS))
    assert BASE in found.transforms
    assert {f.code for f in found.findings if f.severity != "info"} <= {"ambiguous-convention"}


@pytest.mark.journey
@pytest.mark.parametrize("axes", ["zyyy", "zyyyx"])
def test_arms_of_four_and_five_joints_are_good(axes):
    """A rotating base and parallel joints after it rotate the flange about two directions, so all is observable."""
    assert calibrate_cell(recorded_arm(SEEN["charuco"], 0, axes, 0.3)).verdict == "good"


def test_parallel_axes_get_no_rotation_advice():
    """An arm with parallel axes cannot rotate about another one; the advice is to state a known transform."""
    found = calibrate_cell(recorded_arm(SEEN["charuco"], 0, "zzz", 0.3))
    message = findings(found, "unobservable-direction")
    assert "all joint axes of hand are parallel" in message
    assert "tate hand_flange_from_board as a prior or fixed" in message
    assert "add poses" not in message


@pytest.mark.journey
def test_prior_held_direction_is_reported():
    """A planar hand with a prior on the board is good, and the one direction known only from the prior is reported."""
    made = recorded(replace(SEEN["charuco"], target_mount="prior"), 3, hand=SCARA)
    found = calibrate_cell(made)
    (finding,) = [f for f in found.findings if f.code == "prior-dominated"]
    assert finding.severity == "info"
    assert finding.about == (BOARD, BASE)
    assert "translation of board along" in finding.message
    assert f"{BASE} depends on it" in finding.message
    # Along one direction only the prior's 5 mm are known.
    assert np.linalg.norm(found[BASE].sigma_t) == pytest.approx(5e-3, rel=0.05)


@pytest.mark.journey
def test_improved_prior_is_not_reported():
    """With all arms moving, a prior of 5 mm and 50 mrad is improved by the data and not reported."""
    found = calibrate_cell(recorded(replace(SEEN["charuco"], target_mount="prior", camera_mount="prior"), 3))
    assert findings(found, "prior-dominated") == ""


@pytest.mark.journey
def test_poorly_known_base_is_doubtful():
    """A base known to eleven degrees, from a prior of 200 mrad, is doubtful, and the motion is named."""
    scenario = replace(SEEN["charuco"], target_mount="prior", mount_prior=(5e-3, 0.2))
    found = calibrate_cell(recorded(scenario, 3, hand=still))
    assert found.verdict == "doubtful"
    assert "hand never moves" in findings(found, "weak-direction")


@pytest.mark.slow
def test_degenerate_arm_is_named_if_solve_fails():
    """An arm with everything free that only translates is named from its poses, solved or not."""
    made = recorded(Scenario(samples=20), 0, hand=SHIFTS)
    robots = {n: replace(r, noise=np.full(6, 1e-4)) for n, r in made.cell.robots.items()}
    found = calibrate(replace(made.cell, robots=robots), made.recording)
    assert found.verdict == "refused"
    assert "ny translation of hand_base" in findings(found, "unobservable-direction")


def test_too_few_samples_report_robot_motion():
    """The refusal of two samples reports that the hand did not move between them."""
    made = simulate(Scenario(samples=2, arms="hand_still"), 0)
    found = calibrate(made.cell, made.recording)
    assert "hand never moves in 2 samples" in findings(found, "too-few-samples")


def problem_of(made: SimulatedCell):
    return build_problem(made.cell, made.recording)[0]


def test_unobservable_directions_follow_from_poses():
    """Recorded poses alone give an error about the base and its devices, with advice. Arms that rotate give none."""
    made = recorded(SEEN["charuco"], 3, hand=SHIFTS)
    (found,) = unobservable_by_poses(made.cell, problem_of(made))
    assert (found.code, found.severity, found.about) == ("unobservable-direction", "error", (BASE, BOARD))
    assert found.message.startswith("By the recorded poses alone, any translation of hand_base is unobservable")
    assert "hand only translates" in found.message
    assert f"state {BOARD} as a prior or fixed" in found.message
    assert unobservable_by_poses(made.cell, problem_of(recorded(SEEN["charuco"], 3))) == []


def test_known_mount_removes_unobservable_direction():
    """With the board's mount fixed, the base is observable however the hand moves."""
    made = recorded(replace(SEEN["charuco"], target_mount="fixed"), 3, hand=SHIFTS)
    assert unobservable_by_poses(made.cell, problem_of(made)) == []


@pytest.mark.parametrize("converged", [True, False])
@pytest.mark.parametrize("by_poses", [(), ("by poses",)])
def test_poses_are_checked_first_if_solve_failed(monkeypatch, converged, by_poses):
    """If the solve failed, the check by poses comes first; else, or if it finds nothing, the solution counts."""
    made = recorded(SEEN["charuco"], 3, hand=SHIFTS)
    solution = replace(solve_problem(problem_of(made), made.cell, EXACT), converged=converged)
    monkeypatch.setattr(unobservable_direction, "unobservable_by_poses", lambda *given: list(by_poses))
    found = unobservable_direction.unobservable_directions(SimpleNamespace(cell=made.cell, solution=solution))
    if by_poses and not converged:
        assert found == ["by poses"]
    else:
        assert [(each.code, each.about[0]) for each in found] == [("unobservable-direction", BASE)]


AXES = np.eye(3)


@pytest.mark.parametrize(
    ("names", "twists", "words"),
    [
        (
            ["mark_a", "mark_b"],
            "line",
            "Touch a third mark, at least 0.3 m off the line through mark_a and mark_b, with",
        ),
        (
            ["mark_a", "mark_b", "mark_c"],
            "line",
            "Touch a further mark, at least 0.3 m off the line through mark_a and mark_b",
        ),
        (["mark_a"], "all", "Touch three marks, 0.3 m apart and not on one line, with eye_tip and hand_tip."),
    ],
)
def test_next_mark_advice(names, twists, words):
    """The advised mark is off the line of two marks that is the axis; else three marks are advised."""
    marks = {name: MARKS[name] for name in names}
    cell = touch_cell(names)
    problem, _ = build_problem(cell, touched(cell, touch_lines(np.random.default_rng(0), 12, 0.0, marks)))
    known = {f"eye_base_from_{name}": SE3(AXES, at) for name, at in marks.items()}
    state = State({**dict.fromkeys(problem.unknowns, SE3.identity()), **known}, {}, np.zeros((0, 6)))
    axis = (MARKS["mark_b"] - MARKS["mark_a"]) / np.linalg.norm(MARKS["mark_b"] - MARKS["mark_a"])
    rotations = axis[None] if twists == "line" else AXES
    space = np.hstack([np.cross(MARKS["mark_a"], rotations), rotations])
    found = touch_advice(cell, problem, state, NullDirection("rotation", (BASE,), space))
    assert found is not None
    assert found[0][0].startswith(words)


def test_mark_beside_axis_is_not_on_line():
    """A mark touched by one arm only does not fix the axis; the line is through the two marks on it."""
    names = ["mark_c", "mark_a", "mark_b"]
    cell = touch_cell(names)
    lines = touch_lines(np.random.default_rng(0), 12, 0.0, {name: MARKS[name] for name in names})
    problem, _ = build_problem(cell, touched(cell, lines))
    known = {f"eye_base_from_{name}": SE3(AXES, MARKS[name]) for name in names}
    state = State({**dict.fromkeys(problem.unknowns, SE3.identity()), **known}, {}, np.zeros((0, 6)))
    axis = MARKS["mark_c"] - MARKS["mark_b"]
    axis = (axis / np.linalg.norm(axis))[None]
    space = np.hstack([np.cross(MARKS["mark_b"], axis), axis])
    found = touch_advice(cell, problem, state, NullDirection("rotation", (BASE,), space))
    assert found is not None
    assert "0.3 m off the line through mark_b and mark_c" in found[0][0]
    assert found[1] == "All marks that determine hand_base are on one line."


def test_other_directions_get_no_touch_advice():
    """A translation and a mount on a flange get advice about robot motion, not about touches."""
    cell = touch_cell(["mark_a"]).with_transform(BASE, Unknown())
    lines = touch_lines(np.random.default_rng(0), 12, 0.0, {"mark_a": MARKS["mark_a"]})
    problem, _ = build_problem(cell, touched(cell, lines))
    state = State(dict.fromkeys(problem.unknowns, SE3.identity()), {}, np.zeros((0, 6)))
    for kind, name in (("translation", BASE), ("rotation", "eye_flange_from_eye_tip")):
        assert touch_advice(cell, problem, state, NullDirection(kind, (name,), np.zeros((1, 6)))) is None


@pytest.mark.parametrize("size", [0.1, 1.0, 30.0])
def test_distance_of_mark_from_axis(size: float) -> None:
    """The distance of a mark from an axis is zero along it, and independent of the size and pitch of the twist."""
    rng = np.random.default_rng(0)
    axis = np.array([0.48, 0.6, 0.64])
    beside, at = np.cross(axis, [1.0, 0.0, 0.0]), rng.standard_normal(3)
    beside /= np.linalg.norm(beside)
    for pitch in (0.0, 0.7):
        twist = size * np.concatenate([np.cross(at, axis) + pitch * axis, axis])
        for far in (0.0, 0.3):
            point = at + 2.0 * axis + far * beside
            assert unobservable_direction._distance(point, twist) == pytest.approx(far, abs=1e-12)
