"""Distance of a base from the truth if it absorbs errors of recorded poses."""

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


def absorb_errors(samples: int, seed: int, distort: Callable[[SE3], SE3]) -> tuple[list[str], float, float]:
    """Random effects of the hand's stops if its recorded poses are distorted, and squared distances of the base.

    Args:
        samples: Number of simulated samples.
        seed: Seed of the simulation.
        distort: Function from the true to the recorded pose.

    Returns:
        Names of the likeliest random effects, the distance from the truth in the integrated covariance, and that
        without the effects.
    """
    scenario = Scenario(samples=samples, position_m=0.15, state_robot_noise=False, robot_noise=(3e-5, 5e-5))
    simulated = simulate(scenario, seed)
    recorded = [
        replace(s, robots={**s.robots, "hand": RobotState(distort(s.robots["hand"].base_from_flange))})
        for s in simulated.recording.samples
    ]
    problem, _ = build_problem(simulated.cell, Recording(tuple(recorded)))
    model, end, noise = estimate_jointly(problem, State(simulated.truth, simulated.cameras, np.zeros((0, 6))), 100)
    integrated_noise = integrate_sigmas(model, end.state, noise)
    base, error = model.columns[NAME], (end.state.transforms[NAME].inverse() @ simulated.truth[NAME]).log()
    integrated, alone = (
        covariance[base, base] for covariance in (integrated_noise.covariance, np.linalg.inv(end.normal.hessian))
    )
    return list(integrated_noise.common), *(
        float(error @ np.linalg.solve(covariance, error)) for covariance in (integrated, alone)
    )
