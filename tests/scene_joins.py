"""How two cameras' scenes join in truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.scene.joining import Join
from basecal.accuracy.scene.one_camera import OneCamera
from basecal.geometry import IntArray
from basecal.numerics.batch import take
from scene_points import BASE, Scene


def point_by_place(scene: Scene) -> dict[tuple[float, ...], int]:
    """The point that an image point shows, by its view and pixels."""
    places = zip(scene.tracks.view, scene.tracks.pixels, scene.tracks.point, strict=True)
    return {(int(view), *map(float, pixels)): int(point) for view, pixels, point in places}


def true_points(scene: Scene, one: OneCamera) -> IntArray:
    """The point of the world that each image point of a camera's fit shows."""
    assert one.fit is not None
    at = point_by_place(scene)
    tracks = one.fit.tracks
    return np.array([at[int(one.rows[v]), *map(float, px)] for v, px in zip(tracks.view, tracks.pixels, strict=True)])


def true_join(scene: Scene, ones: tuple[OneCamera, OneCamera]) -> Join:
    """Each image point of the second that shows a point of the first, as that."""
    first, second = (true_points(scene, one) for one in ones)
    assert ones[0].fit is not None
    assert ones[1].fit is not None
    of_first = dict(zip(first.tolist(), ones[0].fit.tracks.point.tolist(), strict=True))
    shown = [k for k, point in enumerate(second.tolist()) if point in of_first]
    point = np.array([of_first[int(second[k])] for k in shown])
    return Join(BASE.inverse(), replace(take(ones[1].fit.tracks, np.array(shown)), point=point), 0.0, 1.0)
