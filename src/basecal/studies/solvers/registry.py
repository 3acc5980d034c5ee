"""Registry of solvers of studies: add a module and an entry here for a new solver."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.studies.solvers import closed_form, maximum_likelihood, opencv
from basecal.studies.solvers.solver import Solver

SOLVERS: Mapping[str, Solver] = {
    "maximum_likelihood": maximum_likelihood.SOLVER,
    "closed_form": closed_form.SOLVER,
    "opencv": opencv.SOLVER,
}
"""Solvers by their names in the file of a study."""
