"""Which marks to touch next, and how: one mark more, and touches by all arms that a task needs most."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from basecal.cell import WORLD, Calibration, Cell, CellTarget, Recording, RobotState, Sample, Unknown
from basecal.cell.schema.touching import tip_shape
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import lengths, rotation_exp
from basecal.planning.feasible import reach_pose
from basecal.planning.plan import Offer, Plan, plan_for_task
from basecal.planning.poses import draw_in_ball
from basecal.planning.prospects import sketches
from basecal.planning.sketch import Sketch

NEXT_MARK = "next_mark"
"""Name of a mark that is not there yet."""

_PLACES = 8  # of the next mark that are tried, far from one another and from what was touched
_DRAWS = 400  # of places, before those out of reach are left out
_AWAY_M = 0.6  # [m] of the next mark from the middle of what was touched
_FARTHER = 1.05  # than any touch from the base: as far as an arm is known to reach
_TURN_RAD = 1.6  # [rad] of a tip from a rotation that was recorded
_TOUCHES = 16  # of each mark by each tip that are tried


def plan_touches(
    cell: Cell,
    recording: Recording,
    calibration: Calibration | None,
    points_m: Array,
    tolerance_m: float | None = None,
    count: int | None = None,
    seed: int = 0,
) -> Plan:
    """The touches to record for a task, with the place of one mark more if that is better.

    Args:
        cell: The cell.
        recording: Touches that count, and show where the arms reach.
        calibration: Of them; None if nothing is calibrated, and the cell's own guesses are taken.
        points_m: (n, 3) the task in the reference's base [m].
        tolerance_m: The error that 95 of 100 are to stay below [m].
        count: How many touches; as many as the tolerance needs where None.
        seed: Of the draws.

    Raises:
        InputError: if no tip of the cell has touched anything, or a transform has no guess.
    """
    rng = np.random.default_rng([seed, 31])
    known = sketches(cell, calibration)[0]
    touches = list(_touches(known, recording))
    if not touches:
        raise InputError("a plan of touches begins at touches: import or capture some of each arm first")
    plans = []
    for place in (None, *_places(known, touches, rng)):
        wider = cell if place is None else _with_mark(cell, place)
        offers = _offers(sketches(wider, calibration)[0], touches, rng)
        size = len({tip for tip, _ in touches})
        found = plan_for_task(wider, recording, calibration, points_m, tolerance_m, count, seed, offers, size)
        plans.append(found if place is None else replace(found, marks={NEXT_MARK: place}))
    return min(plans, key=lambda plan: (plan.needed or np.inf, plan.expected_m or np.inf))


def _touches(sketch: Sketch, recording: Recording) -> Iterator[tuple[str, RobotState]]:
    """Tips that touched, and where their robots were."""
    tips = {name: camera.on for name, camera in sketch.cell.cameras.items() if camera.kind == "tip"}
    for sample in recording.samples:
        for seen in sample.observations:
            for name in {seen.camera, seen.target} & tips.keys():
                if tips[name] in sample.robots:
                    yield name, sample.robots[tips[name]]


def _places(sketch: Sketch, touches: Sequence[tuple[str, RobotState]], rng: np.random.Generator) -> list[Array]:
    """Places (3,) of a mark that all arms reach, far from one another and from what was touched."""
    robots = {tip: sketch.cell.cameras[tip].on for tip, _ in touches}
    touched = np.array([sketch.body_pose(tip, {robots[tip]: state}).translation for tip, state in touches])
    drawn = touched.mean(0) + _AWAY_M * draw_in_ball(rng, _DRAWS)
    for tip, robot in robots.items():
        base = sketch.world_from_base(robot).translation
        far = lengths(touched[[name == tip for name, _ in touches]] - base).max()
        drawn = drawn[lengths(drawn - base) < _FARTHER * far]
    places, apart = list[Array](), lengths(drawn[:, None] - touched).min(1)
    while len(places) < _PLACES and len(drawn):
        places.append(drawn[int(np.argmax(apart))])
        apart = np.minimum(apart, lengths(drawn - places[-1]))
    return places


def _with_mark(cell: Cell, place: Array) -> Cell:
    mark = CellTarget(NEXT_MARK, WORLD, Unknown("free", SE3(np.eye(3), place)), tip_shape("mark"))
    return replace(cell, targets={**cell.targets, NEXT_MARK: mark})


def _offers(sketch: Sketch, touches: Sequence[tuple[str, RobotState]], rng: np.random.Generator) -> list[Offer]:
    """Touches of each mark by each tip in turn, so that those of one mark follow one another."""
    recorded: dict[str, list[RobotState]] = {}
    for tip, state in touches:
        recorded.setdefault(tip, []).append(state)
    cell = sketch.cell
    marks = [
        name for name, target in cell.targets.items() if target.target is not None and target.target.kind == "mark"
    ]
    offers = list[Offer]()
    for mark in marks:
        tried = {tip: _touch_states(sketch, (tip, mark), states, rng) for tip, states in recorded.items()}
        for group in zip(*tried.values(), strict=False):
            for tip, state in zip(tried, group, strict=True):
                sample = Sample(0, robots={cell.cameras[tip].on: state})
                offers.append((replace(sketch, view=(tip, mark)), [sample]))
    return offers


def _touch_states(
    sketch: Sketch, view: tuple[str, str], states: Sequence[RobotState], rng: np.random.Generator
) -> list[RobotState]:
    """States of a robot whose tip is at a mark, turned from those that were recorded."""
    tip, mark = view
    robot = sketch.cell.cameras[tip].on
    near = [states[k] for k in rng.integers(len(states), size=_TOUCHES)]
    turned = rotation_exp(_TURN_RAD * draw_in_ball(rng, _TOUCHES))
    rotation = SE3.stack([sketch.base_from_flange(robot, state) for state in near]).rotation @ turned
    mark_in_base = sketch.world_from_base(robot).inverse() @ sketch.body_pose(mark, {}).translation
    tip_in_flange = sketch.transforms[sketch.cell.mount_name(tip)].translation
    flanges = SE3(rotation, mark_in_base - rotation @ tip_in_flange)
    found = (reach_pose(sketch.cell.robots[robot], flanges[k], state) for k, state in enumerate(near))
    return [state for state in found if state is not None]
