"""Tests of `innovations`: new views compared with the prediction of a calibration."""

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.drift.innovations import (
    MOST_VIEWS,
    Innovations,
    _bearings,
    first_order_tangents,
    innovations,
    view_tangents,
)
from basecal.accuracy.drift.verify import verify
from basecal.cell import HeldGauge, Recording, RobotState
from basecal.effects.smooth import kernel
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.geometry import SE3, Array, Camera
from drift_cells import BASE, Later, later


@pytest.mark.journey
def test_whitened_innovations_have_unit_variance() -> None:
    """Whitened innovations of four cells with six views of six numbers have a mean square of 1.

    They are 144: their mean has a standard error of 0.12, of which the band is three.
    """
    squares = []
    for seed in range(4):
        made = later(seed)
        of = innovations(made.cell, made.calibration, made.recording)
        squares.append(float(of.deviation @ of.covariance_inverse @ of.deviation) / len(of.deviation))
    assert 0.65 < np.mean(squares) < 1.35


def test_unwhitened_innovations_exceed_unit_variance() -> None:
    """Without the uncertainty of predictions the mean square is above 3."""
    made = later()
    of = innovations(made.cell, made.calibration, made.recording)
    assert float(of.deviation @ of.deviation) / len(of.deviation) > 3.0


def test_moved_base_changes_innovations_by_derivative() -> None:
    """A moved base changes the innovations by the frame derivative."""
    made, tangent = later(), np.array([1e-4, -5e-5, 2e-5, 1e-4, 0.0, -1e-4])
    before = innovations(made.cell, made.calibration, made.recording)
    after = innovations(made.cell, made.calibration, made.with_base_moved(tangent))
    expected = before.whiten(before.frame_jacobian(BASE)) @ tangent
    np.testing.assert_allclose(after.deviation - before.deviation, expected, atol=0.02 * np.abs(expected).max())


def test_dropped_sample_equals_missing_sample() -> None:
    """Dropping a sample equals innovations without it."""
    made = later()
    number = made.recording.samples[2].sample
    less = Recording(tuple(s for s in made.recording.samples if s.sample != number))
    without = innovations(made.cell, made.calibration, made.recording).drop_sample(number)
    never = innovations(made.cell, made.calibration, less)
    np.testing.assert_allclose(without.deviation, never.deviation, atol=1e-9)
    np.testing.assert_allclose(without.predicted, never.predicted, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(without.covariance_inverse, never.covariance_inverse, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(without.frame_jacobian(BASE), never.frame_jacobian(BASE), atol=1e-9)


def test_views_of_one_stop_share_robot_error() -> None:
    """Views of one stop share the robot error in the prediction."""
    made = later(robot_noise=(1e-3, 1e-3))
    apart = innovations(made.cell, made.calibration, made.recording)
    number = apart.situation.problem.groups[0]
    assert len(set(number.hand.stop_number.tolist())) == len(number)
    one, other = made.recording.samples[:2]
    same = Recording((one, other.__class__(**{**vars(other), "robots": one.robots})))
    of = innovations(made.cell, made.calibration, same)
    across = of.predicted[:6, 6:]
    assert np.linalg.norm(across) > 0.5 * np.linalg.norm(of.predicted[:6, :6])


def test_many_views_are_thinned() -> None:
    """Too many views are thinned to at most `MOST_VIEWS`."""
    made = later()
    many = [
        sample.__class__(**{**vars(sample), "sample": 1000 * k + sample.sample})
        for k in range(60)
        for sample in made.recording.samples
    ]
    perturbed = [  # no two views are exactly equal, else they would count once
        sample.__class__(
            **{
                **vars(sample),
                "observations": tuple(
                    o.__class__(**{**vars(o), "pixels": o.pixels + 1e-6 * k}) for o in sample.observations
                ),
            }
        )
        for k, sample in enumerate(many)
    ]
    of = innovations(made.cell, made.calibration, Recording(tuple(perturbed)))
    assert 0.4 * MOST_VIEWS < len(of.sample) <= MOST_VIEWS


def test_link_uncertainty_adds_derivative_at_joints() -> None:
    """Link uncertainty adds the squared derivative at the new joints in sigmas; an older file has none."""
    made = later(joints=True)
    links = {"sigma": [1e-3] * 6, "shift_m": 5e-4, "turn_rad": 1e-3}
    robots = made.calibration.noise["robots"]

    def predicted(**common: object) -> np.ndarray:
        noise = {**made.calibration.noise, "robots": {**robots, "hand": {**robots["hand"], **common}}}
        return innovations(made.cell, replace(made.calibration, noise=noise), made.recording).predicted

    of = innovations(made.cell, made.calibration, made.recording)
    at = of.posture("hand")
    assert at is not None
    sigma = np.tile(np.repeat([5e-4, 1e-3], 3), at.chain.n + 1)
    moved = of.whiten(of.flange_jacobian("hand") @ (at.true.link_derivative * sigma))
    added = predicted(link_parameters=links) - predicted()
    np.testing.assert_allclose(added, moved @ moved.T, atol=1e-9 * np.abs(added).max())
    older = predicted(link_parameters={"sigma": [1e-3] * 6}) - predicted()
    assert np.abs(older - added).max() > 0.1 * np.abs(added).max()


def test_time_errors_follow_stamps() -> None:
    """Views half a second apart share errors in time, samples a minute apart do not; without stamps there are none."""
    made = later()
    robots = made.calibration.noise["robots"]
    hand = {**robots["hand"], "smooth_in_time": {"sigma": [1e-3] * 6, "lasts_s": 1.0}}
    moving = replace(made.calibration, noise={**made.calibration.noise, "robots": {**robots, "hand": hand}})

    def added(apart_s: float | None) -> np.ndarray:
        stamps = [None if apart_s is None else apart_s * k for k in range(len(made.recording.samples))]
        stamped = [replace(s, stamp_s=t) for s, t in zip(made.recording.samples, stamps, strict=True)]
        known, more = (innovations(made.cell, of, Recording(tuple(stamped))) for of in (made.calibration, moving))
        return more.predicted - known.predicted

    near, far = added(0.5), added(60.0)
    assert np.linalg.norm(near[:6, 6:12]) > 0.3 * np.linalg.norm(near[:6, :6])
    assert np.linalg.norm(far[:6, 6:12]) < 1e-6 * np.linalg.norm(far[:6, :6])
    assert not np.any(added(None))


def test_mean_square_of_noise_exceeds_likeliest() -> None:
    """Noise from few samples counts with its mean square, which is larger than the square of the likeliest sigma."""
    made = later()
    robots = {name: {**known, "rms_factor": 3.0} for name, known in made.calibration.noise["robots"].items()}
    wider = replace(made.calibration, noise={**made.calibration.noise, "robots": robots})
    before, after = (innovations(made.cell, of, made.recording).predicted for of in (made.calibration, wider))
    exact = {
        name: {**known, "sigma_t_m": [0.0] * 3, "sigma_r_rad": [0.0] * 3}
        for name, known in made.calibration.noise["robots"].items()
    }
    without = replace(made.calibration, noise={**made.calibration.noise, "robots": exact})
    rest = innovations(made.cell, without, made.recording).predicted
    np.testing.assert_allclose(after - rest, 9 * (before - rest), rtol=1e-6, atol=1e-6 * np.abs(after).max())


def test_robot_errors_are_those_of_stops() -> None:
    """With exact transforms each robot's sigmas count through its derivative, independently between samples."""
    made = later()
    exact = replace(made.calibration, joint_covariance=None)
    of = innovations(made.cell, exact, made.recording)
    wanted = np.zeros_like(of.predicted)
    for robot in ("eye", "hand"):
        known = made.calibration.noise["robots"][robot]
        sigma = np.array([*known["sigma_t_m"], *known["sigma_r_rad"]])
        moved = of.root.mT @ of.flange_jacobian(robot) * sigma * (known.get("rms_factor") or 1.0)
        for k, each in enumerate(moved):
            wanted[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] += each @ each.T
    np.testing.assert_allclose(of.predicted, wanted, atol=1e-9 * np.abs(wanted).max())
    np.testing.assert_allclose(of.covariance_inverse @ (np.eye(len(wanted)) + wanted), np.eye(len(wanted)), atol=1e-7)


def pulls(of: Innovations, off: np.ndarray) -> np.ndarray:
    """Innovations in the views' own tangents, (6 n,), independent of the order and signs of whitening."""
    return np.asarray(of.root @ off.reshape(-1, 6, 1)).ravel()


@pytest.mark.parametrize("robot", ["eye", "hand"])
@pytest.mark.parametrize("joints", [False, True])
def test_robot_shift_changes_innovations_by_derivative(robot: str, joints: bool) -> None:
    """A shift of either flange, or of recorded joints, changes the innovations by its derivative."""
    made, by = later(joints=joints), 1e-5 * np.array([3.0, -2, 1, 2, 1, -3])
    before = innovations(made.cell, made.calibration, made.recording)
    samples = []
    for sample in made.recording.samples:
        of = sample.robots[robot]
        moved = RobotState(joints_rad=of.joints_rad + by) if joints else RobotState(of.base_from_flange @ SE3.exp(by))
        samples.append(replace(sample, robots={**sample.robots, robot: moved}))
    after = innovations(made.cell, made.calibration, Recording(tuple(samples)))
    moves = before.joint_jacobian(robot) if joints else before.flange_jacobian(robot)
    expected = -pulls(before, before.whiten(moves) @ by)
    found = pulls(after, after.deviation) - pulls(before, before.deviation)
    np.testing.assert_allclose(found, expected, atol=0.05 * np.abs(expected).max())
    assert before.joint_jacobian(robot).shape == (6, 6, 6 if joints else 0)


def test_noise_freedoms_are_smallest_of_robots() -> None:
    """The noise freedoms are the smallest of the participating robots; stated noise has infinitely many."""
    made = later()
    robots = made.calibration.noise["robots"]
    for freedoms, fewest in (((30.0, 12.0), 12.0), ((None, 40.0), 40.0), ((None, None), np.inf)):
        each = dict(zip(("eye", "hand"), freedoms, strict=True))
        noise = {
            **made.calibration.noise,
            "robots": {**{n: {**robots[n], "freedoms": f} for n, f in each.items()}, "idle": {"freedoms": 3.0}},
        }
        found = innovations(made.cell, replace(made.calibration, noise=noise), made.recording)
        assert found.noise_freedoms == fewest


def test_smooth_errors_correlate_near_poses() -> None:
    """Smooth errors correlate views by the kernel of robot poses, up to small modes, through both derivatives."""
    made = later()
    robots = made.calibration.noise["robots"]
    sigma = np.array([1e-3, 2e-3, 0.0, 1e-3, 0.0, 3e-3])
    smooth = {"sigma": sigma.tolist(), "length_m": 0.7}
    noise = {**made.calibration.noise, "robots": {**robots, "hand": {**robots["hand"], "smooth": smooth}}}
    of, more = (
        innovations(made.cell, each, made.recording)
        for each in (made.calibration, replace(made.calibration, noise=noise))
    )
    poses, stands = of.recorded_stops("hand")
    moved = of.root.mT @ (of.flange_jacobian("hand") * sigma)
    alike = kernel(poses, poses)
    added = more.predicted - of.predicted
    for i in range(len(moved)):
        for j in range(len(moved)):
            wanted = alike[i, j] * moved[i] @ moved[j].T
            np.testing.assert_allclose(
                added[6 * i : 6 * i + 6, 6 * j : 6 * j + 6], wanted, atol=0.02 * np.abs(added).max()
            )
    assert len(set(stands.tolist())) == len(stands) == 6
    recorded = [s.robots["hand"].base_from_flange.matrix for s in made.recording.samples]
    np.testing.assert_allclose(poses.matrix, recorded, atol=1e-12)


def _direction(seed: int) -> Array:
    way = np.random.default_rng(seed).normal(size=6)
    return np.concatenate([half / np.linalg.norm(half) for half in (way[:3], way[3:])])


def _views(made: Later) -> tuple[PixelMeasurement, SE3, object]:
    situation = innovations(made.cell, made.calibration, made.recording).situation
    group = situation.problem.groups[0]
    assert isinstance(group.measurement, PixelMeasurement)
    predicted = situation.state.camera_from_target(group, situation.problem.stops)
    return group.measurement, predicted, situation.state.cameras[group.camera]


def test_near_views_are_first_order() -> None:
    """For an unchanged cell the view tangents equal those of first order."""
    measurement, predicted, camera = _views(later())
    found = view_tangents(measurement, predicted, camera)  # type: ignore[arg-type]
    expected = first_order_tangents(measurement.linearise(predicted, camera, False))  # type: ignore[arg-type]
    np.testing.assert_array_equal(found.tangent, expected.tangent)
    np.testing.assert_array_equal(found.information, expected.information)


@pytest.mark.parametrize("seed", range(4))
def test_tangent_reaches_observed_pose(seed: int) -> None:
    """The tangent reaches the observed pose from predictions moved by 0.4 m and 1.2 rad.

    Noise of 0.2 px rotates a board by milliradians.
    """
    measurement, predicted, camera = _views(later())
    before = predicted @ SE3.exp(view_tangents(measurement, predicted, camera).tangent)  # type: ignore[arg-type]
    moved = predicted @ SE3.exp(_direction(seed) * np.repeat([0.4, 1.2], 3))
    after = moved @ SE3.exp(view_tangents(measurement, moved, camera).tangent)  # type: ignore[arg-type]
    assert np.abs((before.inverse() @ after).log()).max() < 1e-3


@pytest.mark.parametrize("samples", [1, 3, 12])
@pytest.mark.parametrize(("length_m", "angle_rad"), [(1.0, 0.0), (0.0, 1.5), (0.6, 2.0)])
def test_far_moved_base_is_detected(samples: int, length_m: float, angle_rad: float) -> None:
    """A base moved far is detected, though boards are predicted behind the camera.

    Three samples give the shift itself.
    """
    made = later(new=12).first(samples)
    for seed in range(3):
        tangent = _direction(seed) * np.repeat([length_m, angle_rad], 3)
        found = verify(made.cell, made.calibration, made.with_base_moved(tangent))
        assert found.moved is True
        assert found.shift is not None
        if samples > 1:
            assert found.shift.transform == BASE
            assert found.shift.shift_m == pytest.approx(np.linalg.norm(tangent[:3]), abs=0.01)
            assert found.shift.shift_rad == pytest.approx(angle_rad, abs=0.01)


@pytest.mark.parametrize("target", ["led", "points3d", "pose"])
def test_far_moved_base_is_detected_by_any_measurement(target: str) -> None:
    """A base moved far is detected by any measurement.

    A point has no pose: its direction counts, also if predicted behind the camera.
    """
    made = later(target=target)
    for seed in range(4):
        tangent = _direction(seed) * np.repeat([1.0, 0.0], 3)
        assert verify(made.cell, made.calibration, made.with_base_moved(tangent)).moved is True


def test_gauge_covariance_is_no_prediction_uncertainty() -> None:
    """A gauge's error is equal in new samples, so predictions are those without its covariance."""
    made = later()
    root = 1e-4 * np.random.default_rng(0).standard_normal((len(made.calibration.joint_covariance), 3))
    held = root @ root.T
    wider = replace(
        made.calibration,
        joint_covariance=made.calibration.joint_covariance + held,
        gauges=(HeldGauge("eye", ("joint_offsets",), 0.25 * held), HeldGauge("hand", ("joint_offsets",), 0.75 * held)),
    )
    alone, beside = (innovations(made.cell, each, made.recording) for each in (made.calibration, wider))
    np.testing.assert_allclose(beside.predicted, alone.predicted, atol=1e-9 * np.abs(alone.predicted).max())


def test_unseen_points_have_no_weight() -> None:
    """Seen points are weighted by pixel sigmas over the focal length.

    Unseen points, and points outside the lens, have no weight.
    """
    camera = Camera("pinhole", [800.0, 400.0, 320.0, 240.0])
    pixels = np.array([[[320.0, 240.0], [1120.0, 240.0], [320.0, 640.0]]])
    seen = np.array([[True, True, False]])
    points, weight = np.zeros((3, 3)), np.array([[2.0, 4.0, 8.0]])
    found = _bearings(PixelMeasurement(points, pixels, seen, weight, weight), camera)
    np.testing.assert_allclose(found.weight, [[1200.0, 2400.0, 0.0]])
    np.testing.assert_allclose(
        found.bearings_in_camera[0, :2], [[0, 0, 1], [np.sqrt(0.5), 0, np.sqrt(0.5)]], atol=1e-12
    )
