"""Mix-ups that are looked for only where nothing usual explains how the targets move.

An order turned round, streams off by many samples, rotation matrices transposed, and angles that one controller lists
in one way and were read in another. They are many: each costs a look, and chance more to choose from.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from basecal.accuracy.input_check import rewriting
from basecal.accuracy.input_check.hypotheses import (
    ConventionHypothesis,
    Rewritten,
    given_by_pose,
    listed,
    of_robots,
    of_targets,
    shift,
    streams,
    subsets,
)
from basecal.cell import Cell, PoseObservation, Recording
from basecal.geometry import SE3, Array

_FAR_SHIFTS = tuple(by for far in (3, 4, 5, 6) for by in (far, -far))  # samples; up to two are usual slips
# How controllers list three numbers of a rotation, by SciPy's names: capitals are axes that turn with the flange.
_LISTINGS = {
    "roll, pitch, yaw about fixed axes x, y, z (ROS, FANUC)": "xyz",
    "angles about moving axes x, y, z (Staubli)": "XYZ",
    "angles about moving axes z, y, x (KUKA's A, B, C)": "ZYX",
    "angles about moving axes z, y, z (Kawasaki, Denso)": "ZYZ",
    "a rotation vector (Universal Robots)": "",
}


def rare_hypotheses(cell: Cell, recording: Recording) -> list[ConventionHypothesis]:
    """All of them that this recording can have."""
    robots = given_by_pose(cell, recording)
    moved = streams([name for name in cell.robots if any(name in s.robots for s in recording.samples)])
    poses = any(isinstance(o, PoseObservation) for s in recording.samples for o in s.observations)
    return [
        *_of_order(moved, recording),
        *(hypothesis for names in subsets(robots) for hypothesis in _of_rotations(names, of_robots, listed(names))),
        *(_of_rotations((), lambda _, of: of_targets(of), "the observed target") if poses else ()),
    ]


def _of_order(moved: list[str | None], recording: Recording) -> Iterator[ConventionHypothesis]:
    for stream in moved:
        yield _turned_round(stream)
        for by in _FAR_SHIFTS:
            if abs(by) < len(recording.samples) // 3:
                yield shift(stream, by)


def _turned_round(stream: str | None) -> ConventionHypothesis:
    who = "what the cameras saw" if stream is None else f"what {stream} recorded"
    return ConventionHypothesis(
        "pairing-shifted",
        () if stream is None else (stream,),
        f"{who} stands in reverse order",
        "turn its order round",
        "let the arms stand in clearly different poses from one sample to the next",
        lambda cell, recording: (cell, rewriting.turned_round(recording, stream)),
    )


def _of_rotations(
    names: tuple[str, ...],
    rewritten: Callable[[tuple[str, ...], rewriting.PoseMap], Callable[[Cell, Recording], Rewritten]],
    who: str,
) -> Iterator[ConventionHypothesis]:
    tell = f"turn {listed(names) or 'every arm'} further between samples"
    yield ConventionHypothesis(
        "matrix-transposed",
        names,
        f"the rotation matrices of {who} are transposed",
        "write them by rows, or transpose them",
        tell,
        rewritten(names, lambda poses: SE3(np.swapaxes(poses.rotation, -1, -2), poses.translation)),
    )
    for meant, read in permutations(_LISTINGS, 2):
        # Two lists of angles give one rotation. The middle one of three axes is usually within a quarter turn.
        of_three_axes = all(len(set(_LISTINGS[each])) == len("xyz") for each in (meant, read))
        for choose in (_first,) if of_three_axes else (_first, _second, _shorter):
            yield ConventionHypothesis(
                "euler-order",
                names,
                f"the rotations of {who} are {meant} that were read as {read}",
                f"turn them into rotations as {meant}",
                tell,
                rewritten(names, _relisted(_LISTINGS[meant], _LISTINGS[read], choose)),
            )


def _relisted(meant: str, read: str, choose: Callable[[Array], Array]) -> rewriting.PoseMap:
    def of(poses: SE3) -> SE3:
        """The poses whose three numbers, listed as `meant`, were read as `read`."""
        numbers = choose(_numbers(poses.rotation, read))
        turned = Rotation.from_euler(meant, numbers) if meant else Rotation.from_rotvec(numbers)
        return replace(poses, rotation=turned.as_matrix())

    return of


def _first(numbers: Array) -> Array:
    return numbers[:, 0]


def _second(numbers: Array) -> Array:
    return numbers[:, 1]


def _shorter(numbers: Array) -> Array:
    chosen: Array = numbers[np.arange(len(numbers)), np.argmin(np.linalg.norm(numbers, axis=-1), axis=-1)]
    return chosen


def _numbers(rotation: Array, listing: str) -> Array:
    """The two lists of three numbers that give each rotation, (n, 2, 3) [rad]; of a rotation vector one, twice."""
    turned = Rotation.from_matrix(rotation)
    if not listing:
        return np.repeat(turned.as_rotvec()[:, None], 2, axis=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # where two axes align any split of the angles is right
        angles = turned.as_euler(listing)
    first, middle, last = angles.T
    other = -middle if listing[0] == listing[2] else np.pi - middle
    both: Array = np.stack([angles, np.stack([first + np.pi, other, last + np.pi], axis=-1)], axis=1)
    return (both + np.pi) % (2 * np.pi) - np.pi
