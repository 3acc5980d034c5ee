"""A pose as FANUC's listings (.LS) and pendants say it: X, Y, Z in mm, W, P, R in degrees."""

from __future__ import annotations

from collections.abc import Sequence

from basecal.exchange.controllers.fanuc import CONVENTION
from basecal.exchange.exports.pasted_numbers import pasted_numbers


def _lines(numbers: Sequence[str]) -> list[str]:
    """Two lines a pose, as in the positions of a listing."""
    x, y, z, w, p, r = (f"{name} = {number}" for name, number in zip(CONVENTION.names, numbers, strict=True))
    return [f"{x} mm, {y} mm, {z} mm,", f"{w} deg, {p} deg, {r} deg"]


EXPORTER = pasted_numbers("X, Y, Z, W, P, R in mm and deg", CONVENTION, "!", "mm and deg", _lines)
