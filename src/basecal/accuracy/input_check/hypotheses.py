"""Hypotheses about common mistakes in a cell and its recording; each is undone by reading the input differently.

A hypothesis holds if the input deviates from its format: flange_from_base written as base_from_flange, or millimetres
as metres. A hypothesis is never applied to the answer; it is fitted for comparison with the declared input.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations

import numpy as np

from basecal.accuracy.readings.carriers import describe_carriers, swap_carriers
from basecal.accuracy.readings.reading import PoseMap, Reading
from basecal.cell import Cell, CellCamera, Unknown
from basecal.estimation.problem.correspondence import half_turn
from basecal.estimation.problem.problem import Problem
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.fields.problems import Loc
from basecal.geometry import SE3

_MILLI = 1e-3  # metres in a millimetre, by definition
_SHIFTS = (1, -1, 2, -2)  # delay of a stream in samples: one or two dropped or duplicated images; assumed
# Wrong contents of a field q_xyzw: components in the order w, x, y, z, or reordered although they were x, y, z, w.
_ORDERS = {"w, x, y, z": (1, 2, 3, 0), "converted from w, x, y, z although they were x, y, z, w": (3, 0, 1, 2)}

Reread = Callable[[Reading], Reading]

ROTATE_ARMS, MOVE_ARMS = "rotate {arms} further about two axes between samples", "move {arms} further between samples"
"""Instructions to record data that distinguish hypotheses."""


@dataclass(frozen=True, eq=False)
class ConventionHypothesis:
    """One interpretation of a cell and its recording.

    Attributes:
        code: The finding's code.
        about: Names of robots, cameras and targets.
        words: Statement of the hypothesis, as the end of "It fits if ...".
        fix: Instruction to fix the input, in one line.
        distinction: Instruction to record data that distinguish this hypothesis from the declared one; `{arms}` is
            replaced by the names of its robots.
        reread: Function that returns the reading under this hypothesis, given the declared reading.
        nested: Whether the declared hypothesis is a special case of this one, which therefore never fits worse.
        by_order: Whether the hypothesis depends on the order of the samples, so that `reread` needs all of them.
        carriers: Alternative values of `on` that fit equally well, by location in `cell.yaml`.
    """

    code: str
    about: tuple[str, ...]
    words: str
    fix: str
    distinction: str
    reread: Reread
    is_wider: bool = False
    depends_on_order: bool = False
    carriers: Mapping[Loc, str] = field(default_factory=dict)


AS_DECLARED = ConventionHypothesis("", (), "it is as declared", "", "", lambda reading: reading)


def convention_hypotheses(baseline: Reading) -> list[ConventionHypothesis]:
    """All hypotheses that apply to this reading, except those with an unknown number."""
    pose_robots, joint_robots = baseline.pose_robots, baseline.joint_robots
    has_poses, has_points = baseline.shows(PoseMeasurement), baseline.shows(PointMeasurement)
    shifts = [count for count in _SHIFTS if abs(count) < len(baseline.order) // 3]
    return [
        *_direction_hypotheses(baseline.cell, pose_robots, has_poses),
        *_unit_hypotheses(pose_robots, joint_robots, has_poses, has_points),
        *_joint_hypotheses(joint_robots),
        *_quaternion_hypotheses(pose_robots, has_poses),
        *_exchange_hypotheses(baseline, pose_robots, "poses"),
        *_exchange_hypotheses(baseline, joint_robots, "joints"),
        *(shift_hypothesis(stream, count) for stream in streams([*pose_robots, *joint_robots]) for count in shifts),
        *(_size_unit_hypotheses(baseline.cell) if baseline.shows(PixelMeasurement, PointMeasurement) else ()),
        *(_symmetry_hypotheses(baseline.cell) if has_poses else ()),
        *_mirror_hypotheses(has_poses, has_points),
        *_lens_hypotheses(baseline),
        *_fixed_transform_hypotheses(baseline.cell),
    ]


def robot_subjects(robots: list[str]) -> dict[tuple[str, ...], str]:
    """Map the names of each robot alone, and of all robots together, to a phrase."""
    subjects = [*((name,) for name in robots), tuple(robots)]
    return {names: " and ".join(names) for names in subjects if names}


def pose_subjects(
    robots: list[str], has_poses: bool, observations: str = "the observed poses"
) -> dict[tuple[str, ...], str]:
    """Map names of robots that record poses to a phrase; if `has_poses`, also no name to `observations`."""
    return robot_subjects(robots) | ({(): observations} if has_poses else {})


def map_poses(names: tuple[str, ...], pose_map: PoseMap) -> Reread:
    """Map the recorded poses of these robots, or all observed poses if `names` is empty."""
    return lambda reading: reading.with_poses(names, pose_map) if names else reading.with_target_poses(pose_map)


def scale_translations(factor: float) -> PoseMap:
    """Pose map that multiplies translations by a factor."""
    return lambda poses: SE3(poses.rotation, factor * poses.translation)


def _reorder_quaternion(order: tuple[int, ...]) -> PoseMap:
    """Pose map that reorders the components of the quaternions; their sign does not matter."""
    return lambda poses: SE3.from_quaternion(poses.quaternion[..., list(order)], poses.translation)


def _mirror_behind_camera(poses: SE3) -> SE3:
    """Mirror poses through the camera's centre: a plane's points lie on the same lines, but behind the camera."""
    return SE3(poses.rotation * np.array([-1.0, -1.0, 1.0]), -poses.translation)


def _direction_hypotheses(cell: Cell, robots: list[str], has_poses: bool) -> Iterator[ConventionHypothesis]:
    for names, who in robot_subjects(robots).items():
        carriers = swap_carriers(cell, names)
        words, advice = f"the poses of {who} are inverted (flange_from_base)", "invert the poses"
        if carriers:
            words += f", or {describe_carriers(carriers)}"
            advice += ", or import with the other --camera-on"
        yield ConventionHypothesis(
            "robot-pose-inverted",
            names,
            words,
            f"write base_from_flange of {who}, or {advice}",
            ROTATE_ARMS,
            map_poses(names, SE3.inverse),
            carriers=carriers,
        )
    if has_poses:
        yield ConventionHypothesis(
            "target-pose-inverted",
            (),
            "the poses of the target are inverted (target_from_camera)",
            "write camera_from_target, or invert the observed poses",
            ROTATE_ARMS,
            map_poses((), SE3.inverse),
        )


def _unit_hypotheses(
    pose_robots: list[str], joint_robots: list[str], has_poses: bool, has_points: bool
) -> Iterator[ConventionHypothesis]:
    for factor, words, advice in (
        (_MILLI, "in millimetres", "divide them by 1000"),
        (1 / _MILLI, "1000 times too small", "multiply them by 1000"),
    ):
        pose_map = scale_translations(factor)
        for names, who in pose_subjects(pose_robots, has_poses).items():
            yield _unit_hypothesis(
                names, f"the poses of {who}" if names else who, words, advice, map_poses(names, pose_map)
            )
        if has_points:
            yield _unit_hypothesis(
                (), "the observed 3-D points", words, advice, partial(Reading.with_points, factor=factor)
            )
        if pose_robots and not joint_robots:
            yield _unit_hypothesis(
                tuple(pose_robots),
                "all lengths, of robots and targets,",
                words,
                advice,
                _scale_lengths(pose_robots, factor),
            )


def _unit_hypothesis(
    subjects: tuple[str, ...], subject: str, words: str, advice: str, reread: Reread
) -> ConventionHypothesis:
    return ConventionHypothesis(
        "length-unit",
        subjects,
        f"{subject} are {words}",
        f"lengths are in metres: {advice}",
        "give the size of something known, such as the target's points or a prior of a mount",
        reread,
    )


def _size_unit_hypotheses(cell: Cell) -> Iterator[ConventionHypothesis]:
    for name, target in cell.targets.items():
        if target.target is not None and not target.target.is_point:
            yield ConventionHypothesis(
                "board-size",
                (name,),
                f"the size of {name} is in millimetres",
                "lengths are in metres: divide it by 1000",
                MOVE_ARMS,
                partial(Reading.resize, factors={name: _MILLI}),
            )


def _scale_lengths(robots: list[str], factor: float) -> Reread:
    def reread(reading: Reading) -> Reading:
        """Multiply all lengths of the reading by the factor."""
        pose_map = scale_translations(factor)
        mapped = reading.with_poses(tuple(robots), pose_map).with_target_poses(pose_map).with_points(factor)
        return mapped.resize(dict.fromkeys(reading.cell.targets, factor))

    return reread


def _joint_hypotheses(robots: list[str]) -> Iterator[ConventionHypothesis]:
    for names, who in robot_subjects(robots).items():
        for factor, words, advice in (
            (np.pi / 180, "in degrees", "convert them to radians"),
            (180 / np.pi, "converted from degrees to radians although they were radians", "do not convert them"),
        ):
            yield ConventionHypothesis(
                "angle-unit",
                names,
                f"the joints of {who} are {words}",
                f"joints_rad of {who} is in radians: {advice}",
                "move every joint of {arms} further",
                partial(Reading.with_joints, robots=names, factor=factor),
            )


def _quaternion_hypotheses(robots: list[str], has_poses: bool) -> Iterator[ConventionHypothesis]:
    for words, order in _ORDERS.items():
        pose_map = _reorder_quaternion(order)
        for names, who in pose_subjects(robots, has_poses).items():
            yield ConventionHypothesis(
                "quaternion-order",
                names,
                f"the quaternions of {who} are {words}",
                f"write the quaternions of {who} as x, y, z, w",
                ROTATE_ARMS,
                map_poses(names, pose_map),
            )


def _exchange_hypotheses(baseline: Reading, robots: list[str], quantity: str) -> Iterator[ConventionHypothesis]:
    cell, tracks = baseline.cell, baseline.tracks
    carriers = {c.on for c in cell.cameras.values()} | {t.on for t in cell.targets.values()}
    for first, second in combinations([name for name in robots if name in carriers], 2):
        if tracks[first].joint_count != tracks[second].joint_count:
            continue
        yield ConventionHypothesis(
            "robots-swapped",
            (first, second),
            f"the {quantity} of {first} and {second} are exchanged",
            f"exchange them, or what cell.yaml says is `on` {first} and on {second}",
            ROTATE_ARMS,
            partial(Reading.exchange, first=first, second=second),
        )


def streams(robots: list[str]) -> list[str | None]:
    """Streams that may be paired wrongly: the observations (None), and each robot if there are several."""
    return [None, *(robots if len(robots) > 1 else [])]


def shift_hypothesis(stream: str | None, count: int, start: int = 0, first: int | None = None) -> ConventionHypothesis:
    """Hypothesis that one stream is shifted by `count` samples; sample `first` is the one at position `start`."""
    late = f"{abs(count)} sample{'s' if abs(count) > 1 else ''} {'later' if count > 0 else 'earlier'}"
    return pairing_hypothesis(
        stream,
        f"{'' if first is None else f'from sample {first} on '}belongs {late}",
        f"pair it accordingly{' (was a detection missed or given twice there?)' if start else ''}",
        lambda reading: reading.shift(stream, count, start),
    )


def pairing_hypothesis(stream: str | None, fault: str, fix: str, reread: Reread) -> ConventionHypothesis:
    """Hypothesis that one stream is in another order: the observations if it is None, else a robot's records."""
    return ConventionHypothesis(
        "pairing-shifted",
        () if stream is None else (stream,),
        f"{'what the cameras saw' if stream is None else f'what {stream} recorded'} {fault}",
        fix,
        "let the arms stand in clearly different poses from one sample to the next",
        reread,
        depends_on_order=True,
    )


def _symmetry_hypotheses(cell: Cell) -> Iterator[ConventionHypothesis]:
    for name, target in cell.targets.items():
        turn = None if target.target is None else half_turn(target.target)
        if turn is not None:
            yield ConventionHypothesis(
                "board-symmetry",
                (name,),
                f"the observed poses of {name} are rotated by half a turn: the grid was read from its other end",
                f"let the origin of {name} be its other end, or use a target without symmetry",
                "use a target without symmetry",
                partial(_turn_target, name=name, target_from_turned=turn),
            )


def _turn_target(reading: Reading, name: str, target_from_turned: SE3) -> Reading:
    return reading.with_target_poses(lambda poses: poses @ target_from_turned, name)


def _mirror_hypotheses(has_poses: bool, has_points: bool) -> Iterator[ConventionHypothesis]:
    mirrored: dict[str, tuple[bool, Reread]] = {
        "the observed poses": (has_poses, map_poses((), _mirror_behind_camera)),
        "the observed 3-D points": (has_points, partial(Reading.with_points, factor=-1.0)),
    }
    for who, (is_seen, reread) in mirrored.items():
        if is_seen:
            yield ConventionHypothesis(
                "mirrored",
                (),
                f"{who} are mirrored through the camera's centre",
                "take the solution before the camera, z > 0",
                ROTATE_ARMS,
                reread,
            )


def _lens_hypotheses(baseline: Reading) -> Iterator[ConventionHypothesis]:
    for name in sorted(baseline.problem.lenses):
        camera = baseline.cell.cameras[name]
        lens = camera.intrinsics
        if lens is not None and lens.status == "fixed":
            yield ConventionHypothesis(
                "intrinsics",
                (name,),
                f"the lens of {name} is not as stated{other_resolution(camera, baseline.problem)}",
                f"calibrate the lens of {name}, or set its intrinsics' status to free",
                "",
                partial(Reading.restate, cell=free_lens(baseline.cell, name)),
                is_wider=True,
            )


def _fixed_transform_hypotheses(cell: Cell) -> Iterator[ConventionHypothesis]:
    for name, unknown in cell.transforms.items():
        if unknown.status == "fixed":
            yield ConventionHypothesis(
                "fixed-contradicted",
                (name,),
                f"{name} is not as stated",
                f"measure {name} again, or set its status to free",
                "",
                partial(Reading.restate, cell=cell.with_transform(name, Unknown("free", unknown.mean))),
                is_wider=True,
            )


def free_lens(cell: Cell, name: str) -> Cell:
    """Copy of the cell that uses the stated lens of a camera as an initial guess only."""
    camera = cell.cameras[name]
    lens = camera.intrinsics
    freed = replace(camera, intrinsics=None if lens is None else replace(lens, status="free"))
    return replace(cell, cameras={**cell.cameras, name: freed})


_FACTOR_TOLERANCE = 0.15  # relative, between the factors of width and height: centres are within 10 % of the middle
_OTHER_FACTOR = 1.25  # factor between two resolutions that count as different


def other_resolution(camera: CellCamera, problem: Problem) -> str:
    """Clause that names the resolution that a camera matrix seems to have; empty if it matches the images.

    If the image size is stated, the principal point determines the resolution. Otherwise the extent of the recorded
    pixels does.
    """
    lens = None if camera.intrinsics is None else camera.intrinsics.camera
    if lens is None:
        return ""
    lens_size_px = 2 * (lens.center + 0.5)
    if camera.size_px is None:
        views = [g.measurement for g in problem.groups if g.camera == camera.name]
        seen = [view.pixels[view.seen] for view in views if isinstance(view, PixelMeasurement)]
        reach = np.concatenate([np.zeros((1, 2)), *seen]).max(axis=0)
        if not np.all(reach > _OTHER_FACTOR * lens_size_px):
            return ""
        return f": points reach to ({reach[0]:.0f}, {reach[1]:.0f}) px, its camera matrix is of smaller images"
    width, height = camera.size_px
    factors = lens_size_px / np.array([width, height])
    factor = float(np.sqrt(np.prod(np.maximum(factors, 0.0))))
    if np.ptp(factors) > _FACTOR_TOLERANCE * factor or 1 / _OTHER_FACTOR < factor < _OTHER_FACTOR:
        return ""
    size = f"{width * factor:.0f} x {height * factor:.0f} px"
    return f": its camera matrix looks like that of images of about {size}, not of {width} x {height} px"
