"""OpenCV: each view's pose by `solvePnP`, then `calibrateRobotWorldHandEye`; without a covariance."""

from __future__ import annotations

import numpy as np

from basecal.geometry import SE3, Array
from basecal.studies.cells import Settings
from basecal.studies.draws import Draws
from basecal.studies.solvers.solver import Answers, Solver
from basecal.vision.robot_world import RobotWorld, camera_from_target, robot_world


def refusal_reason(settings: Settings) -> str | None:
    """The reason why the solver does not support settings; None if it does."""
    has_one_robot = settings["layout"] in ("eye_in_hand", "eye_to_hand")
    if not has_one_robot and not (settings["layout"] == "dual" and settings["camera_mount"] == "fixed"):
        return "opencv has two unknowns: layout eye_in_hand or eye_to_hand, or dual with camera_mount fixed"
    if settings["intrinsics"] != "fixed":
        return "opencv takes the lens as known: intrinsics fixed"
    return None


def solve(draws: Draws) -> Answers:
    """Solve all trials, one after another."""
    found = [_solve_trial(draws, pixels) for pixels in draws.measurement().pixels]
    solved = np.array([each is not None for each in found])
    transforms = SE3.stack([SE3.identity() if each is None else each for each in found])
    return Answers(transforms, None, solved, "" if solved.all() else "OpenCV found nothing")


def _solve_trial(draws: Draws, pixels: Array) -> SE3 | None:
    """The evaluated transform from the pixels of a trial, (n, p, 2); None if OpenCV finds no solution."""
    group, measurement = draws.problem.groups[0], draws.measurement()
    lens, points = draws.simulated.cameras[group.camera], measurement.points_in_target
    views = [camera_from_target(lens, points, *view) for view in zip(pixels, measurement.seen, strict=True)]
    kept = [k for k, view in enumerate(views) if view is not None]
    if not kept:
        return None
    seen = SE3.stack([view for view in views if view is not None])
    eye, hand = (end.base_from_flange[kept] for end in group.ends)
    if group.hand.robot is None:
        return _evaluated_transform(draws, robot_world(seen, eye.inverse()), True)
    if group.eye.robot is None:
        return _evaluated_transform(draws, robot_world(seen, hand), True)
    known = draws.simulated.truth[group.eye.mount]
    return _evaluated_transform(draws, robot_world(eye @ known @ seen, hand), False)


def _evaluated_transform(draws: Draws, solution: RobotWorld | None, is_camera_mount: bool) -> SE3 | None:
    """Select the evaluated transform of the two unknowns; the first is the camera's inverse mount, or the base."""
    group = draws.problem.groups[0]
    if solution is None:
        return None
    if draws.transform == group.hand.mount:
        return solution.last
    return solution.first.inverse() if is_camera_mount else solution.first


SOLVER = Solver(solve, refusal_reason)
