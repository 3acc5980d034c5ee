"""A summary of a study in the form that pages take."""

from __future__ import annotations

from itertools import product
from typing import Any

HOSTILE = "<script>alert(1)</script>"


def summary(boards: tuple[str, ...] = ("small", HOSTILE)) -> dict[str, Any]:
    """A summary with two axes, one of words; the last point has no solved trial."""
    axes = {"board": list(boards), "samples": [5, 10, 80]}
    points = [_point(dict(zip(axes, at, strict=True)), 1 + k) for k, at in enumerate(product(*axes.values()))]
    none = dict.fromkeys(("error_mm", "error_deg", "sigma_mm", "sigma_deg", "nees", "coverage"))
    points[-1] |= {**none, "solved": 0}
    return {
        "title": "Some study",
        "about": HOSTILE,
        "trials": 10,
        "cells": 2,
        "seed": 3,
        "axes": axes,
        "points": points,
    }


def _point(at: dict[str, Any], size: float) -> dict[str, Any]:
    spread = {"p05": 0.1 * size, "median": 0.3 * size, "p95": 2.0 * size, "rms": size}
    return {
        "at": at,
        "trials": 10,
        "solved": 9,
        "error_mm": spread,
        "error_deg": spread,
        "sigma_mm": size,
        "sigma_deg": None,
        "nees": {"mean": 6.1, "expected": 6, "standard_error": 0.2},
        "coverage": {"share": 0.94, "expected": 0.95},
        "time_s": 0.001,
        "reasons": ["not converged"],
    }
