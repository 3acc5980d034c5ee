"""Clock offset: poses are read earlier or later than images by a constant time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from basecal.effects.faces.candidates import Candidates, Moves, Views, one_candidate, robot_moves
from basecal.effects.faces.effect import AGAIN, SECOND, Effect, FoundEffect, SimulatedFault, Words, format_with_sigma
from basecal.geometry import Array


def candidates(views: Views) -> Iterator[Candidates]:
    """Candidates: the clock of each camera against all robots, and of each robot on a path against the others."""
    for name, late in delay_moves(views):
        if "clock_offset" not in views.estimated_effects.get(name, ()):
            yield one_candidate("clock-offset", name, "s" if views.has_times else "samples", late)


def delay_moves(views: Views) -> Iterator[tuple[str, Moves]]:
    """Name of each camera or robot whose clock may be offset, and moves of the views by a delay of the poses."""
    velocity = {robot: views.velocity(robot) for robot in views.robots}
    paths = {robot: v for robot, v in velocity.items() if v is not None}
    if not paths:
        return
    groups = views.groups

    def time_jacobian(views: Views, k: int, robot: str) -> Array:
        """Derivatives of a group's views with respect to a delay of a robot's poses, (n, 6, 1)."""
        return views.flange_jacobian(k, robot) @ paths[robot][views.sample_indices(groups[k])][..., None]

    for camera in sorted({g.camera for g in groups}):
        robots = [[r for r in paths if g.robot_end(r)] if g.camera == camera else [] for g in groups]
        if any(robots):
            late = ([time_jacobian(views, k, r) for r in names] for k, names in enumerate(robots))
            yield camera, tuple(np.sum(each, axis=0) if each else None for each in late)
    for robot in paths if len(paths) > 1 else ():
        yield robot, robot_moves(views, robot, time_jacobian)


def is_late(effect: FoundEffect) -> bool:
    """Whether a device lags: stamps of its images are too late, or its poses are read too early."""
    return bool(np.sign(effect.size[0]) == (-1 if effect.is_camera else 1))


def words(effect: FoundEffect) -> Words:
    """Describe the time by which a device lags or leads."""
    factor, unit = (1e3, "ms") if effect.unit == "s" else (1.0, "samples")
    amount = format_with_sigma(abs(factor * effect.size[0]), factor * effect.sigma)
    kind, relation = "Images" if effect.is_camera else "Poses", "lag behind" if is_late(effect) else "run ahead of"
    what = f"{kind} of {effect.about} {relation} the other devices by {amount} {unit}."
    return Words("clock-offset", what, ("Record while all devices are at rest, or correct the stamps.", AGAIN))


EFFECT = Effect(
    "clock_offset",
    candidates=candidates,
    words=words,
    fault=SimulatedFault("clock-offset", "s", SECOND, 0.2, "the camera's clock is ahead of the arms'"),
    elsewhere={
        "statement": "basecal.cell.cell",
        "size": "basecal.estimation.noise.hyperpriors: jitter of stamps",
        "unknown": "basecal.accuracy.clocks",
        "random": "basecal.estimation.streams.jitter",
        "map": "basecal.accuracy.clocks.correction widens the answer by it",
    },
)
