"""Images of a static scene as arrays: the recorded poses of their cameras, and tracks of image points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from basecal.cell import Intrinsics, Unknown
from basecal.geometry import SE3, Array, BoolArray, Camera, IntArray
from basecal.numerics.batch import SHARED, take

FEWEST_VIEWS = 3  # fewest views of a track: two rays give no constraint along the epipolar line
AT_WORLD = Unknown("fixed", SE3.identity())
"""Base that is the world of a scene, fixed at the identity."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Image points with their view and scene point.

    Attributes:
        view: (n,) index of the view.
        point: (n,) index of the scene point; each point appears at most once per view.
        pixels: (n, 2) [px], the centre of the top-left pixel is (0, 0).
        feature: (n,) index of the feature within its view.
    """

    view: IntArray
    point: IntArray
    pixels: Array
    feature: IntArray

    def __len__(self) -> int:
        return len(self.view)

    @property
    def count(self) -> int:
        """Number of scene points."""
        return int(self.point.max(initial=-1)) + 1

    def take(self, keep: BoolArray, min_views: int = FEWEST_VIEWS) -> tuple[Tracks, IntArray]:
        """Select image points; points with fewer than `min_views` remaining views are dropped.

        Args:
            keep: (n,) image points to keep.
            min_views: Fewest views of a scene point.

        Returns:
            The selected image points with renumbered scene points, and the old indices of the scene points.
        """
        view_counts = np.bincount(self.point[keep], minlength=self.count)
        selected = take(self, np.flatnonzero(keep & (view_counts[self.point] >= min_views)))
        kept_points, point = np.unique(selected.point, return_inverse=True)
        return replace(selected, point=point.astype(np.int64)), kept_points.astype(np.int64)


@dataclass(frozen=True, eq=False)
class SceneCamera:
    """A camera that takes images of the scene.

    Attributes:
        name: Name of the camera.
        robot: Name of the robot that carries it; None on `world`.
        mount: Stated `flange_from_camera`, or `world_from_camera` on `world`.
        lens: Stated intrinsics.
    """

    name: str
    robot: str | None
    mount: Unknown
    lens: Intrinsics


@dataclass(frozen=True, eq=False)
class SceneViews:
    """The images of all cameras.

    Attributes:
        cameras: The cameras.
        robots: Names of the robots that carry cameras; `bases` has as many entries.
        bases: Stated `world_from_base` of each robot; fixed at the identity for the reference.
        sample: (v,) sample number of each view.
        camera: (v,) index of the camera.
        robot: (v,) index of the robot; -1 on `world`.
        stop: (v,) index of the robot's stop; -1 on `world`.
        base_from_flange: (v,) recorded poses; identity on `world`.
        stop_robot: (s,) index of the robot of each stop.
    """

    cameras: tuple[SceneCamera, ...] = field(metadata=SHARED)
    robots: tuple[str, ...] = field(metadata=SHARED)
    bases: tuple[Unknown, ...] = field(metadata=SHARED)
    sample: IntArray
    camera: IntArray
    robot: IntArray
    stop: IntArray
    base_from_flange: SE3
    stop_robot: IntArray = field(metadata=SHARED)

    def __len__(self) -> int:
        return len(self.sample)

    @property
    def reach_m(self) -> Array:
        """RMS distance of each robot's flange from its base, (r,) [m]."""
        squares = np.sum(self.base_from_flange.translation**2, 1)
        return np.sqrt([np.mean(squares[self.robot == k]) for k in range(len(self.robots))])

    def directions(self, tracks: Tracks, lenses: tuple[Camera, ...]) -> tuple[Array, BoolArray]:
        """Unit directions of image points in camera axes, (n, 3), and whether each is in the lens's domain, (n,)."""
        unit, valid = np.zeros((len(tracks), 3)), np.zeros(len(tracks), dtype=bool)
        camera = self.camera[tracks.view]
        for index, lens in enumerate(lenses):
            rows = np.flatnonzero(camera == index)
            if len(rows):
                unit[rows], valid[rows] = lens.undistort(tracks.pixels[rows])
        return np.where(valid[:, None], unit, 0.0), valid
