"""Which of many samples say most about the task: greedy, with exchange, by their information alone.

Let C be the covariance, and U U' the information that a sample adds to its inverse. C falls by C U (I + U'C U)^-1 U'C
(Woodbury). Each candidate costs the inverse of a matrix as small as its own information. The criterion is trace(W C),
A-optimality at the task. Source: Fedorov 1972 (exchange); docs/mathematics.md (15.1), (15.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from basecal.geometry import Array

_EXCHANGE_PASSES = 3  # over what is chosen: the third exchanges next to nothing
_LEAST_GAIN = 1e-4  # of the criterion, below which an exchange is not worth another pass

Enough = Callable[[Array, int], bool]


def greedy(roots: Array, covariance: Array, weight: Array) -> Iterator[tuple[int, Array]]:
    """Candidates in the order of what each adds to those before, none twice, with the covariance then, (p, p).

    Args:
        roots: (n, p, q) U of each candidate.
        covariance: (p, p) to begin with.
        weight: (p, p) W.
    """
    left = np.ones(len(roots), dtype=bool)
    while left.any():
        best = int(np.argmax(np.where(left, gains(roots, covariance, weight), -np.inf)))
        left[best] = False
        covariance = with_sample(covariance, roots[best])
        yield best, covariance


def exchange(roots: Array, choice: list[int], covariance: Array, weight: Array) -> tuple[list[int], Array]:
    """The choice after each sample was exchanged for the best of all others, and its covariance.

    Args:
        roots: (n, p, q).
        choice: Which were chosen.
        covariance: (p, p) with them.
        weight: (p, p).
    """
    choice = list(choice)
    for _ in range(_EXCHANGE_PASSES):
        before = float(np.trace(weight @ covariance))
        for place, old in enumerate(choice):
            without = without_sample(covariance, roots[old])
            of_each = gains(roots, without, weight)
            of_each[[k for k in choice if k != old]] = -np.inf
            choice[place] = int(np.argmax(of_each))
            covariance = with_sample(without, roots[choice[place]])
        if before - float(np.trace(weight @ covariance)) < _LEAST_GAIN * before:
            break
    return choice, covariance


def choose_fewest(
    roots: Array, covariance: Array, weight: Array, max_count: int, is_enough: Enough
) -> tuple[list[int], bool]:
    """The fewest candidates that are enough, or the best `max_count` of them, and whether they are enough.

    Args:
        roots: (n, p, q).
        covariance: (p, p) to begin with.
        weight: (p, p).
        max_count: How many at most.
        is_enough: Whether a covariance with so many candidates is.
    """
    if is_enough(covariance, 0):
        return [], True
    chosen: list[int] = []
    now = covariance
    for best, now in greedy(roots, covariance, weight):
        chosen.append(best)
        if is_enough(now, len(chosen)) or len(chosen) == max_count:
            break
    chosen, now = exchange(roots, chosen, now, weight)
    if not is_enough(now, len(chosen)):
        return chosen, False
    while len(chosen) > 1:
        losses = [float(np.trace(weight @ without_sample(now, roots[k]))) for k in chosen]
        least = chosen[int(np.argmin(losses))]
        left = [k for k in chosen if k != least]
        fewer, after = exchange(roots, left, without_sample(now, roots[least]), weight)
        if not is_enough(after, len(fewer)):
            break
        chosen, now = fewer, after
    return chosen, True


def gains(roots: Array, covariance: Array, weight: Array) -> Array:
    """Decrease of the criterion by each candidate alone, (n,)."""
    n, p, q = roots.shape
    flat = np.swapaxes(roots, 0, 1).reshape(p, n * q)
    carried = np.swapaxes((covariance @ flat).reshape(p, n, q), 0, 1)
    at_task = np.swapaxes(carried, 1, 2) @ weight @ carried
    inner = np.eye(q) + np.swapaxes(roots, 1, 2) @ carried
    return np.asarray(np.trace(np.linalg.solve(inner, at_task), axis1=1, axis2=2))


def with_sample(covariance: Array, root: Array) -> Array:
    """The covariance with one sample more."""
    carried = covariance @ root
    return _symmetrise(covariance - carried @ np.linalg.solve(np.eye(root.shape[1]) + root.T @ carried, carried.T))


def without_sample(covariance: Array, root: Array) -> Array:
    """The covariance with one sample less."""
    carried = covariance @ root
    return _symmetrise(covariance + carried @ np.linalg.solve(np.eye(root.shape[1]) - root.T @ carried, carried.T))


def _symmetrise(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))
