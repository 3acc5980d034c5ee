"""`lens-model`: residuals that depend on the position in the image."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.lens_structure import LensStructure
from basecal.cell import Finding
from basecal.fields.digits import p_value_text, two_digits

# Sigmas by which a requested transform has to shift for a warning: less is within its uncertainty; assumed.
_RELEVANT_SIGMAS = 1.0


def lens_model(evidence: Evidence) -> list[Finding]:
    """A warning if the error of a lens model shifts the answer by more than its sigmas, else an info."""
    findings = []
    for found in evidence.lens_structures:
        shifts = [
            _shift_sigmas(evidence, found, name)
            for name in evidence.cell.requested_transforms
            if name in evidence.solution.problem.columns
        ]
        worst = max(shifts, default=0.0)
        what = f"Residuals of {found.camera} depend on their position in the image: {two_digits(found.rms_px)} px rms."
        chance = f"Its lens model cannot represent them ({p_value_text(found.chance, 1)})."
        why = f"{chance} They move the answer by up to {worst:.1f} sigma, which the covariance contains."
        do = "Try another lens model or more distortion terms.", "Fill the images to their corners."
        findings.append(
            Finding("lens-model", "warning" if worst > _RELEVANT_SIGMAS else "info", (found.camera,), what, do, why)
        )
    return findings


def _shift_sigmas(evidence: Evidence, structure: LensStructure, name: str) -> float:
    """Largest shift of a transform by the error of a lens model, in sigmas."""
    columns = evidence.solution.problem.columns[name]
    sigma = np.sqrt(np.maximum(np.diag(evidence.solution.joint_transform_covariance([name])), 0.0))[
        : columns.stop - columns.start
    ]
    return float(np.abs(structure.moved[columns] / np.maximum(sigma, np.finfo(np.float64).tiny)).max())
