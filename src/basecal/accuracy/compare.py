"""Whether two calibrations agree: what differs between their answers, in mm and in sigmas, and between their inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from basecal.accuracy.model_comparison.nested_models import MOVED, compare_nested_models
from basecal.cell import Calibration
from basecal.errors import check_type
from basecal.numerics.spectral import spectrum

_ROUNDING = 1e-12  # [m, rad] between equal transforms that have no sigma: rounding


@dataclass(frozen=True)
class Difference:
    """How far apart one transform is in two calibrations.

    Attributes:
        shift_m: Distance of the origins [m].
        shift_rad: Angle [rad]; 0 of a point.
        sigmas: Root of the squared Mahalanobis distance over its freedoms: about 1 where they agree; None where
            neither is uncertain.
        chance: Of a distance so large where they agree; None likewise.
    """

    shift_m: float
    shift_rad: float
    sigmas: float | None
    chance: float | None


@dataclass(frozen=True)
class Comparison:
    """Two calibrations side by side.

    Attributes:
        transforms: What differs, by name, of all that both have.
        only: Transforms that one of them has, by name: which one, 0 or 1.
        inputs: Names of the files that differ.
        settings: What was asked otherwise, by name, of both.
        agree: Whether no transform differs by more than its covariance explains; None where none can be compared.
    """

    transforms: Mapping[str, Difference]
    only: Mapping[str, int]
    inputs: tuple[str, ...]
    settings: Mapping[str, tuple[Any, Any]]
    agree: bool | None


def compare(first: Calibration, second: Calibration) -> Comparison:
    """Two calibrations of one cell.

    Their errors count as independent. Where both were made of the same samples they are not, and differ by less than
    their covariances say.

    Raises:
        InputError: if one is no calibration.
    """
    for name, calibration in (("first", first), ("second", second)):
        check_type(name, calibration, Calibration)
    common = [name for name in first.transforms if name in second.transforms]
    found = {name: _difference(first, second, name) for name in common}
    chances = [each.chance for each in found.values() if each.chance is not None]
    moved = any(each.chance is None and max(each.shift_m, each.shift_rad) > _ROUNDING for each in found.values())
    alike = all(len(chances) * chance >= MOVED for chance in chances)
    only = {name: 0 for name in first.transforms if name not in common}
    only |= {name: 1 for name in second.transforms if name not in common}
    files = sorted(first.inputs.keys() | second.inputs.keys())
    asked = sorted(first.settings.keys() | second.settings.keys())
    return Comparison(
        found,
        only,
        tuple(name for name in files if first.inputs.get(name) != second.inputs.get(name)),
        {n: (a, b) for n in asked if (a := first.settings.get(n)) != (b := second.settings.get(n))},
        (alike and not moved) if found else None,
    )


def _difference(first: Calibration, second: Calibration, name: str) -> Difference:
    width = 3 if name in first.points | second.points else 6
    apart = (first[name].mean.inverse() @ second[name].mean).log()
    # What a gauge holds at zero is held there in both.
    parts = (
        [each[name].covariance, *(-held for held in each.gauge_covariances(name).values())] for each in (first, second)
    )
    covariance = np.sum([part for of in parts for part in of], axis=0)[:width, :width]
    length, angle = float(np.linalg.norm(apart[:3])), float(np.linalg.norm(apart[3:])) if width == 6 else 0.0
    if not np.any(covariance) or not np.all(np.isfinite(covariance)):
        return Difference(length, angle, None, None)
    of = spectrum(covariance)
    squared, freedoms = float(apart[:width] @ of.inverse @ apart[:width]), int(of.rank)
    return Difference(
        length, angle, float(np.sqrt(squared / freedoms)), compare_nested_models(squared, freedoms).chance
    )
