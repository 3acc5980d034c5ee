"""A rigid transform with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from basecal.errors import InputError, check_type
from basecal.geometry.array import Array, ReadOnlyArrays, read_only
from basecal.geometry.se3 import SE3


@dataclass(frozen=True, eq=False)
class PoseEstimate(ReadOnlyArrays):
    """Estimate of a rigid transform: mean and first-order covariance.

    The true transform is `mean @ SE3.exp(xi)` with `xi` ~ N(0, covariance). For an `a_from_b`, the covariance is in the
    axes of b and about the origin of b, without a lever arm.

    Attributes:
        mean: A single transform.
        covariance: (6, 6) [m, rad], translation first.

    Raises:
        InputError: if the mean is a batch, or the shape of the covariance is not (6, 6).
    """

    mean: SE3
    covariance: Array
    __array_ufunc__: ClassVar[None] = None  # see `SE3`

    def __post_init__(self) -> None:
        check_type("mean", self.mean, SE3)
        covariance = read_only(self.covariance, (6, 6), "covariance")
        if self.mean.shape or covariance.ndim != 2:
            shapes = f"{self.mean.shape} transforms and {covariance.shape[:-2]} covariances"
            raise InputError(f"{shapes}, expected one of each: make an estimate of each of a batch")
        object.__setattr__(self, "covariance", covariance)

    @classmethod
    def exact(cls, mean: SE3) -> PoseEstimate:
        """Make the estimate of an exact transform, with zero covariance."""
        return cls(mean, np.zeros((6, 6)))

    def words(self) -> str:
        """Format translation [mm] and rotation vector [deg], each with its sigma per axis."""
        mean = self.mean
        parts = (
            (mean.translation * 1e3, self.sigma_t * 1e3, "mm"),
            (np.degrees(mean.rotvec), np.degrees(self.sigma_r), "deg"),
        )
        return ", ".join(f"{_row(values)} ± {_row(sigmas)} {unit}" for values, sigmas, unit in parts)

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"PoseEstimate({self.words()})"

    def inverse(self) -> PoseEstimate:
        """Return `b_from_a` of an `a_from_b`, with the covariance transformed by the adjoint."""
        ad = self.mean.adjoint()
        return PoseEstimate(self.mean.inverse(), ad @ self.covariance @ ad.T)

    def __matmul__(self, other: PoseEstimate | SE3) -> PoseEstimate:
        """Compose `a_from_b` with an independent or exact `b_from_c`; for a point, use `SE3(np.eye(3), point)`.

        Raises:
            InputError: if `other` is an array.
        """
        if isinstance(other, np.ndarray | Sequence):
            raise InputError("expected a transform: write estimate @ SE3(np.eye(3), point), or SE3.from_matrix")
        if isinstance(other, SE3):
            other = PoseEstimate.exact(other)
        if not isinstance(other, PoseEstimate):
            return NotImplemented
        ad = other.mean.inverse().adjoint()
        return PoseEstimate(self.mean @ other.mean, ad @ self.covariance @ ad.T + other.covariance)

    def __rmatmul__(self, other: SE3) -> PoseEstimate:
        """Compose an exact `a_from_b` with this `b_from_c`."""
        return PoseEstimate.exact(other) @ self if isinstance(other, SE3) else NotImplemented

    def left_covariance(self) -> Array:
        """Covariance of `xi` in `SE3.exp(xi) @ mean`, in the axes and about the origin of a, (6, 6)."""
        ad = self.mean.adjoint()
        covariance: Array = ad @ self.covariance @ ad.T
        return covariance

    @property
    def sigma_t(self) -> Array:
        """Standard deviation of the translation per axis of b, (3,) [m]."""
        return np.sqrt(np.diag(self.covariance)[:3])

    @property
    def sigma_r(self) -> Array:
        """Standard deviation of the rotation per axis of b, (3,) [rad]."""
        return np.sqrt(np.diag(self.covariance)[3:])

    @property
    def sigma_norms(self) -> tuple[float, float]:
        """Standard deviations of translation [m] and rotation [rad] as 3-D norms: square roots of the traces."""
        return float(np.linalg.norm(self.sigma_t)), float(np.linalg.norm(self.sigma_r))


def _row(values: Array) -> str:
    return f"[{', '.join(f'{value:.4g}' for value in values)}]"
