"""Estimate the mount of one camera from its own images, with the points that they show.

`benchmarks.scene` evaluates the limits.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from basecal.accuracy.scene.images import Images
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.mount_search import MountStart, PointPairs, find_mount, point_pairs, scale_focal
from basecal.estimation.scene.state import start_state
from basecal.estimation.scene.views import AT_WORLD, FEWEST_VIEWS, SceneViews, Tracks
from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.numerics.batch import take
from basecal.vision.tracks.chains import chain_matches, longest_chains
from basecal.vision.tracks.matching import Matches, match_rigid

_NEIGHBOURS = 20  # images of the most similar directions with which each image is matched
_MOST_ALL = 60  # largest number of images of which all pairs are matched
_PAIRS = 3000  # of image points, for the search of the mount
_MOST_POINTS = 1500  # of a camera's own scene: more take time without effect on the result (benchmarks.scene)
MOST_EPIPOLAR_PX = 5.0  # [px] median distance of image points from their epipolar geometry; 0.5 to 2 with correct poses
_FOCAL_SCALES = (0.65, 1.0, 1.5)  # tried factors of a guessed focal length


@dataclass(frozen=True, eq=False)
class OneCamera:
    """The scene from one camera's images.

    Attributes:
        rows: Indices of the camera's views among all views.
        start: The mount from pairs of image points; None if there are too few pairs.
        fit: The adjustment of the camera's views alone. None without a start, if the start does not explain the
            images, or if the adjustment fails.
        matched_pairs: Number of image pairs with matches.
    """

    rows: IntArray
    start: MountStart | None
    fit: SceneFit | None
    matched_pairs: int

    @property
    def adjustment(self) -> SceneFit:
        """The adjustment of a camera that passed all checks."""
        assert self.fit is not None
        return self.fit

    @property
    def tracks(self) -> Tracks:
        """Image points of the adjustment, with indices of views among all views."""
        return replace(self.adjustment.tracks, view=self.rows[self.adjustment.tracks.view])


def solve_camera(images: Images, camera: int, stop_noise: Array | None) -> OneCamera:
    """Estimate the mount of a camera, its lens and the points that its images show.

    Args:
        images: Images of all cameras.
        camera: Index of the camera.
        stop_noise: (6,) noise of the robot that carries the camera [m, rad]; None if it is to be estimated.
    """
    views, rows = own_views(images.views, camera)
    lens = images.lenses[camera]
    matches = match_images(images, rows, lens, views)
    counts = [len(images.features[row]) for row in rows]
    chains = longest_chains(chain_matches(counts, matches, FEWEST_VIEWS), _MOST_POINTS)
    pixels = [images.features[rows[v]].pixels[f] for v, f in zip(chains.view, chains.feature, strict=True)]
    tracks = Tracks(chains.view, chains.track, np.array(pixels).reshape(-1, 2), chains.feature)
    guess = images.mounts[camera] if images.mounts else None
    start = _start(point_pairs(tracks, _PAIRS), views, lens, images.is_guessed[camera], guess)
    fit = None
    if start is not None and start.misfit <= (False, MOST_EPIPOLAR_PX):
        state = start_state(views, [_first_mount(views, start)], [SE3.identity()], (start.lens,))
        with suppress(np.linalg.LinAlgError):
            fit = fit_scene(views, tracks, state, state.lenses, (stop_noise,))
    return OneCamera(rows, start, fit, len(matches))


def _first_mount(views: SceneViews, start: MountStart) -> SE3:
    """Return the stated mount if it is fixed, else the mount of the start."""
    known = views.cameras[0].mount
    return known.mean if known.status == "fixed" and known.mean is not None else start.flange_from_camera


def own_views(views: SceneViews, camera: int) -> tuple[SceneViews, IntArray]:
    """Return the views of one camera, with only its robot and stops, and their indices among all views."""
    rows = np.flatnonzero(views.camera == camera).astype(np.int64)
    mine, first = take(views, rows), np.zeros(len(rows), dtype=np.int64)
    stops, stop = np.unique(mine.stop, return_inverse=True)
    alone = replace(
        mine,
        cameras=(views.cameras[camera],),
        robots=(views.robots[mine.robot[0]],),
        bases=(AT_WORLD,),
        camera=first,
        robot=first,
        stop=stop.astype(np.int64),
        stop_robot=first[: len(stops)],
    )
    return alone, rows


def match_images(images: Images, rows: IntArray, lens: Camera, views: SceneViews) -> dict[tuple[int, int], Matches]:
    """Match pairs of one camera's images consistently with a rigid scene; keys are pairs of indices into `rows`."""
    features = [images.features[row] for row in rows]
    planes = [_plane(lens, each.pixels) for each in features]
    found = {}
    for i, j in image_pairs(views.base_from_flange):
        matches = match_rigid(features[i], features[j], (planes[i], planes[j]), float(lens.focal.mean()))
        if matches is not None:
            found[i, j] = matches
    return found


def image_pairs(base_from_flange: SE3) -> list[tuple[int, int]]:
    """Return the pairs of images to match: all pairs, or those of the most similar directions if images are many."""
    count = len(base_from_flange)
    if count <= _MOST_ALL:
        return [(i, j) for i in range(count) for j in range(i + 1, count)]
    flat = base_from_flange.rotation.reshape(count, 9)
    nearest = np.argsort(-(flat @ flat.T), axis=1)[:, 1 : _NEIGHBOURS + 1]
    return sorted({(min(i, int(j)), max(i, int(j))) for i in range(count) for j in nearest[i] if i != j})


def _plane(lens: Camera, pixels: Array) -> Array:
    """Undistorted image points at unit depth, (n, 2); far outside the image if a pixel cannot be undistorted."""
    unit, valid = lens.undistort(pixels)
    plane = unit[:, :2] / np.maximum(unit[:, 2:], 1e-3)
    return np.where(valid[:, None], plane, 1e3)


def _start(
    pairs: PointPairs, views: SceneViews, lens: Camera, is_guessed: bool, guess: SE3 | None
) -> MountStart | None:
    """Find the mount, near a guess if there is one; with a guessed lens also the focal length that fits best."""
    is_free = views.cameras[0].lens.status == "free"
    found = []
    for scale in _FOCAL_SCALES if is_guessed else (1.0,):
        start = find_mount(pairs, views.base_from_flange, scale_focal(lens, scale), is_free, guess)
        found += [] if start is None else [start]
    return min(found, key=lambda each: each.misfit, default=None)
