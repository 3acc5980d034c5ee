"""Rotations of A X B = Y C Z where no closed form determines them: the best cells of a grid, refined in turn.

Given two of the three rotations, the third that fits best is the one nearest to a weighted mean over the samples. X is
nearest to that of A'YCZB', Y to that of AXBZ'C', and Z to that of C'Y'AXB. All three are sums over products of entries
of A, C and B. The moments sum w^2 A (x) C (x) B, (9, 9, 9) of one loop, therefore represent its samples. Loops with the
same unknowns go side by side. The sixty rotations of the icosahedron cover all rotations within 45 degrees.
`benchmarks.starts` judges its limits.
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

# Cells of the grid that are refined; for how many rounds, and how many of the best go on then.
_GRID_CELLS = 16
_ALTERNATION_SCHEDULE = ((5, 6), (10, 2), (25, 1))
_CHUNK_LOOPS = 8
# Of starts that are refined as a whole later: enough to bring grid cells of one basin together.
_START_ROUNDS = 12
_SETTLING_ROUNDS = 25  # of one start: its error falls to a few hundredths
# Starts nearer to each other than this end in the same optimum: half of what a descent's basin spans [rad].
_EQUAL_ANGLE_RAD = 0.15
# Rotations whose entries change by less in a round have settled.
_CONVERGED_ANGLE_RAD = 1e-6
# Each round of the sum of singular values leaves at most a ninth of the error: enough to rank by.
_SUM_ROUNDS = 8

KEPT_SHARE = 0.7
"""Share of samples that counts, the best: three in ten may be outliers; `benchmarks.starts` judges it."""

HOPELESS_RAD = 0.5
"""Rotations further off than this [rad] are wrong: no further round or reading helps; `benchmarks.starts`."""

Turns = Mapping[str, Array]
"""By letter of X, Y and Z: (h, m, 3, 3) rotations of h loops, m of each."""


@cache
def icosahedral_rotations() -> Array:
    """The sixty rotations that carry an icosahedron onto itself, (60, 3, 3).

    Those of a tetrahedron, each after a turn about a vertex: half turns about the axes, and the axes in turn.
    """
    vertex = np.array([0.0, 1.0, (1 + 5**0.5) / 2])
    about_vertex = rotation_exp(2 * np.pi / 5 * np.arange(5)[:, None] * vertex / np.linalg.norm(vertex))
    signs = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    tetrahedral = np.array([np.roll(np.diag(each), shift, axis=0) for each in signs for shift in range(3)])
    return read_only((tetrahedral[:, None] @ about_vertex).reshape(-1, 3, 3))


@dataclass(frozen=True, eq=False)
class _Loops:
    """Loops with the same unknowns, h of them, of at most n samples.

    Attributes:
        a: (h, n, 3, 3), rotations of A.
        b: (h, n, 3, 3), likewise.
        c: (h, n, 3, 3), likewise.
        weight: (h, n), 0 if a loop has fewer samples.
        count: (h,) how many samples a loop has.
        known: (h, 1, 3, 3) by the letters that are known.
        unknown: The other letters.
        moments: (h, 9, 9, 9) by entries of X, Y and Z.
    """

    a: Array
    b: Array
    c: Array
    weight: Array
    count: IntArray
    known: Turns
    unknown: str
    moments: Array

    def means(self, letter: str, turns: Turns, count: bool = False) -> Array:
        """Weighted sums whose nearest rotation is the one of `letter`, (h, m, 3, 3); `count` firsts by all seconds.

        Then they are (h, p, q, 3, 3) of p of the first and q of the second other letter.
        """
        first, second = (other for other in "xyz" if other != letter)
        h = len(self.moments)
        by = np.moveaxis(self.moments, 1 + "xyz".index(letter), -1).reshape(h, 9, 81)
        p, q = (turns[other].reshape(*turns[other].shape[:2], 9) for other in (first, second))
        half = (p @ by).reshape(h, p.shape[1], 9, 9)
        if count:
            return np.asarray((q[:, None] @ half).reshape(h, p.shape[1], q.shape[1], 3, 3))
        return np.asarray((q[:, :, None] @ half).reshape(h, p.shape[1], 3, 3))


def pose_starts(loops: Sequence[Loop], max_count: int) -> list[list[Rotations]]:
    """The most promising rotations of X, Y and Z of each loop whose views give whole poses, without duplicates.

    The best cells of the grid, refined: most of them end in the same few places.

    Args:
        loops: With the same unknowns.
        max_count: How many cells of the grid.
    """
    every = _loops(loops)
    at = _alternate(every, _grid_starts(every, max_count), _START_ROUNDS)
    count = at[every.unknown[0]].shape[1]
    turns = {k: np.broadcast_to(turn, (len(loops), count, 3, 3)) for k, turn in at.items()}
    off = np.max([rotation_angle(turns[k][:, :, None], turns[k][:, None]) for k in every.unknown], axis=0)
    return [
        [Rotations(*(turns[k][h, i] for k in "xyz")) for i in _distinct_rotations(off[h])] for h in range(len(loops))
    ]


def settled_rotations(loops: Sequence[Loop], starts: Sequence[Rotations]) -> list[Rotations]:
    """Rotations of loops with the same unknowns that agree with each loop's own samples, downhill of X, Y, Z."""
    every = _loops(loops)
    begun = {k: np.stack([getattr(turns, k)[None] for turns in starts]) for k in every.unknown}
    at = _alternate(every, {**every.known, **begun}, _SETTLING_ROUNDS)
    return [Rotations(*(at[k][h, 0] for k in "xyz")) for h in range(len(loops))]


def _distinct_rotations(angles: Array) -> list[int]:
    """The rotations that differ from all before them, by angles (m, m)."""
    apart: list[int] = []
    for i in range(len(angles)):
        if np.all(angles[i, apart] > _EQUAL_ANGLE_RAD):
            apart.append(i)
    return apart


def search_rotations(loops: Sequence[Loop]) -> list[Rotations]:
    """Rotations of loops with the same unknowns, two or three, that close most samples of each."""
    every = _loops(loops)
    at = _grid_starts(every, _GRID_CELLS)
    found = {k: turn[:, 0].copy() for k, turn in at.items()}
    going = np.arange(len(loops))
    for rounds, best in _ALTERNATION_SCHEDULE:
        some = take(every, going)
        at, angle = _rank_rotations(some, _alternate(some, at, rounds), best)
        for letter, turn in at.items():
            found[letter][going] = turn[:, 0]
        near = angle[:, 0] < HOPELESS_RAD
        going, at = going[near], take(at, near)
        if not len(going):
            break
    return [Rotations(*triple) for triple in zip(found["x"], found["y"], found["z"], strict=True)]


def rotation_angle(first: Array, second: Array) -> Array:
    """Angles between rotations, (..., 3, 3) each to (...,) [rad]: exact near zero, to 1e-8 near half a turn."""
    off = first - second
    chord = np.sqrt(np.einsum("...ij,...ij->...", off, off) / 8)
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
    """The most promising rotations, (h, m, 3, 3) by letter, best first; of so many loops at a time as a cache holds."""
    count = len(loops.moments)
    parts = [
        _best_of_grid(take(loops, slice(at, at + _CHUNK_LOOPS)), max_count) for at in range(0, count, _CHUNK_LOOPS)
    ]
    return concatenate(parts)


def _best_of_grid(loops: _Loops, max_count: int) -> dict[str, Array]:
    h = len(loops.moments)
    averaged, grid = loops.unknown[-1], icosahedral_rotations()
    tried = {
        k: np.broadcast_to(grid, (h, len(grid), 3, 3)) if k in loops.unknown else loops.known[k]
        for k in "xyz"
        if k != averaged
    }
    first, second = tried
    means = loops.means(averaged, tried, count=True)
    score = _sum_of_singular_values(means).reshape(h, -1)
    max_count = min(max_count, score.shape[1])
    best = np.argpartition(-score, max_count - 1, axis=-1)[:, :max_count]
    row = np.arange(h)[:, None]
    best = best[row, np.argsort(-score[row, best], axis=-1, kind="stable")]
    at_first, at_second = np.unravel_index(best, means.shape[1:3])
    return {
        first: tried[first][row, at_first],
        second: tried[second][row, at_second],
        averaged: nearest_rotation(means[row, at_first, at_second]),
    }


def _sum_of_singular_values(matrix: Array) -> Array:
    """Nuclear norms of (..., 3, 3), tenfold faster than by their singular values s, t and u.

    With p = st + tu + us, these hold: (s + t + u)^2 == s^2 + t^2 + u^2 + 2 p and p^2 == (st)^2 + (tu)^2 + (us)^2 + 2
    stu (s + t + u). The squares of the entries give the first sum of squares, those of the cofactors the second, and
    the determinant is stu.
    """
    rows = np.moveaxis(matrix, -2, 0)
    cofactors = np.cross(rows[[1, 2, 0]], rows[[2, 0, 1]])
    twice_determinant = 2 * np.abs(np.vecdot(rows[0], cofactors[0]))
    squares, squared_products = (np.vecdot(of, of).sum(0) for of in (rows, cofactors))
    total: Array = np.sqrt(3 * squares)
    for _ in range(_SUM_ROUNDS):
        total = np.sqrt(squares + 2 * np.sqrt(squared_products + twice_determinant * total))
    return total


def _alternate(loops: _Loops, turns: Turns, rounds: int) -> dict[str, Array]:
    """Each unknown rotation in turn as the mean that follows from the others, until those of a loop settle."""
    found = {k: turn.copy() for k, turn in turns.items()}
    moving = np.arange(len(loops.moments))
    for _ in range(rounds):
        if not len(moving):
            break
        some, now = take(loops, moving), take(found, moving)
        for letter in loops.unknown:
            now[letter] = nearest_rotation(some.means(letter, now))
        change = [np.abs(now[k] - found[k][moving]).max((1, 2, 3)) for k in loops.unknown]
        for letter in loops.unknown:
            found[letter][moving] = now[letter]
        moving = moving[np.max(change, axis=0) > _CONVERGED_ANGLE_RAD]
    return found


def _rank_rotations(loops: _Loops, turns: Turns, max_count: int) -> tuple[dict[str, Array], Array]:
    """The best rotations of each loop, (h, most, 3, 3) by letter, and the angles that they leave, (h, most) [rad]."""
    x, y, z = (turns[k][:, :, None] for k in "xyz")
    seen = loops.a[:, None] @ x @ loops.b[:, None]
    told = y @ loops.c[:, None] @ z
    angle = _trimmed_rms(rotation_angle(told, seen), loops.count)
    best = np.argsort(angle, axis=-1, kind="stable")[:, :max_count]
    row = np.arange(len(best))[:, None]
    return {k: turn[row, best] for k, turn in turns.items()}, angle[row, best]


def _trimmed_rms(angle: Array, count: IntArray) -> Array:
    """Rms over the least of the first `count` values, (h, m, n) to (h, m)."""
    among = np.arange(angle.shape[-1]) < count[:, None]
    ordered = np.sort(np.where(among[:, None], angle, np.inf), axis=-1)
    kept = np.maximum(1, np.ceil(KEPT_SHARE * count).astype(np.int64))
    used = np.arange(angle.shape[-1]) < kept[:, None]
    total: Array = np.sqrt(np.sum(np.where(used[:, None], ordered, 0.0) ** 2, -1) / kept[:, None])
    return total
