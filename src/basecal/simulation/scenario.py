"""Scenarios of simulations, and simulated cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Literal, get_args

from basecal.cell.cell import Cell, Status
from basecal.cell.recording import Recording
from basecal.cell.target import Target
from basecal.cell.targets.registry import TargetKindName
from basecal.errors import InputError, check_choice, check_integer
from basecal.estimation.problem.robot_parameters import Kinematics
from basecal.geometry import SE3, Camera
from basecal.geometry.lenses.registry import lens_models

ObservedKind = Literal[TargetKindName, "pose", "points3d"]
Arms = Literal["both", "eye_still", "hand_still", "halves", "stations"]
LayoutName = Literal["dual", "eye_in_hand", "eye_to_hand", "two_cameras", "two_world_cameras", "chain", "ring", "grid"]

_CHOICES = {
    "target": get_args(ObservedKind),
    "arms": get_args(Arms),
    "layout": get_args(LayoutName),
    "lens": lens_models(),
    **dict.fromkeys(("base", "camera_mount", "target_mount", "intrinsics"), get_args(Status)),
    **dict.fromkeys(("joint_offsets", "link_parameters", "deflection"), get_args(Status)),
}


@dataclass(frozen=True)
class Scenario:
    """Parameters of a cell and its recording; a seed selects one realisation.

    Sigmas in pairs are (translation [m], rotation [rad]), per axis.

    Attributes:
        samples: Number of samples.
        target: Observations: pixels of a board, of rigid points or of one LED, or the target's pose, or 3-D points.
        arms: Moving robots. The eye carries the camera, the hand the target (with two cameras: the first and the second
            robot). `halves`: first the hand is at rest, then the eye. `stations`: the eye stops at a few places, the
            hand moves at each.
        layout: Layout of the cell. `dual` has robots eye and hand. `eye_in_hand` and `eye_to_hand` have a robot arm,
            and the target or the camera on the world. `two_cameras` has robots left and right, and the board on the
            world. In `two_world_cameras`, the robot arm holds the board. `chain` is a ring of robots r1, r2, ...; each
            observes the target of the next, one pair after another. In a `ring`, each also observes the second next,
            which closes loops. `grid` has robots in rows; each observes the robots to its right and below. Samples of a
            `ring` or a `grid` contain only the robots of a pair.
        robots: Number of robots in a `chain`, `ring` or `grid`.
        stations: Number of stations.
        base: Status of the bases in the cell.
        camera_mount: Status of the cameras' mounts in the cell.
        target_mount: Status of the targets' mounts in the cell.
        intrinsics: Status of the lenses in the cell.
        base_prior: Sigmas of a base's prior.
        mount_prior: Sigmas of a mount's prior.
        intrinsics_prior: Sigmas of focal lengths [px], centre [px] and distortion coefficients of a lens's prior.
        lens: Lens model of the cameras if `camera` is None.
        camera: True lens of every camera; None to draw it.
        board: Shape of the target; None to draw it. With `pose`, it determines which poses are in view.
        pixel_px: True sigma of a pixel coordinate [px].
        correlated_px: True sigma of an error that all points of a view share, per coordinate [px].
        state_pixel_noise: Whether the cell states `pixel_px` and `correlated_px`.
        robot_noise: True sigmas of a recorded pose in flange axes, drawn once per robot and stop.
        state_robot_noise: Whether the cell states `robot_noise`.
        pose_noise: True sigmas of an observed pose in the target's axes.
        point_m: True sigma of a coordinate of an observed 3-D point [m].
        state_observation_noise: Whether the recording states the sigmas of poses and 3-D points.
        spread_rad: Largest rotation of flanges from their home, uniform in the ball of rotation vectors.
        position_m: Largest translation of flanges in addition to the rotation about the target, uniform in a ball.
        distance_m: Smallest and largest distance of target and camera at the home poses.
        partial: Whether views of a part of the target, with at least 8 points, are kept.
        joints: Whether robots are arms with six axes that record joints; only for layouts with one group of views.
        joint_offset_rad: Sigma of each joint's true offset [rad].
        link_error: True sigmas of the errors of each origin and the tip of an arm.
        joint_offsets: Status of the joint offsets in the cell; a prior has the true sigma.
        link_parameters: Status of the links in the cell; a prior has the true sigmas.
        compliance: Sigma of each joint's true compliance [rad/Nm].
        deflection: Status of the compliances in the cell; a prior has the true sigma.
    """

    samples: int = 30
    target: ObservedKind = "charuco"
    arms: Arms = "both"
    layout: LayoutName = "dual"
    robots: int = 3
    stations: int = 5
    base: Status = "free"
    camera_mount: Status = "free"
    target_mount: Status = "free"
    intrinsics: Status = "fixed"
    base_prior: tuple[float, float] = (0.01, 0.02)
    mount_prior: tuple[float, float] = (0.005, 0.05)
    intrinsics_prior: tuple[float, float, float] = (5.0, 5.0, 0.01)
    lens: str = "pinhole"
    camera: Camera | None = None
    board: Target | None = None
    pixel_px: float = 0.2
    correlated_px: float = 0.0
    state_pixel_noise: bool = True
    robot_noise: tuple[float, float] = (0.0, 0.0)
    state_robot_noise: bool = True
    pose_noise: tuple[float, float] = (1e-3, 3e-3)
    point_m: float = 1e-3
    state_observation_noise: bool = True
    spread_rad: float = 0.6
    position_m: float = 0.12
    distance_m: tuple[float, float] = (0.5, 0.9)
    partial: bool = False
    joints: bool = False
    joint_offset_rad: float = 0.0
    link_error: tuple[float, float] = (0.0, 0.0)
    joint_offsets: Status = "fixed"
    link_parameters: Status = "fixed"
    compliance: float = 0.0
    deflection: Status = "fixed"

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            check_choice(name, getattr(self, name), choices)
        for name, least in (("samples", 1), ("stations", 1), ("robots", 2)):
            check_integer(name, getattr(self, name), least)
        for name in ("robot_noise", "pose_noise", "link_error", "distance_m"):
            pair = getattr(self, name)
            if not isinstance(pair, tuple | list) or len(pair) != 2:
                raise InputError(f"{name} is {pair!r}, expected two numbers")
        if not 0 < self.distance_m[0] <= self.distance_m[1] < inf:
            raise InputError(f"distance_m is {self.distance_m}, expected the least and then the greatest distance > 0")
        sigmas = (self.pixel_px, self.correlated_px, self.point_m, *self.robot_noise, *self.pose_noise)
        of_arms = (self.joint_offset_rad, *self.link_error, self.compliance)
        if not all(sigma >= 0 for sigma in (*sigmas, *of_arms, self.spread_rad, self.position_m)):
            raise InputError("sigmas and spreads of a scenario must be numbers >= 0")


@dataclass(frozen=True, eq=False)
class SimulatedCell:
    """A cell, its recording, and the truth.

    Attributes:
        cell: The cell that a solver receives.
        recording: The recording with noise.
        truth: True value of every transform of `cell.transforms`, by name.
        cameras: True lenses, by name.
        true_base_from_flange: True poses of the flange by robot, (samples,). They are `recorded @ SE3.exp(e)` with one
            error `e` per robot and stop.
        robots: True kinematics of robots with joints.
    """

    cell: Cell
    recording: Recording
    truth: Mapping[str, SE3]
    cameras: Mapping[str, Camera]
    true_base_from_flange: Mapping[str, SE3]
    robots: Mapping[str, Kinematics] = field(default_factory=dict)
