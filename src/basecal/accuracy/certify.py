"""A solution with a certificate, and replaced by a better one where the proof finds one."""

from __future__ import annotations

from dataclasses import replace

from basecal.cell import Certificate
from basecal.estimation.certificate.certificate import certify
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from

# Better optima to go to, one after another: each lowers the cost; `benchmarks.certificate` judges it.
_CERTIFICATE_ROUNDS = 3


def prove_solution(solution: Solution, settings: Settings) -> tuple[Solution, Certificate | None]:
    """The best solution found and its certificate; the solution that was given where the proof finds none better.

    A certificate is made where the settings ask for it, and where starts ended in different optima.
    """
    if not (settings.certify or solution.disputed):
        return solution, None
    best, found = solution, certify(solution)
    for _ in range(_CERTIFICATE_ROUNDS):
        if found.better is None:
            break
        best = replace(solve_from(best.problem, found.better, settings, best.findings), disputed=best.disputed)
        found = certify(best)
    return best, found.certificate
