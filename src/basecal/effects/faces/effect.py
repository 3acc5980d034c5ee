"""An effect: one property of a cell that may differ from its statement, and how the program treats it.

The faces of an effect are optional and typed. Unknown, random effect and candidate share the derivative, not the
inference. An effect that is estimated as an unknown of a robot is no random effect and no candidate of that robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from basecal.effects.faces.candidates import Candidates, Views
from basecal.effects.faces.robot_parameter import Posture, RobotParameter
from basecal.effects.faces.shared_errors import SharedErrors, SharedPrior
from basecal.fields.digits import two_digit_decimals
from basecal.geometry import SE3, Array, Camera
from basecal.numerics.spectral import scaled_spectrum

DEGREE, MILLI, SECOND, ONE = math.radians(1), 1e-3, 1.0, 1.0

FIX = "Or let `basecal fix CELL` do so."
"""Advice for faults that `basecal fix` can correct in the files of a cell."""

AGAIN = "Calibrate again when it is fixed."

_NODES = np.arange(-2.0, 3.0)  # of the logarithm of a sigma, in standard deviations


class Words(NamedTuple):
    """The text of a finding.

    Attributes:
        code: Code of the finding.
        what: The problem, with its number and unit.
        do: What to do, in sentences.
        why: The cause, if it is known.
        severity: Severity of the finding, if the effect was not found by a test.
    """

    code: str
    what: str
    do: tuple[str, ...]
    why: str = ""
    severity: Literal["warning", "info"] = "warning"


@dataclass(frozen=True, eq=False)
class FoundEffect:
    """An effect that explains residuals better than noise does.

    Attributes:
        effect: Name of the effect.
        code: Code of its candidate, such as `joint-offset`.
        about: The affected robot, camera, target or transform.
        is_camera: Whether `about` is a camera.
        is_target: Whether `about` is a target.
        since: Number of the first affected sample; None if all samples are affected.
        unit: Unit of the sizes.
        size: (q,) correction of the recording.
        covariance: (q, q) of the size.
        moved: (p,) shift of the answer's columns when the recording is corrected.
        joint: Index of the affected joint, from 0; None if the effect concerns no single joint.
        is_certain: Whether chance is excluded; other effects may still predict held-out blocks better.
        alternatives: Effects that the data do not distinguish from this one.
        probability: Probability that the effect exists, which scales the variance that it adds to the answer.
    """

    effect: str
    code: str
    about: str
    is_camera: bool
    is_target: bool
    since: int | None
    unit: str
    size: Array
    covariance: Array
    moved: Array
    joint: int | None = None
    is_certain: bool = True
    alternatives: tuple[FoundEffect, ...] = ()
    probability: float = 1.0

    @property
    def sigma(self) -> float:
        """Sigma of a single size."""
        return float(np.sqrt(self.covariance[0, 0]))


class SigmaPrior(NamedTuple):
    """A discrete prior: possible sigmas of sizes, (m, ...), and their probabilities, (m,)."""

    sigmas: Array
    probabilities: Array

    @classmethod
    def single_value(cls, sigma: float) -> SigmaPrior:
        """Prior of a known sigma."""
        return cls(np.array([sigma]), np.ones(1))

    @classmethod
    def spike_and_slab(cls, sigmas: Array, kinds: int = 1) -> SigmaPrior:
        """Prior of zero or one of m equally likely sigmas; of `kinds` independent effects all are zero with 50 %.

        It is a discrete spike-and-slab prior.

        Source: Jeffreys, Theory of Probability, 1961, ch. 5; Scott & Berger 2010 (many kinds).
        """
        none = 0.5 ** (1 / kinds)
        probabilities = np.append(none, np.full(len(sigmas), (1 - none) / len(sigmas)))
        return cls(np.concatenate([np.zeros_like(sigmas[:1]), sigmas]), probabilities)


class ExpectedSize(NamedTuple):
    """The expected sizes of a candidate.

    Attributes:
        sigma: Median of the prior of their sigma, in the unit of the candidate.
        factor: Factor by which one standard deviation of the prior multiplies the sigma; 1 if it is known.
        source: Source of the numbers, or `assumed`.
        is_stated: Whether the answer assumes size zero, as stated, with a covariance that covers other sizes.
            Otherwise the answer contains the expected size, given the data.
    """

    sigma: float
    factor: float
    source: str
    is_stated: bool = False

    def prior(self, kinds: int) -> SigmaPrior:
        """Prior of the sigma: zero or one of five values; of `kinds` effects all are zero with 50 %."""
        return SigmaPrior.spike_and_slab(self.sigma * self.factor**_NODES, kinds)


@dataclass(frozen=True, eq=False)
class RandomEffect:
    """A kind of error that the stops of a robot share.

    Attributes:
        expected: Prior of its sigmas.
        report: Text in the report, `error of robot eye that is ...`; `{...}` are filled in from `figures`.
        by_joints: Errors of an arm with recorded joints, from its posture; None if the arm lacks required data.
        by_poses: Errors of an arm with recorded poses, from all recorded poses, (m,), at poses, (n,).
        by_times: Errors of a moving arm, from the instants of stops, (n,) [s], NaN while the arm is at rest.
        is_of_poses_alone: Whether it applies only to arms that record poses; joints and links replace it on others.
        is_by_coordinate: Whether each error affects one coordinate of the flange, so that its sigma is that of errors.
        likely: Text for an effect that the evidence supports, from sigmas (shift [m], turn [rad]) of each robot.
        is_certain: Whether every modelled arm has the error to some extent, since no arm is built exactly as stated.
        is_mapped: Whether the error map and `verify` compute it from joints.
        replaced_by: Names of robot parameters that replace it if they are estimated.
        figures: Numbers that `calibration.json` stores in addition to its sigmas.
    """

    expected: SharedPrior
    report: str
    by_joints: Callable[[Posture], SharedErrors | None] | None = None
    by_poses: Callable[[SE3, SE3], SharedErrors | None] | None = None
    by_times: Callable[[Array], SharedErrors | None] | None = None
    is_of_poses_alone: bool = False
    is_by_coordinate: bool = False
    likely: Callable[[Mapping[str, Array]], Words] | None = None
    is_certain: bool = False
    is_mapped: bool = False
    replaced_by: tuple[str, ...] = ()
    figures: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class LensParameter:
    """Parameters of a lens whose errors have the same scale.

    Attributes:
        indices: Their slice of a lens's parameters.
        typical_sigmas: Sigmas of their errors in a typical calibration, (k,).
        source: Source of these sigmas, or `assumed`.
        words: Text for the difference of a stated lens from an estimated one, with sigmas of its parameters, (4 + n,).
        is_each_alone: Whether each parameter has its own scale of error; otherwise all have the same.
    """

    indices: slice
    typical_sigmas: Callable[[Camera], Array]
    source: str
    words: Callable[[Camera, Camera, Array], str]
    is_each_alone: bool = False


@dataclass(frozen=True, eq=False)
class TargetParameter:
    """A target shape that differs from the stated one.

    Attributes:
        unit_shifts: Shifts of a target's points, (p, 3) [m], by one sigma of each coefficient, (p, 3, k) [m].
        source: Source of the sigmas, or `assumed`.
        words: Text for the shape of a target's points, (p, 3), with coefficients, (k,); None if it is negligible.
    """

    unit_shifts: Callable[[Array], Array]
    source: str
    words: Callable[[str, Array, Array], Words | None]


@dataclass(frozen=True)
class SimulatedFault:
    """A fault that can be switched on in the simulator.

    Attributes:
        name: Name of the fault, such as `joint-offsets`.
        unit: Unit in which its size is written.
        scale: Value of the unit in SI units.
        default_size: Default size, in `unit`.
        description: Description of the fault for help.
        is_sudden: Whether it occurs suddenly, after a number of moves of the arm.
        draw: For a robot parameter: random values of this size, for a number of joints.
        true_lens: For a lens: the true lens, from the stated one.
        move_mount: For a mount: the tangent of the flange, (6,), by which the mount moves. Arguments: the size, and
            the direction of gravity in the flange, (3,).
    """

    name: str
    unit: str
    scale: float
    default_size: float
    description: str
    is_sudden: bool = False
    draw: Callable[[float, int, np.random.Generator], Array] | None = None
    true_lens: Callable[[float, Camera], Camera] | None = None
    move_mount: Callable[[float, Array], Array] | None = None


Face = Literal["statement", "size", "unknown", "random", "candidate", "map", "words", "fault"]
"""Statement in cell.yaml; expected size with its source; unknown; random effect; candidate of a score test; part of the
error map and `verify`; text of findings; fault of the simulator."""


NOT_OF_LENSES: dict[Face, str] = {
    "random": "a lens is the same in all views",
    "candidate": "a stated lens is estimated from the start, with the error of a usual calibration",
    "map": "the answer's covariance contains it",
}
"""Faces that lens parameters lack, with the reason."""


@dataclass(frozen=True, eq=False)
class Effect:
    """One effect.

    Attributes:
        name: Name of the effect, such as `joint_offsets`; for a robot parameter also the key in cell.yaml.
        parameter: Parameters of a robot with recorded joints, which cell.yaml states and the solver estimates.
        lens: Parameters of a lens, which cell.yaml states and the solver estimates.
        target: Shape of a target, whose coefficients are estimated under their prior.
        random: Error that a robot's stops share, whose sigmas are estimated.
        expected: Prior of the candidates' sizes, whose uncertainty every answer contains.
        candidates: Generator of the candidates of score tests.
        words: Text for a candidate that was found.
        fault: Fault of the simulator.
        is_by_place: Whether smooth fields of position-dependent errors contain its candidates.
        is_in_time: Whether its candidates change a frame in time; they are tested together with errors by place.
        elsewhere: Faces that another module implements, with the name of that module.
        absent: Faces that the effect lacks, with the reason.
    """

    name: str
    parameter: RobotParameter | None = None
    lens: LensParameter | None = None
    target: TargetParameter | None = None
    random: RandomEffect | None = None
    expected: ExpectedSize | None = None
    candidates: Callable[[Views], Iterator[Candidates]] | None = None
    words: Callable[[FoundEffect], Words] | None = None
    fault: SimulatedFault | None = None
    is_by_place: bool = False
    is_in_time: bool = False
    elsewhere: Mapping[Face, str] = field(default_factory=dict)
    absent: Mapping[Face, str] = field(default_factory=dict)

    @property
    def faces(self) -> frozenset[Face]:
        """Names of the faces that the effect has, here or in another module."""
        stated = self.parameter is not None or self.lens is not None
        has_prior = any(each is not None for each in (self.random, self.lens, self.target))
        has: dict[Face, bool] = {
            "statement": stated,
            "size": has_prior or self.expected is not None,
            "unknown": stated,
            "random": self.random is not None or self.target is not None or self.expected is not None,
            "candidate": self.candidates is not None,
            "map": self.parameter is not None or (self.random is not None and self.random.is_mapped),
            "words": self.words is not None or has_prior,
            "fault": self.fault is not None,
        }
        return frozenset(face for face, present in has.items() if present) | self.elsewhere.keys()


def format_with_sigma(value: float, sigma: float) -> str:
    """Text of a value and its sigma, with two digits of the sigma."""
    digits = two_digit_decimals(max(sigma, 1e-9), limit=9)
    return f"{value:.{digits}f} ± {sigma:.{digits}f}"


def format_length(values: Array, covariance: Array, factor: float) -> str:
    """Text of the length of a vector with its sigma, both multiplied by a factor."""
    length = float(np.linalg.norm(values))
    along = values / max(length, 1e-300)
    sigma = float(np.sqrt(max(float(along @ covariance @ along), 0.0)))
    return format_with_sigma(factor * length, factor * sigma)


def clearest_joint(effect: FoundEffect, factor: float, unit: str) -> tuple[int, str]:
    """Number of the most significant joint of a found effect, from 1, and the text of its size times a factor."""
    sigmas = np.sqrt(np.maximum(np.diag(effect.covariance), 0.0))
    clearest = int(np.argmax(np.abs(effect.size) / np.where(sigmas > 0, sigmas, np.inf)))
    amount = format_with_sigma(factor * effect.size[clearest], factor * float(sigmas[clearest]))
    return (clearest if effect.joint is None else effect.joint) + 1, f"{amount} {unit}"


def format_tangent(size: Array, covariance: Array) -> str:
    """Text ` by ...` of the translation [mm] and rotation [deg] of a tangent, (6,), or of a point's shift, (3,).

    Only components larger than their sigma are included; the text is empty if there are none.
    """
    parts = (slice(0, 3), 1e3, "mm"), (slice(3, 6), float(np.degrees(1)), "deg")
    texts = []
    for part, factor, unit in parts:
        known = _known_part(size[part], covariance[part, part])
        if known.any():
            texts.append(f"{format_length(known, covariance[part, part], factor)} {unit}")
    return " by " + " and ".join(texts) if texts else ""


def _known_part(size: Array, covariance: Array) -> Array:
    """A vector without its most uncertain directions, as few as make it longer than its sigma; zero if none do."""
    axes = scaled_spectrum(covariance, 0.0).vectors
    for count in range(len(size), 0, -1):
        part = axes[:, :count] @ (axes[:, :count].T @ size)
        if (part @ part) ** 2 > part @ covariance @ part:
            return np.asarray(part)
    return np.zeros_like(size)
