"""Choice of the samples that are most informative about the task: greedy with exchange.

Let C be the covariance, and U U' the information that a sample adds to its inverse. C decreases by
C U (I + U'C U)^-1 U'C (Woodbury). Each candidate needs the inverse of one (q, q) matrix; q is the number of columns of
U. The criterion is trace(W C), A-optimality at the task.

Source: Fedorov 1972 (exchange); docs/mathematics.md (15.1), (15.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from basecal.geometry import Array

_EXCHANGE_PASSES = 3  # over the chosen samples: the third changes almost nothing
_LEAST_GAIN = 1e-4  # relative gain of the criterion in a pass, below which no further pass is made

IsEnough = Callable[[Array, int], bool]
"""Whether a covariance, (p, p), with a number of candidates is good enough."""


def greedy_choices(roots: Array, covariance: Array, weight: Array) -> Iterator[tuple[int, Array]]:
    """Yield the best remaining candidate again and again, with the covariance after it, (p, p).

    Args:
        roots: (n, p, q) root U of each candidate.
        covariance: (p, p) covariance without candidates.
        weight: (p, p) weight W.
    """
    is_left = np.ones(len(roots), dtype=bool)
    while is_left.any():
        best = int(np.argmax(np.where(is_left, gains(roots, covariance, weight), -np.inf)))
        is_left[best] = False
        covariance = with_sample(covariance, roots[best])
        yield best, covariance


def exchange(roots: Array, choice: list[int], covariance: Array, weight: Array) -> tuple[list[int], Array]:
    """Improve a choice by exchanging each sample for the best other one; the new choice and its covariance, (p, p).

    Args:
        roots: (n, p, q) root U of each candidate.
        choice: Indices of the chosen candidates.
        covariance: (p, p) covariance with the chosen candidates.
        weight: (p, p) weight W.
    """
    choice = list(choice)
    for _ in range(_EXCHANGE_PASSES):
        previous = float(np.trace(weight @ covariance))
        for position, old in enumerate(choice):
            reduced = without_sample(covariance, roots[old])
            gain = gains(roots, reduced, weight)
            gain[[k for k in choice if k != old]] = -np.inf
            choice[position] = int(np.argmax(gain))
            covariance = with_sample(reduced, roots[choice[position]])
        if previous - float(np.trace(weight @ covariance)) < _LEAST_GAIN * previous:
            break
    return choice, covariance


def choose_fewest(
    roots: Array, covariance: Array, weight: Array, max_count: int, is_enough: IsEnough
) -> tuple[list[int], bool]:
    """The fewest candidates that satisfy `is_enough`, or the best `max_count`; and whether they satisfy it.

    Args:
        roots: (n, p, q) root U of each candidate.
        covariance: (p, p) covariance without candidates.
        weight: (p, p) weight W.
        max_count: Largest number of candidates.
        is_enough: Criterion for a covariance, (p, p), and the number of candidates.
    """
    if is_enough(covariance, 0):
        return [], True
    chosen: list[int] = []
    current = covariance
    for best, current in greedy_choices(roots, covariance, weight):
        chosen.append(best)
        if is_enough(current, len(chosen)) or len(chosen) == max_count:
            break
    chosen, current = exchange(roots, chosen, current, weight)
    if not is_enough(current, len(chosen)):
        return chosen, False
    while len(chosen) > 1:
        losses = [float(np.trace(weight @ without_sample(current, roots[k]))) for k in chosen]
        least_useful = chosen[int(np.argmin(losses))]
        others = [k for k in chosen if k != least_useful]
        fewer, reduced = exchange(roots, others, without_sample(current, roots[least_useful]), weight)
        if not is_enough(reduced, len(fewer)):
            break
        chosen, current = fewer, reduced
    return chosen, True


def gains(roots: Array, covariance: Array, weight: Array) -> Array:
    """Decrease of the criterion by each candidate alone, (n,)."""
    n, p, q = roots.shape
    flat = np.swapaxes(roots, 0, 1).reshape(p, n * q)
    spread = np.swapaxes((covariance @ flat).reshape(p, n, q), 0, 1)
    decrease = np.swapaxes(spread, 1, 2) @ weight @ spread
    inner = np.eye(q) + np.swapaxes(roots, 1, 2) @ spread
    return np.asarray(np.trace(np.linalg.solve(inner, decrease), axis1=1, axis2=2))


def with_sample(covariance: Array, root: Array) -> Array:
    """The covariance with one additional sample."""
    spread = covariance @ root
    return _symmetrise(covariance - spread @ np.linalg.solve(np.eye(root.shape[1]) + root.T @ spread, spread.T))


def without_sample(covariance: Array, root: Array) -> Array:
    """The covariance without one of its samples."""
    spread = covariance @ root
    return _symmetrise(covariance + spread @ np.linalg.solve(np.eye(root.shape[1]) - root.T @ spread, spread.T))


def _symmetrise(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))
