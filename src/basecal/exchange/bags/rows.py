"""Rows of a recording from a bag: one for each stop, or one for each message."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from basecal.cell import PixelObservation, PoseObservation, RobotState
from basecal.errors import DatasetError, InputError
from basecal.exchange.bags.bag import Bag, message_time
from basecal.exchange.bags.images import image_file
from basecal.exchange.bags.sources import Taken
from basecal.exchange.bags.stops import Instant, Look, collect_looks, explain_no_stop, find_stops
from basecal.exchange.bags.tracks import Track, Tracks
from basecal.exchange.importing.imported import Row

_MOST_ROWS = 200_000  # as many as a recording may have samples


def still_instants(tracks: Tracks, path: str) -> tuple[Instant, ...]:
    """One for each stop of the robots.

    Raises:
        InputError: if there is none.
    """
    stops = find_stops(tracks)
    if not stops:
        raise InputError(f"{path}: {explain_no_stop(tracks)}")
    return stops


def stream_instants(tracks: Tracks, path: str) -> tuple[Instant, ...]:
    """One for each record of a robot, and one for each look, by time.

    Raises:
        InputError: if they are more than a recording holds.
    """
    found = [
        Instant(float(time), {name: _state(track, k)})
        for name, track in tracks.robots.items()
        for k, time in enumerate(track.times)
    ]
    found += [Instant(look.stamp_s, {}, (look,)) for look in collect_looks(tracks)]
    if len(found) > _MOST_ROWS:
        raise InputError(f"{path}: {len(found)} lines, expected at most {_MOST_ROWS}: cut it, as by `ros2 bag convert`")
    return tuple(sorted(found, key=lambda instant: instant.stamp_s))


def write_images(bag: Bag, sources: Taken, instants: Sequence[Instant], folder: Path) -> dict[Look, Path]:
    """The images of instants, each written into a folder as it is read: under its time, to be imported again by it.

    Raises:
        InputError: if one cannot be read, or written.
    """
    looks = {look for instant in instants for look in instant.looks if isinstance(look.channel, str)}
    wanted = {(look.channel, look.place): look for look in looks}
    written = {}
    cameras = {source.topic: name for name, source in sources.cameras.items()}
    seen = dict.fromkeys(cameras.values(), 0)
    for message in bag.read(cameras):
        camera = cameras[message.topic.name]
        look = wanted.get((camera, seen[camera]))
        seen[camera] += 1
        if look is None:
            continue
        if message_time(message.data.header, message.recorded_s) != look.stamp_s:
            raise DatasetError(bag.path, f"{message.topic.name} was read in another order than before")
        image = image_file(message, bag.path)
        written[look] = folder / camera / f"{look.stamp_s:.6f}{image.ending}"
        written[look].parent.mkdir(exist_ok=True)
        written[look].write_bytes(image.content)
    for look in looks - written.keys():
        raise InputError(f"an image of {look.channel} at {look.stamp_s:.6f} s was there, and is not when read again")
    return written


def make_rows(tracks: Tracks, instants: Sequence[Instant], paths: Mapping[Look, Path]) -> Iterator[Row]:
    """A row for each instant, with its images where they were written."""
    for instant in instants:
        images: dict[str, Path] = {}
        views: list[PoseObservation | PixelObservation] = []
        for look in instant.looks:
            if isinstance(look.channel, str):
                images[look.channel] = paths[look]
                continue
            view = tracks.views[look.channel]
            if view.tags is not None:
                views.append(PixelObservation(*look.channel, *view.tags[look.place]))
            elif view.poses is not None:
                views.append(PoseObservation(*look.channel, view.poses[look.place]))
        yield Row(instant.robots, tuple(views), images, stamp_s=instant.stamp_s)


def _state(track: Track, k: int) -> RobotState:
    if track.joints is not None:
        return RobotState(joints_rad=track.joints[k])
    assert track.poses is not None
    return RobotState(track.poses[k])
