"""True joins of two cameras' scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.scene.joining import Join
from basecal.accuracy.scene.one_camera import OneCamera
from basecal.geometry import IntArray
from basecal.numerics.batch import take
from scene_points import BASE, Scene


def point_by_place(scene: Scene) -> dict[tuple[float, ...], int]:
    """Index of the point that an image point shows, by view and pixels."""
    places = zip(scene.tracks.view, scene.tracks.pixels, scene.tracks.point, strict=True)
    return {(int(view), *map(float, pixels)): int(point) for view, pixels, point in places}


def true_points(scene: Scene, one: OneCamera) -> IntArray:
    """Index of the scene's point that each image point of a camera's fit shows."""
    assert one.fit is not None
    point_at = point_by_place(scene)
    tracks = one.fit.tracks
    return np.array(
        [point_at[int(one.rows[v]), *map(float, px)] for v, px in zip(tracks.view, tracks.pixels, strict=True)]
    )


def true_join(scene: Scene, ones: tuple[OneCamera, OneCamera]) -> Join:
    """The join of all image points of the second camera that show a point of the first."""
    first, second = (true_points(scene, one) for one in ones)
    assert ones[0].fit is not None
    assert ones[1].fit is not None
    first_point = dict(zip(first.tolist(), ones[0].fit.tracks.point.tolist(), strict=True))
    shared = [k for k, point in enumerate(second.tolist()) if point in first_point]
    point = np.array([first_point[int(second[k])] for k in shared])
    return Join(BASE.inverse(), replace(take(ones[1].fit.tracks, np.array(shared)), point=point), 0.0, 1.0)
