"""Tests of the transform that joins two scenes, and of its rivals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from basecal.accuracy.scene import joining
from basecal.accuracy.scene.checks import join_findings
from basecal.accuracy.scene.images import Images
from basecal.accuracy.scene.joining import (
    Join,
    _evidence_share,
    _new_sightings,
    common_share,
    find_join,
    merged_tracks,
    paired_points,
    shared_points,
)
from basecal.accuracy.scene.one_camera import OneCamera
from basecal.estimation.scene.views import Tracks
from basecal.numerics.batch import concatenate, take
from basecal.vision.tracks.features import Descriptors
from scene_images import images_of_scene, moved_object, random_looks, repeated_object, solved_camera
from scene_joins import point_by_place, true_join, true_points
from scene_points import BASE, Scene, made_scene

NAMES = ("left_eye", "right_eye")


def join_images(scene: Scene, looks: tuple[Descriptors, Descriptors] | None = None) -> tuple[Images, Join | None]:
    """Images of two cameras, and their join."""
    images = images_of_scene(scene, looks=looks)
    return images, find_join(images, *(solved_camera(scene, images, camera) for camera in (0, 1)))


def codes(found: Join | None) -> list[str]:
    """Codes of the refusals, if enough points are shared."""
    return [each.code for each in join_findings(NAMES, found, 200, (12, 12))]


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Two arms in front of one table."""
    return made_scene(1, arms=2, count=12, points=220)


def test_shared_points_join_two_arms(scene: Scene) -> None:
    """The base is within 2 mm and 0.1 deg of the truth, with no chance agreement and no rival."""
    _, found = join_images(scene)
    assert found is not None
    off = (BASE @ found.second_from_first).log()
    assert np.linalg.norm(off[:3]) < 2e-3
    assert np.degrees(np.linalg.norm(off[3:])) < 0.1
    assert found.by_chance < 1
    assert found.common > 0.9
    assert found.rival < 0.1
    assert codes(found) == []


def test_sightings_show_same_points(scene: Scene) -> None:
    """Sightings in images of the second camera show the stated points of the first."""
    looks = random_looks(np.random.default_rng(4), scene.tracks.count)
    images, found = join_images(scene, (looks, looks))
    assert found is not None
    first, second = (solved_camera(scene, images, camera) for camera in (0, 1))
    seen = found.sightings
    of_points = images.descriptors(first.tracks)[seen.point]
    shown = [images.features[second.rows[v]].descriptors[f] for v, f in zip(seen.view, seen.feature, strict=True)]
    assert len(seen) > 500
    assert set(seen.view) == set(range(12))
    assert np.sum(of_points * np.array(shown), 1).min() > 0.8


def test_pairs_show_one_point(scene: Scene) -> None:
    """Paired points of both scenes are one point of the world within their tolerance."""
    images = images_of_scene(scene)
    first, second = (solved_camera(scene, images, camera) for camera in (0, 1))
    pairs, tolerance = paired_points(images, first, second)
    assert first.fit is not None
    assert second.fit is not None
    apart = first.fit.state.points[pairs[:, 0]] - BASE @ second.fit.state.points[pairs[:, 1]]
    assert len(pairs) > 150
    assert (np.linalg.norm(apart, axis=1) < tolerance).mean() > 0.95
    assert tolerance.max() < 0.05


def test_scenes_without_overlap_are_not_joined(scene: Scene) -> None:
    """If no point looks equal to both arms, the join is refused for lack of overlap."""
    rng = np.random.default_rng(5)
    _, found = join_images(scene, tuple(random_looks(rng, scene.tracks.count) for _ in range(2)))
    assert codes(found) == ["scene-overlap"]


@pytest.mark.journey
def test_repeated_object_has_rival() -> None:
    """If the shared part occurs twice, another base explains half as much, and the join is refused."""
    scene, looks = repeated_object(is_seen_apart=False)
    _, found = join_images(scene, looks)
    assert found is not None
    assert codes(found) == ["scene-rival"]
    assert np.linalg.norm((BASE @ found.second_from_first).translation) < 5e-3


def share(ones: tuple[OneCamera, OneCamera], sightings: Tracks) -> float:
    """Share of the first camera's places that the second shows."""
    return common_share(ones[0].adjustment.state.points, ones[1].adjustment, BASE.inverse(), sightings)


@pytest.fixture(scope="module")
def few() -> tuple[Scene, tuple[OneCamera, OneCamera]]:
    """Two arms in front of one table of fewer points, solved."""
    scene = made_scene(1, arms=2, count=8, points=120)
    images = images_of_scene(scene)
    return scene, (solved_camera(scene, images, 0), solved_camera(scene, images, 1))


def test_share_counts_places_in_both_views(
    few: tuple[Scene, tuple[OneCamera, OneCamera]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Most places within both views are shared, fewer with a quarter of the sightings.

    Without places the share is None.
    """
    monkeypatch.setattr(joining, "_CUBE_M", 0.5)
    seen = true_join(*few).sightings
    assert share(few[1], seen) > 0.7
    assert share(few[1], take(seen, seen.point % 4 == 0)) < 0.5
    assert share(few[1], take(seen, np.arange(0))) == 0
    monkeypatch.setattr(joining, "_CUBE_M", 1e-3)
    assert share(few[1], seen) is None


def test_places_count_equally(few: tuple[Scene, tuple[OneCamera, OneCamera]], monkeypatch: pytest.MonkeyPatch) -> None:
    """Places count equally however many points they have.

    Two equal objects have most of the points, and their surroundings contradict that they are one.
    """
    monkeypatch.setattr(joining, "_CUBE_M", 0.25)
    seen = true_join(*few).sightings
    cubes = np.floor(few[1][0].adjustment.state.points / 0.25).astype(np.int64)
    _, number, count = np.unique(cubes, axis=0, return_inverse=True, return_counts=True)
    largest = np.flatnonzero(number.ravel() == np.argmax(count))
    assert share(few[1], seen) > 0.9
    assert share(few[1], take(seen, np.isin(seen.point, largest))) < 0.5


@pytest.mark.journey
def test_moved_object_is_no_rival() -> None:
    """A moved box with most of the points has a base of its own but few places, so it is no rival."""
    scene, looks = moved_object()
    _, found = join_images(scene, looks)
    assert found is not None
    assert codes(found) == []
    assert np.linalg.norm((BASE @ found.second_from_first).translation) < 5e-3


def test_rival_without_places_is_judged_by_score() -> None:
    """A rival is judged by its score alone if no place counts, as in a sparse scene."""
    best = Join(BASE, made_tracks(100), 1.0, 0.9)
    rival = replace(best, sightings=made_tracks(60), common=0.1)
    assert _evidence_share(rival, best) == pytest.approx(1 / 9)
    assert _evidence_share(rival, replace(best, common=None)) == pytest.approx(59 / 99)
    assert _evidence_share(replace(rival, common=None), best) == pytest.approx(59 / 99)


def made_tracks(count: int) -> Tracks:
    """The given number of sightings."""
    return Tracks(*(np.zeros(count, dtype=np.int64) for _ in range(2)), np.zeros((count, 2)), np.zeros(count, int))


@pytest.fixture(scope="module")
def scene_of_merging() -> Scene:
    """Two arms in front of one table."""
    return made_scene(1, arms=2, count=8, points=120)


@pytest.fixture(scope="module")
def images(scene_of_merging: Scene) -> Images:
    """Images of their cameras."""
    return images_of_scene(scene_of_merging)


@pytest.fixture(scope="module")
def ones(scene_of_merging: Scene, images: Images) -> tuple[OneCamera, OneCamera]:
    """Solutions of both cameras."""
    return solved_camera(scene_of_merging, images, 0), solved_camera(scene_of_merging, images, 1)


def test_merged_tracks_are_true_ones(
    scene_of_merging: Scene, images: Images, ones: tuple[OneCamera, OneCamera]
) -> None:
    """With the true join, merged tracks are as many as the true ones, and each shows one point."""
    tracks = merged_tracks(ones, {1: true_join(scene_of_merging, ones)})
    at = point_by_place(scene_of_merging)
    true = np.array([at[int(v), *map(float, px)] for v, px in zip(tracks.view, tracks.pixels, strict=True)])
    pairs = np.unique(np.column_stack([tracks.point, true]), axis=0)
    assert len(pairs) == tracks.count == len(np.unique(true)) > 90


def test_shared_points_are_counted(scene_of_merging: Scene, images: Images, ones: tuple[OneCamera, OneCamera]) -> None:
    """A point is shared if two views of each camera show it; without a join none is."""
    own = [true_points(scene_of_merging, one) for one in ones]
    many = [set(np.flatnonzero(np.bincount(points) >= 2).tolist()) for points in own]
    tracks = merged_tracks(ones, {1: true_join(scene_of_merging, ones)})
    assert shared_points(scene_of_merging.views, tracks, 1) == (len(many[0] & many[1]), (8, 8))
    assert shared_points(scene_of_merging.views, merged_tracks(ones, {}), 1) == (0, (0, 0))


def test_false_sightings_do_not_mix_tracks(
    scene_of_merging: Scene, images: Images, ones: tuple[OneCamera, OneCamera]
) -> None:
    """With one false sighting in six, the majority of each track decides, and none is mixed."""
    join = true_join(scene_of_merging, ones)
    point = join.sightings.point
    rng = np.random.default_rng(2)
    wrong = rng.random(len(point)) < 1 / 6
    point = np.where(wrong, rng.permutation(point), point)
    assert ones[0].fit is not None
    mixed = replace(join, sightings=replace(join.sightings, point=point))
    right = shared_points(scene_of_merging.views, merged_tracks(ones, {1: join}), 1)[0]
    assert shared_points(scene_of_merging.views, merged_tracks(ones, {1: mixed}), 1)[0] > 0.85 * right


def test_view_shows_point_once(scene_of_merging: Scene, images: Images, ones: tuple[OneCamera, OneCamera]) -> None:
    """No view shows a point twice after merging."""
    join = true_join(scene_of_merging, ones)
    few = take(join.sightings, np.arange(40))
    beside = replace(few, feature=few.feature * 0)
    tracks = merged_tracks(ones, {1: replace(join, sightings=concatenate([beside, join.sightings]))})
    places = np.column_stack([tracks.view, tracks.point])
    assert len(np.unique(places, axis=0)) == len(places)


def test_shared_point_needs_two_views_of_each_camera() -> None:
    """A shared point needs two views of both cameras.

    Views that show one are counted, and other cameras have no effect.
    """
    views = replace(made_scene(1, arms=2, count=4, points=40).views, camera=np.array([0, 0, 0, 1, 1, 1, 2, 2]))
    of_point = {0: [0, 1, 3, 4], 1: [0, 3, 4, 5], 2: [0, 1, 2, 3, 6, 7], 3: [1, 2, 4, 5, 6]}
    seen = np.array([(view, point) for point, shown in of_point.items() for view in shown])
    tracks = Tracks(seen[:, 0], seen[:, 1], np.zeros((len(seen), 2)), np.arange(len(seen)))
    assert shared_points(views, tracks, 1) == (2, (3, 3))
    assert shared_points(views, tracks, 2) == (1, (3, 2))


def test_own_tracks_tie_points() -> None:
    """An own point is tied to the other camera's point that most of its matched features show.

    The rest are new sightings; the last views may show no own point.
    """

    def tracks(*rows: tuple[int, int, int]) -> Tracks:
        view, point, feature = np.array(rows).T
        return Tracks(view, point, np.zeros((len(rows), 2)), feature)

    own = tracks((0, 0, 0), (1, 0, 0), (2, 0, 1), (0, 1, 1), (1, 1, 1), (0, 2, 2), (1, 2, 2))
    sightings = tracks((0, 5, 0), (1, 5, 0), (2, 6, 1), (0, 7, 1), (1, 8, 1), (0, 0, 9), (1, 9, 2))
    more, tied = _new_sightings(own, sightings)
    assert tied.tolist() == [[0, 5], [2, 9]]
    assert (more.view.tolist(), more.point.tolist(), more.feature.tolist()) == ([0], [0], [9])
    more, tied = _new_sightings(own, tracks((0, 5, 0), (4, 5, 0)))
    assert (tied.tolist(), more.view.tolist()) == ([[0, 5]], [4])
