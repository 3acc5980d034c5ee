"""What the page of a cell's runs says: a sample, and the answer with and without some samples."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from basecal.accuracy.residuals.without_samples import WithoutSamples
from basecal.cell import Calibration, Cell, SampleResidual
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.statement.verdict import error_text


def sample_words(number: int, residuals: Sequence[SampleResidual], excluded: Collection[int]) -> str:
    """How a sample fits, a line for each view of it."""
    lines = [f"sample {number}{', left out' if number in excluded else ''}"]
    for each in residuals:
        if each.sample != number:
            continue
        parts = [] if each.rms_px is None else [f"{two_digits(each.rms_px)} px"]
        if each.loop_m is not None and each.loop_rad is not None:
            parts.append(error_text(each.loop_m, each.loop_rad))
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
        line = f"{name} to {error_text(*estimate.sigma_norms)} (1 sigma)"
        if name in calibration.transforms:
            apart = (calibration[name].mean.inverse() @ estimate.mean).log()
            moved_m, moved_rad = (float(np.linalg.norm(each)) for each in (apart[:3], apart[3:]))
            line += f"; {error_text(moved_m, moved_rad)} from the run"
        lines.append(line)
    loop = result.residuals.loop_rms_m
    return "\n".join([*lines, *([] if loop is None else [f"loops close to {error_text(loop, None)} rms"])])
