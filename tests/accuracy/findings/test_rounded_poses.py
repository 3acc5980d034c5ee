"""`rounded-poses`."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.findings.rounded_poses import rounded_poses
from basecal.cell import Recording, RobotState
from basecal.estimation.noise.robot_noise import with_robot_noise
from basecal.estimation.problem.build import build_problem
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def found_in(read, noise=(3e-4, 3e-4)):
    """Findings where the hand's poses are read otherwise, and the noise in use is such."""
    made = simulate(Scenario(samples=12, target="pose"), 0)
    samples = []
    for sample in made.recording.samples:
        pose = read(sample.robots["hand"].base_from_flange)
        samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(pose)}))
    problem, _ = build_problem(made.cell, Recording(tuple(samples)))
    used = with_robot_noise(problem, dict.fromkeys(("eye", "hand"), np.repeat(noise, 3)))
    return rounded_poses(SimpleNamespace(solution=SimpleNamespace(problem=used)))


def in_steps(step):
    return lambda pose: SE3(pose.rotation, step * np.round(pose.translation / step))


def test_all_digits_are_silent():
    """Poses as they are give nothing."""
    assert found_in(lambda pose: pose) == []


@pytest.mark.parametrize(
    ("step", "noise_m", "severity"),
    [
        (1e-3, 3e-4, "warning"),
        (1e-3, 5e-5, "info"),
        (1e-3, 1e-3, "info"),
        (1e-4, 3e-4, "info"),
        (1e-4, 3e-5, "warning"),
    ],
)
def test_translations(step, noise_m, severity):
    """Multiples of a step are told; a warning where rounding makes a good part of the noise in use."""
    (finding,) = found_in(in_steps(step), (noise_m, 3e-4))
    assert (finding.code, finding.about, finding.severity) == ("rounded-poses", ("hand",), severity)
    assert f"multiples of {1e3 * step:g} mm" in finding.message
    assert f"{1e3 * step / 12**0.5:.2g} mm" in finding.message


@pytest.mark.parametrize("step_deg", [0.1, 0.01])
def test_angles(step_deg):
    """Roll, pitch and yaw in few digits of a degree are told."""

    def read(pose):
        """The pose in round angles."""
        return SE3.from_rpy(np.radians(step_deg * np.round(np.degrees(pose.rpy) / step_deg)), pose.translation)

    (finding,) = found_in(read, (3e-4, 1e-4))
    assert f"angles of hand are all multiples of {step_deg:g} deg" in finding.message


def test_few_places_say_nothing():
    """An arm that stands at one round place is no arm whose poses are rounded."""
    assert found_in(lambda pose: SE3(np.eye(3), np.array([0.4, 0.1, 0.3]))) == []
