"""Unstated sigmas, estimated from the residuals.

If no other sigma is stated, they have one common factor: cost / dof. If priors or robots' noise are stated too, each
sigma is the fixed point of sigma^2 = (sum of squares) / (n - gamma). gamma is the number of unknowns that its residuals
determine: the derivative of the posterior's log determinant to the log of its weight. Source: MacKay 1992;
docs/mathematics.md (5.1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from basecal.estimation.least_squares.bundle_adjustment import Optimum, bundle_adjust
from basecal.estimation.least_squares.normal_equations import NormalEquations, linearise
from basecal.estimation.noise.robot_noise import with_robot_noise
from basecal.estimation.noise.shaped_targets import reshape_targets
from basecal.estimation.problem.problem import Problem
from basecal.estimation.view.measurement import Noise
from basecal.geometry import Array
from basecal.numerics.spectral import spectrum

if TYPE_CHECKING:
    from basecal.estimation.noise.laplace import SigmaPosterior

CONTRADICTED = 1.5
"""Residuals over their sigmas beyond which one or the other is wrong; `benchmarks.outliers` judges it."""

PLAUSIBLE_SIGMAS = 4.0
"""Residuals over their sigmas that sigmas alone may explain: people state them too small, but not by more; assumed."""

PLAUSIBLE_PX = 3.0
"""[px] rms of residuals that a detector may leave, far beyond the detectors of docs/benchmarks.md."""

PLAUSIBLE_TOUCH_M = 3e-3
"""[m] per axis that touches may scatter, far beyond people who lead a tip to a mark, and sockets; assumed."""

UNSUSPECTED_PX = 1.0
"""[px] of noise in which neither outliers nor a wrong lens hide; `benchmarks.outliers` judges it."""

ROUNDING = 1e-9
"""[m, rad, px] below which numbers of metres are rounding: files have nine digits, computations fifteen."""

_FIXED_POINT_ROUNDS = 40  # of the fixed point, which gains a digit in two or three
# [1] relative change of a variance that ends the rounds: ten thousand residuals tell it to a hundredth.
_SETTLED_CHANGE = 1e-3
_LOG_STEP = 1e-3  # of the difference that gives a slope: rounding and bend are a millionth each


@dataclass(frozen=True, eq=False)
class NoiseEstimate:
    """Sigmas in use for unstated noise.

    Attributes:
        noise: The sigmas.
        factor: What the information's inverse is multiplied by.
        estimated: Fields of `noise` that were estimated.
        settled: Whether the estimation came to rest.
        robots: Estimated sigmas of robots without stated ones, (6,) [m, rad], by name.
        cameras: Sigmas by camera; those of `noise` where none is named.
        common: Sigmas of errors that robots' stops share, of shifts and rotations, (2,), by term and robot; of the
            likely term.
        covariance: (p, p) of all columns, the sigmas integrated over; None where it is the information's inverse.
        minus_2_log_evidence: Minus twice the log of the evidence, the sigmas integrated over, but for a constant.
        plain_minus_2_log_evidence: The same of the model without shared terms.
        shapes: Of targets whose shape was estimated: its coefficients, (k,), and their covariance, (k, k).
        logs: (k,) logarithms of the sigmas that were estimated jointly; None of others.
        models: If sigmas were integrated over: those of single stops and views alone, by "", and those with each term
            that stops may share, by name.
        robot_variances: Of robots in `robots`, the mean over all that their sigmas may be of their squares, (6,).
        jitter_s: Of stamps of cameras without stated jitter [s].
        beside_common: The sigmas of single stops and of views beside those in `common`; None without any.
    """

    noise: Noise
    factor: float
    estimated: tuple[str, ...]
    settled: bool
    robots: Mapping[str, Array] = field(default_factory=dict)
    cameras: Mapping[str, Noise] = field(default_factory=dict)
    common: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    covariance: Array | None = None
    minus_2_log_evidence: float = 0.0
    plain_minus_2_log_evidence: float = 0.0
    shapes: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    logs: Array | None = None
    models: Mapping[str, SigmaPosterior] = field(default_factory=dict)
    robot_variances: Mapping[str, Array] = field(default_factory=dict)
    jitter_s: Mapping[str, float] = field(default_factory=dict)
    beside_common: NoiseEstimate | None = None

    def hold_sigmas(self, problem: Problem) -> Problem:
        """The problem with these sigmas, held, and targets shaped so."""
        return replace(self.apply(problem), held=True)

    def apply(self, problem: Problem) -> Problem:
        """The problem with these sigmas, which may be estimated again, and targets shaped so."""
        problem = reshape_targets(problem, {name: shape for name, (shape, _) in self.shapes.items()})
        groups = (g.with_noise(self.cameras.get(g.camera, self.noise)) for g in problem.groups)
        noisy = with_robot_noise(problem.with_groups(groups), self.robots)
        return replace(noisy, jitter_s={**problem.jitter_s, **self.jitter_s})


def residual_counts(problem: Problem) -> dict[str, int]:
    """Scalar residuals by the field of `Noise` that is their sigma, and `stated`."""
    total: dict[str, int] = {}
    for group in problem.groups:
        for key, count in group.measurement.counts().items():
            total[key] = total.get(key, 0) + count
    if problem.tied is not None:
        total["stated"] = total.get("stated", 0) + problem.tied.count
    return total


def degrees_of_freedom(problem: Problem) -> int:
    """Scalar residuals, priors among them, less unknowns."""
    status = _statuses(problem)
    priors = sum(problem.column_width(name) for name in problem.columns if status[name] == "prior")
    held = sum(
        int(of.sum()) for name, of in problem.gauges.items() if name in problem.columns and status[name] == "free"
    )
    return int(sum(residual_counts(problem).values()) + priors + held - problem.width)


def _statuses(problem: Problem) -> dict[str, str]:
    transforms: dict[str, str] = {name: unknown.status for name, unknown in problem.unknowns.items()}
    robots = {n: "free" if s is None else "prior" for m in problem.models.values() for n, s in m.sigmas.items()}
    return transforms | {name: lens.status for name, lens in problem.lenses.items()} | robots


def estimate_noise(problem: Problem, end: Optimum, iterations: int) -> tuple[Problem, Optimum, NoiseEstimate]:
    """The problem and its optimum with unstated sigmas estimated, and these sigmas."""
    if problem.held:
        return problem, end, NoiseEstimate(Noise(), 1.0, (), True)
    counts = residual_counts(problem)
    fields = tuple(f for f in Noise._fields if counts.get(f))
    noise = Noise()
    dof = degrees_of_freedom(problem)
    if not fields:
        return problem, end, NoiseEstimate(noise, 1.0, (), True)
    has_priors = "prior" in _statuses(problem).values()
    if len(fields) == 1 and not counts.get("stated") and not has_priors and not len(problem.stops):
        factor = max(end.cost, 0.0) / max(dof, 1)
        scaled = noise._replace(**{fields[0]: getattr(noise, fields[0]) * np.sqrt(factor)})
        return problem, end, NoiseEstimate(scaled, factor, fields, True)
    for _ in range(_FIXED_POINT_ROUNDS):
        ratios = {}
        for f in fields:
            least = (ROUNDING / getattr(noise, f)) ** 2
            ratios[f] = max(_ratio(problem, end, noise, f, counts[f]), least)
        noise = noise._replace(**{f: getattr(noise, f) * np.sqrt(r) for f, r in ratios.items()})
        problem = problem.with_noise(noise)
        end = bundle_adjust(problem, end.state, dof, iterations)
        if all(abs(r - 1) < _SETTLED_CHANGE for r in ratios.values()):
            return problem, end, NoiseEstimate(noise, 1.0, fields, True)
    return problem, end, NoiseEstimate(noise, 1.0, fields, False)


def _ratio(problem: Problem, end: Optimum, noise: Noise, field: str, count: int) -> float:
    """New over old variance of one field."""
    squares = 0.0
    for group in problem.groups:
        predicted = end.state.camera_from_target(group, problem.stops)
        squares += group.measurement.squares(predicted, end.state.cameras.get(group.camera)).get(field, 0.0)
    heavier = noise._replace(**{field: getattr(noise, field) * np.exp(-_LOG_STEP / 2)})
    after = linearise(problem.with_noise(heavier), end.state)
    gamma = (_log_det(after) - _log_det(end.normal)) / _LOG_STEP
    return float(np.clip(squares / max(count - gamma, 0.01 * count), 1e-8, 1e8))


def _log_det(normal: NormalEquations) -> float:
    return float(spectrum(normal.hessian).log_det) + float(normal.stop_log_det)
