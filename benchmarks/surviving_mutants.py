"""Why mutants survive: those that nothing can tell from the original, and those that no test does so far."""

from __future__ import annotations

from typing import Any

UNKNOWN = "no test so far"

# By file, what stood there and what stands there now.
WHY: dict[tuple[str, str, str], str] = {
    ("estimation/outliers/robust_scale.py", "1e-300", "1e-299"): "equivalent: keeps a quotient of zeros finite",
    ("accuracy/residuals/fit.py", "-1", "1"): "equivalent: the last of two axes",
    ("accuracy/residuals/fitted_again.py", "4", "5"): "equivalent: a Gauss-Newton step more at the optimum",
    ("accuracy/findings/outlier_samples.py", "-1", "1"): "equivalent: the last of two axes",
    ("estimation/observability/motions.py", "-1", "1"): "equivalent: the last of two axes",
    (
        "geometry/lenses/fisheye.py",
        "newton >= low",
        "newton < low",
    ): "equivalent: halves the bracket in place of Newton",
    ("geometry/rotation.py", "3", "4"): "equivalent: a coefficient more is computed and not used",
    ("geometry/se3.py", "3", "4"): "equivalent: a coefficient more is computed and not used",
    (
        "numerics/levenberg_marquardt.py",
        "1000000000000.0",
        "10000000000000.0",
    ): "equivalent: dampings grow past both at one step",
    (
        "numerics/levenberg_marquardt.py",
        "flight.cost * (1 + _UPHILL)",
        "flight.cost / (1 + _UPHILL)",
    ): "equivalent but for rounding of a cost",
    ("numerics/levenberg_marquardt.py", "1e-12", "1e-11"): "equivalent but for unknowns that nothing holds",
    ("kinematics/inverse.py", "-1", "1"): "equivalent: the last of two axes",
    ("kinematics/inverse.py", "uphill < 0", "uphill <= 0"): "equivalent: a derivative of exactly zero",
    (
        "cell/schema/cell_nouns.py",
        "entry.sigma_focal_px is None or entry.sigma_center_px is None",
        "entry.sigma_focal_px is None and entry.sigma_center_px is None",
    ): "equivalent: the schema wants both or neither",
}


def reason(survivor: dict[str, Any]) -> str:
    """Why it survives."""
    return WHY.get((survivor["file"], survivor["old"], survivor["new"]), UNKNOWN)
