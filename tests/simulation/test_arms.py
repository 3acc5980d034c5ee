"""Arms of six axes: their stated and true kinematics, joints that reach poses, and scenes moved onto them."""

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


def test_the_arm_has_the_lengths_it_is_said_to_have():
    """Straight joints lay both links along one line: 0.42 and 0.39 m from the shoulder."""
    arm = six_axis()
    elbow = arm.origins[1].translation + arm.origins[2].translation
    assert arm.n == 6
    np.testing.assert_allclose(np.linalg.norm(arm.origins[2].translation), 0.42)
    np.testing.assert_allclose(np.linalg.norm(arm.origins[3].translation[:2]), 0.39)
    np.testing.assert_allclose(elbow[1], 0.05)
    assert arm.masses is not None
    np.testing.assert_allclose(arm.masses.kg.sum(), 18.8)


def test_straight_joints_lay_the_arm_along_its_base():
    """Places add up along the links: the flange is 0.81 m back, and looks along the base's y axis, backwards."""
    at_zero = six_axis().forward(np.zeros(6))
    np.testing.assert_allclose(at_zero.translation, [-0.81, -0.255, 0.06], atol=1e-12)
    np.testing.assert_allclose(at_zero.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-12)


def test_joints_are_found_for_poses_within_reach():
    """Those of poses a step away bring the flange there; of a pose two metres off none do, and that is said."""
    arm, step = six_axis(), 0.2 * rng().standard_normal((5, 6))
    wanted = arm.forward(HOME + step)
    found, reached = solve_joints(arm, wanted, HOME)
    assert reached.all()
    np.testing.assert_allclose(arm.forward(found).matrix, wanted.matrix, atol=1e-8)
    far = SE3(wanted.rotation[:1], wanted.translation[:1] + np.array([2.0, 0, 0]))
    assert not solve_joints(arm, far, HOME)[1].any()


def test_joints_beyond_their_limits_do_not_count():
    """The pose is reached, the limit is not kept."""
    arm = six_axis()
    high = HOME + np.array([2 * np.pi, 0, 0, 0, 0, 0])
    assert solve_joints(arm, arm.forward(HOME[None]), HOME)[1].all()
    assert not solve_joints(arm, arm.forward(high[None]), high)[1].any()


@pytest.mark.parametrize("layout", ["dual", "eye_in_hand", "eye_to_hand", "two_cameras"])
def test_views_of_the_homes_stay_as_they_were(layout):
    """Bases and what stands on the world move together; the first base is the world."""
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


def test_homes_are_on_both_sides_of_the_middle():
    """Cells differ: each joint is somewhere else, within its reach of a bent arm."""
    scenario, draws = Scenario(layout="eye_in_hand", joints=True), rng()
    scene = draw_scene(scenario, make_layout("eye_in_hand"), np.random.default_rng(1))
    homes = np.stack([arm.home for _ in range(20) for arm in with_arms(scene, scenario, draws)[1].values()])
    middle = np.array([0.0, -1.2, 1.5, -1.8, 1.4, 0.0])
    assert np.all(homes.min(0) < middle)
    assert np.all(homes.max(0) > middle)
    assert np.all(np.abs(homes - middle)[:, 1:5] <= 0.5)


def test_a_light_on_the_world_stays_without_rotation():
    """Its mount is a point, whichever way the bases turned."""
    scenario = Scenario(layout="eye_in_hand", target="led", joints=True)
    before = draw_scene(scenario, make_layout("eye_in_hand"), np.random.default_rng(1))
    after, _ = with_arms(before, scenario, rng())
    assert before.layout.targets["board"] == WORLD
    np.testing.assert_array_equal(after.mounts["board"].rotation, np.eye(3))
    np.testing.assert_allclose(
        np.linalg.norm(after.camera_from_target(("wrist", "board"), after.homes[0]).translation),
        np.linalg.norm(before.camera_from_target(("wrist", "board"), before.homes[0]).translation),
    )


def test_true_arms_differ_by_the_sigmas_asked_for():
    """Offsets, links and compliances of 40 arms have their sigmas to a fifth; without any the arm is as stated."""
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


def test_several_homes_suit_no_arms():
    """The layout is named, and what to do."""
    scene = draw_scene(Scenario(layout="chain"), make_layout("chain"), rng())
    with pytest.raises(InputError, match="'chain' has robots with several homes"):
        with_arms(scene, Scenario(layout="chain"), rng())


def test_joints_turn_once_either_way_and_masses_lie_on_their_links():
    """Those of both long links near their middles."""
    arm = six_axis()
    np.testing.assert_allclose([arm.lower, arm.upper], [np.full(6, -2 * np.pi), np.full(6, 2 * np.pi)])
    np.testing.assert_array_equal(arm.axes, np.tile([0, 0, 1], (6, 1)))
    for link in (1, 2):
        assert arm.masses.centres[link, 0] == pytest.approx(arm.origins[link + 1].translation[0] / 2, abs=0.02)
    assert np.linalg.norm(arm.masses.centres, axis=1).max() < 0.25
    assert np.all(np.diff(arm.masses.kg[1:]) <= 0)


def test_far_joints_are_found_in_bounded_steps():
    """From joints that are a radian off; those of a single start serve all poses."""
    arm = six_axis()
    wanted = arm.forward(np.stack([HOME, HOME + 0.1]))
    found, reached = solve_joints(arm, wanted, HOME + np.array([1, 0.5, -0.5, 0.5, -0.3, 1]))
    assert reached.all()
    np.testing.assert_allclose(arm.forward(found).matrix, wanted.matrix, atol=1e-8)


def test_homes_turn_all_round_at_both_ends_of_the_arm():
    """Shoulder and flange by half a turn either way, what is between by half a radian."""
    draws = rng()
    homes = np.stack([_arm(Scenario(joints=True), draws).home for _ in range(30)])
    reach = np.abs(homes - [0.0, -1.2, 1.5, -1.8, 1.4, 0.0]).max(0)
    limits = np.array([np.pi, 0.4, 0.4, 0.5, 0.5, np.pi])
    assert np.all(reach <= limits)
    assert np.all(reach > 0.85 * limits)
