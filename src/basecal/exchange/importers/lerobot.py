"""Import of a robot's joints and camera images from an episode of LeRobot."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from basecal.bounded_file import check_regular
from basecal.box import frames
from basecal.errors import DatasetError, InputError, UsageError, list_names
from basecal.exchange.fields import read_fields
from basecal.exchange.images import image_size
from basecal.exchange.importing.cell_files import scratch_folder
from basecal.exchange.importing.imported import (
    Imported,
    KnownCell,
    choose_carrier,
    known_cell,
    recorded_samples,
    replaceable_size,
)
from basecal.exchange.joints import joint_model
from basecal.exchange.lerobot import (
    LARGEST_INFO,
    Episode,
    JointUnit,
    joint_rows,
    motor_indices,
    nearest_frames,
    read_columns,
    read_episode,
    read_motor_ranges,
    select_motors,
    still_frames,
)
from basecal.geometry import Array, IntArray
from basecal.kinematics import SerialChain

_PREFIX = "observation.images."
_EPISODES = "meta", "episodes"
_NAME = re.compile(r"\w[\w.-]{0,99}")  # name of a feature, which is also the name of a folder
_MOST_FILES = 10**6  # largest index of a chunk, and of a file in a chunk


def read_lerobot(
    cell: str | Path,
    folder: str | Path,
    /,
    *,
    robot: str,
    unit: JointUnit,
    episode: int = 0,
    every_s: float = 1.0,
    calibration: Path | None = None,
    urdf: Path | None = None,
    base_link: str | None = None,
    flange_link: str | None = None,
    offset_sigma_deg: float | None = None,
    motors: str = "*",
    camera: str | None = None,
    film: str | None = None,
    on: str | None = None,
) -> Imported:
    """Import a robot's joints from an episode that LeRobot recorded (v2 or v3).

    The gripper is left out. The other motors are matched by the names of the
    URDF's joints, or in order. The frame of each second with the least motion of
    the motors becomes a sample. If samples with times lack the robot, the frames
    nearest to these times are added to them. Values are degrees
    (`use_degrees=true`), or normalised to -100 to 100, which needs the arm's
    calibration file. With --camera its film is read too. With two arms in one
    dataset, --motors selects one.

    For example:

        basecal import lerobot mycell my_dataset --robot left --unit deg \\
            --urdf so101.urdf --base-link base_link --flange-link gripper_link \\
            --offset-sigma-deg 2
        basecal import lerobot mycell my_dataset --robot left --unit deg \\
            --motors "left_*" --camera left_eye --film left_wrist

    Args:
        cell: Folder of the cell.
        folder: Folder of the dataset, with meta/ and data/ in it.
        robot: Name of the robot.
        unit: Unit of the joint values.
        episode: Number of the episode.
        every_s: Period in which one frame is taken [s]; 0 for all frames.
        calibration: LeRobot's calibration file of the arm, for normalised values.
        urdf: The robot's URDF, if the cell has none.
        base_link: Base link of the robot in that URDF.
        flange_link: Flange link of the robot in that URDF.
        offset_sigma_deg: Sigma of each joint's offset [deg]; the offsets are then estimated.
        motors: Pattern of the names of the robot's motors.
        camera: Name of the camera of the film; the robot carries it unless --on is given.
        film: Name of the film, if the dataset has several.
        on: Carrier of a new camera: a robot, or world.

    Raises:
        UsageError: if options are inconsistent, or a number is out of range.
        MissingExtra: if the parquet library is not installed.
        InputError: if the dataset cannot be read, or is inconsistent with the robot.
    """
    if calibration is not None and unit != "normalised":
        raise UsageError("--calibration belongs to --unit normalised")
    if episode < 0 or not every_s >= 0:
        raise UsageError("--episode and --every-s must be at least 0")
    if camera is None and (film is not None or on is not None):
        raise UsageError("--film and --on belong to --camera")
    model = joint_model(cell, robot, urdf, base_link, flange_link, offset_sigma_deg)
    ranges = None if calibration is None else read_motor_ranges(calibration)
    recorded = read_episode(Path(folder), episode)
    frame_indices = _choose_frames(cell, known_cell(cell), robot, recorded, every_s)
    chosen = select_motors(recorded, motors)
    rows = joint_rows(chosen, robot, model.chain, unit, ranges, frame_indices)
    what = f"{len(rows)} of {len(recorded.stamps_s)} frames of episode {episode}: joints of {robot!r} in {unit}"
    what += f": {_describe_motors(chosen, model.chain)}"
    advice = "check --unit, the calibration and the URDF"
    imported = Imported(str(folder), what, rows, model.entry, files=model.files, advice=advice)
    if camera is None:
        return imported
    imported = _with_camera(imported, cell, camera, on, robot)
    return _with_images(imported, Path(cell), camera, find_film(Path(folder), episode, film))


def _describe_motors(episode: Episode, chain: SerialChain) -> str:
    """Text of the motor used for each joint; a single name if motor and joint have the same name."""
    motors = [episode.names[index] for index in motor_indices(episode.names, chain.joint_names)]
    pairs = zip(chain.joint_names, motors, strict=True)
    return ", ".join(joint if joint == motor else f"{joint} from {motor}" for joint, motor in pairs)


def _choose_frames(folder: str | Path, cell: KnownCell, robot: str, episode: Episode, every_s: float) -> IntArray:
    """Frames nearest to samples that have a time but lack the robot; without such samples, the frames at rest."""
    samples = recorded_samples(folder, cell)
    times_s = [sample.stamp_s for sample in samples if sample.stamp_s is not None and robot not in sample.robots]
    found = nearest_frames(episode, np.array(times_s)) if times_s else np.zeros(0, dtype=np.int64)
    return found if len(found) else still_frames(episode, every_s)


def _with_camera(source: Imported, folder: str | Path, name: str, stated_carrier: str | None, robot: str) -> Imported:
    """A copy with a new camera with a free lens; for an existing camera, its unstated size may be replaced.

    Raises:
        InputError: if the cell states another carrier of the camera.
    """
    present_cell = known_cell(folder)
    if name in present_cell.cameras:
        choose_carrier(present_cell, "camera", name, stated_carrier)
        return replace(source, replaced=replaceable_size(folder, present_cell, name))
    camera = {"on": stated_carrier or robot, "intrinsics": {"status": "free"}}
    return replace(source, cell={**source.cell, "cameras": {name: camera}})


def _with_images(source: Imported, cell: Path, camera: str, film: Film) -> Imported:
    """A copy with the images of a film in its rows."""
    with scratch_folder(cell) as scratch:
        stamps = np.array([row.stamp_s for row in source.rows], dtype=np.float64)
        paths = write_images(film, stamps, Path(scratch.name))
    size_px = image_size(paths[0])
    rows = tuple(replace(row, images={camera: path}) for row, path in zip(source.rows, paths, strict=True))
    entry = {} if size_px is None else {"size_px": list(size_px)}
    cameras = {camera: entry | source.cell.get("cameras", {}).get(camera, {})}
    what = f"{source.what}, with what {camera!r} saw"
    return replace(source, what=what, rows=rows, cell={**source.cell, "cameras": cameras}, scratch=scratch)


class Film(NamedTuple):
    """A video file, and the start time of the episode in it [s]."""

    path: Path
    start_s: float


def find_film(folder: Path, number: int, name: str | None) -> Film:
    """Find the film of an episode.

    Args:
        folder: Folder of the dataset.
        number: Number of the episode.
        name: Feature of `info.json`, with or without "observation.images."; the only film if None.

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
    """Write grey images of a film at ascending times of the episode, (n,) [s], as files named by the times.

    Raises:
        DatasetError: if the film cannot be decoded, or ends before the last time.
    """
    check_regular(film.path)
    words = [os.path.abspath(film.path), *(repr(float(film.start_s + stamp)) for stamp in stamps_s)]
    paths = [folder / f"{stamp:010.3f}.png" for stamp in stamps_s]
    done = 0
    try:
        for (index,), content in frames("basecal.exchange.lerobot_film_boxed", words, film.path.stat().st_size):
            paths[int(index)].write_bytes(content)
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
    """Full name of a film's feature.

    Raises:
        DatasetError: if no film, or more than one, matches the name.
    """
    features = read_fields(folder / "meta" / "info.json", LARGEST_INFO).find("features")
    kinds = {key: features.find(key).first("dtype") for key in features.names() if _NAME.fullmatch(key)}
    films = [key for key, kind in kinds.items() if kind is not None and kind.data == "video"]
    chosen = [key for key in films if name in (None, key, key.removeprefix(_PREFIX))]
    if len(chosen) == 1:
        return chosen[0]
    short = list_names([key.removeprefix(_PREFIX) for key in films])
    raise DatasetError(folder, f"has the films {short}: choose one with --film")


def _shared_film(folder: Path, number: int, key: str) -> Film:
    names = [f"videos/{key}/{field}" for field in ("chunk_index", "file_index", "from_timestamp")]
    rows = read_columns(folder, folder.joinpath(*_EPISODES), number, names)
    chunk, file, start_s = (float(value) for value in rows[0])
    if not (0 <= chunk < _MOST_FILES and 0 <= file < _MOST_FILES):
        raise DatasetError(folder, f"has the film of episode {number} in chunk {chunk:g}, file {file:g}")
    path = folder / "videos" / key / f"chunk-{int(chunk):03d}" / f"file-{int(file):03d}.mp4"
    if not path.is_file():
        raise DatasetError(path, "is missing, although meta/episodes names it")
    return Film(path, start_s)
