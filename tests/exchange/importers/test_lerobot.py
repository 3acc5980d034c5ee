"""Tests of `basecal import lerobot`."""

from __future__ import annotations

import json
import shutil
import socket
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.exchange.test_lerobot import DEGREES, dataset, names_of
from tests.shared.boxed_here import boxed_here

from basecal.cell import RobotState, Sample
from basecal.cell.files import append_samples, read_cell, read_recording
from basecal.cli import main
from basecal.errors import DatasetError
from basecal.exchange.importers.lerobot import Film, _choose_frames, find_film, write_images
from basecal.exchange.lerobot import Episode
from basecal.exchange.urdf import chain_urdf
from basecal.geometry import SE3
from basecal.kinematics import SerialChain

FILM = Path(__file__).parents[2] / "data" / "film_av1.mp4"
"""60 images of 64 x 48 px at 30 Hz: number k has the level 4 k."""

pytest.importorskip("pyarrow")


def test_lerobot_dataset_becomes_cell(tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]) -> None:
    """Joints are read in radians with the URDF beside them; a wrong unit is refused."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    data = dataset(tmp_path / "d", names_of(arm))
    base = ["import", "lerobot", str(tmp_path / "c"), str(data), "--robot", "left", "--every-s", "0"]
    base += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    assert main([*base, "--unit", "rad"]) == 3
    assert "nothing is imported; check --unit" in capsys.readouterr().err
    assert main([*base, "--unit", "deg"]) == 0
    assert "3 of 3 frames of episode 0: joints of 'left' in deg" in capsys.readouterr().out
    found = [sample.robots["left"].joints_rad for sample in read_recording(tmp_path / "c").samples]
    np.testing.assert_allclose(np.degrees(found), DEGREES[:, :6], atol=1e-9)
    assert main([*base, "--unit", "deg", "--calibration", "x.json"]) == 2


def test_motor_assignment_by_order_is_reported(
    tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]
) -> None:
    """Motors named unlike the joints are listed with their joint, since a wrong order cannot be detected otherwise."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    data = dataset(tmp_path / "d", [*"uvwxyz", "gripper"])
    words = ["import", "lerobot", str(tmp_path / "c"), str(data), "--robot", "left", "--unit", "deg"]
    words += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    assert main(words) == 0
    pairs = ", ".join(f"{joint} from {motor}" for joint, motor in zip(arm.joint_names, "uvwxyz", strict=True))
    assert f"joints of 'left' in deg: {pairs}\n" in capsys.readouterr().out


def two_arms(folder: Path, arm: SerialChain, rest: int = 8) -> Path:
    """Write an episode of two arms with a film of each wrist, 60 frames at 30 Hz; the arms rest up to frame `rest`."""
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    names = [f"{side}_{name}.pos" for side in ("left", "right") for name in (*arm.joint_names, "gripper")]
    films = [f"observation.images.{side}_wrist" for side in ("left", "right")]
    features = {"observation.state": {"names": names}, **{film: {"dtype": "video"} for film in films}}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps({"features": features}))
    moved = np.maximum(np.arange(60) - float(rest), 0)[:, None] + np.concatenate([DEGREES[0], DEGREES[1]])
    rows = [
        {"observation.state": [float(v) for v in row], "timestamp": k / 30, "episode_index": 0}
        for k, row in enumerate(moved)
    ]
    table = folder / "data" / "chunk-000" / "episode_000000.parquet"
    table.parent.mkdir(parents=True)
    parquet.write_table(pyarrow.Table.from_pylist(rows), table)
    for film in films:
        place = folder / "videos" / "chunk-000" / film / "episode_000000.mp4"
        place.parent.mkdir(parents=True)
        shutil.copy(FILM, place)
    return folder


def test_two_arms_and_wrist_films_share_samples(
    tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]
) -> None:
    """Both arms and both cameras are in the same samples, at the frames in which the arms moved least."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    data, cell = two_arms(tmp_path / "d", arm), tmp_path / "c"
    for side in ("left", "right"):
        words = ["import", "lerobot", str(cell), str(data), "--robot", side, "--unit", "deg", "--motors", f"{side}_*"]
        words += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
        words += ["--camera", f"{side}_eye"]
        assert main(words) == 3
        assert "has the films left_wrist, right_wrist: choose one with --film" in capsys.readouterr().err
        assert main([*words, "--film", f"{side}_wrist"]) == 0
        assert (
            f"joints of '{side}' in deg: {', '.join(arm.joint_names)}, with what '{side}_eye' saw"
            in capsys.readouterr().out
        )
    found, samples = read_cell(cell), read_recording(cell).samples
    assert {name: (camera.on, camera.size_px) for name, camera in found.cameras.items()} == {
        "left_eye": ("left", (64, 48)),
        "right_eye": ("right", (64, 48)),
    }
    assert [sorted(sample.images) for sample in samples] == [["left_eye", "right_eye"]] * 2
    np.testing.assert_allclose(np.degrees(samples[0].robots["right"].joints_rad), DEGREES[1, :6], atol=1e-9)
    assert not list(tmp_path.glob(".import-*"))


def test_arm_without_camera_follows_existing_samples(
    tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each arm has a dataset of its own, with a camera on one and a board on the other.

    The second dataset's frames follow the samples.
    """
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    one, other, cell = two_arms(tmp_path / "one", arm), two_arms(tmp_path / "other", arm, rest=40), tmp_path / "c"
    base = ["--unit", "deg", "--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    first = ["import", "lerobot", str(cell), str(one), "--robot", "left", "--motors", "left_*", "--camera", "eye"]
    assert main([*first, *base, "--film", "left_wrist"]) == 0
    capsys.readouterr()
    second = ["import", "lerobot", str(cell), str(other), "--robot", "right", "--motors", "right_*"]
    assert main([*second, "--every-s", "0", *base]) == 0
    assert "2 of 60 frames" in capsys.readouterr().out
    samples = read_recording(cell).samples
    assert [sorted(sample.robots) for sample in samples] == [["left", "right"]] * 2
    for side, row, rest in (("left", 0, 8), ("right", 1, 40)):
        frames = np.array([30 * sample.stamp_s for sample in samples])
        found = np.degrees([sample.robots[side].joints_rad for sample in samples])
        np.testing.assert_allclose(found, np.maximum(frames - rest, 0)[:, None] + DEGREES[row, :6], atol=1e-6)


def test_film_option_needs_camera(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The camera of a film must be given."""
    words = ["import", "lerobot", str(tmp_path / "c"), str(tmp_path), "--robot", "left", "--unit", "deg"]
    assert main([*words, "--film", "wrist"]) == 2
    assert "--film and --on belong to --camera" in capsys.readouterr().err


def test_film_sets_image_size_of_new_cell(tmp_path: Path, arm: SerialChain, capsys: pytest.CaptureFixture[str]) -> None:
    """The size that `basecal new` writes is an example until a camera is recorded; a stated carrier must match."""
    (tmp_path / "arm.urdf").write_text(chain_urdf(arm, "base", "tool"))
    data, cell = two_arms(tmp_path / "d", arm), tmp_path / "c"
    assert main(["new", str(cell), "--names", "left", "right", "--squares", "5x7", "--square", "30mm"]) == 0
    words = ["import", "lerobot", str(cell), str(data), "--robot", "left", "--unit", "deg", "--motors", "left_*"]
    words += ["--urdf", str(tmp_path / "arm.urdf"), "--base-link", "base", "--flange-link", "tool"]
    words += ["--camera", "camera", "--film", "left_wrist"]
    assert main([*words, "--on", "right"]) == 3
    assert "camera 'camera' is on 'left' in cell.yaml, not on 'right'" in capsys.readouterr().err
    assert main(words) == 0
    assert read_cell(cell).cameras["camera"].size_px == (64, 48)


def film_dataset(folder: Path, *names: str) -> Path:
    (folder / "meta").mkdir(parents=True)
    features = {f"observation.images.{name}": {"dtype": "video", "names": None} for name in names}
    info = {"features": {"observation.state": {"dtype": "float32"}, **features}}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder


def levels(paths: list[Path]) -> list[float]:
    return [float(cv2.imread(str(path), cv2.IMREAD_UNCHANGED).mean()) for path in paths]


def test_film_images_are_extracted_at_episode_times(tmp_path: Path) -> None:
    """Times start at the episode's start in the film, and name the images."""
    paths = write_images(Film(FILM, 0.0), np.array([0.0, 0.5, 1.5]), tmp_path)
    assert [path.name for path in paths] == ["000000.000.png", "000000.500.png", "000001.500.png"]
    np.testing.assert_allclose(levels(paths), [0, 60, 180], atol=3)
    later = write_images(Film(FILM, 1.0), np.array([0.1]), tmp_path)
    np.testing.assert_allclose(levels(later), [4 * 33], atol=3)


def test_short_and_invalid_films_are_reported(tmp_path: Path) -> None:
    """The error is one line with the film and what to do."""
    with pytest.raises(DatasetError, match=r"ends before 2.5 s of the episode"):
        write_images(Film(FILM, 0.0), np.array([0.5, 2.5]), tmp_path)
    broken = tmp_path / "film.mp4"
    for content in (FILM.read_bytes()[:1000], b"no film", b""):
        broken.write_bytes(content)
        with boxed_here(), pytest.raises(DatasetError, match="cannot be decoded; save its frames under their times"):
            write_images(Film(broken, 0.0), np.array([0.0]), tmp_path)


def test_film_of_episode_is_found(tmp_path: Path) -> None:
    """Version 2 has a file for each episode; with several cameras a choice is requested."""
    data = film_dataset(tmp_path / "d", "left", "right")
    place = data / "videos" / "chunk-000" / "observation.images.left" / "episode_000003.mp4"
    place.parent.mkdir(parents=True)
    shutil.copy(FILM, place)
    assert find_film(data, 3, "left") == find_film(data, 3, "observation.images.left") == Film(place, 0.0)
    with pytest.raises(DatasetError, match="has the films left, right: choose one with --film"):
        find_film(data, 3, None)
    with pytest.raises(DatasetError, match=r"episode_000004\.mp4"):
        find_film(data, 4, "left")


def test_film_of_many_episodes_is_found(tmp_path: Path) -> None:
    """Version 3's tables of episodes state the file, and where an episode starts in it."""
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    data = film_dataset(tmp_path / "d", "wrist")
    key = "videos/observation.images.wrist"
    rows = [
        {"episode_index": k, f"{key}/chunk_index": 0, f"{key}/file_index": 2, f"{key}/from_timestamp": 0.5 * k}
        for k in range(3)
    ]
    table = data / "meta" / "episodes" / "chunk-000" / "file-000.parquet"
    table.parent.mkdir(parents=True)
    parquet.write_table(pyarrow.Table.from_pylist(rows), table)
    with pytest.raises(DatasetError, match="is missing, although meta/episodes names it"):
        find_film(data, 1, None)
    place = data / key / "chunk-000" / "file-002.mp4"
    place.parent.mkdir(parents=True)
    shutil.copy(FILM, place)
    film = find_film(data, 1, None)
    assert film == Film(place, 0.5)
    np.testing.assert_allclose(levels(write_images(film, np.array([0.1]), tmp_path)), [4 * 18], atol=3)


@pytest.mark.parametrize("key", ["../../secret", "..", "*", "a" * 300, "a\0b", "a,b"])
def test_unsafe_film_names_are_refused(tmp_path: Path, key: str) -> None:
    """A foreign dataset must not determine which other file is read."""
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"features": {key: {"dtype": "video"}}}))
    with pytest.raises(DatasetError, match="has the films none"):
        find_film(tmp_path, 0, None)


@pytest.mark.parametrize("number", [-1.0, 1e300])
def test_invalid_film_file_numbers_are_refused(tmp_path: Path, number: float) -> None:
    """A table of episodes may contain any number."""
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    data, key = film_dataset(tmp_path / "d", "wrist"), "videos/observation.images.wrist"
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
def test_playlists_are_not_opened_as_films(tmp_path: Path, kind: str) -> None:
    """A film that names an address, or another film, opens neither: the listening peer receives no connection."""
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


def test_frames_follow_samples_without_robot(tmp_path: Path) -> None:
    """Frames are those of timed samples that lack the robot; if none is near the episode, the frames at rest."""
    (tmp_path / "cell.yaml").write_text("schema: basecal/cell/1\nreference: a\nrobots: {a: {}, b: {}}\n")
    state = {"a": RobotState(SE3.identity())}
    append_samples(
        tmp_path, [Sample(0, 0.5, state), Sample(1, 1.5, {**state, "b": state["a"]}), Sample(2, None, state)]
    )
    episode = Episode(("m",), np.arange(8.0)[:, None], np.arange(8) / 4)
    cell = read_cell(tmp_path)
    assert _choose_frames(tmp_path, cell, "b", episode, 0.0).tolist() == [2]
    assert _choose_frames(tmp_path, cell, "a", episode, 0.0).tolist() == list(range(8))
    late = Episode(("m",), episode.values, episode.stamps_s + 100)
    assert _choose_frames(tmp_path, cell, "b", late, 0.0).tolist() == list(range(8))
    assert len(_choose_frames(tmp_path, cell, "b", late, 1.0)) == 2
