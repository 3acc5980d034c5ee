"""Rotations of A X B = Y C Z if no closed form determines them: the best cells of a grid, refined by alternation.

Given two of the three rotations, the best third one is the rotation nearest to a weighted mean over the samples. X is
nearest to the mean of A'YCZB', Y to that of AXBZ'C', and Z to that of C'Y'AXB. All three are sums of products of
entries of A, C and B. The moments sum w^2 A (x) C (x) B of a loop, (9, 9, 9), are therefore sufficient statistics of
its samples. Loops with the same unknowns form a batch. Every rotation is within 45 degrees of one of the 60 rotations
of the icosahedron.
The thresholds are validated by `benchmarks.starts`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from basecal.estimation.start.closed_form import Loop, Rotations
from basecal.geometry import Array, IntArray, read_only
from basecal.geometry.rotation import nearest_rotation, rotation_exp
from basecal.numerics.batch import concatenate, take

# Number of refined cells of the grid; then rounds, and number of best candidates retained after them.
_GRID_CELLS = 16
_ALTERNATION_SCHEDULE = ((5, 6), (10, 2), (25, 1))
_CHUNK_LOOPS = 8
# Rounds for starts that are fully refined later: enough to merge grid cells of one basin.
_START_ROUNDS = 12
_SETTLING_ROUNDS = 25  # rounds for a single start: reduces its error to a few percent
# [rad] starts closer to each other have the same optimum: half the width of a descent's basin.
_EQUAL_ANGLE_RAD = 0.15
# Largest change of an entry in a round at which rotations have converged.
_CONVERGED_ANGLE_RAD = 1e-6
# Each round reduces the error of the sum of singular values at least ninefold: sufficient for ranking.
_SUM_ROUNDS = 8

KEPT_SHARE = 0.7
"""Share of samples in a trimmed error: 30 % of them may be outliers; validated by `benchmarks.starts`."""

HOPELESS_RAD = 0.5
"""Error beyond which rotations are wrong and not refined further [rad]; validated by `benchmarks.starts`."""

RotationsByLetter = Mapping[str, Array]
"""Rotations of h loops, m candidates each, (h, m, 3, 3), by letter of X, Y and Z."""


@cache
def icosahedral_rotations() -> Array:
    """Rotation group of the icosahedron, (60, 3, 3).

    Each element is the product of a tetrahedral rotation and a rotation about a vertex. The tetrahedral rotations are
    half turns about the axes, cyclic permutations of the axes, and their products.
    """
    vertex = np.array([0.0, 1.0, (1 + 5**0.5) / 2])
    about_vertex = rotation_exp(2 * np.pi / 5 * np.arange(5)[:, None] * vertex / np.linalg.norm(vertex))
    signs = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    tetrahedral = np.array([np.roll(np.diag(each), shift, axis=0) for each in signs for shift in range(3)])
    return read_only((tetrahedral[:, None] @ about_vertex).reshape(-1, 3, 3))


@dataclass(frozen=True, eq=False)
class _Loops:
    """Batch of h loops with the same unknowns and at most n samples.

    Attributes:
        a: (h, n, 3, 3) rotations of A.
        b: (h, n, 3, 3) rotations of B.
        c: (h, n, 3, 3) rotations of C.
        weight: (h, n) weights of samples, 0 for padding.
        count: (h,) number of samples of each loop.
        known: (h, 1, 3, 3) known rotations, by letter of X, Y and Z.
        unknown: Letters of the unknown rotations.
        moments: (h, 9, 9, 9) moments by entries of X, Y and Z.
    """

    a: Array
    b: Array
    c: Array
    weight: Array
    count: IntArray
    known: RotationsByLetter
    unknown: str
    moments: Array

    def means(self, letter: str, rotations: RotationsByLetter, all_pairs: bool = False) -> Array:
        """Weighted means whose nearest rotation is the best one of `letter`, (h, m, 3, 3).

        Args:
            letter: Letter of X, Y or Z.
            rotations: Candidates of the other two letters, paired by index.
            all_pairs: Whether to combine all p candidates of the first letter with all q of the second, to
                (h, p, q, 3, 3).
        """
        first, second = (other for other in "xyz" if other != letter)
        h = len(self.moments)
        moments = np.moveaxis(self.moments, 1 + "xyz".index(letter), -1).reshape(h, 9, 81)
        p, q = (rotations[other].reshape(*rotations[other].shape[:2], 9) for other in (first, second))
        half = (p @ moments).reshape(h, p.shape[1], 9, 9)
        if all_pairs:
            return np.asarray((q[:, None] @ half).reshape(h, p.shape[1], q.shape[1], 3, 3))
        return np.asarray((q[:, :, None] @ half).reshape(h, p.shape[1], 3, 3))


def pose_starts(loops: Sequence[Loop], max_count: int) -> list[list[Rotations]]:
    """Find distinct start rotations of X, Y and Z for each loop of views with poses.

    The best cells of the grid are refined; most of them converge to the same few rotations.

    Args:
        loops: Loops with the same unknowns.
        max_count: Number of cells of the grid.
    """
    batch = _loops(loops)
    refined = _alternate(batch, _grid_starts(batch, max_count), _START_ROUNDS)
    count = refined[batch.unknown[0]].shape[1]
    rotations = {k: np.broadcast_to(rotation, (len(loops), count, 3, 3)) for k, rotation in refined.items()}
    angles = np.max([rotation_angle(rotations[k][:, :, None], rotations[k][:, None]) for k in batch.unknown], axis=0)
    return [
        [Rotations(*(rotations[k][h, i] for k in "xyz")) for i in _distinct_rotations(angles[h])]
        for h in range(len(loops))
    ]


def refine_rotations(loops: Sequence[Loop], starts: Sequence[Rotations]) -> list[Rotations]:
    """Refine start rotations of loops with the same unknowns by alternation, each loop with its own samples."""
    batch = _loops(loops)
    unknown_starts = {k: np.stack([getattr(start, k)[None] for start in starts]) for k in batch.unknown}
    refined = _alternate(batch, {**batch.known, **unknown_starts}, _SETTLING_ROUNDS)
    return [Rotations(*(refined[k][h, 0] for k in "xyz")) for h in range(len(loops))]


def _distinct_rotations(angles: Array) -> list[int]:
    """Indices of rotations that differ from all previously selected ones, given their angles (m, m) [rad]."""
    distinct: list[int] = []
    for i in range(len(angles)):
        if np.all(angles[i, distinct] > _EQUAL_ANGLE_RAD):
            distinct.append(i)
    return distinct


def search_rotations(loops: Sequence[Loop]) -> list[Rotations]:
    """Find the rotations that close most samples of each loop; loops have the same two or three unknowns."""
    batch = _loops(loops)
    candidates = _grid_starts(batch, _GRID_CELLS)
    found = {k: rotation[:, 0].copy() for k, rotation in candidates.items()}
    active = np.arange(len(loops))
    for rounds, best in _ALTERNATION_SCHEDULE:
        active_loops = take(batch, active)
        candidates, angle = _rank_rotations(active_loops, _alternate(active_loops, candidates, rounds), best)
        for letter, rotation in candidates.items():
            found[letter][active] = rotation[:, 0]
        is_close = angle[:, 0] < HOPELESS_RAD
        active, candidates = active[is_close], take(candidates, is_close)
        if not len(active):
            break
    return [Rotations(*triple) for triple in zip(found["x"], found["y"], found["z"], strict=True)]


def rotation_angle(first: Array, second: Array) -> Array:
    """Angles between rotations (..., 3, 3), (...,) [rad]; exact near zero, accurate to 1e-8 near half a turn."""
    difference = first - second
    chord = np.sqrt(np.einsum("...ij,...ij->...", difference, difference) / 8)
    angle: Array = 2 * np.arcsin(np.minimum(chord, 1.0))
    return angle


def _loops(loops: Sequence[Loop]) -> _Loops:
    n = max(len(loop.weight) for loop in loops)
    a, b, c = (np.stack([_pad_rotations(getattr(loop, k).rotation, n) for loop in loops]) for k in "abc")
    weight = np.stack([np.append(loop.weight, np.zeros(n - len(loop.weight))) for loop in loops])
    unknown = loops[0].unknown
    known = {k: np.stack([getattr(loop, k).rotation[None] for loop in loops]) for k in "xyz" if k not in unknown}
    count = np.array([len(loop.weight) for loop in loops])
    return _Loops(a, b, c, weight, count, known, unknown, _moments(a, b, c, weight))


def _pad_rotations(rotations: Array, n: int) -> Array:
    return np.concatenate([rotations, np.broadcast_to(np.eye(3), (n - len(rotations), 3, 3))])


def _moments(a: Array, b: Array, c: Array, weight: Array) -> Array:
    """Sums over samples of w^2 A_ji C_km B_lp, (h, 9, 9, 9) by (i, l), (j, k) and (m, p)."""
    h, n = weight.shape
    share = weight**2 / np.sum(weight**2, -1, keepdims=True)
    left = (share[..., None, None] * a).reshape(h, n, 9)
    right = (c[..., :, :, None, None] * b[..., None, None, :, :]).reshape(h, n, 81)
    total = (left.mT @ right).reshape(h, 3, 3, 3, 3, 3, 3)
    # The axes are j, i, k, m, l, p.
    return np.asarray(total.transpose(0, 2, 5, 1, 3, 4, 6).reshape(h, 9, 9, 9))


def _grid_starts(loops: _Loops, max_count: int) -> dict[str, Array]:
    """Best rotations of the grid, (h, m, 3, 3) by letter, best first; in chunks of loops that fit into the cache."""
    count = len(loops.moments)
    parts = [
        _best_of_grid(take(loops, slice(start, start + _CHUNK_LOOPS)), max_count)
        for start in range(0, count, _CHUNK_LOOPS)
    ]
    return concatenate(parts)


def _best_of_grid(loops: _Loops, max_count: int) -> dict[str, Array]:
    h = len(loops.moments)
    averaged, grid = loops.unknown[-1], icosahedral_rotations()
    candidates = {
        k: np.broadcast_to(grid, (h, len(grid), 3, 3)) if k in loops.unknown else loops.known[k]
        for k in "xyz"
        if k != averaged
    }
    first, second = candidates
    means = loops.means(averaged, candidates, all_pairs=True)
    score = _sum_of_singular_values(means).reshape(h, -1)
    max_count = min(max_count, score.shape[1])
    best = np.argpartition(-score, max_count - 1, axis=-1)[:, :max_count]
    row = np.arange(h)[:, None]
    best = best[row, np.argsort(-score[row, best], axis=-1, kind="stable")]
    first_index, second_index = np.unravel_index(best, means.shape[1:3])
    return {
        first: candidates[first][row, first_index],
        second: candidates[second][row, second_index],
        averaged: nearest_rotation(means[row, first_index, second_index]),
    }


def _sum_of_singular_values(matrix: Array) -> Array:
    """Nuclear norms of (..., 3, 3), (...,), by a fixed-point iteration ten times as fast as a decomposition.

    s, t and u are the singular values and p = st + tu + us. Two equations hold: (s + t + u)^2 == s^2 + t^2 + u^2 + 2 p
    and p^2 == (st)^2 + (tu)^2 + (us)^2 + 2 stu (s + t + u). The first sum of squares is that of the entries, the second
    that of the cofactors, and stu is the absolute determinant.
    """
    rows = np.moveaxis(matrix, -2, 0)
    cofactors = np.cross(rows[[1, 2, 0]], rows[[2, 0, 1]])
    twice_determinant = 2 * np.abs(np.vecdot(rows[0], cofactors[0]))
    squares, squared_products = (np.vecdot(vectors, vectors).sum(0) for vectors in (rows, cofactors))
    total: Array = np.sqrt(3 * squares)
    for _ in range(_SUM_ROUNDS):
        total = np.sqrt(squares + 2 * np.sqrt(squared_products + twice_determinant * total))
    return total


def _alternate(loops: _Loops, rotations: RotationsByLetter, rounds: int) -> dict[str, Array]:
    """Replace each unknown rotation in turn by the mean that follows from the others, until a loop converges."""
    found = {k: rotation.copy() for k, rotation in rotations.items()}
    moving = np.arange(len(loops.moments))
    for _ in range(rounds):
        if not len(moving):
            break
        moving_loops, current = take(loops, moving), take(found, moving)
        for letter in loops.unknown:
            current[letter] = nearest_rotation(moving_loops.means(letter, current))
        change = [np.abs(current[k] - found[k][moving]).max((1, 2, 3)) for k in loops.unknown]
        for letter in loops.unknown:
            found[letter][moving] = current[letter]
        moving = moving[np.max(change, axis=0) > _CONVERGED_ANGLE_RAD]
    return found


def _rank_rotations(loops: _Loops, rotations: RotationsByLetter, max_count: int) -> tuple[dict[str, Array], Array]:
    """Best rotations of each loop, (h, max_count, 3, 3) by letter, and their errors, (h, max_count) [rad]."""
    x, y, z = (rotations[k][:, :, None] for k in "xyz")
    measured = loops.a[:, None] @ x @ loops.b[:, None]
    predicted = y @ loops.c[:, None] @ z
    angle = _trimmed_rms(rotation_angle(predicted, measured), loops.count)
    best = np.argsort(angle, axis=-1, kind="stable")[:, :max_count]
    row = np.arange(len(best))[:, None]
    return {k: rotation[row, best] for k, rotation in rotations.items()}, angle[row, best]


def _trimmed_rms(angle: Array, count: IntArray) -> Array:
    """Trimmed rms, (h, m), of the smallest 70 % of the first `count` values of angles (h, m, n)."""
    is_sample = np.arange(angle.shape[-1]) < count[:, None]
    ordered = np.sort(np.where(is_sample[:, None], angle, np.inf), axis=-1)
    kept = np.maximum(1, np.ceil(KEPT_SHARE * count).astype(np.int64))
    is_kept = np.arange(angle.shape[-1]) < kept[:, None]
    rms: Array = np.sqrt(np.sum(np.where(is_kept[:, None], ordered, 0.0) ** 2, -1) / kept[:, None])
    return rms
