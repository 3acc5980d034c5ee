"""The face of a noise term, a module of `basecal.estimation.noise.terms`, and those there are.

A term is an error of a robot's poses that its stops have in common, beside the error of each by itself: what unit
errors of its modes are at each stop, in every coordinate alike. Its two sigmas, of translation and rotation, are
estimated with all others; it stands in a model of its own, which counts by its evidence.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import Any, Protocol

from basecal.estimation.problem.problem import Problem
from basecal.geometry import Array
from basecal.registry import NOISE_TERMS


class NoiseTerm(Protocol):
    """A kind of error that stops have in common.

    Attributes:
        OVER_STOP: Its sigma over that of single stops as expected beforehand, and the factor of a standard deviation.
        FIGURES: What else is told of it beside its sigmas, by the names that its words in the registry have.
    """

    OVER_STOP: tuple[float, float]
    FIGURES: Mapping[str, float]

    def modes(self, problem: Problem, robot: str) -> Array:
        """What unit errors of each mode are at each stop of a robot, (stops, k); k is 0 where stops show none of it."""


@cache
def noise_terms() -> Mapping[str, NoiseTerm]:
    """The terms there are, by name."""
    modules: dict[str, Any] = {name: import_module(f"basecal.estimation.noise.terms.{name}") for name in NOISE_TERMS}
    return modules
