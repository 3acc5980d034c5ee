"""Explanation of residuals that are smaller than the errors of held-out views."""

from __future__ import annotations

import numpy as np

from basecal.cell import Calibration
from basecal.fields.digits import two_digits

_CLEAR_RATIO = 1.5  # ratio of the two errors, below which the choice of views may explain the difference; assumed


def explain_held_out_error(calibration: Calibration) -> str | None:
    """Explanation if the pose errors of robot stops absorb much of the held-out errors; else None."""
    residuals, validation = calibration.residuals, calibration.validation
    if validation is None or residuals.rms_px is None or validation.rms_px is None:
        return None
    robots = []
    for name, noise in (calibration.noise.get("robots") or {}).items():
        sigmas = np.array([noise["sigma_t_m"], noise["sigma_r_rad"]], dtype=np.float64)
        length, angle = np.sqrt(np.mean(sigmas**2, axis=1)).tolist()
        if length > 0 or angle > 0:
            robots.append(f"{name} {two_digits(1e3 * length)} mm and {two_digits(1e3 * angle)} mrad")
    if not robots or validation.rms_px < _CLEAR_RATIO * residuals.rms_px:
        return None
    return (
        f"Held-out views are off by {two_digits(validation.rms_px)} px and residuals are "
        f"{two_digits(residuals.rms_px)} px. Each stop in use has its own estimated pose error "
        f"({'; '.join(robots)}; 1 sigma per axis). The pose error of a held-out stop is unknown. "
        "Expect the larger figure at a new pose."
    )
