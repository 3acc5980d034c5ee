"""Every solver of studies: a new one is a module, and a line here."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.studies.solvers import closed_form, maximum_likelihood, opencv
from basecal.studies.solvers.solver import Solver

SOLVERS: Mapping[str, Solver] = {
    "maximum_likelihood": maximum_likelihood.SOLVER,
    "closed_form": closed_form.SOLVER,
    "opencv": opencv.SOLVER,
}
"""By their names in the file of a study."""
