"""The paper's closed form, for all trials as one batch; without a covariance."""

from __future__ import annotations

import numpy as np

from basecal.estimation.axis_shift.closed_form import base_of_station, estimate, image_gradient
from basecal.studies.cells import SHIFT_LAYOUTS, Settings
from basecal.studies.draws import Draws
from basecal.studies.solvers.solver import Answers, Solver


def refusal_reason(settings: Settings) -> str | None:
    """The reason why the solver does not support settings; None if it does."""
    if settings["layout"] not in SHIFT_LAYOUTS:
        return f"closed_form needs layout {' or '.join(SHIFT_LAYOUTS)}: an LED shifted in front of a camera at rest"
    return None


def solve(draws: Draws) -> Answers:
    """Compute the base by eqs. (7)-(10) from the LED's pixels before and after its shifts, in each trial."""
    group = draws.problem.groups[0]
    lens = draws.simulated.cameras[group.camera]
    image = draws.measurement().pixels[..., 0, :] - lens.center
    hand_base_from_led = group.hand.base_from_flange @ draws.simulated.truth[group.hand.mount]
    eye_base_from_camera = group.eye.base_from_flange[0] @ draws.simulated.truth[group.eye.mount]
    shifts = (hand_base_from_led[0].inverse() @ hand_base_from_led).translation[1:]
    gradient = image_gradient(image[..., 1:, :] - image[..., :1, :], shifts)
    found = estimate(image[..., 0, :], gradient, lens.focal)
    base = base_of_station(eye_base_from_camera, found.camera_from_led, hand_base_from_led[0])
    return Answers(base, None, np.ones(draws.count, dtype=bool))


SOLVER = Solver(solve, refusal_reason, blocks=64)
