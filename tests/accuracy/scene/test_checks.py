"""Tests of the findings about an answer from a scene."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.accuracy.scene.checks import (
    FEWEST_VIEWS,
    base_findings,
    camera_findings,
    describe_scatter,
    direction_findings,
    join_findings,
    joint_findings,
    kept_findings,
    missing_base_findings,
    motion_findings,
    points_finding,
)
from basecal.accuracy.scene.joining import Join
from basecal.accuracy.scene.one_camera import OneCamera
from basecal.accuracy.scene.shared_errors import SceneMotion
from basecal.cell import Cell, Robot, Unknown
from basecal.estimation.scene.views import Tracks
from basecal.fields.parameters import Parameters
from basecal.geometry import SE3
from scene_images import images_of_scene, solved_camera
from scene_points import made_scene

NAMES = ("left_eye", "right_eye")


def sightings(count: int) -> Tracks:
    """The given number of image points."""
    none = np.zeros(count, dtype=np.int64)
    return Tracks(none, none, np.zeros((count, 2)), none)


GOOD = Join(SE3.identity(), sightings(400), 9.0, 0.9, rival=0.2)


@pytest.fixture(scope="module")
def good() -> OneCamera:
    """Twelve images that show enough."""
    scene = made_scene(1, count=12, points=120)
    return solved_camera(scene, images_of_scene(scene), 0)


def codes_and_severities(one: OneCamera) -> list[tuple[str, str]]:
    """Codes and severities of a camera's findings."""
    return [(each.code, each.severity) for each in camera_findings("eye", one)]


def test_good_images_have_no_finding(good: OneCamera) -> None:
    """Twelve views with texture and correct poses have no finding."""
    assert codes_and_severities(good) == []


def test_camera_findings_by_cause(good: OneCamera) -> None:
    """Lack of views, pairs, poses and points is reported in this order, each with advice."""
    assert good.start is not None
    few = replace(good, rows=np.arange(FEWEST_VIEWS - 1))
    fewer = replace(good, rows=np.arange(FEWEST_VIEWS))
    assert codes_and_severities(few) == [("too-few-samples", "error")]
    assert codes_and_severities(fewer) == [("few-images", "warning")]
    assert codes_and_severities(replace(good, matched_pairs=9)) == [("scene-texture", "error")]
    assert codes_and_severities(replace(good, start=None, fit=None)) == [("scene-texture", "error")]
    assert codes_and_severities(replace(good, start=replace(good.start, median_px=30.0))) == [("poor-fit", "error")]
    assert codes_and_severities(replace(good, start=replace(good.start, front=0.2))) == [("poor-fit", "error")]
    assert codes_and_severities(replace(good, fit=None)) == [("scene-texture", "error")]
    assert all(finding.do for one in (few, fewer) for finding in camera_findings("eye", one))


def test_join_findings_by_cause() -> None:
    """Missing or chance agreement, a rival, few points or few images refuse a join."""

    def codes(found: Join | None, shared: int = 300, of_each: tuple[int, int] = (12, 12)) -> list[str]:
        return [each.code for each in join_findings(NAMES, found, shared, of_each)]

    assert codes(GOOD) == []
    assert codes(None) == ["scene-overlap"]
    assert codes(replace(GOOD, sightings=sightings(20))) == ["scene-overlap"]
    assert codes(replace(GOOD, sightings=sightings(900), by_chance=500.0)) == ["scene-overlap"]
    assert codes(replace(GOOD, rival=0.4)) == ["scene-rival"]
    assert codes(replace(GOOD, common=0.3)) == ["scene-rival"]
    assert codes(GOOD, shared=99) == ["scene-overlap"]
    assert codes(GOOD, of_each=(3, 12)) == codes(GOOD, of_each=(12, 3)) == ["scene-overlap"]
    assert codes(GOOD, shared=100, of_each=(4, 4)) == []
    edge = replace(GOOD, by_chance=100.0)
    assert codes(replace(edge, sightings=sightings(400))) == codes(replace(edge, sightings=sightings(401))) == []
    assert codes(replace(edge, sightings=sightings(399))) == ["scene-overlap"]
    assert codes(replace(edge, sightings=sightings(1249), by_chance=500.0)) == ["scene-overlap"]
    assert codes(replace(edge, sightings=sightings(1250), by_chance=500.0)) == []
    assert (
        codes(replace(GOOD, rival=0.33)) == codes(replace(GOOD, common=0.46)) == codes(replace(GOOD, common=None)) == []
    )
    assert codes(replace(GOOD, rival=0.34)) == codes(replace(GOOD, common=0.44)) == ["scene-rival"]


def test_scene_motion_is_warning_below_one_in_thousand() -> None:
    """A motion with a chance below one in a thousand is a warning with its length, as steady or at a sample."""
    steady = SceneMotion(1e-4, None, 0.0095, np.zeros(6))
    assert list(motion_findings(steady._replace(chance=0.01))) == []
    (found,) = motion_findings(steady)
    assert (found.code, found.severity) == ("scene-moved", "warning")
    assert "9.5 mm from the first sample to the last" in found.what
    (sudden,) = motion_findings(steady._replace(first_sample=7))
    assert "9.5 mm at sample 7" in sudden.what


def test_lost_shared_points_refuse_join() -> None:
    """A join is refused if fewer than half of its points, or fewer than a hundred, are kept: they were not shared."""
    for before, after in ((300, 200), (300, 150), (200, 100)):
        assert list(kept_findings(NAMES, before, after)) == []
    for before, after in ((300, 149), (150, 99)):
        assert [each.code for each in kept_findings(NAMES, before, after)] == ["scene-rival"]


def test_unknown_directions_are_refused() -> None:
    """Along any axis, a sigma above 10 mm or 0.5 deg is a warning, above 100 mm or 5 deg an error."""
    turned = SE3.from_rpy((0.4, 0.5, 0.6), (0, 0, 0)).rotation

    def codes(shift_m: float, turn_deg: float) -> list[str]:
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = turned @ np.diag([1e-8, 1e-8, shift_m**2]) @ turned.T
        covariance[3:, 3:] = turned @ np.diag([1e-8, 1e-8, np.radians(turn_deg) ** 2]) @ turned.T
        return [each.code for each in direction_findings("mount", covariance, "")]

    assert codes(9e-3, 0.4) == []
    assert codes(11e-3, 0.4) == codes(9e-3, 0.6) == codes(0.09, 4.9) == ["weak-direction"]
    assert codes(0.11, 0.4) == codes(9e-3, 5.1) == ["unobservable-direction"]


def test_scattering_poses_are_named_as_cause() -> None:
    """A robot whose poses scatter beyond 2 mm or 3 mrad is named with its noise.

    A weak direction then advises to check it first.
    """
    scene = made_scene(1, arms=2, count=12, points=120)
    fit = solved_camera(scene, images_of_scene(scene), 0).adjustment
    for sound in (np.full(6, 1e-3), np.repeat([1.9e-3, 2.9e-3], 3)):
        assert describe_scatter(replace(fit, stop_sigma=np.tile(sound, (12, 1)))) == ""
    loose = np.tile(np.repeat([2.1e-3, 1e-3], 3), (12, 1))
    assert describe_scatter(replace(fit, stop_sigma=loose)) == "Poses of left scatter by 2.1 mm and 0.057 deg."
    scatter = describe_scatter(replace(fit, stop_sigma=np.tile(np.repeat([1e-3, 8e-3], 3), (12, 1))))
    assert scatter == "Poses of left scatter by 1.0 mm and 0.46 deg."
    (found,) = direction_findings("mount", np.diag(np.full(6, 1e-3)), scatter)
    assert found.why == scatter
    assert "joint offsets" in found.do[0]
    (plain,) = direction_findings("mount", np.diag(np.full(6, 1e-3)), "")
    assert (plain.why, plain.do) == ("", found.do[1:])


def test_joint_parameters_are_not_estimated_from_scene() -> None:
    """A scene uses recorded poses with their noise, so the robot and its free joint parameters are named.

    A parameter with a prior is an info; a free one was requested and is missing from the answer.
    """
    arms = {
        "left": Robot("left", parameters={"joint_offsets": Parameters(status="free")}),
        "right": Robot("right", parameters={"joint_offsets": Parameters()}),
    }
    (found,) = joint_findings(Cell("left", arms, {}, {}, {}), ["left", "right"])
    assert (found.code, found.severity, found.about) == ("scene-joints", "warning", ("left",))
    assert found.what.startswith("The joint offsets of left are not estimated from a scene")
    known = {"left": Robot("left", parameters={"joint_offsets": Parameters(status="prior")})}
    assert [each.severity for each in joint_findings(Cell("left", known, {}, {}, {}), ["left"])] == ["info"]


def test_missing_bases_are_errors() -> None:
    """Each free base of a robot without images is an error; the reference and a fixed base are not."""
    robots = {name: Robot(name) for name in ("left", "right", "third")}
    cell = Cell("left", robots, {"right": Unknown(), "third": Unknown("fixed", SE3.identity())}, {}, {})
    assert list(missing_base_findings(cell, ["left", "right"])) == []
    (found,) = missing_base_findings(cell, ["left"])
    assert (found.code, found.severity, found.about) == (
        "unobservable-direction",
        "error",
        ("left_base_from_right_base",),
    )


def test_points_are_counted_with_shared_ones() -> None:
    """Points are counted with those seen by two cameras; two views of one camera do not make a point shared."""
    scene = made_scene(1, arms=2, count=12, points=120)
    fit = solved_camera(scene, images_of_scene(scene), 0).adjustment
    views = replace(scene.views, camera=np.repeat([0, 1], 12))
    tracks = Tracks(np.array([0, 1, 0, 12, 13, 14]), np.array([0, 0, 1, 1, 2, 2]), np.zeros((6, 2)), np.arange(6))
    found = points_finding(replace(fit, views=views, tracks=tracks))
    assert found.what == "3 points of the scene in 24 images are used. Two cameras or more see 1 of the points."
    assert (found.code, found.severity) == ("scene-joined", "info")
    alone = replace(views, cameras=views.cameras[:1], camera=0 * views.camera)
    assert (
        points_finding(replace(fit, views=alone, tracks=tracks)).what == "3 points of the scene in 24 images are used."
    )


@pytest.mark.parametrize(("sigma_m", "code"), [(0.019, ""), (0.5, "not-validated")])
def test_coarse_base_evidence_does_not_validate(sigma_m: float, code: str) -> None:
    """Agreement with coarse evidence, which chance explains in a room, does not validate a base."""
    found = base_findings("left_base_from_right_base", np.full(3, 1e-3), sigma_m**2 * np.eye(3))
    assert [each.code for each in found] == [code] * bool(code)


@pytest.mark.parametrize(("off_m", "code"), [(0.1, "scene-rival"), (0.02, ""), (None, "not-validated")])
def test_base_evidence_contradicts_or_confirms(off_m: float | None, code: str) -> None:
    """Other evidence of a base contradicts it at ten sigmas and confirms it at two.

    Without any, the base rests on the scene.
    """
    offset = None if off_m is None else np.array([off_m, 0.0, 0.0])
    found = [each.code for each in base_findings("left_base_from_right_base", offset, 1e-4 * np.eye(3))]
    assert found == [code] * bool(code)


@pytest.mark.parametrize(
    ("images", "pairs", "points", "codes"),
    [
        (7, 10, 60, ["too-few-samples"]),
        (8, 10, 60, ["few-images"]),
        (11, 10, 60, ["few-images"]),
        (12, 10, 60, []),
        (12, 9, 60, ["scene-texture"]),
        (12, 10, 59, ["scene-texture"]),
    ],
)
def test_camera_needs_images_pairs_and_points(images: int, pairs: int, points: int, codes: list[str]) -> None:
    """A camera needs eight images, ten pairs and sixty points; fewer than twelve images are few."""
    start = SimpleNamespace(misfit=(False, 0.5), is_behind=False, median_px=0.5)
    fit = SimpleNamespace(tracks=SimpleNamespace(count=points))
    one = SimpleNamespace(rows=np.arange(images), fit=fit, start=start, matched_pairs=pairs)
    found = list(camera_findings("eye", one))  # type: ignore[arg-type]
    assert [each.code for each in found] == codes
    assert {each.about for each in found} <= {("eye",)}
