"""A pose as FANUC's listings (.LS) and pendants say it: X, Y, Z in mm, W, P, R in degrees."""

from __future__ import annotations

from basecal.exchange.controllers.fanuc import CONVENTION
from basecal.exchange.exports.digits import written_numbers
from basecal.exchange.exports.exporter import Exporter
from basecal.exchange.exports.remarks import comments, describe_transform
from basecal.exchange.exports.wanted import Wanted


def export_text(request: Wanted) -> str:
    """Two lines a pose, as in the positions of a listing."""
    lines = comments(request.remarks, "!")
    for one in request.transforms:
        lines += comments([describe_transform(one, "mm and deg")], "!")
        pairs = zip(CONVENTION.names, written_numbers(CONVENTION, one.estimate), strict=True)
        x, y, z, w, p, r = (f"{name} = {number}" for name, number in pairs)
        lines += [f"{x} mm, {y} mm, {z} mm,", f"{w} deg, {p} deg, {r} deg"]
    return "\n".join(lines) + "\n"


EXPORTER = Exporter("X, Y, Z, W, P, R in mm and deg", export_text, is_pasted=True)
