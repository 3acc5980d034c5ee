"""A solution with a certificate, and replaced by a better one where the proof finds one."""

from __future__ import annotations

from dataclasses import replace

from basecal.cell import Certificate, Finding
from basecal.estimation.certificate.certificate import certify
from basecal.estimation.settings import Settings
from basecal.estimation.solve import Solution, solve_from

_ROUNDS = 3


def certified(solution: Solution, settings: Settings) -> tuple[Solution, Certificate | None, list[Finding]]:
    """The best solution found, its certificate, and a finding where it is not the one that was given.

    A certificate is made where the settings ask for it, and where starts ended in different optima.
    """
    if not (settings.certify or solution.disputed):
        return solution, None, []
    best, found = solution, certify(solution)
    for _ in range(_ROUNDS):
        if found.better is None:
            break
        best = replace(solve_from(best.problem, found.better, settings, best.findings), disputed=best.disputed)
        found = certify(best)
    return best, found.certificate, _replaced(solution, best)


def _replaced(first: Solution, best: Solution) -> list[Finding]:
    if best is first:
        return []
    message = (
        f"the start had led to an optimum of cost {first.cost:.6g}, the certificate to one of {best.cost:.6g}: the "
        "answer is the better of the two"
    )
    return [Finding("better-optimum", "info", (), message)]
