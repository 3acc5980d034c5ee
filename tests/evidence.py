"""Evidence about a solution as checks take it, without outliers."""

from __future__ import annotations

from basecal.accuracy.cross_validation.validation import CrossValidation
from basecal.accuracy.findings.evidence import Evidence
from basecal.cell import Cell
from basecal.estimation.outliers.robust_solve import RobustSolution
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution


def evidence_of(cell: Cell, solution: Solution, cross_validation: CrossValidation | None = None) -> Evidence:
    """Return the evidence about a solution of a cell, with no group left out."""
    problem = solution.problem
    robust = RobustSolution(solution, (), problem.with_groups(()), len(cell.targets), 0)
    return Evidence(cell, Settings(), problem, robust, solution, cross_validation)
