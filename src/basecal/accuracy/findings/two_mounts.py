"""`two-mounts`: a mount has two positions, one at some samples and another at the others.

A tool frame that was changed in the controller shifts the poses of some samples, in any order. Estimated noise absorbs
the difference.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.model_comparison.nested_models import SINGLE_LEVEL, Comparison, compare_split, decide
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.accuracy.systematic_errors.search import candidate_log_chance
from basecal.accuracy.systematic_errors.situation import Situation, situate
from basecal.cell import Finding
from basecal.effects.faces.candidates import one_candidate
from basecal.estimation.solve import Solution
from basecal.fields.digits import two_digits
from basecal.geometry import Array, IntArray
from basecal.numerics.group_sums import GroupSums
from basecal.numerics.spectral import principal_axes, spectrum

_LEAST_SIDE = 3  # samples of either position: two may be single outliers; assumed


class _Shifts(NamedTuple):
    """Positions of a mount from n single samples.

    Attributes:
        samples: Sample numbers, (n,).
        shift_m: Shift of the mount from the answer, (n, 3) [m].
        information: Information of the shifts, (n, 3, 3).
    """

    samples: IntArray
    shift_m: Array
    information: Array

    def take(self, rows: IntArray) -> _Shifts:
        """Shifts of the samples at these rows."""
        return _Shifts(self.samples[rows], self.shift_m[rows], self.information[rows])

    def mean(self) -> Array:
        """Mean shift weighted by information, (3,) [m]."""
        weighted = (self.information @ self.shift_m[..., None]).sum(0)
        return np.linalg.solve(self.information.sum(0), weighted)[:, 0]

    def squares(self) -> Array:
        """Sum of squared residuals of the first k shifts about their own mean, in sigmas, for k = 1 to n, (n,)."""
        off = self.shift_m - self.mean()
        weighted = (self.information @ off[..., None])[..., 0]
        total, force = np.cumsum(self.information, 0), np.cumsum(weighted, 0)[..., None]
        of_means = np.sum(force * np.linalg.solve(total, force), (1, 2))
        return np.asarray(np.cumsum(np.sum(off * weighted, 1)) - of_means)


class _Split(NamedTuple):
    """A mount with two positions: its name, both sets of samples, and the comparison with one position."""

    mount: str
    sides: tuple[_Shifts, _Shifts]
    comparison: Comparison


def two_mounts(evidence: Evidence) -> list[Finding]:
    """A warning about the mount that two positions explain best, if no certain systematic error explains it."""
    found = evidence.systematic_error
    if not evidence.solution.converged or (found is not None and found.is_certain):
        return []
    splits = [split for split in _splits(evidence) if split.comparison.is_taken]
    if not splits:
        return []
    best = min(splits, key=lambda split: split.comparison.log_chance)
    minority, majority = sorted(best.sides, key=lambda side: len(side.samples))
    if not _is_significant(evidence.solution, best.mount, minority, majority):
        return []
    apart_mm = 1e3 * float(np.linalg.norm(minority.mean() - majority.mean()))
    what = f"{best.mount} differs by {two_digits(apart_mm)} mm at {list_samples(sorted(minority.samples.tolist()))}."
    do = "Check whether the controller's tool frame was changed between samples.", "Calibrate both sets separately."
    return [Finding("two-mounts", "warning", (best.mount,), what, do, "The estimated noise contains the difference.")]


def _is_significant(solution: Solution, mount: str, minority: _Shifts, majority: _Shifts) -> bool:
    """Whether the shift is significant beside stop errors, with noise re-estimated; true if noise is stated."""
    situation = situate(solution)
    jacobians = tuple(
        situation.frame_jacobian(k, mount)[:, :, :3] * np.isin(group.sample, minority.samples)[:, None, None]
        for k, group in enumerate(situation.groups)
    )
    candidate = one_candidate("two-mounts", mount, "m", jacobians)
    log_splits = (len(minority.samples) + len(majority.samples) - 1) * np.log(2)
    log_chance = candidate_log_chance(solution, candidate, minority.mean() - majority.mean(), float(log_splits))
    return solution.noise.logs is None or decide(0.0, log_chance, SINGLE_LEVEL).is_taken


def _splits(evidence: Evidence) -> Iterator[_Split]:
    """Best split of each mount into two positions."""
    situation = situate(evidence.solution)
    for mount in situation.mounts:
        shifts = _mount_shifts(situation, mount)
        if len(shifts.samples) < 2 * _LEAST_SIDE:
            continue
        root = spectrum(shifts.information.mean(0)).root
        whitened = (shifts.shift_m - shifts.mean()) @ root
        order = np.argsort(whitened @ principal_axes(whitened).axes[:, 0])
        ends = np.arange(_LEAST_SIDE, len(order) - _LEAST_SIDE + 1)
        first, last = (shifts.take(each).squares() for each in (order, order[::-1]))
        squares = first[ends - 1] + last[len(order) - ends - 1]
        end = ends[np.argmin(squares)]
        compared = compare_split(float(squares.min() / max(first[-1], 1e-300)), len(order), 3)
        yield _Split(mount, (shifts.take(order[:end]), shifts.take(order[end:])), compared)


def _mount_shifts(situation: Situation, mount: str) -> _Shifts:
    """Shifts of a mount from each sample that determines its position."""
    samples, information, gradient = [], [], []
    for k, (group, views) in enumerate(zip(situation.groups, situation.linearisation.views, strict=True)):
        if situation.depends(k, mount):
            jacobian = situation.frame_jacobian(k, mount)[:, :, :3]
            samples.append(group.sample)
            information.append(jacobian.mT @ views.information[:, :6, :6] @ jacobian)
            gradient.append((jacobian.mT @ views.gradient[:, :6, None])[..., 0])
    numbers, row = np.unique(np.concatenate(samples), return_inverse=True)
    sums = GroupSums(row, len(numbers))
    total, force = sums.sum(np.concatenate(information)), sums.sum(np.concatenate(gradient))
    known = spectrum(total)
    seen = np.flatnonzero(known.rank == 3)
    shifts = -(known.inverse @ force[..., None])[..., 0]
    return _Shifts(numbers, shifts, total).take(seen)
