"""What the page of a cell's runs says: a sample, and the answer with and without some samples."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np

from basecal.accuracy.residuals.without_samples import WithoutSamples
from basecal.cell import Calibration, Cell, SampleResidual


def sample_words(number: int, residuals: Sequence[SampleResidual], excluded: Collection[int]) -> str:
    """How a sample fits, a line for each view of it."""
    lines = [f"sample {number}{', left out' if number in excluded else ''}"]
    for each in residuals:
        if each.sample != number:
            continue
        parts = [] if each.rms_px is None else [f"{each.rms_px:.2f} px"]
        if each.loop_m is not None and each.loop_rad is not None:
            parts += [f"{1e3 * each.loop_m:.2f} mm", f"{math.degrees(each.loop_rad):.3f} deg"]
        lines.append(f"{each.target} seen by {each.camera}: {', '.join(parts) or 'no residual'}")
    return "\n".join(lines)


def answer_words(cell: Cell, calibration: Calibration, result: WithoutSamples, excluded: Collection[int]) -> str:
    """The answer without some samples, and how far that is from the run's."""
    many = f"without {len(excluded)} sample{'s' if len(excluded) > 1 else ''}" if excluded else "with all samples"
    lines = [f"run: {calibration.verdict}; {many}{'' if result.converged else ': no optimum was found'}"]
    for name in cell.asked:
        if name not in result.transforms:
            lines.append(f"{name}: not every direction of it is seen")
            continue
        estimate = result.transforms[name]
        sigma_mm, sigma_deg = (float(np.linalg.norm(each)) for each in (1e3 * estimate.sigma_t, estimate.sigma_r))
        line = f"{name} to {sigma_mm:.2g} mm and {math.degrees(sigma_deg):.2g} deg (1 sigma)"
        if name in calibration.transforms:
            apart = (calibration[name].mean.inverse() @ estimate.mean).log()
            moved_mm, moved_deg = 1e3 * np.linalg.norm(apart[:3]), np.degrees(np.linalg.norm(apart[3:]))
            line += f"; {moved_mm:.3f} mm and {moved_deg:.4f} deg from the run"
        lines.append(line)
    loop = result.residuals.loop_rms_m
    return "\n".join([*lines, *([] if loop is None else [f"loops close to {1e3 * loop:.2f} mm rms"])])
