"""Planning of touches: the position of one additional mark, and the most informative touches of all arms."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from basecal.cell import WORLD, Calibration, Cell, CellTarget, Recording, RobotState, Sample, Unknown
from basecal.cell.schema.touching import point_shape
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import lengths, rotation_exp
from basecal.planning.candidates import draw_in_ball
from basecal.planning.feasible import reach_poses
from basecal.planning.plan import Offer, Plan, least_variance_m2, plan_for_task
from basecal.planning.prospects import sketches
from basecal.planning.sketch import Sketch

NEXT_MARK = "next_mark"
"""Name of the additional mark, which does not exist yet."""

PLACES = 48
"""Number of tried positions of the next mark, far from one another and from recorded touches."""

ROTATIONS = 100
"""Number of tried touches of each mark by each tip."""

_DRAWN_POSITIONS, _KEPT_POSITIONS = 40_000, 400  # drawn positions, and the number kept of those in reach of all arms
_LARGEST_OFFSET_M = 0.6  # largest distance of the next mark from the mean of the recorded touches
_REACH_FACTOR = 1.05  # times the largest distance of a touch from the base: assumed reach of an arm
_LARGEST_ROTATION_RAD = 1.6  # largest rotation of a tip from a recorded rotation
_COMPARED_TOUCHES = 12  # number of touches for the comparison of positions if `count` is None


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
    """Plan the touches to record for a task, with the position of one additional mark if it lowers the error.

    Args:
        cell: The cell.
        recording: The recorded touches; they also show the reach of the arms.
        calibration: Calibration of the recording; None to use the guesses of the cell.
        points_m: (n, 3) task points in the reference's base [m].
        tolerance_m: Largest accepted 95 % quantile of the error [m].
        count: Number of touches; None for as many as the tolerance needs.
        seed: Seed of the random draws.
        places: Number of tried positions of the next mark.
        rotations: Number of tried rotations of each tip at each mark.

    Raises:
        InputError: if no tip of the cell has touched anything, or a transform has no guess.
    """
    rng = np.random.default_rng([seed, 31])
    known = sketches(cell, calibration)[0]
    touches = list(_touches(known, recording))
    if not touches:
        raise InputError("a plan of touches needs recorded touches: import or capture some of each arm first")
    marks = [name for name, mark in cell.targets.items() if mark.target is not None and mark.target.kind == "mark"]
    offers = _offers(known, marks, touches, rotations, rng)
    choices = [_Choice(cell, offers, {})]
    for place in _places(known, touches, places, rng):
        cell_with_mark = with_marks(cell, {NEXT_MARK: place})
        mark_offers = _offers(sketches(cell_with_mark, calibration)[0], [NEXT_MARK], touches, rotations, rng)
        choices.append(_Choice(cell_with_mark, [*mark_offers, *offers], {NEXT_MARK: place}))
    best = min(
        choices,
        key=lambda each: least_variance_m2(
            each.cell, recording, calibration, points_m, count or _COMPARED_TOUCHES, each.offers
        ),
    )
    plan = plan_for_task(best.cell, recording, calibration, points_m, tolerance_m, count, seed, best.offers)
    touched = {observation.target for sample in plan.samples for observation in sample.observations}
    return replace(plan, marks={name: place for name, place in best.marks.items() if name in touched})


class _Choice(NamedTuple):
    """A cell with or without the next mark, the touches to choose from, and the mark's position, (3,) [m], by name."""

    cell: Cell
    offers: list[Offer]
    marks: dict[str, Array]


def _touches(sketch: Sketch, recording: Recording) -> Iterator[tuple[str, RobotState]]:
    """Tips of recorded touches, with the states of their robots."""
    tips = {name: camera.on for name, camera in sketch.cell.cameras.items() if camera.kind == "tip"}
    for sample in recording.samples:
        for observation in sample.observations:
            for name in {observation.camera, observation.target} & tips.keys():
                if tips[name] in sample.robots:
                    yield name, sample.robots[tips[name]]


def _places(
    sketch: Sketch, touches: Sequence[tuple[str, RobotState]], count: int, rng: np.random.Generator
) -> list[Array]:
    """Positions of a mark, (3,) each [m], in reach of all arms, far from one another and from recorded touches."""
    robots = {tip: sketch.cell.cameras[tip].on for tip, _ in touches}
    touched = np.array([sketch.body_pose(tip, {robots[tip]: state}).translation for tip, state in touches])
    drawn = touched.mean(0) + _LARGEST_OFFSET_M * draw_in_ball(rng, _DRAWN_POSITIONS)
    for tip, robot in robots.items():
        base = sketch.world_from_base(robot).translation
        reach_m = lengths(touched[[name == tip for name, _ in touches]] - base).max()
        drawn = drawn[lengths(drawn - base) < _REACH_FACTOR * reach_m]
    drawn, places = drawn[:_KEPT_POSITIONS], list[Array]()
    distances = lengths(drawn[:, None] - touched).min(1)
    for _ in range(min(count, len(drawn))):
        places.append(drawn[int(np.argmax(distances))])
        distances = np.minimum(distances, lengths(drawn - places[-1]))
    return places


def with_marks(cell: Cell, marks: Mapping[str, Array]) -> Cell:
    """The cell with additional free marks at guessed positions, (3,) each [m]."""
    targets = {
        name: CellTarget(name, WORLD, Unknown("free", SE3(np.eye(3), place)), point_shape("mark"))
        for name, place in marks.items()
    }
    return replace(cell, targets={**cell.targets, **targets})


def _offers(
    sketch: Sketch,
    marks: Sequence[str],
    touches: Sequence[tuple[str, RobotState]],
    count: int,
    rng: np.random.Generator,
) -> list[Offer]:
    """Draw touches of each mark by each tip."""
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
    """Robot states with the tip at the mark, with rotations drawn near recorded ones."""
    tip, mark = sketch.view
    robot = sketch.camera.on
    rotations = rotation_exp(_LARGEST_ROTATION_RAD * draw_in_ball(rng, len(states)))
    rotation = SE3.stack([sketch.base_from_flange(robot, state) for state in states]).rotation @ rotations
    mark_in_base = sketch.world_from_base(robot).inverse() @ sketch.body_pose(mark, {}).translation
    tip_in_flange = sketch.transforms[sketch.cell.mount_name(tip)].translation
    flanges = SE3(rotation, mark_in_base - rotation @ tip_in_flange)
    return [state for state in reach_poses(sketch.cell.robots[robot], flanges, states) if state is not None]
