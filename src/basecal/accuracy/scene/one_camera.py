"""The mount of one camera from its own images, and the points that they show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from basecal.accuracy.scene.pictures import Pictures
from basecal.cell import Unknown
from basecal.estimation.scene.adjust import SceneFit
from basecal.estimation.scene.epipolar import PointPairs, point_pairs
from basecal.estimation.scene.fit import fit_scene
from basecal.estimation.scene.mount_search import MountStart, find_mount
from basecal.estimation.scene.state import SceneState
from basecal.estimation.scene.views import FEWEST_VIEWS, SceneViews, Tracks
from basecal.geometry import SE3, Array, Camera, IntArray
from basecal.vision.tracks.chains import chain_matches, longest_chains
from basecal.vision.tracks.features import Descriptors
from basecal.vision.tracks.matching import Matches, match_rigid

_NEIGHBOURS = 20  # images of the most similar directions that each one is matched with
_MOST_ALL = 60  # images that are all matched with one another
_PAIRS = 3000  # of image points by which the mount is found
_MOST_POINTS = 1500  # of a camera's own scene: more take time and move no answer (benchmarks.scene)
MOST_PX = 5.0  # [px] median distance of image points from their epipolar geometry; right poses leave 0.5 to 2
_AT_WORLD = Unknown("fixed", SE3.identity())
_FOCAL_SCALES = (0.65, 1.0, 1.5)  # of a guessed lens, that are tried


@dataclass(frozen=True, eq=False)
class OneCamera:
    """The answer of one camera's images.

    Attributes:
        camera: Its index.
        views: Its views alone, of which the camera, the robot and its stops are the only ones.
        rows: Of these views, their indices among all.
        start: Its mount by pairs of image points; None if there are too few.
        fit: The adjustment; None without a start, or with one that does not explain the images.
        feature: (n,) index of the feature of each image point of the fit.
        matched_pairs: Pairs of images with matches.
    """

    camera: int
    views: SceneViews
    rows: IntArray
    start: MountStart | None
    fit: SceneFit | None
    feature: IntArray
    matched_pairs: int

    def points_by_feature(self) -> dict[tuple[int, int], int]:
        """The point of each feature that shows one, by view and feature."""
        assert self.fit is not None
        tracks = self.fit.tracks
        return dict(
            zip(zip(tracks.view.tolist(), self.feature.tolist(), strict=True), tracks.point.tolist(), strict=True)
        )

    def descriptors(self, pictures: Pictures) -> Descriptors:
        """Mean descriptor of the image points of each point of the fit, (p, 128) of unit length."""
        assert self.fit is not None
        return pictures.descriptors(self.fit.tracks, self.rows)


def solve_camera(pictures: Pictures, camera: int, stop_noise: Array | None) -> OneCamera:
    """The mount of a camera, its lens and the points that its images show.

    Args:
        pictures: Of all cameras.
        camera: Index of the camera.
        stop_noise: (6,) noise of the robot that carries it [m, rad]; None if it is to be estimated.
    """
    views, rows = own_views(pictures.views, camera)
    lens = pictures.lenses[camera]
    matches = match_pictures(pictures, rows, lens, views)
    counts = [len(pictures.features[row]) for row in rows]
    chains = longest_chains(chain_matches(counts, matches, FEWEST_VIEWS), _MOST_POINTS)
    pixels = [pictures.features[rows[v]].pixels[f] for v, f in zip(chains.view, chains.feature, strict=True)]
    tracks = Tracks(chains.view, chains.track, np.array(pixels).reshape(-1, 2))
    pairs = point_pairs(views, tracks, 0, _PAIRS)
    guess = pictures.mounts[camera] if pictures.mounts else None
    start = _start(pairs, views, lens, pictures.is_guessed[camera], guess)
    nothing = OneCamera(camera, views, rows, start, None, np.zeros(0, dtype=np.int64), len(matches))
    if start is None or start.misfit > (False, MOST_PX):
        return nothing
    state = SceneState(
        SE3.stack([_first_mount(views, start)]),
        SE3.stack([SE3.identity()]),
        (start.lens,),
        np.zeros((len(views.stop_robot), 6)),
        np.zeros((0, 3)),
    )
    try:
        fit = fit_scene(views, tracks, state, (start.lens,), (stop_noise,))
    except np.linalg.LinAlgError:
        return nothing
    return OneCamera(
        camera, views, rows, start, fit, _feature_indices(fit.tracks, tracks, chains.feature), len(matches)
    )


def _first_mount(views: SceneViews, start: MountStart) -> SE3:
    """The mount if it is stated as fixed, else that of the start."""
    known = views.cameras[0].mount
    return known.mean if known.status == "fixed" and known.mean is not None else start.flange_from_camera


def own_views(views: SceneViews, camera: int) -> tuple[SceneViews, IntArray]:
    """The views of one camera with its robot and stops alone, and their indices among all."""
    rows = np.flatnonzero(views.camera == camera).astype(np.int64)
    mine = views.take(rows)
    robot = mine.robot[0] if len(rows) else 0
    stops = np.flatnonzero(views.stop_robot == robot)
    numbered = np.full(len(views.stop_robot), -1, dtype=np.int64)
    numbered[stops] = np.arange(len(stops))
    alone = SceneViews(
        (views.cameras[camera],),
        (views.robots[robot],),
        (_AT_WORLD,),
        mine.sample,
        np.zeros(len(rows), dtype=np.int64),
        np.zeros(len(rows), dtype=np.int64),
        numbered[mine.stop],
        mine.base_from_flange,
        np.zeros(len(stops), dtype=np.int64),
    )
    return alone, rows


def match_pictures(
    pictures: Pictures, rows: IntArray, lens: Camera, views: SceneViews
) -> dict[tuple[int, int], Matches]:
    """Matches of pairs of one camera's images that a rigid scene can have, by their indices among `rows`."""
    features = [pictures.features[row] for row in rows]
    planes = [_plane(lens, each.pixels) for each in features]
    found = {}
    for i, j in picture_pairs(views.base_from_flange):
        matches = match_rigid(features[i], features[j], (planes[i], planes[j]), float(lens.focal.mean()))
        if matches is not None:
            found[i, j] = matches
    return found


def picture_pairs(base_from_flange: SE3) -> list[tuple[int, int]]:
    """Pairs of images to match: all, or of many those of the most similar directions."""
    count = len(base_from_flange)
    if count <= _MOST_ALL:
        return [(i, j) for i in range(count) for j in range(i + 1, count)]
    flat = base_from_flange.rotation.reshape(count, 9)
    nearest = np.argsort(-(flat @ flat.T), axis=1)[:, 1 : _NEIGHBOURS + 1]
    return sorted({(min(i, int(j)), max(i, int(j))) for i in range(count) for j in nearest[i] if i != j})


def _plane(lens: Camera, pixels: Array) -> Array:
    """Undistorted image points at unit depth, (n, 2); far outside if the lens has none."""
    unit, valid = lens.undistort(pixels)
    plane = unit[:, :2] / np.maximum(unit[:, 2:], 1e-3)
    return np.where(valid[:, None], plane, 1e3)


def _start(
    pairs: PointPairs, views: SceneViews, lens: Camera, is_guessed: bool, guess: SE3 | None
) -> MountStart | None:
    """The best mount, near a guess if there is one; of a guessed lens with the focal length that fits best."""
    is_free = views.cameras[0].lens.status == "free"
    found = []
    for scale in _FOCAL_SCALES if is_guessed else (1.0,):
        parameters = lens.parameters.copy()
        parameters[:2] *= scale
        start = find_mount(pairs, views.base_from_flange, lens.with_parameters(parameters), is_free, guess)
        found += [] if start is None else [start]
    return min(found, key=lambda each: each.misfit, default=None)


def _feature_indices(kept_tracks: Tracks, tracks: Tracks, feature: IntArray) -> IntArray:
    """The features of the image points that were kept, which have a view and pixels each."""
    by_place = {(int(v), *map(float, p)): int(f) for v, p, f in zip(tracks.view, tracks.pixels, feature, strict=True)}
    return np.array(
        [by_place[int(v), *map(float, p)] for v, p in zip(kept_tracks.view, kept_tracks.pixels, strict=True)],
        dtype=np.int64,
    )
