"""The face of a noise term, a module of `basecal.estimation.noise.terms`, and those there are.

A term is an error of a robot's poses that its stops have in common, beside the error of each by itself. Its two sigmas,
of shifts and of turns, are estimated with all others; it stands in a model of its own, which counts by its evidence.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Any, Protocol

from basecal.cell.robot_parameters.kind import Posture
from basecal.estimation.noise.hyperpriors import CommonPrior
from basecal.estimation.noise.terms.common_errors import CommonErrors
from basecal.estimation.problem.problem import Problem
from basecal.registry import NOISE_TERMS


class NoiseTerm(Protocol):
    """A kind of error that stops have in common.

    Attributes:
        EXPECTED: What is expected of its sigmas beforehand.
        IS_LEFT: Whether what is told of it is what a base and a mount leave, which take up most of such errors.
        IS_SURE: Whether every arm that has it modelled has some of it, however little: none is built as stated.
        FIGURES: What else is told of it beside its sigmas, by the names that its words in the registry have.
    """

    EXPECTED: CommonPrior
    IS_LEFT: bool
    IS_SURE: bool
    FIGURES: Mapping[str, float]

    def errors(self, problem: Problem, robot: str) -> CommonErrors | None:
        """What a robot's stops have in common; None where they show none of it."""

    def at_posture(self, at: Posture) -> CommonErrors | None:
        """The same errors of an arm at any joints; None of what does not go by joints."""


@cache
def noise_terms() -> Mapping[str, NoiseTerm]:
    """The terms there are, by name."""
    modules: dict[str, Any] = {name: import_module(f"basecal.estimation.noise.terms.{name}") for name in NOISE_TERMS}
    return modules
