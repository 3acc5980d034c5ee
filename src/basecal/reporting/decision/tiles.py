"""The result in a few numbers, with remarks and passed checks."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from inspect import getmodule

from basecal.accuracy.findings.registry import ANSWER_CHECKS, INPUT_CHECKS
from basecal.accuracy.fit_details import FitDetails
from basecal.accuracy.sample_use import sample_use
from basecal.cell import Calibration, Cell, Recording
from basecal.errors import count_text
from basecal.fields.digits import two_digits
from basecal.reporting.statement.verdict import error_text, requested_estimates

_SEVERITY_NAMES = {"error": "error", "warning": "warning", "info": "note"}
_BAR_ROOM = 1.05  # length of a bar relative to the larger of error and tolerance
_CODES_AND_TEXT = re.compile(r"((?:`[a-z-]+`(?: and |, )?)+)[^:]*: (.*)")


@dataclass(frozen=True)
class Tile:
    """A number with its unit and its name.

    Attributes:
        value: The number with its unit.
        name: Name of the quantity.
        limit: The tolerance; None if there is none.
        shares: Positions of the number and of the tolerance on a bar, 0 to 1.
        kind: `within` the tolerance, `beyond`, or `open` if the number may still decrease.
    """

    value: str
    name: str
    limit: str | None = None
    shares: tuple[float, float] = (0.0, 0.0)
    kind: str = ""


def tiles(cell: Cell, recording: Recording, calibration: Calibration, details: FitDetails) -> Iterator[Tile]:
    """Tiles of expected error, sigma, held-out errors and used samples, as far as they are known."""
    expected_m = expected_error_m(cell, calibration, details)
    if expected_m is not None:
        yield error_tile(expected_m, None if calibration.tolerance is None else calibration.tolerance.asked_m)
    names = requested_estimates(cell, calibration)
    if names:
        worst = max(names, key=lambda name: calibration[name].sigma_norms[0])
        sigma_m, sigma_rad = calibration[worst].sigma_norms
        value = _short(sigma_m, None if worst in calibration.points else sigma_rad)
        yield Tile(value, f"1 sigma (3-D norm) of {worst}{', the least known' if len(names) > 1 else ''}")
    validation = calibration.validation
    if validation is not None and validation.target_m is not None:
        yield Tile(_short(validation.target_m, validation.target_rad), "on held-out samples, rms")
    if calibration.residuals.rms_px is not None:
        held_out = None if validation is None else validation.rms_px
        also = "" if held_out is None else f", held out {two_digits(held_out)} px"
        yield Tile(f"{two_digits(calibration.residuals.rms_px)} px", f"reprojection error, rms{also}")
    use = sample_use(recording, calibration)
    outliers = sum(len(each.ids) for each in calibration.outliers or ())
    also = f", {outliers} points left out" if outliers else ""
    if use.recorded:
        yield Tile(f"{use.used} of {use.recorded}", f"samples used{also}")


def expected_error_m(cell: Cell, calibration: Calibration, details: FitDetails) -> float | None:
    """Length below which 95 % of position errors are expected [m]; None if a requested transform is unknown."""
    if calibration.tolerance is not None:
        return calibration.tolerance.expected_95_m
    if calibration.meeting is not None:
        return calibration.meeting.expected_95_m
    complete = {each.transform for each in details.errors} >= set(cell.requested_transforms)
    return max((each.length_m for each in details.errors), default=None) if complete else None


def _short(length_m: float, angle_rad: float | None) -> str:
    return error_text(length_m, angle_rad).replace(" and ", ", ")


def error_tile(expected_m: float, tolerance_m: float | None, is_final: bool = True) -> Tile:
    """Tile of the expected error with its tolerance; the tolerance is missed only if the error is final."""
    value, name = f"{two_digits(1e3 * expected_m)} mm", "expected error, 95 %"
    if tolerance_m is None:
        return Tile(value, name)
    limit = f"{1e3 * tolerance_m:g} mm"
    kind = "within" if expected_m <= tolerance_m else "beyond" if is_final else "open"
    most = _BAR_ROOM * max(expected_m, tolerance_m)
    return Tile(value, f"{name}; tolerance {limit}", limit, (expected_m / most, tolerance_m / most), kind)


def remarks(calibration: Calibration, outlook: Sequence[tuple[int, float]]) -> Iterator[str]:
    """Sentences below the verdict: number of findings, largest source of error, and effect of more samples."""
    count = Counter(_SEVERITY_NAMES[finding.severity] for finding in calibration.findings)
    names = (name for name in _SEVERITY_NAMES.values() if count[name])
    counted = [count_text(count[name], name) for name in names]
    if counted:
        yield f"{', '.join(counted)}."
    for entry in (calibration.budget or ())[:1]:
        yield f"{100 * entry.share:.0f} % of the variance at the task comes from {entry.source}."
    if len(outlook) > 1:
        more, expected_m = outlook[-1]
        yield f"{more} more samples would leave {two_digits(1e3 * expected_m)} mm (95 %)."


def check_words() -> dict[str, str]:
    """Description of each code of findings, from the first line of its module's docstring."""
    descriptions: dict[str, str] = {}
    for check in (*INPUT_CHECKS, *ANSWER_CHECKS):
        words = _CODES_AND_TEXT.match((getattr(getmodule(check), "__doc__", None) or "").partition("\n")[0])
        if words is not None:
            descriptions |= dict.fromkeys(re.findall(r"`([a-z-]+)`", words[1]), words[2])
    return descriptions


def passed_checks(calibration: Calibration) -> Iterator[tuple[str, str]]:
    """Codes and descriptions of checks without findings; empty if nothing was calibrated."""
    found_codes = {finding.code for finding in calibration.findings}
    if calibration.transforms:
        yield from (each for each in check_words().items() if each[0] not in found_codes)
