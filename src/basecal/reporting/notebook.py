"""A calibration as a notebook shows it: the verdict, and a table of transforms."""

from __future__ import annotations

from html import escape

import numpy as np

from basecal.cell import Calibration
from basecal.exchange.exports.digits import angle_decimals, format_fixed, length_decimals
from basecal.geometry import Array

_MILLIMETRE = 1e-3
_DEGREE = float(np.radians(1))


def html_summary(calibration: Calibration) -> str:
    """HTML of the verdict, what counts against it, and each transform with its sigmas along the axes of the child.

    Args:
        calibration: What came out.
    """
    rows = ""
    for name, estimate in calibration.transforms.items():
        mean, status = estimate.mean, calibration.status.get(name, "free")
        is_point, is_fixed = name in calibration.points, status == "fixed"
        mm, deg = length_decimals(estimate, _MILLIMETRE), angle_decimals(estimate, _DEGREE)
        place = [
            _numbers(mean.translation / _MILLIMETRE, mm),
            "" if is_fixed else _numbers(estimate.sigma_t / _MILLIMETRE, mm),
        ]
        turn = [_numbers(mean.rpy / _DEGREE, deg), "" if is_fixed else _numbers(estimate.sigma_r / _DEGREE, deg)]
        row = [escape(name), *place, *(["", ""] if is_point else turn), escape(status)]
        rows += f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>"
    head = "".join(f"<th>{cell}</th>" for cell in ("transform", "t [mm]", "sigma", "rpy [deg]", "sigma", "status"))
    table = f"<table><tr>{head}</tr>{rows}</table>" if calibration.transforms else ""
    found = [f"<li><code>{escape(f.code)}</code> {escape(f.message)}</li>" for f in calibration.findings]
    return f"<p><b>{escape(calibration.verdict.upper())}</b></p>{table}<ul>{''.join(found)}</ul>"


def _numbers(values: Array, decimals: int) -> str:
    return ", ".join(format_fixed(values.tolist(), decimals))
