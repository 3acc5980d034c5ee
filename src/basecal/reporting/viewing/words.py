"""Words of the page of a cell's runs: a sample, and the answer with and without some samples."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from basecal.accuracy.residuals.without_samples import WithoutSamples
from basecal.cell import Calibration, Cell, SampleResidual
from basecal.reporting.cell_view.sample_labels import view_words
from basecal.reporting.statement.digits import two_digits
from basecal.reporting.statement.verdict import error_text, tangent_text


def sample_words(number: int, residuals: Sequence[SampleResidual], exclusions: Collection[int]) -> list[str]:
    """How a sample fits, a line for each view of it."""
    own = [view_words(each) for each in residuals if each.sample == number]
    return [f"sample {number}{', left out' if number in exclusions else ''}", *own]


def answer_rows(cell: Cell, calibration: Calibration, result: WithoutSamples) -> Iterator[tuple[str, str, str, str]]:
    """Name of each requested transform, its sigma in the run and without some samples, and its shift."""
    for name in cell.requested_transforms:
        run, after = calibration.transforms.get(name), result.transforms.get(name)
        before = "unknown" if run is None else error_text(*run.sigma_norms)
        if after is None:
            yield name, before, "not every direction of it is seen", ""
            continue
        moved = ""
        if run is not None and after is not run:
            moved = tangent_text((run.mean.inverse() @ after.mean).log())
        yield name, before, error_text(*after.sigma_norms), moved


def fit_sentence(result: WithoutSamples) -> str:
    """How well the samples that count agree."""
    loop, rms_px = result.residuals.loop_rms_m, result.residuals.rms_px
    parts = [] if rms_px is None else [f"reprojection error {two_digits(rms_px)} px rms"]
    parts += [] if loop is None else [f"pose consistency error {error_text(loop, None)} rms"]
    parts += [] if result.converged else ["no optimum was found"]
    return f"{'; '.join(parts)}." if parts else ""
