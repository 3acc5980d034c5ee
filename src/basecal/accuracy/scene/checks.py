"""Checks of a calibration from a scene: findings with their cause and remedy.

The limits are assumed: correct scenes of the recordings that were tried pass them by far. They fail in a room in which
everything with texture is copied (benchmarks.scene). A base from a scene alone is therefore doubtful. The doubt ends if
other evidence of the base, however coarse, agrees with it more closely than chance explains.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from basecal.accuracy.model_comparison.nested_models import compare_nested_models, compare_places
from basecal.accuracy.phrases.recorded_robots import advise_check
from basecal.accuracy.scene.joining import Join
from basecal.accuracy.scene.one_camera import MOST_EPIPOLAR_PX, OneCamera
from basecal.accuracy.scene.shared_errors import SceneMotion
from basecal.cell import Cell, Finding
from basecal.errors import count_text
from basecal.estimation.scene.adjust import SceneFit
from basecal.fields.digits import two_digits
from basecal.geometry import Array

FEWEST_VIEWS = 8  # of a camera
_ENOUGH_VIEWS = 12  # with fewer, sigmas are too small
_FEWEST_PAIRS = 10  # of images that share features
_FEWEST_POINTS = 60  # of a camera's own scene
_FEWEST_SHARED = 100  # points that both cameras see
_FEWEST_OF_EACH = 4  # views of each camera that show some of them
_LEAST_SCORE = 30.0  # standard deviations of a count
_LEAST_RATIO = 2.5  # of found points to points found by chance
_RIVAL_SHARE = 1 / 3  # largest evidence of a second transform, relative to the best
_LEAST_COMMON = 0.45  # of places; correct rooms have 1, with each box moved 0.6, two equal object groups 0.13 to 0.29
_LEAST_KEPT = 0.5  # share of the points found in both scenes that the joint adjustment keeps
_WEAK_M, _WEAK_RAD = 0.01, np.radians(0.5)  # sigma along an axis that causes a warning
_STILL_CHANCE = 1e-3  # p-value of a motion below which the scene counts as moved
_LOOSE_M, _LOOSE_RAD = 2e-3, 3e-3  # pose noise above that of arms as delivered (estimation.noise.hyperpriors)
_OPEN_M, _OPEN_RAD = 0.1, np.radians(5.0)  # sigma along an axis that counts as unknown

_PAPER = "Put printed paper or tools on the table, in view of the camera."
SAME_SPOT = "Take about five images with each arm of the same spot, from similar directions."
_OTHER_EVIDENCE = (
    "Measure where the base is to 20 mm, and state it in cell.yaml as a prior with its sigma.",
    "Or let one camera see a board on the other arm, and run `basecal calibrate CELL --scene also`.",
    "Or touch one point with both tools.",
)
_TWO_PLACES = "Check the base in cell.yaml, and whether an object in the scene moved or exists twice."
_MISTAKEN = "Similar objects, or objects that moved between the images, were treated as one."
_TURN = "Rotate the flange about two axes, by 20 deg and more, between images."
_ARM = "Check the robot's joint offsets, its URDF, and that each pose belongs to its image."
_AIM = "Take images that do not all aim at one spot: move the arm along the viewing direction, too."


def drop_target_findings(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Findings of a target search without `few-images`: images of a scene need not show a target."""
    return tuple(each for each in findings if each.code != "few-images")


def camera_findings(name: str, one: OneCamera, joint_robots: Sequence[str] = ()) -> Iterator[Finding]:
    """Findings about one camera's images that are too few, without texture, or inconsistent with the poses.

    Args:
        name: Name of the camera.
        one: The scene from this camera alone.
        joint_robots: The robot that carries it, if its joints were recorded.
    """
    about = (name,)
    if len(one.rows) < FEWEST_VIEWS:
        what = f"{name} has {count_text(len(one.rows), 'image')} with a pose: a scene needs {FEWEST_VIEWS}."
        yield Finding("too-few-samples", "error", about, what, ("Record 15 images and more with each arm.",))
        return
    points = 0 if one.fit is None else one.fit.tracks.count
    if one.start is None or one.matched_pairs < _FEWEST_PAIRS:
        pairs = count_text(one.matched_pairs, "pair")
        what = f"Features match in {pairs} of images of {name}; {_FEWEST_PAIRS} are needed."
        yield Finding("scene-texture", "error", about, what, (_PAPER,), "The scene has too little texture.")
        return
    if one.start.misfit > (False, MOST_EPIPOLAR_PX):
        off = (
            "the scene would lie behind the camera"
            if one.start.is_behind
            else f"features are {two_digits(one.start.median_px)} px off"
        )
        what = f"The poses of {name} do not explain its images: {off}."
        recorded = "joints" if joint_robots else "poses"
        do = f"Check that {recorded} and images have the same times and the same order.", advise_check(joint_robots)
        yield Finding("poor-fit", "error", about, what, do)
        return
    if points < _FEWEST_POINTS:
        seen = count_text(points, "point")
        what = f"{name} sees {seen} of the scene in three images and more; {_FEWEST_POINTS} are needed."
        yield Finding("scene-texture", "error", about, what, (_PAPER,), "The scene has too little texture.")
        return
    if len(one.rows) < _ENOUGH_VIEWS:
        what = f"{len(one.rows)} images of {name} are few: its sigmas may be too small."
        yield Finding("few-images", "warning", about, what, (f"Record {_ENOUGH_VIEWS} images and more.",))


def join_findings(
    names: tuple[str, str], join: Join | None, shared_count: int, of_each: tuple[int, int]
) -> Iterator[Finding]:
    """Findings about the overlap of two cameras' images.

    Args:
        names: Names of the two cameras.
        join: The transform between their scenes and its evidence; None if none was found.
        shared_count: Number of points that both cameras see.
        of_each: Number of views of each camera that show some of these points.
    """
    first, second = names
    if join is None or join.score < _LEAST_SCORE or len(join.sightings) < _LEAST_RATIO * join.by_chance:
        what = f"The images of {first} and {second} show no common part of the scene."
        yield Finding("scene-overlap", "error", names, what, (SAME_SPOT,))
    elif join.rival > _RIVAL_SHARE:
        share = f"{join.rival:.0%}"
        what = f"Two positions of {second} fit its images: the second has {share} of the evidence of the first."
        do = "Remove repeated objects, or add different ones around them.", SAME_SPOT
        yield Finding("scene-rival", "error", names, what, do, "Some objects of the scene look the same.")
    elif join.common is not None and join.common < _LEAST_COMMON:
        what = f"{second} shows the scene of {first} at {join.common:.0%} of the places in its view."
        yield Finding("scene-rival", "error", names, what, (SAME_SPOT,), _MISTAKEN)
    elif shared_count < _FEWEST_SHARED or min(of_each) < _FEWEST_OF_EACH:
        what = (
            f"{first} and {second} share {count_text(shared_count, 'point')}, in {of_each[0]} and {of_each[1]} images."
        )
        why = f"At least {_FEWEST_SHARED} points in {_FEWEST_OF_EACH} images of each are needed."
        yield Finding("scene-overlap", "error", names, what, (SAME_SPOT,), why)


def base_findings(name: str, offset: Array | None, covariance: Array) -> Iterator[Finding]:
    """Findings about the agreement of a base from the scene with other evidence.

    Args:
        name: Name of the base.
        offset: (3,) position by the scene minus position by other evidence [m]; None without other evidence.
        covariance: (3, 3) covariance of `offset` [m^2].
    """
    apart = 0.0 if offset is None else float(offset @ np.linalg.solve(covariance, offset))
    if offset is not None and compare_nested_models(apart, 3).is_taken:
        distance = two_digits(1e3 * float(np.linalg.norm(offset)))
        what = f"The scene and the other evidence disagree about {name} by {distance} mm."
        yield Finding("scene-rival", "error", (name,), what, (_TWO_PLACES,), _MISTAKEN)
    elif offset is None or not compare_places(offset, covariance).is_taken:
        what = f"{name} depends on objects that two cameras see, and on no other evidence."
        yield Finding(
            "not-validated", "warning", (name,), what, _OTHER_EVIDENCE, "Two equal objects would give a wrong base."
        )


def kept_findings(names: tuple[str, str], count_before: int, count_after: int) -> Iterator[Finding]:
    """Findings about points of both scenes that are lost in the joint adjustment."""
    if count_after < _LEAST_KEPT * count_before or count_after < _FEWEST_SHARED:
        what = f"Only {count_after} of {count_before} points that {names[0]} and {names[1]} share fit one scene."
        yield Finding("scene-rival", "error", names, what, (SAME_SPOT,), _MISTAKEN)


def motion_findings(motion: SceneMotion) -> Iterator[Finding]:
    """Finding of a scene that moved during the recording; the covariance then contains the motion."""
    if motion.chance < _STILL_CHANCE:
        when = (
            "from the first sample to the last" if motion.first_sample is None else f"at sample {motion.first_sample}"
        )
        what = f"The scene or the robots moved by {two_digits(1e3 * motion.length_m)} mm {when}."
        do = ("Keep the scene still until the last image is taken.", "Fasten the bases, and let the robots warm up.")
        yield Finding("scene-moved", "warning", (), what, do, "The pose errors change with time.")


def direction_findings(name: str, covariance: Array, scatter: str) -> Iterator[Finding]:
    """Finding of a transform with a large sigma along some axis.

    Args:
        name: Name of the transform.
        covariance: (6, 6) [m, rad].
        scatter: A possible cause in the poses, as a sentence of `describe_scatter`; empty if none.
    """
    shift, turn = (float(np.sqrt(np.linalg.eigvalsh(covariance[part, part])[-1])) for part in (slice(3), slice(3, 6)))
    how = f"{two_digits(1e3 * shift)} mm and {two_digits(np.degrees(turn))} deg along an axis (1 sigma)"
    severity: Literal["error", "warning"]
    if shift > _OPEN_M or turn > _OPEN_RAD:
        code, severity = "unobservable-direction", "error"
    elif shift > _WEAK_M or turn > _WEAK_RAD:
        code, severity = "weak-direction", "warning"
    else:
        return
    do = (_ARM, _TURN, _AIM) if scatter else (_TURN, _AIM)
    yield Finding(code, severity, (name,), f"{name} is determined only to {how}.", do, scatter)


def describe_scatter(fit: SceneFit) -> str:
    """Sentences about robots whose pose noise exceeds that of a sound arm; empty if there are none."""
    found = []
    for k, robot in enumerate(fit.views.robots):
        shift, turn = fit.stop_sigma[fit.views.stop_robot == k][0, ::3]
        if shift > _LOOSE_M or turn > _LOOSE_RAD:
            found.append(
                f"Poses of {robot} scatter by {two_digits(1e3 * shift)} mm and {two_digits(np.degrees(turn))} deg."
            )
    return " ".join(found)


def points_finding(fit: SceneFit) -> Finding:
    """Finding with the number of points used, and the number that two cameras or more see."""
    tracks = fit.tracks
    seen = np.unique(np.column_stack([tracks.point, fit.views.camera[tracks.view]]), axis=0)
    shared = int(np.count_nonzero(np.bincount(seen[:, 0]) > 1))
    what = f"{tracks.count} points of the scene in {len(fit.views)} images are used."
    also = f" Two cameras or more see {shared} of the points." if len(fit.views.cameras) > 1 else ""
    return Finding("scene-joined", "info", (), what + also)


def joint_findings(cell: Cell, robots: Sequence[str]) -> Iterator[Finding]:
    """Findings of robot parameters that a scene does not estimate; a warning if one of them is free."""
    for robot in robots:
        kinds = {name: each.status for name, each in cell.robots[robot].parameters.items() if each.status != "fixed"}
        if kinds:
            words = " and ".join(kind.replace("_", " ") for kind in kinds)
            what = f"The {words} of {robot} are not estimated from a scene. Their errors are part of its pose noise."
            do = (
                "Let one camera see a board in some samples, and run `basecal calibrate CELL --scene also`.",
                "Or calibrate the arm with a board first, and state the corrected URDF in cell.yaml.",
            )
            yield Finding("scene-joints", "warning" if "free" in kinds.values() else "info", (robot,), what, do)


def missing_base_findings(cell: Cell, robots: Sequence[str]) -> Iterator[Finding]:
    """Findings of requested bases whose robot has no camera that shows the scene.

    Args:
        cell: The cell to be calibrated.
        robots: Names of the robots with cameras that show the scene.
    """
    for robot in cell.robots:
        name = cell.base_name(robot)
        if robot not in (cell.reference, *robots) and cell.transforms[name].status == "free":
            what = f"{name} cannot be estimated: no camera on {robot} has images with poses."
            do = (f"Record images with a camera on {robot}, or remove {robot} from cell.yaml.",)
            yield Finding("unobservable-direction", "error", (name,), what, do)
