"""`basecal study paper`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from basecal.cli.simulate import Seed
from basecal.cli.terminal import print_json, progress, say

Draws = Annotated[int, Parameter(validator=validators.Number(gte=2, lte=10_000_000))]


def study_paper(*, seed: Seed = 0, draws: Draws = 10_000, figures: Path | None = None, json: bool = False) -> int:
    """Reproduce the simulations of the paper the axis-shift method comes from.

    Its tables beside ours, its single draw of noise among many, the two orders
    of orthonormalising, and the error against the length of the shifts for
    its closed form, maximum likelihood and the Cramer-Rao bound.

    For example:

        basecal study paper
        basecal study paper --figures docs/figures
        basecal study paper --json > study.json

    Args:
        seed: Of the noise.
        draws: Of the 1 % and 5 % noise.
        figures: Folder to write the figures to, as SVG.
        json: Print one object, in the keys of the paper's figures.
    """
    from basecal.reporting.study_text import length_figures, paper_text
    from basecal.studies.paper import study_paper as studied

    with progress("simulating"):
        study = studied(seed, draws)
    if figures is not None:
        figures.mkdir(parents=True, exist_ok=True)
        for name, svg in length_figures(study).items():
            (figures / name).write_text(svg, encoding="utf-8")
    if json:
        print_json(study)
    else:
        say(paper_text(study))
    return 0
