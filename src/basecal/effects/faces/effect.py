"""An effect: one thing of a cell that may differ from what is stated, with all that the program knows of it.

Its faces are optional and typed. Unknown, random effect and candidate share the derivative, not the inference. An
effect that is estimated as an unknown of a robot is no random effect and no candidate of that robot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from basecal.effects.faces.candidates import Candidates
from basecal.effects.faces.expected_size import ExpectedSize
from basecal.effects.faces.found_effect import FoundEffect, Words
from basecal.effects.faces.lens_parameter import LensParameter
from basecal.effects.faces.random_effect import RandomEffect
from basecal.effects.faces.robot_parameter import RobotParameter
from basecal.effects.faces.simulated_fault import SimulatedFault
from basecal.effects.faces.target_parameter import TargetParameter
from basecal.effects.faces.views import Views

Face = Literal["statement", "size", "unknown", "random", "candidate", "map", "words", "fault"]
"""How cell.yaml states it; expected size with its source; as unknown; as random effect; as candidate of a score test;
in the error map and `verify`; words; fault of the simulator."""


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
