"""Tests of finding stations: intervals with a still camera before a shifted LED."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.ends import with_eye, with_hand

from basecal.cell import Unknown
from basecal.errors import NotObservable
from basecal.estimation.axis_shift.stations import Station, _station, find_stations, fuse_bases, task_weights
from basecal.estimation.problem.build import build_problem
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Camera
from basecal.simulation.shifts import simulate_shifts

LENS = Camera("pinhole", np.array([800.0, 810.0, 640.0, 360.0]), (1280, 720))
BASE = SE3.from_rotvec([0.1, -0.2, 0.3], [1.2, 0.1, -0.05])
EYE = SE3.from_rotvec([[0.0, 0.0, 0.1], [0.05, 0.0, 0.2]], [[0.1, 0.0, 0.0], [0.1, 0.05, 0.0]])
SEEN = SE3.from_rotvec([[0.1, 0.2, 0.0], [0.0, 0.1, -0.1]], [[0.0, 0.0, 0.8], [0.0, 0.0, 0.9]])


def problem_of_two_stations(shift_m=0.01, two_sided=True):
    """A problem of two stations, and their cameras."""
    made = simulate_shifts(BASE, EYE, BASE.inverse() @ EYE @ SEEN, LENS, shift_m, two_sided)
    problem, _ = build_problem(made.cell, made.recording)
    return problem, made.cameras


def perturb_view(problem, view, camera=(0.0,) * 6, light=(0.0,) * 6):
    """The problem with the poses of one view changed."""
    (group,) = problem.groups
    change = np.zeros((2, len(group), 6))
    change[0, view], change[1, view] = camera, light
    eye, hand = (end.base_from_flange @ SE3.exp(off) for end, off in zip(group.ends, change, strict=True))
    return problem.with_groups([with_hand(with_eye(group, base_from_flange=eye), base_from_flange=hand)])


def test_each_camera_pose_is_a_station():
    """Two stations are found, each with its samples, its shifts from the middle, and nearly the true base."""
    problem, cameras = problem_of_two_stations(shift_m=1e-3)
    found = find_stations(problem, cameras)
    assert [sorted(s.samples.tolist()) for s in found] == [list(range(7)), list(range(7, 14))]
    for station, eye in zip(found, (EYE[0], EYE[1]), strict=True):
        np.testing.assert_allclose(station.shifts_in_led[0], 0.0)
        np.testing.assert_allclose(station.rms_shift_m, 1e-3)
        np.testing.assert_allclose(station.eye_base_from_camera.matrix, eye.matrix, atol=1e-12)
        off = (BASE.inverse() @ station.base()).log()
        assert np.abs(off).max() < 2e-3
        np.testing.assert_allclose(station.predicted_px(BASE), station.led_px, atol=1e-9)


@pytest.mark.parametrize(("shift", "views"), [(1.9e-4, [7, 7]), (2.1e-4, [4, 7])])
def test_camera_is_still_within_arm_repeatability(shift, views):
    """A motion of 0.2 mm ends a station, and three views after it do not form another one."""
    problem, cameras = problem_of_two_stations()
    found = find_stations(perturb_view(problem, [4, 5, 6], camera=[shift, 0, 0, 0, 0, 0]), cameras)
    assert [len(station.samples) for station in found] == views


@pytest.mark.parametrize(("turn", "whole"), [(0.9e-3, True), (1.1e-3, False)])
@pytest.mark.parametrize("who", ["camera", "light"])
def test_rotations_end_a_station(turn, whole, who):
    """A rotation of 1 mrad of camera or LED ends a station."""
    problem, cameras = problem_of_two_stations()
    found = find_stations(perturb_view(problem, [5, 6], **{who: [0, 0, 0, turn, 0, 0]}), cameras)
    assert (len(found[0].samples) == 7) == whole


def test_station_needs_three_directions():
    """Three views, or coplanar shifts, form no station, and the error suggests what to do."""
    problem, cameras = problem_of_two_stations(two_sided=False)
    (group,) = problem.groups
    three = problem.with_groups([group.take(np.array([0, 1, 2]))])
    (flat,) = perturb_view(problem, [3], light=[0.0, 0.0, -0.01, 0, 0, 0]).groups
    for none in (three, problem.with_groups([flat.take(np.arange(4))])):
        with pytest.raises(NotObservable, match="no station found"):
            find_stations(none, cameras)


def test_mounts_of_camera_and_led_must_be_known():
    """The mounts of camera and LED have to be fixed or have a prior."""
    problem, cameras = problem_of_two_stations()
    (group,) = problem.groups
    for name in (group.eye.mount, group.hand.mount):
        unknown = replace(problem, unknowns={**problem.unknowns, name: Unknown("free", SE3.identity())})
        with pytest.raises(NotObservable, match=f"needs {name}: state it as fixed or prior"):
            find_stations(unknown, cameras)
        roughly = Unknown("prior", SE3.identity(), np.ones(6))
        assert len(find_stations(replace(problem, unknowns={**problem.unknowns, name: roughly}), cameras)) == 2


def test_bases_are_fused_by_weight():
    """Translations and rotations are averaged by weight, and a weight of zero has no effect."""
    one, two = SE3.from_rotvec([0, 0, 0.1], [0, 0, 0]), SE3.from_rotvec([0, 0, 0.3], [1, 0, 0])
    middle = fuse_bases([one, two], [2.0, 2.0])
    np.testing.assert_allclose(middle.rotvec, [0, 0, 0.2], atol=1e-12)
    np.testing.assert_allclose(middle.translation, [0.5, 0, 0])
    np.testing.assert_allclose(fuse_bases([one, two], [3.0, 1.0]).translation, [0.25, 0, 0])
    np.testing.assert_allclose(fuse_bases([one, two], [0.0, 1.0]).matrix, two.matrix, atol=1e-12)


def test_base_for_a_task_is_nearest_or_weighted():
    """The base is that of the nearest station, or the mean weighted by the squared inverse distance."""
    problem, cameras = problem_of_two_stations()
    first, second = find_stations(problem, cameras)
    bases = [first.base(), second.base()]
    lights = [(b @ s.hand_base_from_led).translation for b, s in zip(bases, (first, second), strict=True)]
    task = lights[1] + [0.0, 0.0, 0.01]
    np.testing.assert_array_equal(task_weights([first, second], task, is_nearest=True), [0.0, 1.0])
    weights = [np.linalg.norm(light - task) ** -2 for light in lights]
    np.testing.assert_allclose(task_weights([first, second], task, is_nearest=False), weights)
    at_first = task_weights([first, second], lights[0], is_nearest=False)
    np.testing.assert_allclose(fuse_bases(bases, at_first).matrix, bases[0].matrix, atol=1e-9)


SHIFTS = np.array([[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.03, 0.0], [0.0, 0.0, 0.06]])
FOCAL = np.array([800.0, 400.0])


def make_station(led_px):
    """A station that saw these pixels at `SHIFTS`."""
    return Station("camera", "light", np.arange(4), FOCAL, led_px, SHIFTS, EYE[0], SEEN[1])


def test_station_predicts_its_pixels():
    """Each shift of the LED is projected through base and camera pose with both focal lengths.

    Shifts have an rms of 4 cm.
    """
    matrix = np.linalg.inv(EYE[0].matrix) @ BASE.matrix @ SEEN[1].matrix
    at = SHIFTS @ matrix[:3, :3].T + matrix[:3, 3]
    found = make_station(np.zeros((4, 2)))
    np.testing.assert_allclose(found.predicted_px(BASE), np.stack([800 * at[:, 0], 400 * at[:, 1]], 1) / at[:, 2:])
    assert found.rms_shift_m == pytest.approx(np.sqrt((0.02**2 + 0.03**2 + 0.06**2) / 3))


def test_closed_form_is_exact_for_shifts_without_depth():
    """For an LED 0.5 m away whose image moves as if depth did not change, the pose is exact to the last digit."""
    pose = SE3.from_rotvec([0.3, -0.2, 0.4], [0.05, -0.1, 0.5])
    first = FOCAL * pose.translation[:2] / 0.5
    px = first + FOCAL * (SHIFTS @ pose.rotation[:2].T) / 0.5
    found = make_station(px).camera_from_led()
    np.testing.assert_allclose(found.matrix, pose.matrix, atol=1e-12)
    several = make_station(np.zeros((4, 2))).camera_from_led(np.stack([px, px]))
    np.testing.assert_allclose(several.matrix, np.stack([pose.matrix] * 2), atol=1e-12)
    base = EYE[0].matrix @ pose.matrix @ np.linalg.inv(SEEN[1].matrix)
    np.testing.assert_allclose(make_station(px).base().matrix, base, atol=1e-12)


def test_shifts_start_from_the_view_nearest_to_their_middle():
    """Shifts are in the axes of the LED, wherever it is. Three views, or coplanar shifts, are no station."""
    (group,) = problem_of_two_stations()[0].groups
    turned = SE3.from_rotvec([0.0, 0.0, np.pi / 2], [5.0, 6.0, 7.0])
    shifts = np.array([[0.2, 0, 0], [0, 0.3, 0], [0.01, 0, 0], [0, 0, 0.25], [-0.2, 0, 0], [0, -0.3, 0], [0, 0, -0.25]])
    lights = SE3.stack([SE3(turned.rotation, turned.translation + shift) for shift in shifts])
    cameras, px, views = SE3.identity((7,)), np.arange(14.0).reshape(7, 2), np.arange(7)
    found = _station(group, views, px, cameras, lights, FOCAL)
    order = [2, 0, 1, 3, 4, 5, 6]
    assert found.samples.tolist() == group.sample[order].tolist()
    np.testing.assert_array_equal(found.led_px, px[order])
    np.testing.assert_allclose(found.shifts_in_led, (shifts - shifts[2])[order] @ turned.rotation, atol=1e-12)
    assert found.hand_base_from_led.translation.tolist() == lights[2].translation.tolist()
    for some in (views[:3], np.array([0, 1, 2, 4, 5])):
        assert _station(group, some, px[some], cameras[some], lights[some], FOCAL) is None
    assert _station(group, views[:4], px[:4], cameras[:4], lights[:4], FOCAL) is not None


def test_targets_with_several_points_have_no_stations():
    """An LED that is not measured in pixels has none either, but an LED beside them has its own."""
    problem, cameras = problem_of_two_stations()
    (group,) = problem.groups
    of = group.measurement
    twice = {name: np.repeat(getattr(of, name), 2, axis=1) for name in ("pixels", "seen", "stated", "weight")}
    board = replace(group, measurement=replace(of, points_in_target=np.zeros((2, 3)), **twice))
    ones = np.ones((len(group), 6))
    poses = replace(group, measurement=PoseMeasurement(SE3.identity((len(group),)), ones, ones))
    for other in (board, poses):
        with pytest.raises(NotObservable, match="no station found"):
            find_stations(problem.with_groups([other]), cameras)
        assert len(find_stations(problem.with_groups([other, group]), cameras)) == 2
