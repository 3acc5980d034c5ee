"""Tests of `impossible_units`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.shared.rewriting import resized, scaled, with_joints, with_points, with_robots, with_targets

from basecal.accuracy.input_screening.units import (
    _sigma_findings,
    count_searchable_images,
    impossible_units,
    needs_search,
)
from basecal.cell import PointObservation, PoseObservation, Recording, RobotState, Sample
from basecal.effects.faces.effect import FIX
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate


def codes(cell, recording):
    return [(each.code, each.severity, each.about) for each in impossible_units(cell, recording)]


@pytest.mark.parametrize("kept", [{}, {"joints": True}, {"target": "pose"}, {"target": "points3d"}, {"target": "led"}])
def test_correct_cell_has_no_finding(kept):
    """Correct poses, joints, points and LEDs have no finding."""
    made = simulate(Scenario(samples=5, **kept), 3)
    assert codes(made.cell, made.recording) == []
    assert codes(made.cell, Recording()) == []


@pytest.mark.parametrize("robots", [("hand",), ("eye", "hand")])
def test_joints_in_degrees_are_found(robots):
    """Joints in degrees, of one robot or all, rotate farther than joints can, and as degrees would not."""
    made = simulate(Scenario(samples=8, joints=True), 0)
    recording = made.recording
    for name in robots:
        recording = with_joints(recording, name, 180 / np.pi)
    assert codes(made.cell, recording) == [("angle-unit", "error", robots)]


def test_endless_wrist_is_no_unit_error():
    """A single joint that rotated many times is no unit error."""
    made = simulate(Scenario(samples=5, joints=True), 0)
    turned = [
        replace(s, robots={**s.robots, "hand": RobotState(joints_rad=s.robots["hand"].joints_rad + 40 * np.eye(6)[5])})
        for s in made.recording.samples
    ]
    assert codes(made.cell, replace(made.recording, samples=tuple(turned))) == []


def test_robots_in_millimetres_are_named():
    """Each robot in millimetres is named, and no other."""
    made = simulate(Scenario(samples=5), 0)
    one = with_robots(made.recording, {"hand": scaled(1000)})
    assert codes(made.cell, one) == [("length-unit", "error", ("hand",))]
    (both,) = impossible_units(made.cell, with_robots(made.recording, dict.fromkeys(("eye", "hand"), scaled(1000))))
    assert both.about == ("eye", "hand")
    assert both.message.startswith("The poses of eye and hand are in millimetres: a flange is ")


def test_observations_in_millimetres_are_named():
    """Observed poses, 3-D points and the board size in millimetres are named."""
    poses = simulate(Scenario(samples=5, target="pose"), 0)
    assert codes(poses.cell, with_targets(poses.recording, scaled(1000))) == [("length-unit", "error", ())]
    points = simulate(Scenario(samples=5, target="points3d"), 0)
    assert codes(points.cell, with_points(points.recording, 1000)) == [("length-unit", "error", ())]
    board = simulate(Scenario(samples=5), 0)
    assert codes(resized(board.cell, {"board": 1000.0}), board.recording) == [("board-size", "error", ("board",))]


@pytest.mark.parametrize(("end", "off_rad", "is_reported"), [("lower", -0.09, True), ("lower", -0.11, False),
                                                      ("upper", 0.09, True), ("upper", 0.11, False)])  # fmt: skip
def test_degrees_must_be_within_urdf_limits(end, off_rad, is_reported):
    """Joints count as degrees only if these are within a tenth of a radian of the URDF limits."""
    made = simulate(Scenario(samples=6, joints=True), 0)
    chain = made.cell.robots["hand"].chain
    narrow = replace(chain, lower=np.full(6, -2.0), upper=np.full(6, 2.0))
    cell = replace(made.cell, robots={**made.cell.robots, "hand": replace(made.cell.robots["hand"], chain=narrow)})
    joints = np.degrees(np.array([[1.5, -1.5, 1.0, 0.5, 0.2, 0.1]] * 6))
    joints[2, 3] = np.degrees(getattr(narrow, end)[3] + off_rad)
    samples = [
        replace(s, robots={**s.robots, "hand": RobotState(joints_rad=q)})
        for s, q in zip(made.recording.samples, joints, strict=True)
    ]
    assert bool(codes(cell, replace(made.recording, samples=tuple(samples)))) == is_reported


def record_distances(far_m, distance_m=1.0, kind="pose"):
    """Three samples of a flange and a target at these distances, and one of both a kilometre away."""
    samples = []
    for k, (far, distance) in enumerate(((far_m, distance_m), (far_m, distance_m), (far_m, distance_m), (1e3, 1e3))):
        place = np.array([0.0, 0.0, distance])
        seen = (
            PoseObservation("wrist", "board", SE3(np.eye(3), place))
            if kind == "pose"
            else PointObservation("wrist", "board", np.arange(2), np.array([place - 0.1, place + 0.1]))
        )
        samples.append(
            Sample(k, robots={"hand": RobotState(SE3(np.eye(3), np.array([0.0, far, 0.0])))}, observations=(seen,))
        )
    return Recording(tuple(samples))


@pytest.mark.parametrize("kind", ["pose", "points"])
def test_lengths_above_fifty_metres_are_no_metres(kind):
    """Median distances of flanges and targets above 50 m are in another unit.

    The advice has the values in likely units.
    """
    cell = simulate(Scenario(samples=1), 0).cell
    assert codes(cell, record_distances(49.9, 49.9, kind)) == []
    (flange, target) = impossible_units(cell, record_distances(51.2, 53.4, kind))
    assert flange.about == ("hand",)
    assert flange.what == "The poses of hand are in another unit: a flange is 51 m from its base."
    who = "The observed poses" if kind == "pose" else "The observed 3-D points"
    assert target.what == f"{who} are in another unit: a target is 53 m away."
    assert flange.do == ("Convert lengths to metres: 51 mm are 0.051 m, 51 cm are 0.51 m, 51 inch are 1.3 m.",)
    assert target.do == ("Convert lengths to metres: 53 mm are 0.053 m, 53 cm are 0.53 m, 53 inch are 1.4 m.",)
    (flange, target) = impossible_units(cell, record_distances(320, 310, kind))
    assert " in millimetres: " in flange.what
    assert " in millimetres: " in target.what
    assert target.do == ("Divide lengths by 1000 to convert them to metres.",)
    assert flange.do == (*target.do, FIX)


@pytest.mark.parametrize(("far", "words"), [(1e8, "1e+08"), (1e300, "1e+300")])
def test_extreme_distances_suggest_no_unit(far, words):
    """Extreme distances, up to the floating-point range, suggest no unit and raise no overflow warning."""
    cell = simulate(Scenario(samples=1), 0).cell
    flange, target = impossible_units(cell, record_distances(far, far))
    assert target.what == f"The observed poses are in another unit: a target is {words} m away."
    assert flange.what == f"The poses of hand are in another unit: a flange is {words} m from its base."
    assert flange.do == ("State lengths in metres.",)


def test_single_samples_in_other_unit_are_named():
    """Single samples in another unit are named, with the unit if it is certain."""
    for reach, unit in ((160.0, "another unit"), (812.0, "millimetres")):
        cell, recording = simulate(Scenario(samples=1), 0).cell, Recording()
        for far in (1.0, 1.0, reach):
            recording = replace(
                recording, samples=(*recording.samples, *record_distances(far, 1.0, "pose").samples[:1])
            )
        (found,) = impossible_units(cell, recording)
        assert found.what == f"Sample 0 of hand looks like {unit} among metres."


@pytest.mark.parametrize(("size_m", "is_reported"), [(19.9, False), (20.1, True)])
def test_targets_are_at_most_twenty_metres_wide(size_m, is_reported):
    """Targets wider than 20 m are an error if they are seen or searched in images."""
    made = simulate(Scenario(samples=3), 0)
    width = float(np.ptp(made.cell.targets["board"].target.points, axis=0).max())
    cell = resized(made.cell, {"board": size_m / width})
    found = impossible_units(cell, made.recording)
    assert [f.about for f in found] == ([("board",)] if is_reported else [])
    assert not is_reported or found[0].what == "The size of board is in another unit: it is stated to be 20 m wide."
    blind = [replace(s, observations=()) for s in made.recording.samples]
    assert impossible_units(cell, Recording(tuple(blind))) == []
    imaged = [replace(s, images={"wrist": "a.png"}) for s in blind]
    assert bool(impossible_units(cell, Recording(tuple(imaged)))) == is_reported


@pytest.mark.parametrize(("turn_rad", "is_reported"), [(6.9, False), (6.95, True)])
def test_two_joints_beyond_a_turn_are_in_degrees(turn_rad, is_reported):
    """Two joints beyond 2.2 half turns are in degrees, and the message states the largest value."""
    made = simulate(Scenario(samples=4, joints=True), 0)
    joints = np.array([0.0, turn_rad, -turn_rad, 0.0, 0.0, 0.0])
    samples = [replace(s, robots={**s.robots, "hand": RobotState(joints_rad=joints)}) for s in made.recording.samples]
    found = impossible_units(made.cell, Recording(tuple(samples)))
    assert [f.what for f in found] == (["The joints of hand are in degrees: they reach 6.95."] if is_reported else [])


@pytest.mark.parametrize(("ratio", "found"), [(0.9e6, []), (1.1e6, [("sigma-range", "error", ())])])
@pytest.mark.parametrize("target", ["charuco", "points3d", "pose"])
def test_sigmas_differing_by_a_million_are_error(target, ratio, found):
    """Sigmas that differ by a factor of a million are an error: the information of the larger is lost in rounding."""
    made = simulate(Scenario(samples=5, target=target), 3)
    fields = {"charuco": "sigma_px", "points3d": "sigma_m", "pose": "sigma"}

    def with_sigma(observation, value):
        count = len(getattr(observation, "ids", range(6)))
        return replace(observation, **{fields[target]: np.full(count, value)})

    samples = [
        replace(s, observations=tuple(with_sigma(o, 1e-3 * (ratio if k == 2 else 1)) for o in s.observations))
        for k, s in enumerate(made.recording.samples)
    ]
    assert list(dict.fromkeys(codes(made.cell, Recording(tuple(samples))))) == found


def test_images_are_searched_only_with_plausible_poses(tmp_path) -> None:
    """Images are searched if the poses are plausible, not if they are in millimetres or there are no images."""
    made = simulate(Scenario(samples=4), 1)
    shown = [replace(sample, images={"wrist": "images/wrist/0.png"}) for sample in made.recording.samples]
    assert not needs_search(made.cell, made.recording)
    assert needs_search(made.cell, Recording(tuple(shown)))

    def in_millimetres(state):
        """The robot state with its pose in millimetres."""
        pose = state.base_from_flange
        return replace(state, base_from_flange=SE3(pose.rotation, 1e3 * pose.translation))

    wrong = [replace(s, robots={name: in_millimetres(of) for name, of in s.robots.items()}) for s in shown]
    assert not needs_search(made.cell, Recording(tuple(wrong)))


def test_searchable_images_need_lens_and_target() -> None:
    """Images by a camera with a lens count as searchable, but not for a target that no image shows."""
    for target, count in (("charuco", 4), ("pose", 0)):
        made = simulate(Scenario(samples=4, target=target), 1)
        shown = [replace(sample, images={"wrist": "images/wrist/0.png"}) for sample in made.recording.samples]
        assert count_searchable_images(made.cell, Recording(tuple(shown))) == count
        assert count_searchable_images(made.cell, made.recording) == 0


@pytest.mark.parametrize(
    ("shift_m", "turn_rad", "units"),
    [(1e-4, 900.0, []), ([1e-7, 1.0, 1.0], 1e-3, ["m"]), (1e-3, [1e-7, 1.0, 1.0], ["rad"])],
)
def test_translation_and_rotation_sigmas_are_compared_separately(shift_m, turn_rad, units):
    """Translation and rotation sigmas are compared separately over all three axes; unstated sigmas are ignored."""
    sigma = np.concatenate([np.broadcast_to(each, 3) for each in (shift_m, turn_rad)])
    seen = PoseObservation("wrist", "board", SE3.identity(), sigma), PoseObservation("wrist", "board", SE3.identity())
    found = [each.what for each in _sigma_findings(Recording((Sample(0, observations=seen), Sample(1))))]
    assert [what.removesuffix(".").split()[-1] for what in found] == units
    assert all("from 1e-07 to 1 " in what for what in found)
