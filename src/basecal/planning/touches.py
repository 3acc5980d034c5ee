"""Which marks to touch next, and how: one mark more, and touches by all arms that a task needs most."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from basecal.cell import WORLD, Calibration, Cell, CellTarget, Recording, RobotState, Sample, Unknown
from basecal.cell.schema.touching import tip_shape
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import lengths, rotation_exp
from basecal.planning.candidates import draw_in_ball
from basecal.planning.feasible import reach_poses
from basecal.planning.plan import Offer, Plan, least_variance_m2, plan_for_task
from basecal.planning.prospects import sketches
from basecal.planning.sketch import Sketch

NEXT_MARK = "next_mark"
"""Name of a mark that is not there yet."""

PLACES = 48
"""Places of the next mark that are tried, far from one another and from what was touched."""

ROTATIONS = 100
"""Touches of each mark by each tip that are tried."""

_DRAWS, _REACHED = 40_000, 400  # places, and of these as many as are in reach of all arms, which may be few
_AWAY_M = 0.6  # [m] of the next mark from the middle of what was touched
_FARTHER = 1.05  # than any touch from the base: as far as an arm is known to reach
_TURN_RAD = 1.6  # [rad] of a tip from a rotation that was recorded
_COUNT = 12  # of touches by which places are compared if their number is to be found


def plan_touches(
    cell: Cell,
    recording: Recording,
    calibration: Calibration | None,
    points_m: Array,
    tolerance_m: float | None = None,
    count: int | None = None,
    seed: int = 0,
    places: int = PLACES,
    rotations: int = ROTATIONS,
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
        places: Of the next mark that are tried.
        rotations: Of each tip at each mark that are tried.

    Raises:
        InputError: if no tip of the cell has touched anything, or a transform has no guess.
    """
    rng = np.random.default_rng([seed, 31])
    known = sketches(cell, calibration)[0]
    touches = list(_touches(known, recording))
    if not touches:
        raise InputError("a plan of touches begins at touches: import or capture some of each arm first")
    marks = [name for name, mark in cell.targets.items() if mark.target is not None and mark.target.kind == "mark"]
    offers = _offers(known, marks, touches, rotations, rng)
    choices = [_Choice(cell, offers, {})]
    for place in _places(known, touches, places, rng):
        wider = with_marks(cell, {NEXT_MARK: place})
        more = _offers(sketches(wider, calibration)[0], [NEXT_MARK], touches, rotations, rng)
        choices.append(_Choice(wider, [*more, *offers], {NEXT_MARK: place}))
    best = min(
        choices,
        key=lambda each: least_variance_m2(each.cell, recording, calibration, points_m, count or _COUNT, each.offers),
    )
    found = plan_for_task(best.cell, recording, calibration, points_m, tolerance_m, count, seed, best.offers)
    touched = {seen.target for sample in found.samples for seen in sample.observations}
    return replace(found, marks={name: place for name, place in best.marks.items() if name in touched})


class _Choice(NamedTuple):
    """A cell with or without the next mark, touches to choose from, and where that mark is."""

    cell: Cell
    offers: list[Offer]
    marks: dict[str, Array]


def _touches(sketch: Sketch, recording: Recording) -> Iterator[tuple[str, RobotState]]:
    """Tips that touched, and where their robots were."""
    tips = {name: camera.on for name, camera in sketch.cell.cameras.items() if camera.kind == "tip"}
    for sample in recording.samples:
        for seen in sample.observations:
            for name in {seen.camera, seen.target} & tips.keys():
                if tips[name] in sample.robots:
                    yield name, sample.robots[tips[name]]


def _places(
    sketch: Sketch, touches: Sequence[tuple[str, RobotState]], count: int, rng: np.random.Generator
) -> list[Array]:
    """Places (3,) of a mark that all arms reach, far from one another and from what was touched."""
    robots = {tip: sketch.cell.cameras[tip].on for tip, _ in touches}
    touched = np.array([sketch.body_pose(tip, {robots[tip]: state}).translation for tip, state in touches])
    drawn = touched.mean(0) + _AWAY_M * draw_in_ball(rng, _DRAWS)
    for tip, robot in robots.items():
        base = sketch.world_from_base(robot).translation
        far = lengths(touched[[name == tip for name, _ in touches]] - base).max()
        drawn = drawn[lengths(drawn - base) < _FARTHER * far]
    drawn, places = drawn[:_REACHED], list[Array]()
    apart = lengths(drawn[:, None] - touched).min(1)
    for _ in range(min(count, len(drawn))):
        places.append(drawn[int(np.argmax(apart))])
        apart = np.minimum(apart, lengths(drawn - places[-1]))
    return places


def with_marks(cell: Cell, marks: Mapping[str, Array]) -> Cell:
    """The cell with free marks about places, (3,) each [m]."""
    made = {
        name: CellTarget(name, WORLD, Unknown("free", SE3(np.eye(3), place)), tip_shape("mark"))
        for name, place in marks.items()
    }
    return replace(cell, targets={**cell.targets, **made})


def _offers(
    sketch: Sketch,
    marks: Sequence[str],
    touches: Sequence[tuple[str, RobotState]],
    count: int,
    rng: np.random.Generator,
) -> list[Offer]:
    """Touches of each mark by each tip."""
    recorded: dict[str, list[RobotState]] = {}
    for tip, state in touches:
        recorded.setdefault(tip, []).append(state)
    offers = list[Offer]()
    for mark, (tip, states) in product(marks, recorded.items()):
        near = [states[k] for k in rng.integers(len(states), size=count)]
        view, robot = replace(sketch, view=(tip, mark)), sketch.cell.cameras[tip].on
        offers.append((view, [Sample(0, robots={robot: state}) for state in _touch_states(view, near, rng)]))
    return offers


def _touch_states(sketch: Sketch, states: Sequence[RobotState], rng: np.random.Generator) -> list[RobotState]:
    """States of a robot whose tip is at a mark, turned from those that were recorded."""
    tip, mark = sketch.view
    robot = sketch.camera.on
    turned = rotation_exp(_TURN_RAD * draw_in_ball(rng, len(states)))
    rotation = SE3.stack([sketch.base_from_flange(robot, state) for state in states]).rotation @ turned
    mark_in_base = sketch.world_from_base(robot).inverse() @ sketch.body_pose(mark, {}).translation
    tip_in_flange = sketch.transforms[sketch.cell.mount_name(tip)].translation
    flanges = SE3(rotation, mark_in_base - rotation @ tip_in_flange)
    return [state for state in reach_poses(sketch.cell.robots[robot], flanges, states) if state is not None]
