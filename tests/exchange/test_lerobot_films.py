"""Films of LeRobot, in both layouts; the film was made by PyAV with SVT-AV1, as LeRobot makes its films."""

from __future__ import annotations

import json
import shutil
import socket
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.shared.boxed_here import boxed_here

from basecal.errors import DatasetError
from basecal.exchange.lerobot_films import Film, find_film, write_images

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
    """From where the episode begins; they are named by their times."""
    paths = write_images(Film(FILM, 0.0), np.array([0.0, 0.5, 1.5]), tmp_path)
    assert [path.name for path in paths] == ["000000.000.png", "000000.500.png", "000001.500.png"]
    np.testing.assert_allclose(levels(paths), [0, 60, 180], atol=3)
    later = write_images(Film(FILM, 1.0), np.array([0.1]), tmp_path)
    np.testing.assert_allclose(levels(later), [4 * 33], atol=3)


def test_films_that_end_or_are_none(tmp_path: Path) -> None:
    """One line says which, and what to do."""
    with pytest.raises(DatasetError, match=r"ends before 2.5 s of the episode"):
        write_images(Film(FILM, 0.0), np.array([0.5, 2.5]), tmp_path)
    broken = tmp_path / "film.mp4"
    for content in (FILM.read_bytes()[:1000], b"no film", b""):
        broken.write_bytes(content)
        with boxed_here(), pytest.raises(DatasetError, match="cannot be decoded; save its frames under their times"):
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


@pytest.mark.parametrize("key", ["../../secret", "..", "*", "a" * 300, "a\0b", "a,b"])
def test_names_that_lead_elsewhere_are_no_films(tmp_path: Path, key: str) -> None:
    """A dataset from a stranger does not say which file beside it is read."""
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"features": {key: {"dtype": "video"}}}))
    with pytest.raises(DatasetError, match="has the films none"):
        find_film(tmp_path, 0, None)


@pytest.mark.parametrize("number", [-1.0, 1e300])
def test_files_of_no_number_are_refused(tmp_path: Path, number: float) -> None:
    """A table of episodes may hold any number."""
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    data, key = dataset(tmp_path / "d", "wrist"), "videos/observation.images.wrist"
    row = {"episode_index": 0, f"{key}/chunk_index": 0.0, f"{key}/file_index": number, f"{key}/from_timestamp": 0.0}
    (data / "meta" / "episodes").mkdir()
    parquet.write_table(pyarrow.Table.from_pylist([row]), data / "meta" / "episodes" / "a.parquet")
    with pytest.raises(DatasetError, match=r"has the film of episode 0 in chunk 0, file"):
        find_film(data, 0, None)


PLAYLISTS = {
    "HLS": "#EXTM3U\n#EXT-X-TARGETDURATION:2\n#EXTINF:2,\n{0}\n#EXT-X-ENDLIST\n",
    "concat": "ffconcat version 1.0\nfile '{0}'\n",
    "SDP": "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=a\nc=IN IP4 127.0.0.1\nt=0 0\nm=video {1} RTP/AVP 96\n",
}


@pytest.mark.parametrize("kind", PLAYLISTS)
def test_lists_of_addresses_are_no_films(tmp_path: Path, kind: str) -> None:
    """A film that names an address, or a film beside it, opens neither: the peer that listens hears nothing."""
    path = tmp_path / "film.mp4"
    with socket.create_server(("127.0.0.1", 0)) as peer:
        peer.settimeout(0.2)
        port = peer.getsockname()[1]
        for there in (f"http://127.0.0.1:{port}/a.mp4", f"tcp://127.0.0.1:{port}", str(FILM), "beside.mp4"):
            shutil.copy(FILM, tmp_path / "beside.mp4")
            path.write_text(PLAYLISTS[kind].format(there, port))
            with boxed_here(), pytest.raises(DatasetError, match="cannot be decoded"):
                write_images(Film(path, 0.0), np.array([0.0]), tmp_path)
        with pytest.raises(TimeoutError):
            peer.accept()
