"""Which transform joins two scenes: found where there is one, with its rivals."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.scene.checks import join_findings
from basecal.accuracy.scene.joining import Join, join, paired_points
from basecal.accuracy.scene.pictures import Pictures
from basecal.vision.tracks.features import Descriptors
from scene_pictures import pictures_of_scene, random_looks, repeated_object, solved_camera
from scene_points import BASE, Scene, made_scene

NAMES = ("left_eye", "right_eye")


def joined(scene: Scene, looks: tuple[Descriptors, Descriptors] | None = None) -> tuple[Pictures, Join | None]:
    """Images of two cameras, and what joins them."""
    pictures = pictures_of_scene(scene, looks=looks)
    return pictures, join(pictures, *(solved_camera(scene, pictures, camera) for camera in (0, 1)))


def codes(found: Join | None) -> list[str]:
    """Of the refusals, if enough points are shared."""
    return [each.code for each in join_findings(NAMES, found, 200, (12, 12), 1.0)]


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Two arms before one table."""
    return made_scene(1, arms=2, count=12, points=220)


def test_common_points_join_two_arms(scene: Scene) -> None:
    """The base is within 2 mm and 0.1 deg of the truth, nothing is found by chance, and there is no rival."""
    _, found = joined(scene)
    assert found is not None
    off = (BASE @ found.second_from_first).log()
    assert np.linalg.norm(off[:3]) < 2e-3
    assert np.degrees(np.linalg.norm(off[3:])) < 0.1
    assert found.by_chance < 1
    assert found.rival < found.score / 10
    assert codes(found) == []


def test_sightings_are_of_the_same_points(scene: Scene) -> None:
    """What is found in images of the second shows the points of the first that it is said to show."""
    looks = random_looks(np.random.default_rng(4), scene.tracks.count)
    pictures, found = joined(scene, (looks, looks))
    assert found is not None
    first, second = (solved_camera(scene, pictures, camera) for camera in (0, 1))
    seen = found.sightings
    of_points = pictures.descriptors(first.tracks)[seen.point]
    shown = [pictures.features[second.rows[v]].descriptors[f] for v, f in zip(seen.view, seen.feature, strict=True)]
    assert len(seen) > 500
    assert set(seen.view) == set(range(12))
    assert np.sum(of_points * np.array(shown), 1).min() > 0.8


def test_pairs_are_of_one_point(scene: Scene) -> None:
    """Paired points of the two scenes are one point of the world to their tolerance."""
    pictures = pictures_of_scene(scene)
    first, second = (solved_camera(scene, pictures, camera) for camera in (0, 1))
    pairs, tolerance = paired_points(pictures, first, second)
    assert first.fit is not None
    assert second.fit is not None
    apart = first.fit.state.points[pairs[:, 0]] - BASE @ second.fit.state.points[pairs[:, 1]]
    assert len(pairs) > 150
    assert (np.linalg.norm(apart, axis=1) < tolerance).mean() > 0.95
    assert tolerance.max() < 0.05


def test_scenes_without_a_common_part_are_not_joined(scene: Scene) -> None:
    """If no point looks alike to both arms they are refused for want of overlap."""
    rng = np.random.default_rng(5)
    _, found = joined(scene, tuple(random_looks(rng, scene.tracks.count) for _ in range(2)))
    assert codes(found) == ["scene-overlap"]


def test_a_repeated_object_has_a_rival() -> None:
    """Where all that both arms share stands twice, another base explains half as much, and the answer is refused."""
    scene, looks = repeated_object(is_seen_apart=False)
    _, found = joined(scene, looks)
    assert found is not None
    assert codes(found) == ["scene-rival"]
    assert np.linalg.norm((BASE @ found.second_from_first).translation) < 5e-3
