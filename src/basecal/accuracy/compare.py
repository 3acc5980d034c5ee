"""Comparison of two calibrations: differences of their transforms, in mm and in sigmas, and of their inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from basecal.accuracy.model_comparison.nested_models import MOVED_LEVEL, compare_nested_models
from basecal.cell import Calibration
from basecal.errors import check_type
from basecal.numerics.spectral import spectrum

_ROUNDING = 1e-12  # [m, rad] rounding error between equal transforms without a sigma


@dataclass(frozen=True)
class Difference:
    """Difference of one transform between two calibrations.

    Attributes:
        shift_m: Distance of the origins [m].
        shift_rad: Angle of the relative rotation [rad]; 0 for a point.
        sigmas: Root of the squared Mahalanobis distance over its degrees of freedom: about 1 if the two agree; None
            if neither is uncertain.
        chance: Probability of a distance at least as large if the two agree; None if neither is uncertain.
    """

    shift_m: float
    shift_rad: float
    sigmas: float | None
    chance: float | None


@dataclass(frozen=True)
class Comparison:
    """Comparison of two calibrations.

    Attributes:
        transforms: Differences of the transforms that both calibrations have, by name.
        only: Transforms of only one calibration, by name: its index, 0 or 1.
        inputs: Names of the input files that differ.
        settings: Both values of each setting that differs, by name.
        agree: Whether the covariance explains the difference of every transform; None without a shared transform.
    """

    transforms: Mapping[str, Difference]
    only: Mapping[str, int]
    inputs: tuple[str, ...]
    settings: Mapping[str, tuple[Any, Any]]
    agree: bool | None


def compare(first: Calibration, second: Calibration) -> Comparison:
    """Compare two calibrations of one cell.

    Their errors are assumed independent. If both use the same samples, the errors are correlated, and their difference
    is smaller than the covariances predict.

    Raises:
        InputError: if an argument is not a calibration.
    """
    for name, calibration in (("first", first), ("second", second)):
        check_type(name, calibration, Calibration)
    common = [name for name in first.transforms if name in second.transforms]
    differences = {name: _difference(first, second, name) for name in common}
    chances = [each.chance for each in differences.values() if each.chance is not None]
    is_changed = any(
        each.chance is None and max(each.shift_m, each.shift_rad) > _ROUNDING for each in differences.values()
    )
    is_explained = all(len(chances) * chance >= MOVED_LEVEL for chance in chances)
    unshared = {name: 0 for name in first.transforms if name not in common}
    unshared |= {name: 1 for name in second.transforms if name not in common}
    files = sorted(first.inputs.keys() | second.inputs.keys())
    setting_names = sorted(first.settings.keys() | second.settings.keys())
    return Comparison(
        differences,
        unshared,
        tuple(name for name in files if first.inputs.get(name) != second.inputs.get(name)),
        {n: (a, b) for n in setting_names if (a := first.settings.get(n)) != (b := second.settings.get(n))},
        (is_explained and not is_changed) if differences else None,
    )


def _difference(first: Calibration, second: Calibration, name: str) -> Difference:
    width = 3 if name in first.points | second.points else 6
    apart = (first[name].mean.inverse() @ second[name].mean).log()
    # Parameters that a gauge holds at zero are zero in both calibrations, so that their uncertainty cancels.
    parts = (
        [each[name].covariance, *(-held for held in each.gauge_covariances(name).values())] for each in (first, second)
    )
    covariance = np.sum([part for of_one in parts for part in of_one], axis=0)[:width, :width]
    length, angle = float(np.linalg.norm(apart[:3])), float(np.linalg.norm(apart[3:])) if width == 6 else 0.0
    spectral = spectrum(covariance) if np.all(np.isfinite(covariance)) else None
    if spectral is None or not spectral.rank:
        return Difference(length, angle, None, None)
    squared, freedoms = float(apart[:width] @ spectral.inverse @ apart[:width]), int(spectral.rank)
    return Difference(
        length, angle, float(np.sqrt(squared / freedoms)), compare_nested_models(squared, freedoms).chance
    )
