"""Comments of an export: its run and data, and whether it is doubtful."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from basecal.cell import Calibration
from basecal.cell.results.calibration_dict import program_version
from basecal.errors import RefusedCalibration, printable
from basecal.exchange.exports.wanted import NamedTransform

_HASH = 12  # digits of a hash: enough to tell any two recordings apart


def check_exportable(calibration: Calibration) -> None:
    """Check that a calibration is not refused.

    Raises:
        RefusedCalibration: if it is.
    """
    if calibration.verdict == "refused":
        raise RefusedCalibration(next((f.message for f in calibration.findings if f.severity == "error"), ""))


def provenance(calibration: Calibration, run: str | None = None) -> tuple[str, ...]:
    """Source of a calibration, a line each, then the doubts about it if there are any.

    Args:
        calibration: What came out.
        run: Name of its run, which is the UTC time of it; None if it is in no run.
    """
    of = "" if run is None else f", run {run}"
    hashes = [f"{name} {digest[: len('sha256:') + _HASH]}" for name, digest in calibration.inputs.items()]
    lines = [f"made by basecal {program_version()}{of}" + (f" from {', '.join(hashes)}" if hashes else "")]
    if calibration.verdict == "doubtful":
        codes = dict.fromkeys(f.code for f in calibration.findings if f.severity != "info")
        lines.append(f"DOUBTFUL: {', '.join(codes)}; see the report before it is used")
    return tuple(lines)


def describe_transform(transform: NamedTransform, units: str) -> str:
    """Description of a transform in a line: its direction, its units, and its sigma."""
    parent, child = transform.own_frames
    estimate = transform.estimate
    mm, deg = np.linalg.norm(estimate.sigma_t) * 1e3, np.degrees(np.linalg.norm(estimate.sigma_r))
    known = "fixed" if transform.status == "fixed" else f"1 sigma {mm:.2g} mm and {deg:.2g} deg"
    return f"{transform.name}: the pose of {child} in {parent}, {units}; {known}"


def comments(lines: Iterable[str], mark: str) -> list[str]:
    """Lines of comments that hold nothing but one line each."""
    return [f"{mark} {' '.join(printable(line).split())}" for line in lines]
