"""How far a base is off that takes up errors of an arm's poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from basecal.cell import Recording, RobotState
from basecal.estimation.noise.joint_estimate import estimate_jointly, integrate_sigmas
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import State
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

NAME = "eye_base_from_hand_base"


def absorbed(samples: int, seed: int, wrong: Callable[[SE3], SE3]) -> tuple[list[str], float, float]:
    """What the hand's stops share if its recorded poses are wrong, and the squared distance of the base from the truth.

    Args:
        samples: How many are simulated.
        seed: Of the simulation.
        wrong: The recorded pose by the true one.

    Returns:
        Names of the likeliest random effects, the distance in the integrated covariance, and that without them.
    """
    scenario = Scenario(samples=samples, position_m=0.15, state_robot_noise=False, robot_noise=(3e-5, 5e-5))
    made = simulate(scenario, seed)
    recorded = [
        replace(s, robots={**s.robots, "hand": RobotState(wrong(s.robots["hand"].base_from_flange))})
        for s in made.recording.samples
    ]
    problem, _ = build_problem(made.cell, Recording(tuple(recorded)))
    used, end, noise = estimate_jointly(problem, State(made.truth, made.cameras, np.zeros((0, 6))), 100)
    found = integrate_sigmas(used, end.state, noise)
    base, error = used.columns[NAME], (end.state.transforms[NAME].inverse() @ made.truth[NAME]).log()
    integrated, alone = (of[base, base] for of in (found.covariance, np.linalg.inv(end.normal.hessian)))
    return list(found.common), *(float(error @ np.linalg.solve(of, error)) for of in (integrated, alone))
