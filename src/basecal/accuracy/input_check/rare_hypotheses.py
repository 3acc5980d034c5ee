"""Mix-ups that are looked for only where nothing usual explains how the targets move.

A reversed order, streams off by many samples, transposed rotation matrices, angles that were read as another
controller's, and arms exchanged in one session. They are many: each costs a look, and chance more to choose from.
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
    ConventionHypothesis,
    map_poses,
    pair_differently,
    pose_subjects,
    scale_translations,
    shift,
    streams,
    subsets,
)
from basecal.accuracy.input_check.plausibility import UNITS_M
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.accuracy.readings.reading import PoseMap, Reading, Track
from basecal.cell import WORLD, Cell
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array, IntArray
from basecal.geometry.rotation import lengths

_FAR_SHIFTS = tuple(by for far in (3, 4, 5, 6) for by in (far, -far))  # samples; up to two are usual slips
_RADIANS_AS_DEGREES_RAD = np.radians(2 * np.pi)  # of three angles up to half a turn each, read as degrees
_CENTRES = 20  # rotations of which one is in the middle of most
_FEWEST_STILL = 5  # samples in a row at which an arm stood still, and a tenth of all: a session
_NO_TURN_RAD = 1e-9  # [rad] below which a rotation vector has no direction
# How controllers list three numbers of a rotation, by SciPy's names: capitals are axes that turn with the flange.
_LISTINGS = {
    "roll, pitch, yaw about fixed axes x, y, z (ROS, FANUC)": "xyz",
    "angles about moving axes x, y, z (Staubli)": "XYZ",
    "angles about moving axes z, y, x (KUKA's A, B, C)": "ZYX",
    "angles about moving axes z, y, z (Kawasaki, Denso)": "ZYZ",
    "a rotation vector (Universal Robots)": "",
}


_AXES = {
    "x and y exchanged": np.eye(3)[[1, 0, 2]],
    "x and z exchanged": np.eye(3)[[2, 1, 0]],
    "y and z exchanged": np.eye(3)[[0, 2, 1]],
    "x with the wrong sign": np.diag([-1.0, 1, 1]),
    "y with the wrong sign": np.diag([1, -1.0, 1]),
    "z with the wrong sign": np.diag([1, 1, -1.0]),
}


def rare_hypotheses(baseline: Reading) -> list[ConventionHypothesis]:
    """All of them that this reading can have."""
    robots, cell = baseline.pose_robots, baseline.cell
    moved = streams([name for name in cell.robots if baseline.tracks[name].seen.any()])
    poses = baseline.shows(PoseMeasurement)
    return [
        *_order_hypotheses(moved, len(baseline.order)),
        *(
            hypothesis
            for names, who in pose_subjects(robots, poses, "the observed target").items()
            for hypothesis in _rotation_hypotheses(names, who)
        ),
        *_small_angle_hypotheses(
            [name for name in robots if _turns_rad(baseline.tracks[name]) < _RADIANS_AS_DEGREES_RAD]
        ),
        *_stated_transform_hypotheses(cell),
        *_carrier_hypotheses(baseline),
        *_session_hypotheses(baseline),
        *_inch_hypotheses(robots),
        *(_pixel_hypotheses() if baseline.shows(PixelMeasurement) else ()),
    ]


def _small_angle_hypotheses(small: list[str]) -> Iterator[ConventionHypothesis]:
    """Roll, pitch and yaw, or rotation vectors, in radians that were read as degrees: then no flange turns far."""
    for names, who in subsets(small).items():
        for what, of in (("roll, pitch and yaw", _degrees_of_rpy), ("rotation vectors", _degrees)):
            yield ConventionHypothesis(
                "angle-unit",
                names,
                f"the {what} of {who} are in radians that were read as degrees",
                f"rpy_deg is in degrees: turn those of {who} into degrees, or write rotvec_rad",
                f"turn {who} further between samples",
                map_poses(names, of),
            )


def _degrees(poses: SE3) -> SE3:
    """Rotations whose vectors in radians are taken as degrees that were read as radians."""
    return SE3.from_rotvec(np.degrees(poses.rotvec), poses.translation)


def _degrees_of_rpy(poses: SE3) -> SE3:
    """Degrees of roll, pitch and yaw about fixed axes."""
    return SE3.from_rpy(np.degrees(poses.rpy), poses.translation)


def _turns_rad(track: Track) -> float:
    """How far a flange turns from its base's axes at most [rad]."""
    return float(lengths(track.pose.rotvec[track.seen]).max())


def _stated_transform_hypotheses(cell: Cell) -> Iterator[ConventionHypothesis]:
    """A base or a mount that is stated the wrong way round."""
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
            "turn every arm further about two axes between samples",
            partial(Reading.restate, cell=inverted),
        )


def _inch_hypotheses(robots: list[str]) -> Iterator[ConventionHypothesis]:
    """Inches that were read in the unit of a controller."""
    for unit, length_m in (("millimetres", 1e-3), ("metres", 1.0)):
        for names, who in subsets(robots).items():
            yield ConventionHypothesis(
                "length-unit",
                names,
                f"the poses of {who} are in inches that were read as {unit}",
                f"import {who} again with --length-unit inch --replace",
                "give the size of something known, such as the target's points or a prior of a mount",
                map_poses(names, scale_translations(UNITS_M["inch"] / length_m)),
            )


def _carrier_hypotheses(baseline: Reading) -> Iterator[ConventionHypothesis]:
    """A target on another robot that moves, or on the world, than is stated."""
    cell = baseline.cell
    moving = [name for name, track in baseline.tracks.items() if track.moves]
    eyes = {group.target: group.eye.robot for group in baseline.problem.groups}
    for target, eye in eyes.items():
        stated = cell.targets[target].on
        for carrier in (WORLD, *moving):
            if carrier not in (stated, eye) and (carrier != WORLD or eye is not None):
                yield ConventionHypothesis(
                    "wrong-carrier",
                    (target,),
                    f"{target} is on {carrier}, not on {stated}",
                    f"write on: {carrier} of {target} in cell.yaml",
                    "turn every arm further about two axes between samples",
                    partial(Reading.with_carrier, target=target, carrier=carrier),
                )


def _session_hypotheses(baseline: Reading) -> Iterator[ConventionHypothesis]:
    """The states of two arms exchanged in a session in which one stood still, or their places in two of these."""
    tracks = {name: baseline.tracks[name] for name in (*baseline.pose_robots, *baseline.joint_robots)}
    runs = {name: _still_runs(baseline.order, track) for name, track in tracks.items()}
    for first, second in combinations(tracks, 2):
        if tracks[first].joint_count != tracks[second].joint_count:
            continue
        sessions = {list_samples(run.tolist()): (run, run) for run in (*runs[first], *runs[second])}
        places = [pair for pair in product(runs[first], runs[second]) if not np.array_equal(*pair)]
        for where, pair in sessions.items():
            words = f"the arms {first} and {second} are exchanged in {where}"
            yield _exchanged_states(first, second, pair, words, "that session")
        for pair in places:
            at_first, at_second = (list_samples(of.tolist()) for of in pair)
            words = f"the places where {first} ({at_first}) and {second} ({at_second}) stood still are exchanged"
            yield _exchanged_states(first, second, pair, words, "both places")


def _exchanged_states(
    first: str, second: str, numbers: tuple[IntArray, IntArray], words: str, subject: str
) -> ConventionHypothesis:
    return ConventionHypothesis(
        "robots-swapped",
        (first, second),
        words,
        f"import {subject} again, each file with the other --robot",
        "turn every arm further about two axes between samples",
        partial(Reading.exchange_states, numbers=dict(zip((first, second), numbers, strict=True))),
    )


def _still_runs(order: IntArray, track: Track) -> list[IntArray]:
    """The samples of each session in which an arm stood at one stop; none if it always did."""
    runs = np.split(np.arange(len(order)), np.flatnonzero(np.diff(track.stand)) + 1)
    fewest = max(_FEWEST_STILL, len(order) // 10)
    return [order[run] for run in runs if fewest <= len(run) < len(order) and track.seen[run[0]]]


def _pixel_hypotheses() -> Iterator[ConventionHypothesis]:
    yield ConventionHypothesis(
        "pixels-swapped",
        (),
        "u and v of the pixels are exchanged",
        "write [u, v], u along the width of the image: exchange them",
        "move every arm further between samples",
        Reading.with_pixels_exchanged,
    )


def _order_hypotheses(streams: list[str | None], count: int) -> Iterator[ConventionHypothesis]:
    for stream in streams:
        yield _reverse_order(stream)
        yield from (_sort_by_number(stream, first) for first in (0, 1) if count > 10)
        for by in _FAR_SHIFTS:
            if abs(by) < count // 3:
                yield shift(stream, by)


def _sort_by_number(stream: str | None, first: int) -> ConventionHypothesis:
    """Rows that were sorted as text by their numbers from `first`: 1, 10, 11, 2."""

    def reread(reading: Reading) -> Reading:
        """Each row where its number belongs."""
        return reading.pair_stream(stream, np.argsort(sorted(range(first, first + len(reading.order)), key=str)))

    order = ", ".join(sorted(map(str, range(first, first + 12)))[:4])
    return pair_differently(stream, f"is sorted as text: {order}", "sort it by number", reread)


def _reverse_order(stream: str | None) -> ConventionHypothesis:
    def reread(reading: Reading) -> Reading:
        """The last in the place of the first."""
        return reading.pair_stream(stream, np.arange(len(reading.order))[::-1])

    return pair_differently(stream, "stands in reverse order", "turn its order round", reread)


def _rotation_hypotheses(names: tuple[str, ...], subject: str) -> Iterator[ConventionHypothesis]:
    distinction = f"turn {' and '.join(names) or 'every arm'} further between samples"
    yield ConventionHypothesis(
        "matrix-transposed",
        names,
        f"the rotation matrices of {subject} are transposed",
        "write them by rows, or transpose them",
        distinction,
        map_poses(names, lambda poses: SE3(poses.rotation.mT, poses.translation)),
    )
    yield from _position_axes(names, subject)
    for meant, read in permutations(_LISTINGS, 2):
        if (_LISTINGS[meant], _LISTINGS[read]) == ("ZYX", "xyz"):
            continue  # the same three numbers the other way round, as the reverse is
        words = f"the rotations of {subject} are {meant} that were read as {read}"
        if (_LISTINGS[meant], _LISTINGS[read]) == ("xyz", "ZYX"):
            words = f"the angles of {subject} are in the reverse order: roll, pitch, yaw and KUKA's A, B, C mixed up"
        # Two lists of angles give one rotation. The middle one of three axes is usually within a quarter turn.
        of_three_axes = all(len(set(_LISTINGS[each])) == len("xyz") for each in (meant, read))
        choices = (
            (_first, _nearest) if not _LISTINGS[read] else (_first,) if of_three_axes else (_first, _second, _shorter)
        )
        for choose in choices:
            yield ConventionHypothesis(
                "euler-order",
                names,
                words,
                f"turn them into rotations as {meant}",
                distinction,
                map_poses(names, _relist_rotations(_LISTINGS[meant], _LISTINGS[read], choose)),
            )


def _position_axes(names: tuple[str, ...], subject: str) -> Iterator[ConventionHypothesis]:
    for words, axes in _AXES.items():
        yield ConventionHypothesis(
            "position-axes",
            names,
            f"the positions of {subject} have {words}",
            "correct the order and the signs of x, y and z: axes are right-handed",
            "turn every arm further between samples",
            map_poses(names, _with_axes(axes)),
        )


def _with_axes(axes: Array) -> PoseMap:
    return lambda poses: SE3(poses.rotation, poses.translation @ axes)


def _relist_rotations(convention: str, read: str, choose: Callable[[Array, Array], IntArray]) -> PoseMap:
    def relist(poses: SE3) -> SE3:
        """The poses whose three numbers, listed as `meant`, were read as `read`."""
        numbers = _numbers(poses.rotation, read)
        of_numbers, flat = scipy.spatial.transform.Rotation, numbers.reshape(-1, 3)
        turned = of_numbers.from_euler(convention, flat) if convention else of_numbers.from_rotvec(flat)
        rotations = turned.as_matrix().reshape(*numbers.shape, 3)
        return replace(poses, rotation=rotations[np.arange(len(numbers)), choose(numbers, rotations)])

    return relist


def _first(numbers: Array, rotations: Array) -> IntArray:
    return np.zeros(len(numbers), dtype=np.int64)


def _second(numbers: Array, rotations: Array) -> IntArray:
    return np.ones(len(numbers), dtype=np.int64)


def _shorter(numbers: Array, rotations: Array) -> IntArray:
    chosen: IntArray = np.argmin(lengths(numbers), axis=1)
    return chosen


def _nearest(numbers: Array, rotations: Array) -> IntArray:
    """The list of each rotation that is nearest to those of the others: arms move about a home."""
    centres = rotations[:_CENTRES].reshape(-1, 3, 3)
    traces = np.einsum("cij,nkij->cnk", centres, rotations)  # 1 + 2 cos of the angle between two
    angles = np.arccos(np.clip((traces - 1) / 2, -1, 1))
    chosen: IntArray = np.argmin(angles[np.argmin(angles.min(axis=2).sum(axis=1))], axis=1)
    return chosen


def _numbers(rotation: Array, listing: str) -> Array:
    """The two lists of three numbers that give each rotation, (n, 2, 3) [rad]; of a rotation vector one, twice."""
    turned = scipy.spatial.transform.Rotation.from_matrix(rotation)
    if not listing:
        vector = turned.as_rotvec()
        angle = lengths(vector)[:, None]
        return np.stack([vector, vector * (1 - 2 * np.pi / np.maximum(angle, _NO_TURN_RAD))], axis=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # where two axes align any split of the angles is right
        angles = turned.as_euler(listing)
    first, middle, last = angles.T
    other = -middle if listing[0] == listing[2] else np.pi - middle
    return _wrap_angles(np.stack([angles, np.column_stack([first + np.pi, other, last + np.pi])], axis=1))


def _wrap_angles(angles: Array) -> Array:
    within: Array = (angles + np.pi) % (2 * np.pi) - np.pi
    return within
