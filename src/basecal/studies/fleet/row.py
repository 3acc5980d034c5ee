"""The row of a cell of a fleet, with its calibration and its report page."""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.accuracy.input_screening.units import needs_search
from basecal.cell import Calibration, Cell, Recording
from basecal.cell.files import calibration_to_dict, input_hashes, read_cell, read_recording
from basecal.cell.results.versions import used_versions
from basecal.errors import BasecalError, printable

VERDICTS = ("good", "doubtful", "refused", "unreadable", "failed")
"""Verdicts of a row: those of a calibration; `unreadable` for invalid files, and `failed` for faults of the program."""

PageMaker = Callable[[Cell, Recording, Calibration, str], str]
"""Function that creates the report page of a calibration, with a title; workers import it."""

_WORST_FIRST = {"error": 0, "warning": 1, "info": 2}


@dataclass(frozen=True)
class Row:
    """Results of one cell of a fleet; None for missing values.

    Attributes:
        cell: Path of the cell in the fleet's folder.
        verdict: One of `VERDICTS`.
        findings: Codes of errors and warnings, the worst first.
        said: Message of the worst finding, or the reason why there is no calibration.
        samples: Number of samples in the recording.
        transform: Name of the first requested transform that was calibrated; the next fields describe it.
        x_m: Position x [m].
        y_m: Position y [m].
        z_m: Position z [m].
        qx: Quaternion x of the rotation.
        qy: Quaternion y of the rotation.
        qz: Quaternion z of the rotation.
        qw: Quaternion w (scalar part) of the rotation.
        sigma_mm: Root of the summed variances of the translation [mm].
        sigma_deg: Root of the summed variances of the rotation [deg].
        rms_px: RMS residual of a pixel coordinate [px].
        held_out_mm: RMS translation error of held-out samples [mm].
        held_out_deg: RMS rotation error of held-out samples [deg].
        time_s: Wall time of reading, detection and calibration [s].
    """

    cell: str
    verdict: str
    findings: str = ""
    said: str = ""
    samples: int | None = None
    transform: str | None = None
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None
    qx: float | None = None
    qy: float | None = None
    qz: float | None = None
    qw: float | None = None
    sigma_mm: float | None = None
    sigma_deg: float | None = None
    rms_px: float | None = None
    held_out_mm: float | None = None
    held_out_deg: float | None = None
    time_s: float | None = None


COLUMNS = tuple(f.name for f in fields(Row))


def calibrate_row(folder: str, cell: str, make_page: PageMaker | None = None) -> bytes:
    """Calibrate a cell; its row, calibration, page, and the traceback of a fault of the program, as JSON.

    Args:
        folder: The fleet's folder.
        cell: Path of the cell in the fleet's folder.
        make_page: Creates the report page; None for no page.
    """
    begin, row, calibration, page, fault_text = time.perf_counter(), Row(cell, "failed"), None, "", ""
    try:
        row, calibration, page = _calibrate_cell(Path(folder, cell), cell, make_page)
    except BasecalError as error:
        row = Row(cell, "unreadable", said=_one_line(error).replace(f"{Path(folder, cell)}/", ""))
    except MemoryError:
        row = Row(cell, "failed", said="there is not enough memory for it")
    except Exception as error:  # a fault in one cell must not end the others
        fault_text = printable(traceback.format_exc())
        row = Row(cell, "failed", said=_one_line(f"a fault of basecal itself ({type(error).__name__}: {error})"))
    row_data = asdict(row) | {"time_s": time.perf_counter() - begin}
    return _pack_row(row_data, calibration, page, fault_text)


def killed_row(cell: str, cause: str) -> bytes:
    """The row of a cell that kills its worker, in the format of `calibrate_row`."""
    return _pack_row(asdict(Row(cell, "failed", said=cause)), None, "", "")


def _pack_row(row: dict[str, Any], calibration: dict[str, Any] | None, page: str, fault: str) -> bytes:
    content = {"row": row, "calibration": calibration, "page": page, "fault": fault}
    return json.dumps(content, allow_nan=False).encode("utf-8", "backslashreplace")


def _one_line(error: object) -> str:
    return " ".join(printable(str(error)).split())


def _calibrate_cell(folder: Path, name: str, make_page: PageMaker | None) -> tuple[Row, dict[str, Any], str]:
    cell = read_cell(folder)
    hashes = input_hashes(folder, cell)
    recording = read_recording(folder, cell)
    if needs_search(cell, recording):
        from basecal.vision.detect import detect

        recording = detect(cell, recording)
    calibration = replace(calibrate(cell, recording), inputs=hashes)
    page = "" if make_page is None else make_page(cell, recording, calibration, name)
    return (
        _row(name, cell, recording, calibration),
        calibration_to_dict(calibration) | {"versions": used_versions()},
        page,
    )


def _row(name: str, cell: Cell, recording: Recording, calibration: Calibration) -> Row:
    ordered = sorted(calibration.findings, key=lambda finding: _WORST_FIRST[finding.severity])
    problems = [finding for finding in ordered if finding.severity != "info"]
    validation = calibration.validation
    transform = next((each for each in cell.requested_transforms if each in calibration.transforms), None)
    return Row(
        name,
        calibration.verdict,
        " ".join(dict.fromkeys(finding.code for finding in problems)),
        _one_line(problems[0].message) if problems else "",
        len(recording.samples),
        **({} if transform is None else _transform_columns(transform, calibration)),
        rms_px=calibration.residuals.rms_px,
        held_out_mm=None if validation is None or validation.target_m is None else 1e3 * validation.target_m,
        held_out_deg=None
        if validation is None or validation.target_rad is None
        else float(np.degrees(validation.target_rad)),
    )


def _transform_columns(name: str, calibration: Calibration) -> dict[str, Any]:
    """The columns of a row that describe a transform."""
    estimate = calibration.transforms[name]
    variances = np.diagonal(estimate.covariance)
    translation = dict(zip(("x_m", "y_m", "z_m"), map(float, estimate.mean.translation), strict=True))
    rotation = dict(zip(("qx", "qy", "qz", "qw"), map(float, estimate.mean.quaternion), strict=True))
    sigmas = [float(np.sqrt(part.sum())) for part in (variances[:3], variances[3:])]
    return {
        "transform": name,
        **translation,
        **rotation,
        "sigma_mm": 1e3 * sigmas[0],
        "sigma_deg": float(np.degrees(sigmas[1])),
    }
