"""`basecal study paper`."""

from __future__ import annotations

from pathlib import Path

from basecal.cli.terminal import print_json, progress, say


def study_paper(*, seed: int = 0, draws: int = 10_000, figures: Path | None = None, json: bool = False) -> int:
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
    from basecal.errors import InputError
    from basecal.reporting.study_text import length_figures, paper_text
    from basecal.studies.paper import study_paper as studied

    if draws < 2 or seed < 0:
        raise InputError(f"draws is {draws} and seed {seed}: expected at least 2 draws and a seed of 0 or more")
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
