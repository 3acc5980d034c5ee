"""Films of LeRobot, in both layouts; the film was made by PyAV with SVT-AV1, as LeRobot makes its films."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from basecal.errors import DatasetError
from basecal.exchange.lerobot_films import Film, find_film, still_frames, write_images

FILM = (
    Path(__file__).parents[1] / "data" / "film_av1.mp4"
)  # 60 images of 64 x 48 px at 30 Hz, number k has the level 4 k


def dataset(folder: Path, *names: str) -> Path:
    (folder / "meta").mkdir(parents=True)
    features = {f"observation.images.{name}": {"dtype": "video", "names": None} for name in names}
    info = {"features": {"observation.state": {"dtype": "float32"}, **features}}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder


def levels(paths: list[Path]) -> list[float]:
    return [float(cv2.imread(str(path), cv2.IMREAD_UNCHANGED).mean()) for path in paths]


def test_images_at_times_of_an_episode(tmp_path: Path) -> None:
    """In any order, from where the episode begins; they are named by their times."""
    paths = write_images(Film(FILM, 0.0), np.array([0.0, 1.5, 0.5]), tmp_path)
    assert [path.name for path in paths] == ["000000.000.png", "000001.500.png", "000000.500.png"]
    np.testing.assert_allclose(levels(paths), [0, 180, 60], atol=3)
    later = write_images(Film(FILM, 1.0), np.array([0.1]), tmp_path)
    np.testing.assert_allclose(levels(later), [4 * 33], atol=3)


def test_films_that_end_or_are_none(tmp_path: Path) -> None:
    """One line says which, and what to do."""
    with pytest.raises(DatasetError, match=r"ends before 2.5 s of the episode"):
        write_images(Film(FILM, 0.0), np.array([0.5, 2.5]), tmp_path)
    broken = tmp_path / "film.mp4"
    for content in (FILM.read_bytes()[:1000], b"no film", b""):
        broken.write_bytes(content)
        with pytest.raises(DatasetError, match="cannot be decoded; save its frames under their times"):
            write_images(Film(broken, 0.0), np.array([0.0]), tmp_path)


def test_film_of_an_episode(tmp_path: Path) -> None:
    """Of v2 a file for each; it is asked which where there are several cameras."""
    data = dataset(tmp_path / "d", "left", "right")
    place = data / "videos" / "chunk-000" / "observation.images.left" / "episode_000003.mp4"
    place.parent.mkdir(parents=True)
    shutil.copy(FILM, place)
    assert find_film(data, 3, "left") == find_film(data, 3, "observation.images.left") == Film(place, 0.0)
    with pytest.raises(DatasetError, match="has the films left, right: say which one by --film"):
        find_film(data, 3, None)
    with pytest.raises(DatasetError, match=r"episode_000004\.mp4"):
        find_film(data, 4, "left")


def test_film_of_many_episodes(tmp_path: Path) -> None:
    """Of v3 the tables of episodes say which file, and where an episode begins in it."""
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    data = dataset(tmp_path / "d", "wrist")
    key = "videos/observation.images.wrist"
    rows = [
        {"episode_index": k, f"{key}/chunk_index": 0, f"{key}/file_index": 2, f"{key}/from_timestamp": 0.5 * k}
        for k in range(3)
    ]
    table = data / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    table.parent.mkdir(parents=True)
    parquet.write_table(pyarrow.Table.from_pylist(rows), table)
    with pytest.raises(DatasetError, match="is not there, though meta/episodes names it"):
        find_film(data, 1, None)
    place = data / key / "chunk-000" / "file-002.mp4"
    place.parent.mkdir(parents=True)
    shutil.copy(FILM, place)
    film = find_film(data, 1, None)
    assert film == Film(place, 0.5)
    np.testing.assert_allclose(levels(write_images(film, np.array([0.1]), tmp_path)), [4 * 18], atol=3)


def test_names_that_lead_elsewhere_are_no_films(tmp_path: Path) -> None:
    """A dataset from a stranger does not say which file beside it is read."""
    (tmp_path / "meta").mkdir()
    info = {"features": {"../../secret": {"dtype": "video"}}}
    (tmp_path / "meta" / "info.json").write_text(json.dumps(info))
    with pytest.raises(DatasetError, match="has the films none"):
        find_film(tmp_path, 0, None)


def test_frame_that_moved_least_of_each_period() -> None:
    """Of each second; all of them where no period is given."""
    stamps_s = np.arange(20) / 10
    values = np.cumsum(np.where((np.arange(20) % 10) == 4, 0.0, 1.0))[:, None] * [1.0, 100.0]
    values[4] = values[3]
    values[14] = values[13]
    taken = still_frames(values, stamps_s, 1.0)
    assert taken.tolist() == [3, 13]
    assert still_frames(values, stamps_s, 0.0).tolist() == list(range(20))
