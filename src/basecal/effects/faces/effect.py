"""An effect: one thing of a cell that may differ from what is stated, with all that the program knows of it.

Its faces are optional and typed. Unknown, random effect and candidate share the derivative, not the inference. An
effect that is estimated as an unknown of a robot is no random effect and no candidate of that robot.
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
from basecal.geometry import SE3, Array, Camera
from basecal.numerics.spectral import scaled_spectrum

DEGREE, MILLI, SECOND, ONE = math.radians(1), 1e-3, 1.0, 1.0

FIX = "Or let `basecal fix CELL` do so."
"""What to do about what the files of a cell allow to fix."""

AGAIN = "Calibrate again when it is fixed."

_NODES = np.arange(-2.0, 3.0)  # of the logarithm of a sigma, in standard deviations


class Words(NamedTuple):
    """A finding in words.

    Attributes:
        code: Of the finding.
        what: The problem, with its number and unit.
        do: What to do, sentences.
        why: The cause, if it is known.
        severity: Of the finding, if the effect was not found by a test.
    """

    code: str
    what: str
    do: tuple[str, ...]
    why: str = ""
    severity: Literal["warning", "info"] = "warning"


@dataclass(frozen=True, eq=False)
class FoundEffect:
    """An effect that the residuals show, and noise does not explain.

    Attributes:
        effect: Its name.
        code: Of its candidate, such as `joint-offset`.
        about: The robot, camera, target or transform that has it.
        is_camera: Whether that is a camera.
        is_target: Whether that is a target.
        since: Number of the first sample that has it; None if all samples do.
        unit: Unit of the sizes.
        size: (q,) correction of the recording.
        covariance: (q, q).
        moved: (p,) shift of the answer's columns when the recording is corrected.
        joint: Which joint of the robot has it, from 0; None if none does.
        is_certain: Whether chance is excluded; other effects predict held-out blocks better all the same.
        alternatives: Effects that the data do not distinguish from it.
        share: How probable it is, so that it widens the answer by as much of the variance.
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
    share: float = 1.0

    @property
    def sigma(self) -> float:
        """Sigma of a single size."""
        return float(np.sqrt(self.covariance[0, 0]))


class SigmaPrior(NamedTuple):
    """Possible sigmas of sizes, (m, ...), and their probabilities, (m,)."""

    sigmas: Array
    shares: Array

    @classmethod
    def single_value(cls, sigma: float) -> SigmaPrior:
        """One value."""
        return cls(np.array([sigma]), np.ones(1))

    @classmethod
    def as_often_as_not(cls, sigmas: Array, kinds: int = 1) -> SigmaPrior:
        """None, or one of the others, (m, ...), equally likely; of so many independent kinds none in one case of two.

        Source: Jeffreys, Theory of Probability, 1961, ch. 5; Scott & Berger 2010 (many kinds).
        """
        none = 0.5 ** (1 / kinds)
        shares = np.append(none, np.full(len(sigmas), (1 - none) / len(sigmas)))
        return cls(np.concatenate([np.zeros_like(sigmas[:1]), sigmas]), shares)


class ExpectedSize(NamedTuple):
    """The expected sizes of a candidate.

    Attributes:
        sigma: The middle of what their sigma may be, in the unit of the candidate.
        factor: Of a standard deviation of it; 1 if it is known.
        source: Of the numbers, or `assumed`.
        is_stated: Whether the answer is that of size zero, as stated, with a covariance that covers other sizes.
            Otherwise the answer is that of the expected size, given the data.
    """

    sigma: float
    factor: float
    source: str
    is_stated: bool = False

    def prior(self, kinds: int) -> SigmaPrior:
        """The prior of their sigma: none, or one of five; of so many kinds none in one case of two."""
        return SigmaPrior.as_often_as_not(self.sigma * self.factor**_NODES, kinds)


@dataclass(frozen=True, eq=False)
class RandomEffect:
    """A kind of error that stops share.

    Attributes:
        expected: Prior of its sigmas.
        report: Its words in the report, `error of robot eye that is ...`; `{...}` are filled in from `figures`.
        by_joints: The errors of an arm at any joints; None if the arm lacks what they need.
        by_poses: Those of arms that record poses alone: by recorded poses, (m,), at some poses, (n,).
        by_times: Those of arms that move: by the instants of stops, (n,) [s], NaN where the arm stood.
        is_of_poses_alone: Whether arms that record their joints have it as errors of joints and links instead.
        is_by_coordinate: Whether each error is of one coordinate of the flange, whose sigmas are then those of errors.
        likely: Words of an effect that the evidence shows, by sigmas (shift [m], turn [rad]) of each robot.
        is_certain: Whether every arm that has it modelled has some of it, however little: none is built as stated.
        is_mapped: Whether the error map and `verify` take it from joint to joint.
        replaced_by: Names of robot parameters that, if they are estimated, replace it.
        figures: Numbers that `calibration.json` holds beside its sigmas.
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
    """Parameters of a lens whose errors have one size.

    Attributes:
        where: Their places among a lens's parameters.
        usual: Sigmas of their errors in a usual calibration, (k,).
        source: Of these, or `assumed`.
        words: By how much a stated lens is off an estimated one whose parameters have sigmas, (4 + n,).
        is_each_alone: Whether one may be far off and the others not; else their errors have one size.
    """

    where: slice
    usual: Callable[[Camera], Array]
    source: str
    words: Callable[[Camera, Camera, Array], str]
    is_each_alone: bool = False


@dataclass(frozen=True, eq=False)
class TargetParameter:
    """A shape that differs from the stated one.

    Attributes:
        unit_shifts: How points of a target, (p, 3) [m], move by one sigma of each coefficient, (p, 3, k) [m].
        source: Of the sigmas, or `assumed`.
        words: Of the shape of a target's points, (p, 3), by its coefficients, (k,); None if it is too small to report.
    """

    unit_shifts: Callable[[Array], Array]
    source: str
    words: Callable[[str, Array, Array], Words | None]


@dataclass(frozen=True)
class SimulatedFault:
    """A fault that can be switched on.

    Attributes:
        name: Such as `joint-offsets`.
        unit: Of its size as it is written.
        scale: The unit, in SI.
        usual: Its size if none is given.
        about: What it does, in words.
        is_sudden: Whether it occurs at a moment, after a number of moves of the arm.
        draw: Values of a robot's parameter of this size, of so many joints, if it is one.
        draw_lens: The true lens by the stated one, if it is a lens's.
        move_mount: By which tangent of the flange, (6,), a mount moves, if it is a mount's. Arguments: its size, and
            the direction of gravity in the flange, (3,).
    """

    name: str
    unit: str
    scale: float
    usual: float
    about: str
    is_sudden: bool = False
    draw: Callable[[float, int, np.random.Generator], Array] | None = None
    draw_lens: Callable[[float, Camera], Camera] | None = None
    move_mount: Callable[[float, Array], Array] | None = None


Face = Literal["statement", "size", "unknown", "random", "candidate", "map", "words", "fault"]
"""How cell.yaml states it; expected size with its source; as unknown; as random effect; as candidate of a score test;
in the error map and `verify`; words; fault of the simulator."""


NOT_OF_LENSES: dict[Face, str] = {
    "random": "a lens is the same in all views",
    "candidate": "a stated lens is estimated from the start, with the error of a usual calibration",
    "map": "the answer's covariance contains it",
}
"""Faces that parameters of lenses have not."""


@dataclass(frozen=True, eq=False)
class Effect:
    """One effect.

    Attributes:
        name: Such as `joint_offsets`; of a robot's parameter the key in cell.yaml.
        parameter: As parameters of a robot that is recorded by joints, which cell.yaml states and the solver estimates.
        lens: As parameters of a lens, likewise.
        target: As a shape of a target, whose coefficients are estimated under their prior.
        random: As an error that a robot's stops share, whose sigmas are estimated.
        expected: As candidates whose sizes are expected beforehand, and left uncertain in every answer.
        candidates: As errors that score tests look for.
        words: Of a candidate that was found.
        fault: In a simulated cell that runs.
        is_by_place: Whether smooth fields of errors by place contain its candidates.
        is_in_time: Whether its candidates change a frame in time, which is judged beside what differs by place.
        elsewhere: Faces that another module has, with its name.
        absent: Why an effect lacks a face.
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
        """The faces it has."""
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
    """A value with its sigma to two digits."""
    digits = int(np.clip(1 - np.floor(np.log10(max(sigma, 1e-9))), 0, 9))
    return f"{value:.{digits}f} ± {sigma:.{digits}f}"


def rounded_length(values: Array, covariance: Array, unit: float = 1.0) -> str:
    """Length of a vector with its sigma, both times a unit."""
    length = float(np.linalg.norm(values))
    along = values / max(length, 1e-300)
    sigma = float(np.sqrt(max(float(along @ covariance @ along), 0.0)))
    return format_with_sigma(unit * length, unit * sigma)


def clearest_joint(effect: FoundEffect, factor: float, unit: str) -> tuple[int, str]:
    """Number of the joint that a found effect is of, or that has most of it, from 1; its size times a factor."""
    sigmas = np.sqrt(np.maximum(np.diag(effect.covariance), 0.0))
    clearest = int(np.argmax(np.abs(effect.size) / np.where(sigmas > 0, sigmas, np.inf)))
    amount = format_with_sigma(factor * effect.size[clearest], factor * float(sigmas[clearest]))
    return (clearest if effect.joint is None else effect.joint) + 1, f"{amount} {unit}"


def format_tangent(size: Array, covariance: Array) -> str:
    """` by` the translation [mm] and rotation [deg] of a tangent, (6,), or of a point, (3,), with their sigmas.

    Of each what is known to be more than its sigma; nothing if neither is.
    """
    parts = (slice(0, 3), 1e3, "mm"), (slice(3, 6), float(np.degrees(1)), "deg")
    told = []
    for where, unit, name in parts:
        known = _known_part(size[where], covariance[where, where])
        if known.any():
            told.append(f"{rounded_length(known, covariance[where, where], unit)} {name}")
    return " by " + " and ".join(told) if told else ""


def _known_part(size: Array, covariance: Array) -> Array:
    """A vector without the directions that are known least, as many as make it shorter than its sigma; else zero."""
    axes = scaled_spectrum(covariance, 0.0).vectors
    for count in range(len(size), 0, -1):
        part = axes[:, :count] @ (axes[:, :count].T @ size)
        if (part @ part) ** 2 > part @ covariance @ part:
            return np.asarray(part)
    return np.zeros_like(size)
