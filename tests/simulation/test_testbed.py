"""Tests of simulated cells: consistency with the measurement equation, and noise with the stated sigmas."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from basecal.cell.cell import WORLD
from basecal.cell.recording import Observation, PixelObservation, PointObservation, PoseObservation
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.simulation import Scenario, SimulatedCell, simulate
from basecal.simulation.layout import make_layout
from basecal.simulation.motion import draw_motions, points_in_camera, seen_points
from basecal.simulation.scenario import Arms, LayoutName, ObservedKind
from basecal.simulation.scene import draw_scene
from basecal.simulation.testbed import observe

LAYOUTS, TARGETS, ARMS = get_args(LayoutName), get_args(ObservedKind), get_args(Arms)
NOISELESS = {"pixel_px": 0.0, "pose_noise": (0.0, 0.0), "point_m": 0.0}
TWO_ARMS = ("dual", "two_cameras", "chain")
COMBINATIONS = [
    (layout, target, arms)
    for layout in LAYOUTS
    for target in TARGETS
    for arms in (ARMS if layout in TWO_ARMS else ("both",))
]


def _world_from(sim: SimulatedCell, name: str, k: int) -> SE3:
    """Pose of a camera or target in the reference's base, by the names of transforms alone."""
    cell = sim.cell
    on = (cell.cameras.get(name) or cell.targets[name]).on
    if on == WORLD:
        return sim.truth[f"{cell.reference}_base_from_{name}"]
    flange = sim.true_base_from_flange[on][k] @ sim.truth[f"{on}_flange_from_{name}"]
    return flange if on == cell.reference else sim.truth[f"{cell.reference}_base_from_{on}_base"] @ flange


def _predicted(sim: SimulatedCell, seen: Observation, k: int) -> SE3:
    """Predicted pose of a target in a camera."""
    return _world_from(sim, seen.camera, k).inverse() @ _world_from(sim, seen.target, k)


def _residual(sim: SimulatedCell, seen: Observation, k: int) -> Array:
    """Observed less predicted: pixels, metres, or a tangent."""
    pose = _predicted(sim, seen, k)
    if isinstance(seen, PoseObservation):
        return (pose.inverse() @ seen.camera_from_target).log()
    target = sim.cell.targets[seen.target].target
    points = pose @ target.points[target.rows(seen.ids)]
    if isinstance(seen, PointObservation):
        return seen.points_in_camera - points
    return seen.pixels - sim.cameras[seen.camera].project(points)


def _residuals(sim: SimulatedCell) -> Array:
    samples = enumerate(sim.recording.samples)
    return np.concatenate([np.atleast_2d(_residual(sim, s, k)) for k, sample in samples for s in sample.observations])


def _recorded(sim: SimulatedCell, robot: str) -> SE3:
    return SE3.stack([sample.robots[robot].base_from_flange for sample in sim.recording.samples])


def _errors(sim: SimulatedCell, robot: str) -> Array:
    return (_recorded(sim, robot).inverse() @ sim.true_base_from_flange[robot]).log()


@pytest.mark.parametrize(("layout", "target", "arms"), COMBINATIONS)
def test_noiseless_observations_satisfy_the_equation(layout: str, target: str, arms: str) -> None:
    """Without noise every observation equals the prediction of the true transforms, for every layout and target."""
    sim = simulate(Scenario(samples=9, layout=layout, target=target, arms=arms, **NOISELESS), 3)
    assert len(sim.recording.samples) == 9
    np.testing.assert_allclose(_residuals(sim), 0, atol=1e-8)
    assert set(sim.truth) == set(sim.cell.transforms)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("target", ["charuco", "chessboard", "points", "led"])
@pytest.mark.parametrize("lens", ["pinhole", "fisheye"])
def test_all_points_are_in_the_image(layout: str, target: str, lens: str) -> None:
    """All points of the target are within the image and in front of the camera; a board shows its front."""
    sim = simulate(Scenario(samples=15, layout=layout, target=target, lens=lens), 8)
    for k, sample in enumerate(sim.recording.samples):
        assert len(sample.observations) == (2 if layout.startswith("two") else 1)
        for seen in sample.observations:
            shape, pose = sim.cell.targets[seen.target].target, _predicted(sim, seen, k)
            assert np.array_equal(seen.ids, shape.ids)
            assert np.all(sim.cameras[seen.camera].sees(pose @ shape.points))
            assert np.all((seen.pixels >= 0) & (seen.pixels <= (1279, 719)))
            assert target not in ("charuco", "chessboard") or pose.rotation[:, 2] @ pose.translation > 0


def test_partial_views_have_at_least_eight_points() -> None:
    """With `partial` some views lack points, and each has eight or more."""
    sim = simulate(Scenario(samples=60, partial=True, distance_m=(0.25, 0.3), layout="eye_in_hand"), 1)
    counts = [len(sample.observations[0].ids) for sample in sim.recording.samples]
    assert 8 <= min(counts) < max(counts)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("spread", [0.1, 0.6, 1.5])
def test_orientations_are_within_the_spread(layout: str, spread: float) -> None:
    """Any two recorded orientations of a moving robot are within twice the spread.

    The largest angle exceeds 70 % of it.
    """
    sim = simulate(Scenario(samples=40, layout=layout, spread_rad=spread, robots=2), 5)
    for robot in sim.cell.robots:
        rotation = _recorded(sim, robot).rotation[: 20 if layout in ("chain", "ring") else None]
        between = SE3(np.swapaxes(rotation[:, None], -1, -2) @ rotation[None], np.zeros((len(rotation),) * 2 + (3,)))
        angle = np.linalg.norm(between.rotvec, axis=-1)
        assert 0.7 * spread < angle.max() <= 2 * spread + 1e-9


def test_pixel_noise_has_stated_sigma() -> None:
    """Residuals at the truth have the sigma `pixel_px` per coordinate and are uncorrelated."""
    residual = _residuals(simulate(Scenario(samples=150, pixel_px=0.3), 2))
    assert residual.std() == pytest.approx(0.3, rel=0.03)
    assert abs(residual.mean()) < 0.015
    assert abs(np.corrcoef(residual.T)[0, 1]) < 0.05


@pytest.mark.parametrize(("target", "sigma"), [("pose", (2e-3, 5e-3)), ("points3d", (2e-3,))])
def test_pose_and_point_noise_have_stated_sigma(target: str, sigma: tuple[float, ...]) -> None:
    """Observed poses and 3-D points scatter about the truth with the sigmas that they state."""
    sim = simulate(Scenario(samples=300, target=target, pose_noise=(2e-3, 5e-3), point_m=2e-3), 4)
    seen = sim.recording.samples[0].observations[0]
    expected = np.repeat(sigma, 3)
    np.testing.assert_allclose(_residuals(sim).std(0), expected, rtol=0.15)
    stated = seen.sigma if isinstance(seen, PoseObservation) else seen.sigma_m[:3]
    np.testing.assert_array_equal(stated, expected)


def test_robot_noise_has_stated_sigmas() -> None:
    """Moving robots have an error per sample, in flange axes, with the sigmas that the cell states."""
    sim = simulate(Scenario(samples=400, robot_noise=(1e-3, 2e-3)), 6)
    errors = np.concatenate([_errors(sim, "eye"), _errors(sim, "hand")])
    np.testing.assert_allclose(errors.std(0), np.repeat([1e-3, 2e-3], 3), rtol=0.12)
    assert abs(np.corrcoef(_errors(sim, "eye")[:, 0], _errors(sim, "hand")[:, 0])[0, 1]) < 0.15
    np.testing.assert_array_equal(sim.cell.robots["eye"].noise, np.repeat([1e-3, 2e-3], 3))


@pytest.mark.parametrize("layout", TWO_ARMS)
@pytest.mark.parametrize(("arms", "stops"), [("eye_still", 1), ("halves", 11), ("stations", 4)])
def test_samples_of_one_stop_share_error(layout: str, arms: str, stops: int) -> None:
    """Consecutive samples of a robot share an error exactly if they share the recorded pose."""
    scenario = Scenario(samples=20, layout=layout, arms=arms, stations=4, robot_noise=(1e-3, 1e-3), robots=2)
    sim = simulate(scenario, 9)
    for robot in sim.cell.robots:
        same_pose = np.all(np.diff(_recorded(sim, robot).matrix, axis=0) == 0, axis=(1, 2))
        same_error = np.all(np.abs(np.diff(_errors(sim, robot), axis=0)) < 1e-12, axis=1)
        np.testing.assert_array_equal(same_pose, same_error)
        if robot == sim.cell.reference and layout != "chain":
            assert 1 + np.sum(~same_pose) == stops


def test_halves_keep_the_hand_still_first() -> None:
    """In `halves` the hand is still while the eye moves, then the eye is still."""
    sim = simulate(Scenario(samples=10, arms="halves"), 1)
    eye, hand = _recorded(sim, "eye").translation, _recorded(sim, "hand").translation
    assert np.ptp(hand[:5], axis=0).max() == 0 == np.ptp(eye[5:], axis=0).max()
    assert np.ptp(eye[:5], axis=0).min() > 0.01 < np.ptp(hand[5:], axis=0).min()


def test_seed_determines_the_recording() -> None:
    """The same seed gives the same recording, and another seed another cell."""
    first, again, other = (simulate(Scenario(samples=5), seed) for seed in (7, 7, 8))
    np.testing.assert_array_equal(_residuals(first), _residuals(again))
    name = "eye_base_from_hand_base"
    np.testing.assert_array_equal(first.truth[name].matrix, again.truth[name].matrix)
    assert np.linalg.norm(first.truth[name].translation - other.truth[name].translation) > 0.01


def test_truth_is_independent_of_noise_and_statuses() -> None:
    """The truth of a seed is the same for other noise, motions and statuses."""
    plain = Scenario(samples=5)
    changed = replace(plain, samples=9, robot_noise=(1e-3, 1e-3), base="prior", intrinsics="free", arms="halves")
    one, two = simulate(plain, 11), simulate(changed, 11)
    for name, pose in one.truth.items():
        np.testing.assert_array_equal(pose.matrix, two.truth[name].matrix)


@pytest.mark.journey
def test_base_rotation_and_distance_vary() -> None:
    """Over seeds the yaw of the base covers the circle and its distance is 0.8 to 2.2 m. Some bases are tilted far."""
    bases = SE3.stack([simulate(Scenario(samples=1), seed).truth["eye_base_from_hand_base"] for seed in range(60)])
    distance = np.linalg.norm(bases.translation, axis=-1)
    assert np.all((distance > 0.8) & (distance < 2.2))
    assert np.ptp(bases.rpy[:, 2]) > 5.5
    assert 2 <= np.sum(bases.rotation[:, 2, 2] < 0.9) <= 30


def test_fixed_transform_is_exact_and_free_unstated() -> None:
    """The cell states fixed values exactly and has no guess for free ones."""
    sim = simulate(Scenario(samples=2, camera_mount="fixed", target="led"), 2)
    stated = sim.cell.transforms
    np.testing.assert_array_equal(
        stated["eye_flange_from_wrist"].mean.matrix, sim.truth["eye_flange_from_wrist"].matrix
    )
    assert stated["eye_base_from_hand_base"].mean is None
    np.testing.assert_array_equal(sim.truth["hand_flange_from_board"].rotation, np.eye(3))


@pytest.mark.journey
def test_priors_scatter_with_stated_sigmas() -> None:
    """The truth is mean @ exp(xi) with xi of the stated sigmas, and the parameters of a lens scatter likewise."""
    scenario = Scenario(
        samples=1, base="prior", camera_mount="prior", target_mount="prior", intrinsics="prior", target="points"
    )
    scaled, lenses = [], []
    for seed in range(60):
        sim = simulate(scenario, seed)
        for name, prior in sim.cell.transforms.items():
            scaled.append((prior.mean.inverse() @ sim.truth[name]).log() / prior.sigma)
        lens = sim.cell.cameras["wrist"].intrinsics
        lenses.append((sim.cameras["wrist"].parameters - lens.camera.parameters) / lens.sigma)
    np.testing.assert_allclose(np.std(scaled, axis=0), 1, atol=0.2)
    assert np.std(lenses) == pytest.approx(1, abs=0.15)


def test_unstated_noise_is_omitted() -> None:
    """Neither the cell nor the recording states noise that the scenario keeps unstated."""
    silent = Scenario(
        samples=2,
        robot_noise=(1e-3, 1e-3),
        state_pixel_noise=False,
        state_robot_noise=False,
        state_observation_noise=False,
    )
    sim = simulate(silent, 1)
    assert (sim.cell.pixel_px, sim.cell.robots["eye"].noise) == (None, None)
    assert simulate(replace(silent, target="pose"), 1).recording.samples[0].observations[0].sigma is None
    stating = simulate(replace(silent, state_pixel_noise=True), 1)
    assert stating.cell.pixel_px == 0.2


def test_robot_without_spread_has_one_stop() -> None:
    """Without any spread all samples are one stop with one error."""
    sim = simulate(Scenario(samples=6, spread_rad=0.0, position_m=0.0, robot_noise=(1e-3, 1e-3)), 3)
    assert np.ptp(_recorded(sim, "hand").matrix, axis=0).max() == 0
    assert np.ptp(_errors(sim, "hand"), axis=0).max() < 1e-12


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"layout": "eye_in_hand", "arms": "halves"}, "needs two robots"),
        ({"layout": "dul"}, "layout is 'dul' .*, expected one of: dual"),
        ({"samples": 0}, "samples is 0, expected a whole number >= 1"),
        ({"pixel_px": float("nan")}, "numbers >= 0"),
        ({"distance_m": (0.05, 0.06)}, "of 30 samples see the target"),
    ],
)
def test_invalid_scenario_is_refused(fields: dict[str, object], message: str) -> None:
    """An inconsistent scenario is refused in one line."""
    with pytest.raises(InputError, match=message):
        simulate(Scenario(**fields), 0)


def test_observations_refer_to_the_cell() -> None:
    """Every observation names a camera and a target of the cell, and stamps increase."""
    sim = simulate(Scenario(layout="chain", samples=7), 0)
    seen = [found for sample in sim.recording.samples for found in sample.observations]
    assert all(isinstance(found, PixelObservation) for found in seen)
    assert {(found.camera, found.target) for found in seen} == {
        ("camera1", "board2"),
        ("camera2", "board3"),
        ("camera3", "board1"),
    }
    assert [sample.stamp_s for sample in sim.recording.samples] == list(range(7))


@pytest.mark.parametrize("target", ["charuco", "led", "pose"])
@pytest.mark.parametrize("layout", ["dual", "eye_in_hand", "eye_to_hand", "two_cameras", "two_world_cameras"])
def test_recorded_joints_satisfy_the_equation(layout, target):
    """True flanges are the true kinematics at recorded joints, and observations agree with them.

    Joint limits are kept.
    """
    errors = {"joint_offset_rad": 0.01, "link_error": (1e-3, 2e-3)}
    sim = simulate(Scenario(samples=10, layout=layout, target=target, joints=True, **errors, **NOISELESS), 3)
    assert np.abs(_residuals(sim)).max() < 1e-8
    for robot, true in sim.robots.items():
        joints = np.array([s.robots[robot].joints_rad for s in sim.recording.samples])
        off = true.forward(joints).inverse() @ sim.true_base_from_flange[robot]
        assert np.abs(off.log()).max() < 1e-12
        as_told = true.chain.forward(joints).inverse() @ sim.true_base_from_flange[robot]
        assert np.abs(as_told.log()).min(axis=0).max() > 1e-5
        assert np.all((joints >= true.chain.lower) & (joints <= true.chain.upper))


def test_still_arm_records_identical_joints():
    """Joints of a still arm are identical to the last digit, so that its samples are one stop."""
    sim = simulate(Scenario(samples=12, arms="stations", stations=3, joints=True, robot_noise=(1e-3, 1e-3)), 0)
    eye = np.array([s.robots["eye"].joints_rad for s in sim.recording.samples])
    assert len(np.unique(eye, axis=0)) == 3


def test_chain_layout_refuses_joints():
    """Each robot of a ring faces two others, at homes that one base does not bring within reach."""
    with pytest.raises(InputError, match="several homes"):
        simulate(Scenario(layout="chain", joints=True), 0)


@pytest.mark.parametrize(
    ("layout", "robots", "pairs"), [("ring", 5, 10), ("ring", 2, 2), ("grid", 6, 7), ("grid", 5, 5)]
)
def test_rings_and_grids_record_only_pairs(layout, robots, pairs):
    """Each robot is observed, each pair in separate samples, which record only its two robots."""
    made = simulate(Scenario(layout=layout, robots=robots, samples=2 * pairs), 1)
    seen = {(o.camera, o.target) for sample in made.recording.samples for o in sample.observations}
    assert len(seen) == pairs
    for sample in made.recording.samples:
        (view,) = sample.observations
        assert set(sample.robots) == {made.cell.cameras[view.camera].on, made.cell.targets[view.target].on}
    assert {robot for sample in made.recording.samples for robot in sample.robots} == set(made.cell.robots)


@pytest.mark.parametrize("seed", [-1, 1.5, None])
def test_seed_must_be_a_whole_number(seed):
    """A seed that is negative or not an integer is refused."""
    with pytest.raises(InputError, match=rf"^seed is {seed}, expected a whole number >= 0$"):
        simulate(Scenario(samples=1), seed)


def test_wrong_scenario_type_is_refused():
    with pytest.raises(InputError, match=r"^scenario is of type int, expected Scenario$"):
        simulate(1, 1)


VIEW = ("wrist", "board")


def observe_scenario(scenario):
    """Scene, motion and observations of a scenario."""
    scene = draw_scene(scenario, make_layout(scenario.layout), np.random.default_rng(1))
    (motion,) = draw_motions(scene, scenario, np.random.default_rng(2), {})
    return scene, motion, observe(motion, scene, scenario, np.random.default_rng(3))


def residuals(scenario):
    """Pixels minus those of the truth, by sample."""
    scene, motion, seen = observe_scenario(scenario)
    exact = scene.lenses["wrist"].project(points_in_camera(scene, VIEW, motion.true))
    return [found.pixels - exact[k] for k, (found,) in enumerate(seen)]


def test_noiseless_pixels_are_exact():
    """All corners of a whole board are observed exactly, by their ids."""
    scenario = Scenario(samples=3, pixel_px=0.0)
    scene, _, seen = observe_scenario(scenario)
    assert all(np.array_equal(found.ids, scene.shapes["board"].ids) for (found,) in seen)
    assert max(np.abs(each).max() for each in residuals(scenario)) < 1e-9


def test_correlated_noise_is_shared_by_a_view():
    """Points scatter by their own sigma, the means of views by the shared one.

    300 views determine both within 10 to 15 %.
    """
    off = residuals(Scenario(samples=300, target="points", pixel_px=0.1, correlated_px=0.5))
    means = np.array([each.mean(0) for each in off])
    assert means.std() == pytest.approx(0.5, rel=0.1)
    assert np.concatenate([each - each.mean(0) for each in off]).std() == pytest.approx(0.1, rel=0.15)


def test_only_visible_points_are_observed():
    """The visible points of a part of a board are observed, each with its own id."""
    scenario = Scenario(samples=20, distance_m=(0.25, 0.35), position_m=0.2, partial=True, pixel_px=0.0)
    scene, motion, seen = observe_scenario(scenario)
    mask = seen_points(scene, scenario, VIEW, motion.true)
    assert not mask.all()
    for k, (found,) in enumerate(seen):
        assert found.ids.tolist() == scene.shapes["board"].ids[mask[k]].tolist()
    assert max(np.abs(each).max() for each in residuals_of(scene, motion, seen, mask)) < 1e-9


def residuals_of(scene, motion, seen, mask):
    exact = scene.lenses["wrist"].project(points_in_camera(scene, VIEW, motion.true))
    return [found.pixels - exact[k][mask[k]] for k, (found,) in enumerate(seen)]


@pytest.mark.parametrize("states", [True, False])
def test_pose_noise_is_in_target_axes(states):
    """Translation and rotation have their sigmas in the axes of the target. The recording states them or not."""
    scenario = Scenario(samples=300, target="pose", pose_noise=(1e-3, 4e-3), state_observation_noise=states)
    scene, motion, seen = observe_scenario(scenario)
    true = scene.camera_from_target(VIEW, motion.true)
    off = np.stack([(true[k].inverse() @ found.camera_from_target).log() for k, (found,) in enumerate(seen)])
    np.testing.assert_allclose(off.std(0), np.repeat([1e-3, 4e-3], 3), rtol=0.15)
    sigma = seen[0][0].sigma
    assert sigma is None if not states else sigma.tolist() == [1e-3] * 3 + [4e-3] * 3


@pytest.mark.parametrize(
    ("point_m", "states", "stated"), [(2e-3, True, True), (2e-3, False, False), (0.0, True, False)]
)
def test_point_noise_has_stated_sigma(point_m, states, stated):
    """Sigmas of 3-D points are stated if there are any and the scenario allows it."""
    scenario = Scenario(samples=100, target="points3d", point_m=point_m, state_observation_noise=states)
    scene, motion, seen = observe_scenario(scenario)
    exact = points_in_camera(scene, VIEW, motion.true)
    off = np.stack([found.points_in_camera - exact[k] for k, (found,) in enumerate(seen)])
    assert off.std() == pytest.approx(point_m, rel=0.1, abs=1e-12)
    assert all((found.sigma_m is not None) == stated for (found,) in seen)
    if stated:
        np.testing.assert_array_equal(seen[0][0].sigma_m, np.full(len(exact[0]), point_m))


def test_all_views_of_a_group_are_observed():
    """Two cameras observe in every sample, in the order of the views."""
    *_, seen = observe_scenario(Scenario(samples=2, layout="two_cameras"))
    assert [[found.camera for found in sample] for sample in seen] == [["left_camera", "right_camera"]] * 2
