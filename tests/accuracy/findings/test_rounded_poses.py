"""Tests of the finding `rounded-poses`."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.ends import end, problem_of, views

from basecal.accuracy.findings.rounded_poses import _multiples, _quaternion_roundings, _Rounding, _step, rounded_poses
from basecal.cell import Recording, RobotState
from basecal.estimation.noise.robot_noise import with_robot_noise
from basecal.estimation.problem.build import build_problem
from basecal.estimation.problem.problem import Stops
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def find_rounding(read, noise=(3e-4, 3e-4)):
    """Findings if the hand's poses are changed by `read`, with the given noise in use."""
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


def test_unrounded_poses_give_no_finding():
    """Poses with all digits give no finding."""
    assert find_rounding(lambda pose: pose) == []


@pytest.mark.parametrize(
    ("step", "noise_m", "severity"),
    [
        (1e-2, 3e-3, "warning"),
        (1e-3, 3e-4, "warning"),
        (1e-3, 5e-5, "info"),
        (1e-3, 1e-3, "info"),
        (1e-4, 3e-4, "info"),
        (1e-4, 3e-5, "warning"),
    ],
)
def test_rounded_translations_are_reported(step, noise_m, severity):
    """Translations in multiples of a step are reported, as a warning if rounding is a good part of the noise in use."""
    (finding,) = find_rounding(in_steps(step), (noise_m, 3e-4))
    assert (finding.code, finding.about, finding.severity) == ("rounded-poses", ("hand",), severity)
    assert f"multiples of {1e3 * step:g} mm" in finding.message
    assert f"{1e3 * step / 12**0.5:.2g} mm" in finding.message
    assert ("the robot was sent to such values" in finding.message) == (noise_m < 0.5 * step / 12**0.5)


@pytest.mark.parametrize("step_deg", [0.1, 0.01])
def test_rounded_euler_angles_are_reported(step_deg):
    """Roll, pitch and yaw with few digits of a degree are reported."""

    def read(pose):
        """The pose with rounded Euler angles."""
        return SE3.from_rpy(np.radians(step_deg * np.round(np.degrees(pose.rpy) / step_deg)), pose.translation)

    (finding,) = find_rounding(read, (3e-4, 1e-4))
    assert f"Angles of hand are all multiples of {step_deg:g} deg" in finding.message


def test_single_round_pose_gives_no_finding():
    """An arm at rest at one round pose is not reported."""
    assert find_rounding(lambda pose: SE3(np.eye(3), np.array([0.4, 0.1, 0.3]))) == []


@pytest.mark.parametrize("step_rad", [1e-2, 1e-3, 1e-4])
def test_rounded_rotation_vectors_are_reported(step_rad):
    """Rotation vectors with few digits of a radian are reported, in milliradians."""

    def read(pose):
        """The pose with a rounded rotation vector."""
        return SE3.from_rotvec(step_rad * np.round(pose.rotvec / step_rad), pose.translation)

    (finding,) = find_rounding(read, (3e-4, 1e-9))
    assert f"Angles of hand are all multiples of {1e3 * step_rad:g} mrad" in finding.message
    assert f"{1e3 * step_rad / 12**0.5:.2g} mrad" in finding.message
    assert finding.severity == "info"


def test_translations_and_angles_share_one_finding():
    """Translations and angles share one finding; the worst severity counts, and both are listed."""

    def read(pose):
        """The pose in whole millimetres and tenths of a degree."""
        turned = SE3.from_rpy(np.radians(0.1 * np.round(np.degrees(pose.rpy) / 0.1)), pose.translation)
        return in_steps(1e-3)(turned)

    (finding,) = find_rounding(read, (3e-4, 1e-9))
    assert (
        "Translations of hand are all multiples of 1 mm. Angles of hand are all multiples of 0.1 deg."
        in finding.message
    )
    assert (
        "errors of 0.29 mm and 0.5 mrad (1 sigma per axis); the noise in use is 0.3 mm and 1e-06 mrad."
        in finding.message
    )
    assert finding.severity == "warning"


@pytest.mark.parametrize("step", [1e-2, 1e-3, 1e-4])
def test_rounded_quaternions_are_reported(step):
    """Quaternion components with few digits are reported, though normalised; each rotates by twice its error."""

    def read(pose):
        """The pose with rounded quaternion components."""
        components = step * np.round(pose.quaternion / step)
        return SE3.from_quaternion(components / np.linalg.norm(components, axis=-1, keepdims=True), pose.translation)

    (finding,) = find_rounding(read, (3e-4, 2 * step / 12**0.5))
    assert f"Quaternions of hand are all multiples of {step:g} before normalisation" in finding.message
    assert f"errors of {2e3 * step / 12**0.5:.2g} mrad" in finding.message
    assert finding.severity == "warning"


def test_quaternions_of_quarter_turns_give_no_finding():
    """Quaternions of quarter turns have round components anyway and give no finding."""
    turns = iter(np.resize([0.0, 0.5, 1.0], 12) * np.pi)
    assert find_rounding(lambda pose: SE3.from_rpy([next(turns), 0.0, 0.0], pose.translation + 1e-5 * np.pi)) == []


@pytest.mark.parametrize("noisy", [True, False])
def test_rounded_joints_are_reported(noisy):
    """Joints in tenths of a degree are reported; if the robot is assumed exact, as an info."""
    made = simulate(Scenario(samples=8, joints=True), 0)
    samples = []
    for sample in made.recording.samples:
        joints = np.radians(0.1 * np.round(np.degrees(sample.robots["hand"].joints_rad) / 0.1))
        samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(joints_rad=joints)}))
    problem, _ = build_problem(made.cell, Recording(tuple(samples)))
    if noisy:
        problem = with_robot_noise(problem, dict.fromkeys(("eye", "hand"), np.full(6, 5e-4)))
    (finding,) = rounded_poses(SimpleNamespace(solution=SimpleNamespace(problem=problem)))
    assert "Joints of hand are all multiples of 0.1 deg" in finding.message
    assert finding.severity == ("warning" if noisy else "info")
    assert f"the noise in use is {0.5 if noisy else 0:.2g} mrad." in finding.message


@pytest.mark.parametrize(("count", "is_reported"), [(9, False), (10, True)])
def test_ten_different_numbers_are_enough(count, is_reported):
    """Ten different numbers are enough; fewer may all be round by chance."""
    numbers = iter(np.resize(1e-3 * np.arange(1, count + 1), 36))

    def read(pose):
        """The pose at one of a few places in whole millimetres."""
        return SE3(pose.rotation, np.array([next(numbers) for _ in range(3)]))

    assert bool(find_rounding(read)) == is_reported


def test_rounding_is_compared_with_own_noise():
    """The rounding of each arm is compared with its own noise."""
    made = simulate(Scenario(samples=12, target="pose"), 0)
    samples = []
    for sample in made.recording.samples:
        robots = {name: RobotState(in_steps(1e-3)(of.base_from_flange)) for name, of in sample.robots.items()}
        samples.append(replace(sample, robots=robots))
    problem, _ = build_problem(made.cell, Recording(tuple(samples)))
    used = with_robot_noise(problem, {"eye": np.full(6, 3e-4), "hand": np.full(6, 4e-3)})
    found = rounded_poses(SimpleNamespace(solution=SimpleNamespace(problem=used)))
    assert [(f.about, f.severity) for f in found] == [(("eye",), "warning"), (("hand",), "info")]
    assert "the noise in use is 0.3 mm." in found[0].message
    assert "the noise in use is 4 mm." in found[1].message


@pytest.mark.parametrize(("values", "step"), [
    (np.arange(10.0), 1.0),
    (np.arange(-3.0, 7.0), 1.0),
    (np.arange(9.0), None),  # few numbers may all be round by chance
    (np.repeat(np.arange(9.0), 3), None),
    (0.3 * np.arange(10), 0.1),
    (0.07 * np.arange(10), 0.01),
    (0.007 * np.arange(10), None),
    (np.arange(10) + 9e-4, 1.0),  # rounding of conversions
    (np.arange(10) - 9e-4, 1.0),
    (np.arange(10) + 1.1e-3, None),
    (np.append(np.arange(10.0), 0.1), 0.1),  # a single other value is enough
])  # fmt: skip
def test_step_is_largest_common_divisor(values, step):
    """The step is the largest one of which all values are multiples, to a thousandth.

    At least ten different numbers are needed.
    """
    assert _step(values.reshape(-1, 1) / 100) == (None if step is None else pytest.approx(step / 100))


@pytest.mark.parametrize(("step_deg", "step_text"), [(1.0, "1 deg"), (0.1, "0.1 deg"), (0.01, "0.01 deg")])
def test_angle_steps_are_display_digits(step_deg, step_text):
    """Steps of angles are a degree, its tenths and hundredths, if all joints differ."""
    joints = np.radians(step_deg * np.arange(1, 37).reshape(6, 6))
    stops = Stops(np.array([[1, 1, 1, 2, 9, 9], [9, 9, 9, 9, 9, 9.0]]), ("hand", "hand"))
    problem = problem_of(views(end(), end("hand", joints=joints)), stops=stops)
    (found,) = rounded_poses(SimpleNamespace(solution=SimpleNamespace(problem=problem)))
    assert f"Joints of hand are all multiples of {step_text}. Rounding" in found.message
    assert "the noise in use is 2e+03 mrad." in found.message


@pytest.mark.parametrize(("noise", "severity"), [
    (0.49, "info"), (0.51, "warning"), (1.99, "warning"), (2.01, "info"),
])  # fmt: skip
def test_rounding_of_half_to_twice_noise_is_warning(noise, severity):
    """Rounding of half to twice the noise in use is a warning.

    A step adds a uniform error of its length over sqrt(12).
    """
    rounding = _Rounding("angles", np.sqrt(12.0), "", noise)
    assert rounding.sigma == pytest.approx(1.0)
    assert rounding.severity == severity


@pytest.mark.parametrize(("least", "count"), [(-3, 0), (-4, 1)])
def test_quaternions_need_ten_different_numbers(least, count):
    """Quaternions need ten different numbers before normalisation; with nine there is no finding."""
    numbers = np.array([[k, 0, 0, 100] for k in range(least, 5) if k], dtype=float)
    quaternions = numbers / np.linalg.norm(numbers, axis=-1, keepdims=True)
    np.testing.assert_array_equal(_multiples(quaternions, 0.01), numbers)
    found = list(_quaternion_roundings(quaternions, 1e-3))
    assert [(each.step, each.step_text, each.noise) for each in found] == [
        (0.02, "0.01 before normalisation", 1e-3)
    ] * count


@pytest.mark.parametrize("norm", [99, 100, 101])
def test_quaternion_numbers_allow_norm_off_by_one_step(norm):
    """Quaternion numbers are found if the norm is off by one step, but not by two."""
    for off, is_found in ((0, True), (2, False)):
        numbers = np.array([[60.0, -20.0, 0.0, 0.0]])
        numbers[0, 3] = np.round(np.sqrt((norm + off) ** 2 - 4000))
        unit = numbers / np.linalg.norm(numbers)
        near = abs(np.round(unit.max() * 100) - numbers.max()) <= 1
        assert np.isfinite(_multiples(unit, 0.01)).all() == near
        assert near or not is_found
