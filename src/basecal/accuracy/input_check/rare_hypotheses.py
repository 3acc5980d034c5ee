"""Rare input mistakes, which are tried only if no common one explains the motion of the targets.

A reversed order, streams shifted by many samples, transposed rotation matrices, angles in another controller's
convention, and robots exchanged in one session. They are many: each takes time and makes a chance match more likely.
`benchmarks.mutations` judges its limits.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations, permutations, product

import numpy as np
import scipy  # its parts are loaded when they are first used

from basecal.accuracy.input_check.hypotheses import (
    MOVE_ARMS,
    ROTATE_ARMS,
    ConventionHypothesis,
    map_poses,
    pairing_hypothesis,
    pose_subjects,
    robot_subjects,
    scale_translations,
    shift_hypothesis,
    streams,
)
from basecal.accuracy.input_check.plausibility import UNITS_M
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.accuracy.readings.reading import PoseMap, Reading, Track
from basecal.cell import WORLD, Cell
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.rotation import lengths

_FAR_SHIFTS = tuple(delay for far in (3, 4, 5, 6) for delay in (far, -far))  # samples; up to two are common mistakes
_RADIANS_AS_DEGREES_RAD = np.radians(2 * np.pi)  # [rad] of three angles of up to half a turn each, read as degrees
_CENTRES = 20  # rotations among which the central one is searched
_FEWEST_STILL = 5  # consecutive samples with a robot at rest that make a session; at least a tenth of all, too
_NO_TURN_RAD = 1e-9  # [rad] below which a rotation vector has no direction
# Three-number rotation formats of controllers, as axes in SciPy's notation: capitals rotate with the flange. The empty
# text is a rotation vector.
_FORMATS = {
    "roll, pitch, yaw about fixed axes x, y, z (ROS, FANUC)": "xyz",
    "angles about moving axes x, y, z (Staubli)": "XYZ",
    "angles about moving axes z, y, x (KUKA's A, B, C)": "ZYX",
    "angles about moving axes z, y, z (Kawasaki, Denso)": "ZYZ",
    "a rotation vector (Universal Robots)": "",
}
_Choose = Callable[[Array, Array], IntArray]
"""Index of the rotation to use, (n,), given two triples of numbers and their rotations for each pose."""

_AXES = {
    "x and y exchanged": np.eye(3)[[1, 0, 2]],
    "x and z exchanged": np.eye(3)[[2, 1, 0]],
    "y and z exchanged": np.eye(3)[[0, 2, 1]],
    "x with the wrong sign": np.diag([-1.0, 1, 1]),
    "y with the wrong sign": np.diag([1, -1.0, 1]),
    "z with the wrong sign": np.diag([1, 1, -1.0]),
}


def rare_hypotheses(baseline: Reading) -> list[ConventionHypothesis]:
    """All rare hypotheses that apply to this reading."""
    robots, cell = baseline.pose_robots, baseline.cell
    shiftable = streams([name for name in cell.robots if baseline.tracks[name].seen.any()])
    has_poses = baseline.shows(PoseMeasurement)
    return [
        *_order_hypotheses(shiftable, len(baseline.order)),
        *(
            hypothesis
            for names, who in pose_subjects(robots, has_poses, "the observed target").items()
            for hypothesis in _rotation_hypotheses(names, who)
        ),
        *_small_angle_hypotheses(
            [name for name in robots if _largest_rotation_rad(baseline.tracks[name]) < _RADIANS_AS_DEGREES_RAD]
        ),
        *_stated_transform_hypotheses(cell),
        *_carrier_hypotheses(baseline),
        *_session_hypotheses(baseline),
        *_inch_hypotheses(robots),
        *(_pixel_hypotheses() if baseline.shows(PixelMeasurement) else ()),
    ]


def _small_angle_hypotheses(robots: list[str]) -> Iterator[ConventionHypothesis]:
    """Roll, pitch and yaw, or rotation vectors, in radians that were read as degrees: all rotations are small."""
    for names, who in robot_subjects(robots).items():
        for what, pose_map in (("roll, pitch and yaw", _scale_rpy), ("rotation vectors", _scale_rotvecs)):
            yield ConventionHypothesis(
                "angle-unit",
                names,
                f"the {what} of {who} are in radians that were read as degrees",
                f"rpy_deg is in degrees: convert those of {who} to degrees, or write rotvec_rad",
                ROTATE_ARMS,
                map_poses(names, pose_map),
            )


def _scale_rotvecs(poses: SE3) -> SE3:
    """Multiply rotation vectors by 180 / pi: undo radians that were read as degrees."""
    return SE3.from_rotvec(np.degrees(poses.rotvec), poses.translation)


def _scale_rpy(poses: SE3) -> SE3:
    """Multiply roll, pitch and yaw about fixed axes by 180 / pi: undo radians that were read as degrees."""
    return SE3.from_rpy(np.degrees(poses.rpy), poses.translation)


def _largest_rotation_rad(track: Track) -> float:
    """Largest rotation angle of a flange with respect to its base [rad]."""
    return float(lengths(track.pose.rotvec[track.seen]).max())


def _stated_transform_hypotheses(cell: Cell) -> Iterator[ConventionHypothesis]:
    """A base or mount transform that is stated inverted."""
    for name, unknown in cell.transforms.items():
        if unknown.status == "free" or unknown.mean is None:
            continue
        end, _, start = name.partition("_from_")
        inverted = cell.with_transform(name, replace(unknown, mean=unknown.mean.inverse()))
        yield ConventionHypothesis(
            "transform-inverted",
            (name,),
            f"{name} is stated inverted ({start}_from_{end})",
            f"invert what cell.yaml states of {name}",
            ROTATE_ARMS,
            partial(Reading.restate, cell=inverted),
        )


def _inch_hypotheses(robots: list[str]) -> Iterator[ConventionHypothesis]:
    """Inches that were read as the length unit of a controller."""
    for unit, length_m in (("millimetres", 1e-3), ("metres", 1.0)):
        for names, who in robot_subjects(robots).items():
            yield ConventionHypothesis(
                "length-unit",
                names,
                f"the poses of {who} are in inches that were read as {unit}",
                f"import {who} again with --length-unit inch --replace",
                "give the size of something known, such as the target's points or a prior of a mount",
                map_poses(names, scale_translations(UNITS_M["inch"] / length_m)),
            )


def _carrier_hypotheses(baseline: Reading) -> Iterator[ConventionHypothesis]:
    """A target that is on a moving robot or the world other than stated, without a camera that sees the target."""
    cell = baseline.cell
    moving = [name for name, track in baseline.tracks.items() if track.moves]
    eyes: dict[str, set[str]] = {}
    for group in baseline.problem.groups:
        eyes.setdefault(group.target, set()).add(group.eye.robot or WORLD)
    for target, camera_carriers in eyes.items():
        stated = cell.targets[target].on
        for carrier in (WORLD, *moving):
            if carrier != stated and carrier not in camera_carriers:
                yield ConventionHypothesis(
                    "wrong-carrier",
                    (target,),
                    f"{target} is on {carrier}, not on {stated}",
                    f"write on: {carrier} of {target} in cell.yaml",
                    ROTATE_ARMS,
                    partial(Reading.with_carrier, target=target, carrier=carrier),
                )


def _session_hypotheses(baseline: Reading) -> Iterator[ConventionHypothesis]:
    """States of two robots exchanged in a session with one robot at rest, or their rest poses in two such sessions."""
    tracks = {name: baseline.tracks[name] for name in (*baseline.pose_robots, *baseline.joint_robots)}
    runs = {name: _still_runs(baseline.order, track) for name, track in tracks.items()}
    for first, second in combinations(tracks, 2):
        if tracks[first].joint_count != tracks[second].joint_count:
            continue
        sessions = {list_samples(run.tolist()): (run, run) for run in (*runs[first], *runs[second])}
        rests = [pair for pair in product(runs[first], runs[second]) if not np.array_equal(*pair)]
        for session, pair in sessions.items():
            words = f"the arms {first} and {second} are exchanged in {session}"
            yield _exchange_hypothesis(first, second, pair, words, "that session")
        for pair in rests:
            of_first, of_second = (list_samples(run.tolist()) for run in pair)
            words = f"the places where {first} ({of_first}) and {second} ({of_second}) stood still are exchanged"
            yield _exchange_hypothesis(first, second, pair, words, "both places")


def _exchange_hypothesis(
    first: str, second: str, numbers: tuple[IntArray, IntArray], words: str, subject: str
) -> ConventionHypothesis:
    return ConventionHypothesis(
        "robots-swapped",
        (first, second),
        words,
        f"import {subject} again, each file with the other --robot",
        ROTATE_ARMS,
        partial(Reading.exchange_states, numbers=dict(zip((first, second), numbers, strict=True))),
    )


def _still_runs(order: IntArray, track: Track) -> list[IntArray]:
    """Sample numbers of each session with a robot at rest at one stop; empty if it never moved."""
    runs = np.split(np.arange(len(order)), np.flatnonzero(np.diff(track.stop_number)) + 1)
    fewest = max(_FEWEST_STILL, len(order) // 10)
    return [order[run] for run in runs if fewest <= len(run) < len(order) and track.seen[run[0]]]


def _pixel_hypotheses() -> Iterator[ConventionHypothesis]:
    yield ConventionHypothesis(
        "pixels-swapped",
        (),
        "u and v of the pixels are exchanged",
        "write [u, v], u along the width of the image: exchange them",
        MOVE_ARMS,
        Reading.with_pixels_exchanged,
    )


def _order_hypotheses(stream_names: list[str | None], count: int) -> Iterator[ConventionHypothesis]:
    for stream in stream_names:
        yield _reverse_order_hypothesis(stream)
        yield from (_text_order_hypothesis(stream, first) for first in (0, 1) if count > 10)
        for delay in _FAR_SHIFTS:
            if abs(delay) < count // 3:
                yield shift_hypothesis(stream, delay)


def _text_order_hypothesis(stream: str | None, first: int) -> ConventionHypothesis:
    """Rows numbered from `first` that were sorted as text: 1, 10, 11, 2."""

    def reread(reading: Reading) -> Reading:
        """Sort the rows by their numbers."""
        return reading.pair_stream(stream, np.argsort(sorted(range(first, first + len(reading.order)), key=str)))

    order = ", ".join(sorted(map(str, range(first, first + 12)))[:4])
    return pairing_hypothesis(stream, f"is sorted as text: {order}", "sort it by number", reread)


def _reverse_order_hypothesis(stream: str | None) -> ConventionHypothesis:
    def reread(reading: Reading) -> Reading:
        """Reverse the order of the stream."""
        return reading.pair_stream(stream, np.arange(len(reading.order))[::-1])

    return pairing_hypothesis(stream, "is in reverse order", "reverse its order", reread)


def _rotation_hypotheses(names: tuple[str, ...], subject: str) -> Iterator[ConventionHypothesis]:
    yield ConventionHypothesis(
        "matrix-transposed",
        names,
        f"the rotation matrices of {subject} are transposed",
        "write them by rows, or transpose them",
        ROTATE_ARMS,
        map_poses(names, lambda poses: SE3(poses.rotation.mT, poses.translation)),
    )
    yield from _axis_hypotheses(names, subject)
    for meant, read in permutations(_FORMATS, 2):
        if (_FORMATS[meant], _FORMATS[read]) == ("ZYX", "xyz"):
            continue  # the same three numbers in reverse order, as in the opposite pair
        words = f"the rotations of {subject} are {meant} that were read as {read}"
        if (_FORMATS[meant], _FORMATS[read]) == ("xyz", "ZYX"):
            words = f"the angles of {subject} are in the reverse order: roll, pitch, yaw and KUKA's A, B, C mixed up"
        # Two triples of angles give one rotation. With three different axes the middle angle is usually within 90 deg.
        of_three_axes = all(len(set(_FORMATS[each])) == len("xyz") for each in (meant, read))
        choices: tuple[_Choose, ...] = (_choose_first, _choose_second, _choose_shorter)
        if of_three_axes or not _FORMATS[read]:
            choices = (_choose_first,) if _FORMATS[read] else (_choose_first, _choose_nearest)
        for choose in choices:
            yield ConventionHypothesis(
                "euler-order",
                names,
                words,
                f"convert them to rotations as {meant}",
                ROTATE_ARMS,
                map_poses(names, _reinterpret_rotations(_FORMATS[meant], _FORMATS[read], choose)),
            )


def _axis_hypotheses(names: tuple[str, ...], subject: str) -> Iterator[ConventionHypothesis]:
    for words, axes in _AXES.items():
        yield ConventionHypothesis(
            "position-axes",
            names,
            f"the positions of {subject} have {words}",
            "correct the order and the signs of x, y and z: axes are right-handed",
            ROTATE_ARMS,
            map_poses(names, _with_axes(axes)),
        )


def _with_axes(axes: Array) -> PoseMap:
    return lambda poses: SE3(poses.rotation, poses.translation @ axes)


def _reinterpret_rotations(true_format: str, read_format: str, choose: _Choose) -> PoseMap:
    def reinterpret(poses: SE3) -> SE3:
        """Interpret the three numbers that were read in the format `read_format` in the format `true_format`."""
        numbers = _number_triples(poses.rotation, read_format)
        rotation_type, rows = scipy.spatial.transform.Rotation, numbers.reshape(-1, 3)
        interpreted = rotation_type.from_euler(true_format, rows) if true_format else rotation_type.from_rotvec(rows)
        rotations = interpreted.as_matrix().reshape(*numbers.shape, 3)
        return replace(poses, rotation=rotations[np.arange(len(numbers)), choose(numbers, rotations)])

    return reinterpret


def _choose_first(numbers: Array, rotations: Array) -> IntArray:
    return np.zeros(len(numbers), dtype=np.int64)


def _choose_second(numbers: Array, rotations: Array) -> IntArray:
    return np.ones(len(numbers), dtype=np.int64)


def _choose_shorter(numbers: Array, rotations: Array) -> IntArray:
    chosen: IntArray = np.argmin(lengths(numbers), axis=1)
    return chosen


def _choose_nearest(numbers: Array, rotations: Array) -> IntArray:
    """Index of the candidate of each rotation nearest to the others, (n,): robots move about a home pose."""
    centres = rotations[:_CENTRES].reshape(-1, 3, 3)
    traces = np.einsum("cij,nkij->cnk", centres, rotations)  # 1 + 2 cos of the angle between two rotations
    angles = np.arccos(np.clip((traces - 1) / 2, -1, 1))
    chosen: IntArray = np.argmin(angles[np.argmin(angles.min(axis=2).sum(axis=1))], axis=1)
    return chosen


def _number_triples(rotation: Array, axes: str) -> Array:
    """The two triples of numbers that describe each rotation, (n, 2, 3) [rad]: vectors, or angles about `axes`."""
    rotations = scipy.spatial.transform.Rotation.from_matrix(rotation)
    if not axes:
        vector = rotations.as_rotvec()
        angle = lengths(vector)[:, None]
        return np.stack([vector, vector * (1 - 2 * np.pi / np.maximum(angle, _NO_TURN_RAD))], axis=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # if two axes align, any split of the angles is right
        angles = rotations.as_euler(axes)
    first, middle, last = angles.T
    other = -middle if axes[0] == axes[2] else np.pi - middle
    return _wrap_angles(np.stack([angles, np.column_stack([first + np.pi, other, last + np.pi])], axis=1))


def _wrap_angles(angles: Array) -> Array:
    within: Array = (angles + np.pi) % (2 * np.pi) - np.pi
    return within
