"""`basecal study paper`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

from basecal.cli.option_types import Output, Seed, number_range
from basecal.cli.study import Workers, execute_study, summary_text
from basecal.cli.terminal import print_json, progress, say
from basecal.errors import UsageError

Draws = Annotated[int | None, number_range(2, 10_000_000)]


def study_paper(
    *,
    seed: Seed | None = None,
    draws: Draws = None,
    figures: Path | None = None,
    workers: Workers = None,
    output: Output = None,
    json: bool = False,
) -> int:
    """Reproduce the simulations of the paper that introduced the axis-shift method.

    Compares the paper's tables with ours, its single draw of noise with many, and
    the two orders of orthonormalisation. The error as a function of the length of
    the shifts is given for its closed form, maximum likelihood and the Cramer-Rao
    bound. The noise and the number of draws are those of a study file in this
    package. With --output this study is run like any other, and its table and
    page are written there.

    For example:

        basecal study paper
        basecal study paper -o paper
        basecal study paper --figures docs/figures
        basecal study paper --json > study.json

    Args:
        seed: Seed of the noise; 0 by default.
        draws: Number of draws of the 1 % and 5 % noise; 10,000 by default.
        figures: Folder to write the figures to, as SVG.
        workers: Number of processes that run the study file; by default the number of cores.
        output: Folder for the table, summary and page of the study file; it is not run by default.
        json: Print one object, with the keys of the paper's figures.
    """
    from basecal.reporting.study_text import paper_text, shift_length_figures
    from basecal.studies.jobs import WorkerPool
    from basecal.studies.paper import paper_study
    from basecal.studies.paper import study_paper as studied

    if output is not None and (seed is not None or draws is not None):
        raise UsageError("--output runs the study file as it is: leave out --seed and --draws, or --output")
    if workers is not None and output is None:
        raise UsageError("--workers run the study file: give --output with a folder for the results")
    with progress("simulating"):
        study = studied(seed, draws)
    if figures is not None:
        figures.mkdir(parents=True, exist_ok=True)
        for name, svg in shift_length_figures(study).items():
            (figures / name).write_text(svg, encoding="utf-8")
    pool = WorkerPool(workers or os.cpu_count() or 1)
    summary = None if output is None else execute_study(paper_study(), output, pool)
    if json:
        file_summary = {} if summary is None else {"study": {k: v for k, v in summary.items() if k != "words"}}
        print_json({**study, **file_summary})
    else:
        say(paper_text(study) if summary is None else f"{paper_text(study)}\n\n{summary_text(summary)}")
    return 0
