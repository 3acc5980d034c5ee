"""`intrinsics`: a stated lens whose error is larger than that of a usual calibration."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.findings.prior_contradicted import informed_spectrum, innovation_covariance
from basecal.accuracy.model_comparison.nested_models import compare_nested_models
from basecal.cell import Finding
from basecal.effects.faces.effect import FIX
from basecal.effects.registry import LENS_PARAMETERS
from basecal.estimation.problem.stated_lens import is_stated, usual_sigmas
from basecal.estimation.solve import Solution
from basecal.geometry import Camera


def stated_lens(evidence: Evidence) -> list[Finding]:
    """A warning for each lens that is not as stated."""
    lenses = {name: evidence.cell.cameras[name].intrinsics for name in sorted(evidence.solution.problem.lenses)}
    stated = {name: lens.camera for name, lens in lenses.items() if lens is not None and is_stated(lens)}
    return [
        Finding("intrinsics", "warning", (name,), *_sentences(name, camera, evidence.solution))
        for name, camera in stated.items()
        if camera is not None and _is_contradicted(name, camera, evidence.solution)
    ]


def _is_contradicted(name: str, stated_camera: Camera, solution: Solution) -> bool:
    """Whether the error of a lens has a probability below 1 in 10,000 under the usual sigmas."""
    usual, used = usual_sigmas(stated_camera), solution.problem.lenses[name].sigma
    assert used is not None
    off = (solution.state.cameras[name].parameters - stated_camera.parameters) / usual
    columns = solution.problem.columns[name]
    known = informed_spectrum(
        innovation_covariance(solution.observability.inverse[columns, columns] / np.outer(usual, usual), used / usual)
    )
    return compare_nested_models(float(known.squared_mahalanobis(off)), int(known.rank)).is_taken


def _sentences(name: str, stated_camera: Camera, solution: Solution) -> tuple[str, tuple[str, ...], str]:
    estimated, sigma = solution.state.cameras[name], np.sqrt(np.diag(solution.lens_covariance(name)))
    off = ", ".join(part.words(stated_camera, estimated, sigma) for part in LENS_PARAMETERS.values())
    do = f"Calibrate the lens of {name}, or set its intrinsics' status to free."
    return f"The lens of {name} is not as stated: {off}.", (do, FIX), "The answer uses the estimated lens."
