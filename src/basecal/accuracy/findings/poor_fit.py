"""`poor-fit`: residuals larger than the stated sigmas, or any plausible noise of detectors or robots, explain."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.findings.touch_noise import is_touch_noise
from basecal.accuracy.stated_sigmas import ContradictedSigma, is_implausibly_small
from basecal.cell import Finding
from basecal.estimation.noise.estimate import PLAUSIBLE_PX
from basecal.fields.digits import p_value_text, two_digits
from basecal.geometry import Array

# Ratio of true to stated sigma without a warning: the covariance is estimated, and the answer hardly changes; assumed.
_LITTLE_RATIO = 1.1
_REPEATABILITY_M = 3e-3  # [m] per axis, thirty times the worst repeatability that makers state, 0.02 to 0.1 mm
_REPEATABILITY_RAD = 1e-2  # [rad] per axis: as much over 0.3 m


def poor_fit(evidence: Evidence) -> list[Finding]:
    """A warning if residuals are larger than stated sigmas, or any plausible noise of detectors or robots, explain."""
    solution, rms_px = evidence.solution, evidence.residuals.rms_px
    contradicted = (each for each in evidence.contradicted_sigmas if not is_touch_noise(each, evidence))
    found = [_stated_finding(each, evidence) for each in contradicted]
    if any(f.severity == "warning" for f in found):
        return found
    robots = solution.noise.robots
    sigmas = np.array([*robots.values()]).reshape(len(robots), 6)
    worst_m, worst_rad = sigmas[:, :3].max(initial=0.0), sigmas[:, 3:].max(initial=0.0)
    if "pixel_px" in solution.noise.estimated and rms_px is not None and rms_px > PLAUSIBLE_PX:
        what = f"Residuals are {rms_px:.1f} px rms, more than any detector's noise."
    elif worst_m > _REPEATABILITY_M or worst_rad > _REPEATABILITY_RAD:
        noise = f"{1e3 * worst_m:.1f} mm and {np.degrees(worst_rad):.2f} deg (1 sigma per axis)"
        what = f"Residuals need pose noise of the robots of {noise}, more than any arm's repeatability."
    else:
        return found
    do = "Check units, directions and the target's size.", "State the robots' noise if it is not stated."
    return [Finding("poor-fit", "warning", (), what, do, "Something in the input is wrong."), *found]


def _stated_finding(sigma: ContradictedSigma, evidence: Evidence) -> Finding:
    """A warning if stated sigmas are clearly too small or replaced; an info if they are too large or nearly right."""
    about = _robots_in_doubt(sigma, evidence) if sigma.of_robot else (sigma.about,) if sigma.about else ()
    whose = (
        f"poses of {' or '.join(about)}"
        if sigma.of_robot
        else f"observations of {sigma.about}"
        if about
        else "all data"
    )
    estimated = evidence.solution.noise.robots.get(sigma.about)
    stated = np.zeros(6) if estimated is None else _mean_noise(sigma.about, evidence)
    if estimated is not None and (not sigma.is_too_small or is_implausibly_small(stated)):
        what = f"The stated noise of {sigma.about} is {_noise_text(stated)}; the data show {_noise_text(estimated)}."
        do = (f"State noise of {_noise_text(estimated)}: sigma_t_m is in metres, sigma_r_rad in radians.",)
        return Finding("poor-fit", "warning", about, what, do, "The answer uses the noise that the data show.")
    if not sigma.is_too_small:
        what = f"Noise of {whose} is {two_digits(sigma.ratio)} times the stated noise."
        why = "The covariance is wider than necessary."
        return Finding("poor-fit", "info", about, what, ("State the smaller sigmas.",), why)
    excess = f"{sigma.ratio:.2f} times what the stated sigmas explain ({p_value_text(sigma.chance, 1)})"
    what = f"Residuals of {whose} are {excess}."
    why = "The covariance is that of the estimated noise."
    do = ("Check units, directions, the lens and the target's size, or state larger sigmas.",)
    return Finding("poor-fit", "warning" if sigma.ratio > _LITTLE_RATIO else "info", about, what, do, why)


def _mean_noise(robot: str, evidence: Evidence) -> Array:
    """Mean stated sigmas of a robot's stops, (6,) [m, rad]."""
    stops = evidence.recorded.stops
    return np.asarray(stops.sigma[stops.robot_mask([robot])].mean(0))


def _robots_in_doubt(sigma: ContradictedSigma, evidence: Evidence) -> tuple[str, ...]:
    """A robot, and if its sigma is too small, the robots with stated noise in the same views: either may be wrong."""
    recorded = evidence.recorded
    seen = {robot for group in recorded.groups if sigma.about in group.robots for robot in group.robots}
    others = sorted(seen - {sigma.about} - set(recorded.unstated)) if sigma.is_too_small else []
    return (sigma.about, *others)


def _noise_text(sigma: Array) -> str:
    """Mean sigmas of a robot, (6,) [m, rad], as text."""
    return f"{two_digits(1e3 * float(np.mean(sigma[:3])))} mm and {two_digits(1e3 * float(np.mean(sigma[3:])))} mrad"
