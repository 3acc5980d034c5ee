"""An effect as errors that a robot's stops share, whose sigmas are estimated with all others.

It is a model of its own, which counts by its evidence, beside the error of each stop alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from basecal.effects.faces.found_effect import Words
from basecal.effects.faces.robot_parameter import Posture
from basecal.effects.faces.shared_errors import SharedErrors, SharedPrior
from basecal.geometry import SE3, Array


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
