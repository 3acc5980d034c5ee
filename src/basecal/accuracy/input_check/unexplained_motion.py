"""Share of the targets' motion in front of the cameras that the robot poses do not explain.

`benchmarks.mutations` judges its limits.
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.input_check.loop_fit import trimmed_rms
from basecal.accuracy.input_check.view_errors import PIXEL_SCALE, view_deviations, view_errors
from basecal.accuracy.phrases.recorded_robots import advise_check
from basecal.cell import Finding
from basecal.effects import joint_offsets
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.problem.build import free_ends, recorded_by_joints, recorded_joints
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.robot_parameters import robot_model
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.settings import Settings
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import IntArray

_AGREEING_SHARE = 0.5  # share of the views that counts, those with the smallest errors: the rest may be outliers
_LEAST_MOTION = 0.02  # [rad] or thousands of pixels: noise is a large part of any smaller motion
# Unexplained share of motion: at most 0.07 in correct real recordings (a hobby robot), at least 0.25 with mispaired
# boards.
_HOPELESS_SHARE = 0.2
_FEWEST_STOPS = 5  # views at different stops, below which residuals in pixels are not judged
_USELESS_PX = 50.0  # [px] residual of a useless fit, half of what is obvious in an image; hobby robots reach 20


def is_hopeless(problem: Problem, state: State) -> bool:
    """Whether robots and views do not match: the residuals are larger than any noise of robots or cameras."""
    return unexplained_motion(problem, state) > _HOPELESS_SHARE or _residual_px(problem, state) > _USELESS_PX


def hopeless_finding(problem: Problem, state: State) -> Finding:
    """An error that the robot poses do not explain the target's motion."""
    share, residual_px = unexplained_motion(problem, state), _residual_px(problem, state)
    rest = f"{100 * share:.0f} % of it" if share > _HOPELESS_SHARE else f"residuals of {residual_px:.0f} px"
    what = f"The robot poses do not explain the target's motion: even the best 50 % of the views leave {rest}."
    why = "None of the usual mistakes (conventions, units, orders, pairing) explains it."
    do = (
        _instants_advice(problem),
        _robots_advice(problem),
        "Check that cameras and targets are on the robots that cell.yaml states.",
    )
    return Finding("poor-fit", "error", (), what, do, why)


def _instants_advice(problem: Problem) -> str:
    """Advice on the instants of poses and images; clock offsets are searched only within one second."""
    clocks = sorted(problem.open_clocks & {*problem.robots, *(group.camera for group in problem.groups)})
    if not clocks:
        return "Check that poses and images of a sample are of one instant."
    entry = "`clock: {status: free, offset_s: ...}`"
    return f"If the clock of {' or '.join(clocks)} is off by more than 1 s, state {entry} there, to a second."


def _robots_advice(problem: Problem) -> str:
    """Advice on the recorded joints, or on the recorded poses if a robot has no joints."""
    are_joints = all(recorded_by_joints(problem, robot) for robot in problem.robots)
    return advise_check(problem.robots if are_joints else ())


def unexplained_motion(problem: Problem, state: State) -> float:
    """Residuals with the robots as recorded, over residuals with targets at rest at their median pose; 0 to 1.

    Each is the RMS over the best 50 % of the stops: of pixels, of 3-D points, or of angles and lengths over the
    distance. The ratio is 0 if hardly anything moves.
    """
    groups = [group.take(_stop_rows(group)) for group in problem.groups if len(group)]
    if not groups:
        return 0.0
    residual = trimmed_rms(np.concatenate([view_errors(problem, group, state) for group in groups]), _AGREEING_SHARE)
    motion = trimmed_rms(np.concatenate([view_deviations(group) for group in groups]), _AGREEING_SHARE)
    return float(min(residual / motion, 1.0)) if motion > _LEAST_MOTION else 0.0


def _residual_px(problem: Problem, state: State) -> float:
    """Residuals in the images, RMS over the best 50 % of the stops with robots as recorded [px]; 0 for few stops."""
    in_pixels = [group for group in problem.groups if len(group) and isinstance(group.measurement, PixelMeasurement)]
    seen = [group.take(_stop_rows(group)) for group in in_pixels]
    if sum(map(len, seen)) < _FEWEST_STOPS:
        return 0.0
    errors = np.concatenate([view_errors(problem, group, state) for group in seen])
    return trimmed_rms(errors, _AGREEING_SHARE) / PIXEL_SCALE


def _stop_rows(group: ViewGroup) -> IntArray:
    """Rows of the first view of each pair of stops: many views of one would resemble a target that hardly moves."""
    stops = np.column_stack([end.stop_number for end in group.ends])
    return np.sort(np.unique(stops, axis=0, return_index=True)[1]).astype(np.int64)


def joint_offset_findings(problem: Problem, state: State, settings: Settings) -> list[Finding]:
    """An error with the joint offsets of robots given by joints; empty if the offsets do not explain the motion.

    Args:
        problem: The recorded problem, with robots whose kinematics are not estimated.
        state: State of its solution, which does not explain the motion.
        settings: Settings of the solver.
    """
    stated = {joint_offsets.NAME: joint_offsets.Stated(status="free")}
    models = {
        robot: robot_model(robot, chain, stated, recorded_joints(problem, robot), free_ends(problem, robot))
        for robot, chain in problem.chains.items()
        if robot in problem.robots and recorded_by_joints(problem, robot)
    }
    if problem.models or not models:
        return []
    freed = problem.with_models(models)
    dof = degrees_of_freedom(freed)
    end = bundle_adjust(freed, state, dof, settings.iterations).state
    if dof <= 0 or is_hopeless(freed, end):
        return []
    found = {robot: end.kinematics(model).kind_values(joint_offsets.NAME) for robot, model in models.items()}
    robots = " and ".join(found)
    largest = {robot: int(np.argmax(np.abs(values))) for robot, values in found.items()}
    each = [f"joint {k + 1} of {robot} by {np.degrees(found[robot][k]):.1f} deg" for robot, k in largest.items()]
    what = f"Joints of {robots} are offset, most of all {' and '.join(each)}."
    before, after = unexplained_motion(problem, state), unexplained_motion(freed, end)
    why = f"The robots as stated leave {100 * before:.0f} % of the target's motion, with these {100 * after:.0f} %."
    entry = joint_offsets.entry(np.concatenate(list(found.values())))
    do = f"Write {entry} at {robots} in cell.yaml, or check the zeros of their joints."
    return [Finding("robot-model", "error", tuple(found), what, (do,), why)]
