"""Tests of simulated six-axis arms: stated and true kinematics, inverse kinematics, and scenes with joints."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.cell.cell import WORLD
from basecal.errors import InputError
from basecal.geometry import SE3
from basecal.simulation.arms import _arm, six_axis, solve_joints, with_arms
from basecal.simulation.layout import make_layout
from basecal.simulation.scenario import Scenario
from basecal.simulation.scene import draw_scene

HOME = np.array([0.3, -1.2, 1.5, -1.8, 1.4, 0.2])


def rng():
    return np.random.default_rng(3)


def test_arm_has_stated_link_lengths():
    """The two long links are 0.42 and 0.39 m, and the masses of all links add up to 18.8 kg."""
    arm = six_axis()
    elbow = arm.origins[1].translation + arm.origins[2].translation
    assert arm.n == 6
    np.testing.assert_allclose(np.linalg.norm(arm.origins[2].translation), 0.42)
    np.testing.assert_allclose(np.linalg.norm(arm.origins[3].translation[:2]), 0.39)
    np.testing.assert_allclose(elbow[1], 0.05)
    assert arm.masses is not None
    np.testing.assert_allclose(arm.masses.kg.sum(), 18.8)


def test_forward_kinematics_at_zero_joints():
    """At zero joints the flange is 0.81 m back and points along the negative y axis of the base."""
    at_zero = six_axis().forward(np.zeros(6))
    np.testing.assert_allclose(at_zero.translation, [-0.81, -0.255, 0.06], atol=1e-12)
    np.testing.assert_allclose(at_zero.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-12)


def test_inverse_kinematics_within_reach():
    """Joints are found for poses a step away. A pose two metres off has none and is reported as not reached."""
    arm, step = six_axis(), 0.2 * rng().standard_normal((5, 6))
    wanted = arm.forward(HOME + step)
    found, reached = solve_joints(arm, wanted, HOME)
    assert reached.all()
    np.testing.assert_allclose(arm.forward(found).matrix, wanted.matrix, atol=1e-8)
    far = SE3(wanted.rotation[:1], wanted.translation[:1] + np.array([2.0, 0, 0]))
    assert not solve_joints(arm, far, HOME)[1].any()


def test_inverse_kinematics_respects_joint_limits():
    """A solution beyond a joint limit is reported as not reached, even if the pose is."""
    arm = six_axis()
    high = HOME + np.array([2 * np.pi, 0, 0, 0, 0, 0])
    assert solve_joints(arm, arm.forward(HOME[None]), HOME)[1].all()
    assert not solve_joints(arm, arm.forward(high[None]), high)[1].any()


@pytest.mark.parametrize("layout", ["dual", "eye_in_hand", "eye_to_hand", "two_cameras"])
def test_home_views_are_unchanged_with_arms(layout):
    """Bases and objects on the world move together, so that the views at home are unchanged.

    The first base is the world.
    """
    scenario = Scenario(layout=layout, joints=True)
    before = draw_scene(scenario, make_layout(layout), np.random.default_rng(1))
    after, arms = with_arms(before, scenario, rng())
    for view in before.layout.groups[0]:
        np.testing.assert_allclose(
            after.camera_from_target(view, after.homes[0]).matrix,
            before.camera_from_target(view, before.homes[0]).matrix,
            atol=1e-12,
        )
    np.testing.assert_array_equal(after.bases[before.layout.robots[0]].matrix, np.eye(4))
    assert arms.keys() == set(before.layout.robots)
    for robot, home in after.homes[0].items():
        np.testing.assert_allclose(home.matrix, arms[robot].chain.forward(arms[robot].home).matrix, atol=1e-12)


def test_home_joints_vary_about_the_middle():
    """Home joints differ between cells, on both sides of the middle, within 0.5 rad of a bent arm."""
    scenario, draws = Scenario(layout="eye_in_hand", joints=True), rng()
    scene = draw_scene(scenario, make_layout("eye_in_hand"), np.random.default_rng(1))
    homes = np.stack([arm.home for _ in range(20) for arm in with_arms(scene, scenario, draws)[1].values()])
    middle = np.array([0.0, -1.2, 1.5, -1.8, 1.4, 0.0])
    assert np.all(homes.min(0) < middle)
    assert np.all(homes.max(0) > middle)
    assert np.all(np.abs(homes - middle)[:, 1:5] <= 0.5)


def test_led_on_world_has_no_rotation():
    """The mount of an LED is a point, whatever the rotation of the bases."""
    scenario = Scenario(layout="eye_in_hand", target="led", joints=True)
    before = draw_scene(scenario, make_layout("eye_in_hand"), np.random.default_rng(1))
    after, _ = with_arms(before, scenario, rng())
    assert before.layout.targets["board"] == WORLD
    np.testing.assert_array_equal(after.mounts["board"].rotation, np.eye(3))
    np.testing.assert_allclose(
        np.linalg.norm(after.camera_from_target(("wrist", "board"), after.homes[0]).translation),
        np.linalg.norm(before.camera_from_target(("wrist", "board"), before.homes[0]).translation),
    )


def test_true_arm_errors_have_requested_sigmas():
    """Offsets, links and compliances of 40 arms have their sigmas within 20 %.

    Without errors the true arm equals the stated one.
    """
    scenario = Scenario(joints=True, joint_offset_rad=0.01, link_error=(1e-3, 2e-3), compliance=1e-4)
    drawn = np.random.default_rng(0)
    scene = draw_scene(scenario, make_layout("dual"), np.random.default_rng(1))
    arms = [arm for _ in range(20) for arm in with_arms(scene, scenario, drawn)[1].values()]
    sizes = {kind: np.stack([arm.true.kind_values(kind) for arm in arms]) for kind in ("joint_offsets", "deflection")}
    links = np.stack([arm.true.kind_values("link_parameters") for arm in arms])
    assert sizes["joint_offsets"].std() == pytest.approx(0.01, rel=0.2)
    assert sizes["deflection"].std() == pytest.approx(1e-4, rel=0.2)
    assert links[..., :3].std() == pytest.approx(1e-3, rel=0.2)
    assert links[..., 3:].std() == pytest.approx(2e-3, rel=0.2)
    exact = next(iter(with_arms(scene, Scenario(joints=True), drawn)[1].values()))
    np.testing.assert_allclose(exact.true.forward(HOME).matrix, exact.chain.forward(HOME).matrix, atol=1e-12)


def test_layout_with_several_homes_refuses_arms():
    """The error names the layout and states what to do."""
    scene = draw_scene(Scenario(layout="chain"), make_layout("chain"), rng())
    with pytest.raises(InputError, match="'chain' has robots with several homes"):
        with_arms(scene, Scenario(layout="chain"), rng())


def test_joint_limits_and_centres_of_mass():
    """Joints rotate by one turn in both directions. The masses of both long links are near their middles."""
    arm = six_axis()
    np.testing.assert_allclose([arm.lower, arm.upper], [np.full(6, -2 * np.pi), np.full(6, 2 * np.pi)])
    np.testing.assert_array_equal(arm.axes, np.tile([0, 0, 1], (6, 1)))
    for link in (1, 2):
        assert arm.masses.centres[link, 0] == pytest.approx(arm.origins[link + 1].translation[0] / 2, abs=0.02)
    assert np.linalg.norm(arm.masses.centres, axis=1).max() < 0.25
    assert np.all(np.diff(arm.masses.kg[1:]) <= 0)


def test_inverse_kinematics_converges_from_far_start():
    """The solution converges from joints that are a radian off. A single start serves all poses."""
    arm = six_axis()
    wanted = arm.forward(np.stack([HOME, HOME + 0.1]))
    found, reached = solve_joints(arm, wanted, HOME + np.array([1, 0.5, -0.5, 0.5, -0.3, 1]))
    assert reached.all()
    np.testing.assert_allclose(arm.forward(found).matrix, wanted.matrix, atol=1e-8)


def test_home_joints_fill_their_ranges():
    """Shoulder and flange of homes vary by half a turn in both directions.

    The joints between them vary by up to half a radian.
    """
    draws = rng()
    homes = np.stack([_arm(Scenario(joints=True), draws).home for _ in range(30)])
    reach = np.abs(homes - [0.0, -1.2, 1.5, -1.8, 1.4, 0.0]).max(0)
    limits = np.array([np.pi, 0.4, 0.4, 0.5, 0.5, np.pi])
    assert np.all(reach <= limits)
    assert np.all(reach > 0.85 * limits)
