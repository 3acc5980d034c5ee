"""Hypotheses of a cell and its recording that people mix up, each undone by a rewriting of what was given.

A hypothesis holds where the input means something else than its format says: flange_from_base written as
base_from_flange, millimetres as metres. It is never applied to the answer; it is fitted beside the declared one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np

from basecal.accuracy.input_check import rewriting
from basecal.accuracy.input_check.image_resolution import other_resolution
from basecal.cell import Cell, Observation, PixelObservation, PointObservation, PoseObservation, Recording, Unknown
from basecal.estimation.problem.correspondence import half_turn
from basecal.geometry import SE3

_MILLI = 1e-3  # metres in a millimetre
_SHIFTS = (1, -1, 2, -2)  # samples that a stream is late: one dropped or doubled image, or two
# What stands in a field q_xyzw: components written as w, x, y, z; and x, y, z, w turned round once too often.
_ORDERS = {"w, x, y, z": (1, 2, 3, 0), "turned from w, x, y, z though they were x, y, z, w": (3, 0, 1, 2)}

Rewritten = tuple[Cell, Recording]


@dataclass(frozen=True, eq=False)
class ConventionHypothesis:
    """One way to read a cell and its recording.

    Attributes:
        code: The finding's code.
        about: Names of robots, cameras and targets.
        words: What is so under this hypothesis, as the end of "It fits if ...".
        fix: What to do, in one line.
        tell: What would tell it from the declared one where both fit.
        apply: The cell and the recording that say so.
        nested: Whether it has the declared hypothesis as a special case and so never fits worse.
        by_order: Whether it goes by where samples stand among the others, so that `apply` needs all of them.
    """

    code: str
    about: tuple[str, ...]
    words: str
    fix: str
    tell: str
    apply: Callable[[Cell, Recording], Rewritten]
    nested: bool = False
    by_order: bool = False


AS_DECLARED = ConventionHypothesis("", (), "it is as declared", "", "", lambda cell, recording: (cell, recording))


def convention_hypotheses(cell: Cell, recording: Recording) -> list[ConventionHypothesis]:
    """All hypotheses that change this cell or recording, but for those with a number to be found."""
    kinds = {type(o) for s in recording.samples for o in s.observations}
    by_pose = given_by_pose(cell, recording)
    by_joints = _robots(cell, recording, "joints_rad")
    shifts = [by for by in _SHIFTS if abs(by) < len(recording.samples) // 3]
    return [
        *_of_directions(by_pose, PoseObservation in kinds),
        *_of_units(by_pose, by_joints, kinds),
        *_of_joints(by_joints),
        *_of_quaternions(by_pose, PoseObservation in kinds),
        *_of_exchanges(cell, by_pose, "poses"),
        *_of_exchanges(cell, by_joints, "joints"),
        *(shift(stream, by) for stream in streams([*by_pose, *by_joints]) for by in shifts),
        *_of_size_units(cell, kinds),
        *_of_symmetry(cell, PoseObservation in kinds),
        *_of_mirrors(kinds),
        *_of_lenses(cell, recording),
        *_of_fixed(cell),
    ]


def given_by_pose(cell: Cell, recording: Recording) -> list[str]:
    """Robots whose every state is a pose."""
    return _robots(cell, recording, "base_from_flange")


def _robots(cell: Cell, recording: Recording, field: str) -> list[str]:
    """Robots whose every state gives that field."""
    given: dict[str, bool] = {}
    for sample in recording.samples:
        for name, state in sample.robots.items():
            given[name] = given.get(name, True) and getattr(state, field) is not None
    return [name for name in cell.robots if given.get(name)]


def subsets(robots: list[str]) -> list[tuple[str, ...]]:
    """Each robot alone, and all of several together."""
    return [*((name,) for name in robots), *([tuple(robots)] if len(robots) > 1 else [])]


def listed(names: tuple[str, ...]) -> str:
    """Names in a sentence."""
    return " and ".join(names)


def of_robots(names: tuple[str, ...], pose_map: rewriting.PoseMap) -> Callable[[Cell, Recording], Rewritten]:
    """A rewriting of the recorded poses of robots."""
    return lambda cell, recording: (cell, rewriting.with_robots(recording, dict.fromkeys(names, pose_map)))


def of_targets(pose_map: rewriting.PoseMap) -> Callable[[Cell, Recording], Rewritten]:
    """A rewriting of all observed poses."""
    return lambda cell, recording: (cell, rewriting.with_targets(recording, pose_map))


def _of_directions(robots: list[str], poses: bool) -> Iterator[ConventionHypothesis]:
    for names in subsets(robots):
        who = listed(names)
        yield ConventionHypothesis(
            "robot-pose-inverted",
            names,
            f"the poses of {who} are inverted (flange_from_base)",
            f"write base_from_flange of {who}, or invert the poses",
            f"turn {who} further about two axes between samples",
            of_robots(names, rewriting.inverted),
        )
    if poses:
        yield ConventionHypothesis(
            "target-pose-inverted",
            (),
            "the poses of the target are inverted (target_from_camera)",
            "write camera_from_target, or invert the observed poses",
            "turn every arm further about two axes between samples",
            of_targets(rewriting.inverted),
        )


def _of_units(
    by_pose: list[str], by_joints: list[str], kinds: set[type[Observation]]
) -> Iterator[ConventionHypothesis]:
    for factor, words, advice in (
        (_MILLI, "in millimetres", "divide them by 1000"),
        (1 / _MILLI, "1000 times too small", "multiply them by 1000"),
    ):
        of = rewriting.scaled(factor)
        for names in subsets(by_pose):
            who = f"the poses of {listed(names)}"
            yield _unit(names, who, words, advice, of_robots(names, of))
        if PoseObservation in kinds:
            yield _unit((), "the observed poses", words, advice, of_targets(of))
        if PointObservation in kinds:
            yield _unit((), "the observed 3-D points", words, advice, _of_points(factor))
        if by_pose and not by_joints:
            yield _unit(tuple(by_pose), "all lengths, of robots and targets,", words, advice, _of_all(by_pose, factor))


def _unit(
    about: tuple[str, ...], who: str, words: str, advice: str, apply: Callable[[Cell, Recording], Rewritten]
) -> ConventionHypothesis:
    return ConventionHypothesis(
        "length-unit",
        about,
        f"{who} are {words}",
        f"lengths are in metres: {advice}",
        "give the size of something known, such as the target's points or a prior of a mount",
        apply,
    )


def _of_size_units(cell: Cell, kinds: set[type[Observation]]) -> Iterator[ConventionHypothesis]:
    if not kinds & {PixelObservation, PointObservation}:
        return
    for name, target in cell.targets.items():
        if target.target is not None and not target.target.is_point:
            yield ConventionHypothesis(
                "board-size",
                (name,),
                f"the size of {name} is in millimetres",
                "lengths are in metres: divide it by 1000",
                "move every arm further between samples",
                _resize(name, _MILLI),
            )


def _resize(name: str, factor: float) -> Callable[[Cell, Recording], Rewritten]:
    return lambda cell, recording: (resized(cell, {name: factor}), recording)


def _of_points(factor: float) -> Callable[[Cell, Recording], Rewritten]:
    return lambda cell, recording: (cell, rewriting.with_points(recording, factor))


def _of_all(robots: list[str], factor: float) -> Callable[[Cell, Recording], Rewritten]:
    def apply(cell: Cell, recording: Recording) -> Rewritten:
        """The cell and the recording so read."""
        of = rewriting.scaled(factor)
        rewritten = rewriting.with_robots(recording, dict.fromkeys(robots, of))
        if any(isinstance(o, PoseObservation) for s in recording.samples for o in s.observations):
            rewritten = rewriting.with_targets(rewritten, of)
        rewritten = rewriting.with_points(rewritten, factor)
        return resized(cell, dict.fromkeys(cell.targets, factor)), rewritten

    return apply


def resized(cell: Cell, factors: dict[str, float]) -> Cell:
    """The cell with the points of targets times a factor, by the target's name."""
    targets = dict(cell.targets)
    for name, factor in factors.items():
        shape = targets[name].target
        if shape is not None:
            targets[name] = replace(targets[name], target=replace(shape, points=shape.points * factor))
    return replace(cell, targets=targets)


def _of_joints(robots: list[str]) -> Iterator[ConventionHypothesis]:
    for names in subsets(robots):
        who = listed(names)
        for factor, words, advice in (
            (np.pi / 180, "in degrees", "turn them into radians"),
            (180 / np.pi, "turned from degrees into radians though they were radians", "leave them as they were"),
        ):
            yield ConventionHypothesis(
                "angle-unit",
                names,
                f"the joints of {who} are {words}",
                f"joints_rad of {who} is in radians: {advice}",
                f"move every joint of {who} further",
                _joints_times(names, factor),
            )


def _joints_times(robots: tuple[str, ...], factor: float) -> Callable[[Cell, Recording], Rewritten]:
    def apply(cell: Cell, recording: Recording) -> Rewritten:
        """The cell and the recording so read."""
        for robot in robots:
            recording = rewriting.with_joints(recording, robot, factor)
        return cell, recording

    return apply


def _of_quaternions(robots: list[str], poses: bool) -> Iterator[ConventionHypothesis]:
    for words, order in _ORDERS.items():
        of = rewriting.reordered(order)
        for names in subsets(robots):
            yield _quaternion(names, f"the quaternions of {listed(names)}", words, of_robots(names, of))
        if poses:
            yield _quaternion((), "the quaternions of the observed poses", words, of_targets(of))


def _quaternion(
    about: tuple[str, ...], who: str, words: str, apply: Callable[[Cell, Recording], Rewritten]
) -> ConventionHypothesis:
    return ConventionHypothesis(
        "quaternion-order",
        about,
        f"{who} are {words}",
        f"write {who} as x, y, z, w",
        f"turn {listed(about) or 'every arm'} further between samples",
        apply,
    )


def _of_exchanges(cell: Cell, robots: list[str], quantity: str) -> Iterator[ConventionHypothesis]:
    carriers = {c.on for c in cell.cameras.values()} | {t.on for t in cell.targets.values()}
    for first, second in combinations([name for name in robots if name in carriers], 2):
        if quantity == "joints" and _joint_count(cell, first) != _joint_count(cell, second):
            continue
        yield ConventionHypothesis(
            "robots-swapped",
            (first, second),
            f"the {quantity} of {first} and {second} are exchanged",
            f"exchange them, or what cell.yaml says is `on` {first} and on {second}",
            "turn every arm further about two axes between samples",
            _exchange(first, second),
        )


def _joint_count(cell: Cell, robot: str) -> int:
    chain = cell.robots[robot].chain
    return 0 if chain is None else chain.n


def _exchange(first: str, second: str) -> Callable[[Cell, Recording], Rewritten]:
    return lambda cell, recording: (cell, rewriting.exchanged(recording, first, second))


def streams(robots: list[str]) -> list[str | None]:
    """What may be paired wrongly against the rest: what was seen, and each robot where there are several."""
    return [None, *(robots if len(robots) > 1 else [])]


def shift(stream: str | None, by: int, start: int = 0, first: int | None = None) -> ConventionHypothesis:
    """One stream paired with other samples; `first` is the number of the sample at position `start`."""
    who = "what the cameras saw" if stream is None else f"what {stream} recorded"
    late = f"{abs(by)} sample{'s' if abs(by) > 1 else ''} {'later' if by > 0 else 'earlier'}"
    return ConventionHypothesis(
        "pairing-shifted",
        () if stream is None else (stream,),
        f"{who}{'' if first is None else f' from sample {first} on'} belongs {late}",
        f"pair it so{' (was a detection missed or given twice there?)' if start else ''}",
        "let the arms stand in clearly different poses from one sample to the next",
        lambda cell, recording: (cell, rewriting.shifted(recording, stream, by, start)),
        by_order=True,
    )


def _of_symmetry(cell: Cell, poses: bool) -> Iterator[ConventionHypothesis]:
    for name, target in cell.targets.items():
        turn = None if target.target is None else half_turn(target.target)
        if poses and turn is not None:
            yield ConventionHypothesis(
                "board-symmetry",
                (name,),
                f"the observed poses of {name} are turned by half a turn: the grid was read from its other end",
                f"let the origin of {name} be its other end, or use a target without symmetry",
                "use a target without symmetry",
                _turned(turn),
            )


def _turned(target_from_turned: SE3) -> Callable[[Cell, Recording], Rewritten]:
    return of_targets(lambda poses: poses @ target_from_turned)


def _of_mirrors(kinds: set[type[Observation]]) -> Iterator[ConventionHypothesis]:
    mirrored = {
        "the observed poses": (PoseObservation, of_targets(rewriting.through_the_camera)),
        "the observed 3-D points": (PointObservation, _of_points(-1.0)),
    }
    for who, (kind, apply) in mirrored.items():
        if kind in kinds:
            yield ConventionHypothesis(
                "mirrored",
                (),
                f"{who} are mirrored through the camera's centre",
                "take the solution before the camera, z > 0",
                "turn every arm further about two axes between samples",
                apply,
            )


def _of_lenses(cell: Cell, recording: Recording) -> Iterator[ConventionHypothesis]:
    seeing = {o.camera for s in recording.samples for o in s.observations if isinstance(o, PixelObservation)}
    for name in sorted(seeing):
        lens = cell.cameras[name].intrinsics
        if lens is not None and lens.status == "fixed":
            yield ConventionHypothesis(
                "intrinsics",
                (name,),
                f"the lens of {name} is not as stated{other_resolution(cell.cameras[name], recording)}",
                f"calibrate the lens of {name}, or set its intrinsics' status to free",
                "",
                _freed(name),
                nested=True,
            )


def _of_fixed(cell: Cell) -> Iterator[ConventionHypothesis]:
    for name, unknown in cell.transforms.items():
        if unknown.status == "fixed":
            yield ConventionHypothesis(
                "fixed-contradicted",
                (name,),
                f"{name} is not as stated",
                f"measure {name} again, or set its status to free",
                "",
                partial(_with_free, name),
                nested=True,
            )


def _with_free(name: str, cell: Cell, recording: Recording) -> Rewritten:
    return cell.with_transform(name, Unknown("free", cell.transforms[name].mean)), recording


def _freed(name: str) -> Callable[[Cell, Recording], Rewritten]:
    def apply(cell: Cell, recording: Recording) -> Rewritten:
        """The cell and the recording so read."""
        camera = cell.cameras[name]
        lens = camera.intrinsics
        freed = replace(camera, intrinsics=None if lens is None else replace(lens, status="free"))
        return replace(cell, cameras={**cell.cameras, name: freed}), recording

    return apply
