"""The cell as a still image, for print and for pages without scripts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from markupsafe import Markup

from basecal.geometry import SE3, Array
from basecal.reporting.cell_view.scene import Arm, Body, Scene, worst_words
from basecal.reporting.svg import dots, drawing, element, path, segments

_WIDTH, _HEIGHT, _MARGIN_PX = 640.0, 440.0, 44.0
_ELEVATION_RAD = 0.45
_AXIS_SHARE = 0.09
_COLOURS = 4
_LETTER_PX, _LINE_PX = 8.0, 17.0
_LABEL_SHIFT_PX = np.array([0.0, 18.0])  # from the labelled point

Project = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Label:
    """A label at a point of the drawing, (2,)."""

    words: str
    place: Array
    kind: str = "label"

    def covers(self, neighbour: Label) -> bool:
        """Whether this label overlaps another."""
        across, down = np.abs(self.place - neighbour.place)
        letters = (len(self.words) + len(neighbour.words)) / 2
        return bool(across < _LETTER_PX * letters and down < _LINE_PX)


def picture(scene: Scene) -> Markup:
    """A drawing of the scene at its first shown sample, viewed so that the bases are side by side."""
    placed = [(body, pose) for body in scene.bodies if (pose := _world_from_body(scene, body)) is not None]
    ends = [pose @ np.concatenate([body.lines.reshape(-1, 3), body.points]) for body, pose in placed]
    project = _projection(scene, ends)
    feet = [project(arm.world_from_base.translation) for arm in scene.arms]
    parts, labels = [path("floor", segments((feet[0], foot) for foot in feet[1:]))], list[Label]()
    for number, (arm, foot) in enumerate(zip(scene.arms, feet, strict=True)):
        colour = f"robot-{number % _COLOURS}"
        parts += _arm(arm, colour, scene, project)
        labels.append(Label(f"{arm.name}_base", foot + _LABEL_SHIFT_PX, f"label {colour}"))
    for (body, world_from_body), flat in zip(placed, map(project, ends), strict=True):
        parts += _ellipsoid(body.ellipsoid, world_from_body, project)
        lines, points = np.split(flat, [2 * len(body.lines)])
        parts.append(path(body.kind, segments(lines.reshape(-1, 2, 2)) + dots(points)))
        labels.append(Label(body.name, np.array([flat[:, 0].mean(), flat[:, 1].min() - 7])))
    if scene.errors is not None:
        worst_point = project(scene.errors.points_m[scene.errors.worst])
        parts.append(path("worst-place", dots([worst_point])))
        labels.append(Label(worst_words(scene.errors), worst_point + _LABEL_SHIFT_PX))
    return drawing(_WIDTH, _HEIGHT, "the cell from the side", *parts, *_place_labels(labels))


def _place_labels(labels: Iterable[Label]) -> Iterator[Markup]:
    """Draw labels, each moved below previous labels that it overlaps."""
    placed: list[Label] = []
    for label in labels:
        for _ in placed:  # bounded, since a step of a line is lost to rounding at coordinates beyond 1e17
            other = next((each for each in placed if each.covers(label)), None)
            if other is None:
                break
            label = replace(label, place=np.array([label.place[0], other.place[1] + _LINE_PX]))
        placed.append(label)
        x, y = label.place
        yield element("text", label.words, class_=label.kind, x=x, y=y)


def _world_from_body(scene: Scene, body: Body) -> SE3 | None:
    """Pose of a body at the first shown sample; None if its robot's pose was not recorded."""
    if body.on is None:
        return body.mount
    world_from_flange = next(arm for arm in scene.arms if arm.name == body.on).world_from_flange(scene.opening)
    return None if world_from_flange is None else world_from_flange @ body.mount


def _projection(scene: Scene, bodies: list[Array]) -> Project:
    """Projection of points, (..., 3) [m], to the drawing, (..., 2), scaled to fit the arms and bodies, (k, 3) [m]."""
    right, up = scene.across, np.array([0.0, 0.0, 1.0])
    axes = np.stack([right, -(np.cos(_ELEVATION_RAD) * up + np.sin(_ELEVATION_RAD) * np.cross(up, right))])
    reach = _AXIS_SHARE * scene.size_m * np.eye(3)
    places = [place for arm in scene.arms for place in (arm.world_from_base @ reach, arm.places)]
    flat = np.concatenate([*places, *bodies]) @ axes.T
    low, high = flat.min(0), flat.max(0)
    size = np.array([_WIDTH, _HEIGHT])
    scale = float(np.min((size - 2 * _MARGIN_PX) / np.maximum(high - low, 1e-9)))
    shift = size / 2 - scale * (low + high) / 2
    return lambda points: scale * (points @ axes.T) + shift


def _frame(world_from_body: SE3, length: float, project: Project) -> Iterator[Markup]:
    origin = project(world_from_body.translation)
    for axis, tip in zip("xyz", project(world_from_body @ (length * np.eye(3))), strict=True):
        yield path(f"axis-{axis}", segments([(origin, tip)]))


def _arm(arm: Arm, colour: str, scene: Scene, project: Project) -> Iterator[Markup]:
    length = _AXIS_SHARE * scene.size_m
    flanges = (arm.world_from_base @ arm.base_from_flange).translation[arm.known]
    yield path(f"trail {colour}", dots(project(flanges)))
    world_from_flange = arm.world_from_flange(scene.opening)
    if world_from_flange is not None:
        joints = () if arm.joints is None else (arm.world_from_base @ arm.joints[scene.opening]).translation
        along = np.stack([arm.world_from_base.translation, *joints, world_from_flange.translation])
        yield path(f"{'links' if len(joints) else 'reach'} {colour}", segments(pairwise(project(along))))
        yield from _frame(world_from_flange, 0.4 * length, project)
    yield from _frame(arm.world_from_base, length, project)
    yield from _ellipsoid(arm.ellipsoid, arm.world_from_base, project)


def _ellipsoid(ellipsoid: Array | None, world_from_body: SE3, project: Project) -> Iterator[Markup]:
    """Outline of an ellipsoid: the projection of the unit ball by M is an ellipse with the semi-axes of M's SVD."""
    if ellipsoid is None:
        return
    world_from_ball = world_from_body.rotation @ ellipsoid
    shadow = (project(world_from_ball.T) - project(np.zeros(3))).T
    u, lengths, _ = np.linalg.svd(shadow, full_matrices=False)
    turn = np.linspace(0, 2 * np.pi, 49)
    outline = project(world_from_body.translation) + (np.stack([np.cos(turn), np.sin(turn)], -1) * lengths) @ u.T
    yield path("ellipsoid", segments(pairwise(outline)))
