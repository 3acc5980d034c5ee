"""Small studies for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from basecal.studies.chunk import COLUMNS
from basecal.studies.study import Study
from basecal.studies.study_file import study_from_text
from basecal.studies.summary import results

BOARD = "board: {kind: chessboard, corners: [4, 3], square_m: 0.06}"


def study(trials: int = 8, cells: int = 2, hold: str = "", axes: str = "", more: str = "") -> Study:
    """A study with cells of a few samples; `hold` and `axes` are entries of these mappings in YAML."""
    text = f"schema: basecal/study/1\ntrials: {trials}\ncells: {cells}\n{more}\nhold: {{{hold}}}\naxes: {{{axes}}}\n"
    return study_from_text(text, "study.yaml")


SMALL = f"samples: 8, {BOARD}"


def numbers(small_study: Study, folder: Path) -> dict[str, bytes]:
    """All columns of a study except the time, as bytes."""
    trials = [result.trials for _, result in results(small_study, folder)]
    named = {name: np.concatenate([getattr(each, name) for each in trials]) for name in COLUMNS}
    return {name: values.tobytes() for name, values in named.items() if name != "time_s"}
