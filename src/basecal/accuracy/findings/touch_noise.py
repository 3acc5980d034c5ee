"""`touch-noise`: touches that scatter more than stated, if no other error explains it."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.stated_sigmas import ContradictedSigma, judge_sigma
from basecal.cell import Finding
from basecal.estimation.noise.estimate import PLAUSIBLE_TOUCH_M
from basecal.estimation.view.points import TouchMeasurement
from basecal.fields.digits import two_digits


def touch_noise(evidence: Evidence) -> list[Finding]:
    """An info about each tip whose touches scatter more than stated."""
    alone = [each for each in evidence.contradicted_sigmas if is_touch_noise(each, evidence)]
    others = evidence.cell.cameras.keys() - {each.about for each in alone}
    with_arm = [each for name in sorted(others) if (each := _sigma_with_arm(name, evidence)) is not None]
    why = "The covariance is that of the larger noise."
    return [
        *(_finding(each, evidence, why) for each in alone),
        *(_finding(each, evidence, f"The noise is that of the touches or of the arm. {why}") for each in with_arm),
    ]


def is_touch_noise(sigma: ContradictedSigma, evidence: Evidence) -> bool:
    """Whether a stated sigma of touches is too small, and no other error is likely."""
    if sigma.of_robot or not sigma.is_too_small or not _touches(sigma.about, evidence):
        return False
    choice, effect = evidence.robot_model, evidence.systematic_error
    is_modelled = choice is None or choice.chosen.kind == "none"
    is_other = effect is not None and effect.is_certain
    return is_modelled and not is_other and sigma.ratio * _stated_sigma(sigma.about, evidence) < PLAUSIBLE_TOUCH_M


def _touches(tip: str, evidence: Evidence) -> list[TouchMeasurement]:
    """Touches by a tip; empty if the camera is not a tip."""
    seen = (group.measurement for group in evidence.recorded.groups if group.camera == tip)
    return [each for each in seen if isinstance(each, TouchMeasurement) and each.noise_field == "touch_m"]


def _stated_sigma(tip: str, evidence: Evidence) -> float:
    """Mean stated sigma of the touches of a tip [m]."""
    return float(np.mean([1 / np.mean(touches.stated) for touches in _touches(tip, evidence)]))


def _sigma_with_arm(tip: str, evidence: Evidence) -> ContradictedSigma | None:
    """The stated sigma of touches, if the estimated noise of the arm contradicts it; else None."""
    solution, camera = evidence.solution, evidence.cell.cameras[tip]
    sigma, touches = solution.noise.robots.get(camera.on), _touches(tip, evidence)
    if sigma is None or not any(each.counts().get("stated") for each in touches):
        return None
    lever_m2 = 2 / 3 * float(np.sum(solution.state.transforms[evidence.cell.mount_name(tip)].translation ** 2))
    arm_m2 = float(np.mean(sigma[:3] ** 2) + lever_m2 * np.mean(sigma[3:] ** 2))
    ratio = 1 + arm_m2 / _stated_sigma(tip, evidence) ** 2
    found = judge_sigma(tip, False, ratio * solution.dof, solution.dof)
    return found if found is not None and is_touch_noise(found, evidence) else None


def _finding(sigma: ContradictedSigma, evidence: Evidence, reason: str) -> Finding:
    stated_m = _stated_sigma(sigma.about, evidence)
    found = two_digits(1e3 * sigma.ratio * stated_m)
    what = f"Touches by {sigma.about} scatter by {found} mm per axis, {1e3 * stated_m:g} mm is stated."
    do = f"State `sigma_m: {sigma.ratio * stated_m:.2g}` of these touches, or state none."
    return Finding("touch-noise", "info", (sigma.about,), what, (do,), reason)
