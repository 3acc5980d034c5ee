"""The cells, and the data that all solvers are given: the pixels, and poses of the board by `solvePnP` on them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import cv2
import numpy as np

from basecal.cell.recording import Observation, PixelObservation
from basecal.cell.target import Target
from basecal.geometry import SE3, Array, Camera
from basecal.geometry.se3_jacobians import right_jacobian
from basecal.simulation import Scenario, SimulatedCell, simulate

DesignName = Literal["halves", "both", "hand-eye"]
SAMPLES = (15, 30, 100)
PIXELS_PX = (0.2, 0.5)
ROBOTS = ((0.0, 0.0), (1e-4, 1e-4), (3e-4, 5e-4))


class Design(NamedTuple):
    """A row of a table: how the arms move, how many samples, and true sigmas [px], ([m], [rad])."""

    name: DesignName
    samples: int
    pixel_px: float
    robot: tuple[float, float]

    def scenario(self) -> Scenario:
        """A 6 x 6 board of 30 mm; nothing is known but its shape and the lens."""
        one_arm = self.name == "hand-eye"
        return Scenario(
            samples=self.samples,
            layout="eye_in_hand" if one_arm else "dual",
            arms="halves" if self.name == "halves" else "both",
            pixel_px=self.pixel_px,
            robot_noise=self.robot,
        )


def designs(name: DesignName) -> list[Design]:
    """Every row of a table; only the design `halves`, which OpenCV can solve, has the worse pixels too."""
    pixels = PIXELS_PX if name == "halves" else PIXELS_PX[:1]
    return [Design(name, n, px, robot) for n in SAMPLES for px in pixels for robot in ROBOTS]


@dataclass(frozen=True, eq=False)
class Task:
    """One simulated cell.

    Attributes:
        made: The cell, its recording and the truth.
        asked: Name of the transform whose error is counted.
        eye_base_from_eye_flange: (n,) as recorded.
        hand_base_from_hand_flange: (n,) as recorded; None if the board is fixed in the world.
        camera_from_target: (n,) by `solvePnP`.
        sigma: (n, 6) of these poses, in the target's axes [m, rad], for pixels of the true sigma.
        pnp_s: Time to compute the poses [s].
    """

    made: SimulatedCell
    asked: str
    eye_base_from_eye_flange: SE3
    hand_base_from_hand_flange: SE3 | None
    camera_from_target: SE3
    sigma: Array
    pnp_s: float

    @property
    def truth(self) -> tuple[SE3, ...]:
        """True values of all unknowns, the requested one first."""
        cell = self.made.cell
        names = dict.fromkeys((self.asked, cell.mount_name("wrist"), cell.mount_name("board")))
        return tuple(self.made.truth[name] for name in names)


def make_task(design: Design, seed: int) -> Task:
    """Simulate a cell of the design, and solve for the poses of the board.

    A seed has the same bases, mounts and lens in every row.
    """
    made = simulate(design.scenario(), seed)
    cell = made.cell
    ((_, camera),) = made.cameras.items()
    target = cell.targets["board"].target
    assert target is not None
    views = [_view(target, sample.observations) for sample in made.recording.samples]
    began = time.perf_counter()
    poses = [board_pose(camera, *view) for view in views]
    took = time.perf_counter() - began
    one_arm = design.name == "hand-eye"
    sigma = np.stack([_sigma(camera, view[0], *pose) for view, pose in zip(views, poses, strict=True)])
    return Task(
        made,
        asked=cell.mount_name("wrist") if one_arm else "eye_base_from_hand_base",
        eye_base_from_eye_flange=_recorded(made, cell.reference),
        hand_base_from_hand_flange=None if one_arm else _recorded(made, "hand"),
        camera_from_target=SE3.stack([SE3.from_rotvec(*pose) for pose in poses]),
        sigma=design.pixel_px * sigma,
        pnp_s=took,
    )


def _view(target: Target, observations: Sequence[Observation]) -> tuple[Array, Array]:
    """Points of the board, (n, 3) [m], and their pixels, (n, 2)."""
    (observation,) = observations
    assert isinstance(observation, PixelObservation)
    return target.points[target.rows(observation.ids)], observation.pixels


def _recorded(made: SimulatedCell, robot: str) -> SE3:
    poses = [sample.robots[robot].base_from_flange for sample in made.recording.samples]
    return SE3.stack([pose for pose in poses if pose is not None])


def _lens(camera: Camera) -> tuple[Array, Array]:
    (fx, fy), (cx, cy) = camera.focal, camera.center
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), camera.distortion


def board_pose(camera: Camera, points_in_target: Array, pixels: Array) -> tuple[Array, Array]:
    """Rotation vector and translation of a board: both poses of IPPE are refined, and the better one is kept."""
    lens = _lens(camera)
    _, turns, places, _ = cv2.solvePnPGeneric(points_in_target, pixels, *lens, flags=cv2.SOLVEPNP_IPPE)
    best: tuple[float, Array, Array] | None = None
    for turn, place in zip(turns, places, strict=True):
        turn, place = cv2.solvePnPRefineLM(points_in_target, pixels, *lens, turn.copy(), place.copy())
        off = cv2.projectPoints(points_in_target, turn, place, *lens)[0].reshape(-1, 2) - pixels
        cost = float(np.sum(off**2))
        if best is None or cost < best[0]:
            best = cost, np.array(turn, dtype=float).ravel(), np.array(place, dtype=float).ravel()
    assert best is not None
    return best[1], best[2]


def _sigma(camera: Camera, points_in_target: Array, turn: Array, place: Array) -> Array:
    """Sigmas of a pose in the target's axes, (6,) [m, rad], for pixels of sigma 1: inv(J' J) of `projectPoints`."""
    jacobian = cv2.projectPoints(points_in_target, turn, place, *_lens(camera))[1][:, :6]
    covariance = np.linalg.inv(jacobian.T @ jacobian)[np.ix_([3, 4, 5, 0, 1, 2], [3, 4, 5, 0, 1, 2])]
    to_tangent = np.zeros((6, 6))
    to_tangent[:3, :3] = SE3.from_rotvec(turn, place).rotation.T
    to_tangent[3:, 3:] = right_jacobian(np.concatenate([np.zeros(3), turn]))[3:, 3:]
    sigma: Array = np.sqrt(np.diagonal(to_tangent @ covariance @ to_tangent.T))
    return sigma
