"""Films of LeRobot's recordings: which file shows an episode, and its images at given times.

Source: huggingface.co, LeRobotDataset v2.1 (a film an episode, videos/chunk-000/KEY/episode_000000.mp4) and v3.0 (films
of many episodes, videos/KEY/chunk-000/file-000.mp4; meta/episodes/ has the `from_timestamp` of each).
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

from basecal.bounded_file import check_regular
from basecal.box import frames
from basecal.errors import DatasetError, InputError, list_names
from basecal.exchange.fields import read_fields
from basecal.exchange.lerobot import LARGEST_INFO, read_columns
from basecal.geometry import Array

_PREFIX = "observation.images."
_EPISODES = "meta", "episodes"
_NAME = re.compile(r"\w[\w.-]{0,99}")  # of a feature, which becomes a folder's
_MOST_FILES = 10**6  # of a chunk, and chunks


class Film(NamedTuple):
    """A file, and when the episode begins in it [s]."""

    path: Path
    start_s: float


def find_film(folder: Path, number: int, name: str | None) -> Film:
    """The film of an episode.

    Args:
        folder: Of the dataset.
        number: Of the episode.
        name: Feature of `info.json`, with or without "observation.images."; the only one if None.

    Raises:
        DatasetError: if there is no such film.
    """
    key = _choose_feature(folder, name)
    if (folder / Path(*_EPISODES)).is_dir():
        return _shared_film(folder, number, key)
    found = sorted((folder / "videos").glob(f"*/{key}/episode_{number:06d}.mp4"))
    if not found:
        raise DatasetError(folder, f"has no film videos/*/{key}/episode_{number:06d}.mp4")
    return Film(found[0], 0.0)


def write_images(film: Film, stamps_s: Array, folder: Path) -> list[Path]:
    """Images of a film at rising times of its episode, (n,) [s], as files of a folder named by these; in grey.

    Raises:
        DatasetError: if the film cannot be decoded, or ends before.
    """
    check_regular(film.path)
    words = [os.path.abspath(film.path), *(repr(float(film.start_s + stamp)) for stamp in stamps_s)]
    paths = [folder / f"{stamp:010.3f}.png" for stamp in stamps_s]
    done = 0
    try:
        for (at,), content in frames("basecal.exchange.lerobot_film_boxed", words, film.path.stat().st_size):
            paths[int(at)].write_bytes(content)
            done += 1
    except DatasetError:
        raise
    except InputError as error:
        advice = "save its frames under their times, and import them by `basecal import images --by time`"
        raise DatasetError(film.path, f"{error}; {advice}") from None
    if done < len(paths):
        raise DatasetError(film.path, f"ends before {stamps_s[done]:g} s of the episode")
    return paths


def _choose_feature(folder: Path, name: str | None) -> str:
    """The full name of a film.

    Raises:
        DatasetError: if there is none, or it is not clear which.
    """
    features = read_fields(folder / "meta" / "info.json", LARGEST_INFO).find("features")
    kinds = {key: features.find(key).first("dtype") for key in features.names() if _NAME.fullmatch(key)}
    films = [key for key, kind in kinds.items() if kind is not None and kind.data == "video"]
    chosen = [key for key in films if name in (None, key, key.removeprefix(_PREFIX))]
    if len(chosen) == 1:
        return chosen[0]
    short = list_names([key.removeprefix(_PREFIX) for key in films])
    raise DatasetError(folder, f"has the films {short}: say which one by --film")


def _shared_film(folder: Path, number: int, key: str) -> Film:
    names = [f"videos/{key}/{field}" for field in ("chunk_index", "file_index", "from_timestamp")]
    rows = read_columns(folder, folder.joinpath(*_EPISODES), number, names)
    chunk, file, start_s = (float(value) for value in rows[0])
    if not (0 <= chunk < _MOST_FILES and 0 <= file < _MOST_FILES):
        raise DatasetError(folder, f"has the film of episode {number} in chunk {chunk:g}, file {file:g}")
    path = folder / "videos" / key / f"chunk-{int(chunk):03d}" / f"file-{int(file):03d}.mp4"
    if not path.is_file():
        raise DatasetError(path, "is not there, though meta/episodes names it")
    return Film(path, start_s)
