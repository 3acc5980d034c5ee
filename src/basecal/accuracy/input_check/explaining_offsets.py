"""Whether joint offsets of degrees explain how targets move, where the robots as stated do not."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.input_check.unexplained_motion import is_hopeless, unexplained_motion
from basecal.cell import Finding
from basecal.effects import joint_offsets
from basecal.estimation.least_squares.bundle_adjustment import bundle_adjust
from basecal.estimation.noise.estimate import degrees_of_freedom
from basecal.estimation.problem.build import free_ends, recorded_by_joints, recorded_joints
from basecal.estimation.problem.problem import Problem, State
from basecal.estimation.problem.robot_parameters import robot_model
from basecal.estimation.settings import Settings


def explaining_offsets(problem: Problem, state: State, settings: Settings) -> list[Finding]:
    """An error that names the offsets of robots that are given by joints; nothing if these explain no more.

    Args:
        problem: What was recorded, with robots whose kinematics are not estimated.
        state: Where its solution ended, which explains nothing.
        settings: How to solve.
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
    what = f"Joints of {robots} are off, most of them {' and '.join(each)}."
    before, after = unexplained_motion(problem, state), unexplained_motion(freed, end)
    why = f"The robots as stated leave {100 * before:.0f} % of the target's motion, with these {100 * after:.0f} %."
    entry = joint_offsets.entry(np.concatenate(list(found.values())))
    do = f"Write {entry} at {robots} in cell.yaml, or check the zeros of their joints."
    return [Finding("robot-model", "error", tuple(found), what, (do,), why)]
