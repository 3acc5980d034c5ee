"""Estimation of unstated sigmas from the residuals.

A single unstated sigma without any stated ones follows from cost / dof. If other sigmas, priors or robots' noise are
present, each sigma is the fixed point of sigma^2 = (sum of squares) / (n - gamma). gamma is the number of unknowns that
its residuals determine: the derivative of the posterior's log determinant with respect to the log of its weight.
Source: MacKay 1992; docs/mathematics.md (5.1).
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
"""Ratio of residuals to their sigmas beyond which one of them is wrong; validated by `benchmarks.outliers`."""

PLAUSIBLE_SIGMAS = 4.0
"""Largest ratio of residuals to their sigmas that underestimated sigmas alone may cause; assumed."""

PLAUSIBLE_PX = 3.0
"""Largest plausible rms residual of a detector [px], far above the detectors of docs/benchmarks.md."""

PLAUSIBLE_TOUCH_M = 3e-3
"""Largest plausible scatter of touches per axis [m], far above tips guided by hand and sockets; assumed."""

UNSUSPECTED_PX = 1.0
"""Pixel noise too small to hide outliers or a wrong lens [px]; validated by `benchmarks.outliers`."""

ROUNDING = 1e-9
"""Rounding error of values of the order of metres [m, rad, px]: files have nine digits, computations fifteen."""

_FIXED_POINT_ROUNDS = 40  # maximum number of iterations, which gain a digit in two or three
# Relative change of a variance at which the iteration ends: ten thousand residuals determine it to 1 %.
_SETTLED_CHANGE = 1e-3
_LOG_STEP = 1e-3  # step of the central difference: its rounding and truncation errors are about 1e-6 each


@dataclass(frozen=True, eq=False)
class NoiseEstimate:
    """Sigmas in use for unstated noise.

    Attributes:
        noise: Sigmas of views.
        factor: Factor of the inverse information in the covariance.
        estimated: Fields of `noise` that were estimated.
        converged: Whether the estimation converged.
        robots: Estimated sigmas of robots with unstated noise, (6,) [m, rad], by name.
        cameras: Sigmas by camera; cameras without an entry have those of `noise`.
        common: Sigmas of shared errors of the likeliest model, (2,) [m, rad], by effect and robot.
        covariance: (p, p) covariance of all columns, integrated over the sigmas; None if it is the inverse information.
        minus_2_log_evidence: Minus twice the log of the evidence, integrated over the sigmas, up to a constant.
        plain_minus_2_log_evidence: Minus twice the log of the evidence of the model without shared errors.
        shapes: Coefficients, (k,), and their covariance, (k, k), of targets with an estimated shape, by name.
        logs: (k,) logarithms of jointly estimated sigmas; None otherwise.
        models: Posteriors of the sigmas by model, if they were integrated over: "" without shared errors, and one for
            each shared effect by its name.
        robot_variances: Posterior mean of the squared sigmas of each robot in `robots`, (6,) [m^2, rad^2].
        jitter_s: Estimated timing jitter of cameras with unstated jitter [s], by name.
        beside_common: Sigmas of single stops and of views in the model with `common`; None without shared errors.
    """

    noise: Noise
    factor: float
    estimated: tuple[str, ...]
    converged: bool
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
        """Return the problem with these sigmas and target shapes, held fixed in later estimations."""
        return replace(self.apply(problem), held=True)

    def apply(self, problem: Problem) -> Problem:
        """Return the problem with these sigmas and target shapes; the sigmas may be estimated again."""
        problem = reshape_targets(problem, {name: shape for name, (shape, _) in self.shapes.items()})
        groups = (g.with_noise(self.cameras.get(g.camera, self.noise)) for g in problem.groups)
        noisy = with_robot_noise(problem.with_groups(groups), self.robots)
        return replace(noisy, jitter_s={**problem.jitter_s, **self.jitter_s})


def residual_counts(problem: Problem) -> dict[str, int]:
    """Number of scalar residuals by the field of `Noise` with their sigma, or `stated`."""
    total: dict[str, int] = {}
    for group in problem.groups:
        for key, count in group.measurement.counts().items():
            total[key] = total.get(key, 0) + count
    if problem.tied is not None:
        total["stated"] = total.get("stated", 0) + problem.tied.count
    return total


def degrees_of_freedom(problem: Problem) -> int:
    """Number of scalar residuals, including priors, minus the number of unknowns."""
    status = _statuses(problem)
    priors = sum(problem.column_width(name) for name in problem.columns if status[name] == "prior")
    gauge_count = sum(
        int(directions.sum())
        for name, directions in problem.gauges.items()
        if name in problem.columns and status[name] == "free"
    )
    return int(sum(residual_counts(problem).values()) + priors + gauge_count - problem.width)


def _statuses(problem: Problem) -> dict[str, str]:
    transforms: dict[str, str] = {name: unknown.status for name, unknown in problem.unknowns.items()}
    robots = {n: "free" if s is None else "prior" for m in problem.models.values() for n, s in m.sigmas.items()}
    return transforms | {name: lens.status for name, lens in problem.lenses.items()} | robots


def estimate_noise(problem: Problem, end: Optimum, iterations: int) -> tuple[Problem, Optimum, NoiseEstimate]:
    """Estimate the unstated sigmas; return the problem with them, its optimum, and the sigmas."""
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
            ratios[f] = max(_variance_ratio(problem, end, noise, f, counts[f]), least)
        noise = noise._replace(**{f: getattr(noise, f) * np.sqrt(r) for f, r in ratios.items()})
        problem = problem.with_noise(noise)
        end = bundle_adjust(problem, end.state, dof, iterations)
        if all(abs(r - 1) < _SETTLED_CHANGE for r in ratios.values()):
            return problem, end, NoiseEstimate(noise, 1.0, fields, True)
    return problem, end, NoiseEstimate(noise, 1.0, fields, False)


def _variance_ratio(problem: Problem, end: Optimum, noise: Noise, field: str, count: int) -> float:
    """Ratio of the new to the old variance of one field."""
    squares = 0.0
    for group in problem.groups:
        predicted = end.state.camera_from_target(group, problem.stops)
        squares += group.measurement.squares(predicted, end.state.cameras.get(group.camera)).get(field, 0.0)
    smaller_noise = noise._replace(**{field: getattr(noise, field) * np.exp(-_LOG_STEP / 2)})
    normal = linearise(problem.with_noise(smaller_noise), end.state)
    gamma = (_log_det(normal) - _log_det(end.normal)) / _LOG_STEP
    return float(np.clip(squares / max(count - gamma, 0.01 * count), 1e-8, 1e8))


def _log_det(normal: NormalEquations) -> float:
    return float(spectrum(normal.hessian).log_det) + float(normal.stop_log_det)
