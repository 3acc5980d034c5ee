"""`poor-fit`: residuals larger than the stated sigmas, or any detector's or arm's noise, explain."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Finding
from basecal.estimation.noise.estimate import CONTRADICTED
from basecal.estimation.solve import Solution

_DETECTOR_PX = 3.0  # [px] rms, far beyond the detectors of docs/benchmarks.md
_REPEATABILITY_M = 3e-3  # [m] per axis, far beyond any arm's: makers state 0.02 to 0.1 mm
_REPEATABILITY_RAD = 1e-2  # [rad] likewise


def poor_fit(of: Evidence) -> list[Finding]:
    """A warning where residuals are larger than the stated sigmas explain, or any detector's or arm's noise."""
    solution, rms_px = of.solution, of.residuals.rms_px
    birge_ratio = float(np.sqrt(solution.cost / max(solution.dof, 1)))
    if not solution.noise.estimated and birge_ratio > CONTRADICTED:
        scaled = "" if solution.noise.robots else "; sigmas are scaled up by it"
        message = f"residuals are {birge_ratio:.1f} times what the stated sigmas explain{scaled}"
    elif "pixel_px" in solution.noise.estimated and rms_px is not None and rms_px > _DETECTOR_PX:
        message = f"residuals are {rms_px:.1f} px rms, more than any detector's noise: something in the input is wrong"
    elif (worst := _beyond_an_arm(solution)) is not None:
        message = (
            f"residuals ask for pose noise of the robots of {1e3 * worst[0]:.1f} mm and "
            f"{np.degrees(worst[1]):.2f} deg, 1 sigma per axis, more than any arm's repeatability"
        )
    else:
        return []
    advice = "check units, directions and the target's size, and state the robots' noise where it is not"
    return [Finding("poor-fit", "warning", (), f"{message}: {advice}")]


def _beyond_an_arm(solution: Solution) -> tuple[float, float] | None:
    """The largest estimated sigmas of robots [m, rad], where no arm in order is as bad as that."""
    sigmas = np.array(list(solution.noise.robots.values())).reshape(-1, 6)
    worst_m, worst_rad = sigmas[:, :3].max(initial=0.0), sigmas[:, 3:].max(initial=0.0)
    return (worst_m, worst_rad) if worst_m > _REPEATABILITY_M or worst_rad > _REPEATABILITY_RAD else None
