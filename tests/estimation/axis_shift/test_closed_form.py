"""Tests of the axis-shift closed form against the paper's tables and against the truth."""

from __future__ import annotations

import json
from importlib.resources import files

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.errors import NotConverged, NotObservable
from basecal.estimation.axis_shift import closed_form
from basecal.estimation.axis_shift.closed_form import base_of_station, estimate, image_gradient, orthonormalise
from basecal.estimation.axis_shift.stations import find_stations, fuse_bases, task_weights
from basecal.estimation.problem.build import build_problem
from basecal.estimation.settings import Settings
from basecal.estimation.solve import solve
from basecal.estimation.start.first_state import lenses
from basecal.geometry import SE3, Camera
from basecal.geometry.rotation import nearest_rotation
from basecal.simulation.shifts import simulate_shifts

PAPER = json.loads(files("basecal.studies").joinpath("paper_numbers.json").read_text())
FOCAL = np.array([1017.3, 979.5])
CAMERA = Camera("pinhole", np.array([*FOCAL, 639.5, 479.5]), (1280, 960))


def pose(entry) -> SE3:
    return SE3(np.array(entry["R"], dtype=float), np.array(entry["t"], dtype=float))


EYE_BASE_FROM_CAMERA = pose(PAPER["testbed"]["eye_base_from_camera"])
HAND_BASE_FROM_LED = pose(PAPER["testbed"]["hand_base_from_led"])
PRINTED = pose(PAPER["testbed"]["eye_base_from_hand_base_true"])
TRUE = SE3(nearest_rotation(PRINTED.rotation), PRINTED.translation)


def estimate_without_noise(shifts):
    camera_from_led = EYE_BASE_FROM_CAMERA.inverse() @ PRINTED @ HAND_BASE_FROM_LED
    at = camera_from_led @ np.concatenate([np.zeros((1, 3)), shifts])
    pixels = FOCAL * at[:, :2] / at[:, 2:]
    return estimate(pixels[0], image_gradient(pixels[1:] - pixels[0], shifts), FOCAL)


def perturb_transform(transform: SE3, spread: float, count: int, seed: int) -> SE3:
    return transform @ SE3.exp(spread * np.random.default_rng(seed).normal(size=(count, 6)))


def test_noiseless_rotation_equals_the_paper():
    """Every entry is within 1e-4 of the printed one, before orthonormalising."""
    ours = estimate_without_noise(0.01 * np.eye(3))
    np.testing.assert_allclose(ours.raw_rotation, PAPER["noiseless"]["camera_from_led"]["R"], atol=1e-4)


def test_noiseless_translation_equals_the_paper_except_depth():
    """The paper prints the true depth 3.6084; eq. (9) gives 3.6092."""
    ours = estimate_without_noise(0.01 * np.eye(3)).camera_from_led.translation
    np.testing.assert_allclose(ours[:2], PAPER["noiseless"]["camera_from_led"]["t"][:2], atol=1e-4)
    assert ours[2] == pytest.approx(3.6092, abs=1e-4)


@pytest.mark.parametrize("level", ["1%", "5%"])
def test_table_2_follows_from_table_1(level):
    """Both ways of orthonormalising give every entry within 1e-4, and agree with one another within 1e-10."""
    rows = np.array(PAPER["table1_camera_from_led"][level]["R"])
    iterated = orthonormalise(rows)
    np.testing.assert_allclose(iterated, PAPER["table2_orthonormalised"][level], atol=1e-4)
    np.testing.assert_allclose(iterated, nearest_rotation(rows), atol=1e-10)


@pytest.mark.parametrize("level", ["1%", "5%"])
def test_table_3_follows_from_table_2(level):
    """Entries agree within 2e-4, except for the one whose digits the paper swaps."""
    table_2 = np.array(PAPER["table2_orthonormalised"][level])
    translation = np.array(PAPER["table1_camera_from_led"][level]["t"])
    ours = base_of_station(EYE_BASE_FROM_CAMERA, SE3(table_2, translation), HAND_BASE_FROM_LED)
    printed = PAPER["table3_eye_base_from_hand_base"][level]
    rotation = np.array(printed["R"])
    if level == "5%":
        rotation[2, 2] = 0.9452
    np.testing.assert_allclose(ours.rotation, rotation, atol=2e-4)
    np.testing.assert_allclose(ours.translation, printed["t"], atol=2e-4)


@pytest.mark.journey
def test_iteration_equals_closed_form_far_from_a_rotation():
    """For 300 random matrices up to 20 degrees from orthonormal, the two agree to 1e-10."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        rows = nearest_rotation(rng.normal(size=(3, 3))) + 0.1 * rng.normal(size=(3, 3))
        np.testing.assert_allclose(orthonormalise(rows), nearest_rotation(rows), atol=1e-10)


def test_iteration_without_convergence_is_an_error():
    """Rows without a nearest rotation near the start raise an error with the last state."""
    with pytest.raises((NotConverged, np.linalg.LinAlgError)):
        orthonormalise(np.full((3, 3), np.nan))


def test_oblique_and_unequal_shifts_equal_the_papers():
    """With infinitesimal shifts the measured matrix of shifts makes any three directions equivalent."""
    shifts = 1e-6 * np.array([[1.0, 0.2, 0.0], [-0.3, 2.0, 0.1], [0.4, 0.0, 1.5]])
    np.testing.assert_allclose(
        estimate_without_noise(shifts).raw_rotation, estimate_without_noise(1e-6 * np.eye(3)).raw_rotation, atol=1e-5
    )


def test_coplanar_shifts_are_not_observable():
    """Three coplanar shifts have no information about the direction across them."""
    with pytest.raises(NotObservable, match="one plane"):
        image_gradient(np.zeros((3, 2)), np.array([[1.0, 0, 0], [0, 1.0, 0], [1.0, 1.0, 0]]))


@pytest.mark.parametrize("two_sided", [False, True])
def test_stations_and_shifts_are_found_from_poses(two_sided):
    """Three stations are separated by the poses alone, each with its own samples and its shifts measured."""
    simulated = simulate_shifts(
        TRUE,
        perturb_transform(EYE_BASE_FROM_CAMERA, 0.03, 3, 1),
        perturb_transform(HAND_BASE_FROM_LED, 0.1, 3, 2),
        CAMERA,
        0.05,
        two_sided,
    )
    problem, _ = build_problem(simulated.cell, simulated.recording)
    stations = find_stations(problem, lenses(problem, simulated.cell))
    size = 7 if two_sided else 4
    assert [sorted(s.samples) for s in stations] == [list(range(k * size, (k + 1) * size)) for k in range(3)]
    np.testing.assert_allclose(stations[0].shifts_in_led[1:4], 0.05 * np.eye(3), atol=1e-12)


def test_base_for_a_task_point():
    """The nearest station's base is used unchanged, and the weighted mean approaches it near that station."""
    simulated = simulate_shifts(
        TRUE,
        perturb_transform(EYE_BASE_FROM_CAMERA, 0.03, 3, 1),
        perturb_transform(HAND_BASE_FROM_LED, 0.2, 3, 2),
        CAMERA,
        0.05,
    )
    problem, _ = build_problem(simulated.cell, simulated.recording)
    stations = find_stations(problem, lenses(problem, simulated.cell))
    base = stations[1].base()
    task = (base @ stations[1].hand_base_from_led).translation
    bases = [s.base() for s in stations]
    for is_nearest, tolerance in ((True, 1e-12), (False, 1e-6)):
        fused = fuse_bases(bases, task_weights(stations, task, is_nearest))
        np.testing.assert_allclose(fused.matrix, base.matrix, atol=tolerance)
    mean = fuse_bases([s.base() for s in stations], [1, 1, 1]).translation
    assert np.linalg.norm(mean - base.translation) > 1e-4


def test_closed_form_includes_neglected_depth_in_sigma():
    """The truth is within four sigmas, which include the neglected depth, and the verdict is doubtful."""
    simulated = simulate_shifts(
        TRUE, perturb_transform(EYE_BASE_FROM_CAMERA, 0.02, 6, 1), perturb_transform(HAND_BASE_FROM_LED, 0.05, 6, 2),
        CAMERA, 0.1, is_two_sided=True, pixel_px=0.05,
    )  # fmt: skip
    calibration = calibrate(simulated.cell, simulated.recording, Settings(method="axis-shift"))
    estimated = calibration["eye_base_from_hand_base"]
    off = (estimated.mean.inverse() @ TRUE).log()
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(estimated.covariance)))
    assert {f.code for f in calibration.findings} >= {"axis-shift-station", "neglected-depth"}
    assert calibration.verdict == "doubtful"


def test_closed_form_starts_the_general_solver():
    """A descent from the closed form ends at the solver's own optimum."""
    simulated = simulate_shifts(
        TRUE,
        perturb_transform(EYE_BASE_FROM_CAMERA, 0.02, 4, 1),
        perturb_transform(HAND_BASE_FROM_LED, 0.05, 4, 2),
        CAMERA,
        0.1,
        pixel_px=0.1,
    )
    name = "eye_base_from_hand_base"
    by_shifts = (
        solve(simulated.cell, simulated.recording, Settings(start="axis-shift", robot_noise="stated"))
        .transforms[name]
        .mean
    )
    unguessed = solve(simulated.cell, simulated.recording).transforms[name].mean
    assert np.abs((by_shifts.inverse() @ unguessed).log()).max() < 1e-8


def test_recording_without_stations_is_reported():
    """An LED without shifts at a still camera is not observable by this method, and the error explains it."""
    from basecal.simulation import Scenario, simulate

    s = simulate(Scenario(target="led", camera_mount="fixed", target_mount="fixed"), seed=0)
    with pytest.raises(NotObservable, match="no station"):
        calibrate(s.cell, s.recording, Settings(method="axis-shift"))
    free = simulate(Scenario(target="led"), seed=0)
    with pytest.raises(NotObservable, match="eye_flange_from_wrist"):
        calibrate(free.cell, free.recording, Settings(method="axis-shift"))


@pytest.mark.parametrize("angle", [1e-9, 1e-5, 2e-4, 0.3, 1.5, 3.0])
def test_rotations_from_two_rows_are_nearest(angle):
    """The result equals that of singular values within 1e-9, whatever the angle between the rows.

    Both are known to as many digits.
    """
    rng = np.random.default_rng(4)
    turned = SE3.exp(np.concatenate([np.zeros((20, 3)), rng.normal(size=(20, 3))], -1)).rotation
    gradient = 100 * np.array([[1.0, 0, 0], [np.cos(angle), np.sin(angle), 0]]) @ turned
    found = estimate(np.zeros((20, 2)), gradient, np.array([800.0, 800.0]))
    expected = nearest_rotation(found.raw_rotation)
    assert np.abs(found.camera_from_led.rotation - expected).max() < 1e-9


def lagrangian(x, rows):
    """Half the squared distance of three rows from those of a rotation, plus its orthonormality constraints."""
    r1, r2, (m1, m2, m3) = x[:3], x[3:6], x[6:]
    off = np.concatenate([r1, r2, np.cross(r1, r2)]) - rows.ravel()
    return 0.5 * (off @ off + m1 * r1 @ r2 + m2 * (r1 @ r1 - 1) + m3 * (r2 @ r2 - 1))


def test_newton_equations_are_derivatives(rng):
    """The residual is the gradient of the Lagrangian by nine numbers, and the matrix is its derivative."""
    step = 1e-5 * np.eye(9)
    for _ in range(3):
        rows, x = rng.standard_normal((3, 3)), rng.standard_normal(9)
        slope = [(lagrangian(x + h, rows) - lagrangian(x - h, rows)) / 2e-5 for h in step]
        slope[6:] = 2 * np.array(slope[6:])
        np.testing.assert_allclose(closed_form._stationarity(x, rows), slope, atol=1e-8)
        matrix = [
            (closed_form._stationarity(x + h, rows) - closed_form._stationarity(x - h, rows)) / 2e-5 for h in step
        ]
        np.testing.assert_allclose(closed_form._newton_matrix(x, rows), np.transpose(matrix), atol=1e-8)


def test_gram_schmidt_keeps_the_first_row():
    """Rows of any length give a rotation: the second row is rotated in their plane until it is orthogonal."""
    found = closed_form._gram_schmidt(np.array([[0.0, 2.0, 0.0], [3.0, 4.0, 0.0], [9.0, 9.0, 9.0]]))
    np.testing.assert_allclose(found, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-15)


@pytest.mark.parametrize(("third", "is_flat"), [(0.9e-3, True), (1.1e-3, False)])
def test_shifts_span_three_directions_by_a_thousandth(third, is_flat):
    """Shifts have to leave a plane by at least a thousandth of the longest shift."""
    shifts = np.array([sign * axis for axis in np.diag([2.0, 1.0, 2.0 * third]) for sign in (-1, 1)])
    gradient = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    if is_flat:
        with pytest.raises(NotObservable):
            image_gradient(shifts @ gradient.T, shifts)
    else:
        np.testing.assert_allclose(image_gradient(shifts @ gradient.T, shifts), gradient, rtol=1e-9)


@pytest.mark.parametrize(("angle", "closed"), [(1.1e-4, True), (0.9e-4, False)])
def test_nearly_parallel_rows_use_singular_values(monkeypatch, angle, closed):
    """Rows parallel or opposite within 1e-4 rad are left to the general method."""
    asked = []
    monkeypatch.setattr(closed_form, "nearest_rotation", lambda raw: asked.append(raw) or nearest_rotation(raw))
    k1 = np.array([1.0, 0.0, 0.0])
    for sign in (1, -1):
        k2 = sign * np.array([np.cos(angle), np.sin(angle), 0.0])
        raw = np.stack([k1, k2, np.cross(k1, k2)])
        found = closed_form._nearest_rotations(raw)
        np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-9)
    assert len(asked) == (0 if closed else 2)
    assert closed_form._nearest_rotations(np.zeros((0, 3, 3))).shape == (0, 3, 3)
