"""Rows of a recording from a bag: one per stop, or one per message."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from basecal.cell import PixelObservation, PoseObservation, RobotState
from basecal.cell.journal.recording_file import MOST_SAMPLES
from basecal.errors import DatasetError, InputError
from basecal.exchange.bags.bag import Bag, message_time
from basecal.exchange.bags.images import image_file
from basecal.exchange.bags.sources import BagSources
from basecal.exchange.bags.tracks import Track, Tracks
from basecal.exchange.importing.imported import Row
from basecal.geometry import Array

_REST_MARGIN_S = 0.15  # before and after an image robots must be at rest: longer than a camera's latency
_LARGEST_GAP_S = 0.25  # to the nearest record before or after an image: within a longer gap a robot may move
_STILL_RAD_M = 1e-4  # largest spread of states at rest [m, rad]: 0.1 mm at one metre
_LARGEST_SPREAD_SIGMAS = 8.0  # largest spread in sigmas of the states' noise: the spread of 75 states is five
_LARGEST_NOISE = 5e-4  # largest plausible noise of recorded states [m, rad]
_STOP_TOLERANCE = 1e-3  # from the start of a stop [m, rad]: distinct stops are further apart
_SECOND_DIFFERENCE = np.sqrt(6.0)  # sigma of a second difference in units of a state's sigma

Channel = str | tuple[str, str]
"""A camera with images, or a camera and the target that it views."""


def still_instants(tracks: Tracks, path: str) -> tuple[Instant, ...]:
    """Instants of a recording, one per stop of the robots.

    Raises:
        InputError: if there is no stop.
    """
    stops = find_stops(tracks)
    if not stops:
        raise InputError(f"{path}: {explain_no_stop(tracks)}")
    return stops


def stream_instants(tracks: Tracks, path: str) -> tuple[Instant, ...]:
    """Instants of a recording, one per record of a robot and one per image or view, sorted by time.

    Raises:
        InputError: if there are more than a recording may hold.
    """
    found = [
        Instant(float(time), {name: _state(track, k)})
        for name, track in tracks.robots.items()
        for k, time in enumerate(track.times)
    ]
    found += [Instant(entry.stamp_s, {}, (entry,)) for entry in collect_entries(tracks)]
    if len(found) > MOST_SAMPLES:
        raise InputError(
            f"{path}: {len(found)} lines, expected at most {MOST_SAMPLES}: shorten it, as by `ros2 bag convert`"
        )
    return tuple(sorted(found, key=lambda instant: instant.stamp_s))


def write_images(bag: Bag, sources: BagSources, instants: Sequence[Instant], folder: Path) -> dict[ChannelEntry, Path]:
    """Write the images of instants into a folder, one at a time, named by their time stamps; return their paths.

    Raises:
        InputError: if an image cannot be read or written.
    """
    entries = {entry for instant in instants for entry in instant.entries if isinstance(entry.channel, str)}
    entries_by_position = {(entry.channel, entry.position): entry for entry in entries}
    written = {}
    cameras = {source.topic: name for name, source in sources.cameras.items()}
    next_position = dict.fromkeys(cameras.values(), 0)
    for message in bag.read(cameras):
        camera = cameras[message.topic.name]
        entry = entries_by_position.get((camera, next_position[camera]))
        next_position[camera] += 1
        if entry is None:
            continue
        if message_time(message.data.header, message.recorded_s) != entry.stamp_s:
            raise DatasetError(bag.path, f"{message.topic.name} was read in another order than before")
        image = image_file(message, bag.path)
        written[entry] = folder / camera / f"{entry.stamp_s:.6f}{image.ending}"
        written[entry].parent.mkdir(exist_ok=True)
        written[entry].write_bytes(image.content)
    for entry in entries - written.keys():
        raise InputError(f"an image of {entry.channel} at {entry.stamp_s:.6f} s is missing when the bag is read again")
    return written


def make_rows(tracks: Tracks, instants: Sequence[Instant], paths: Mapping[ChannelEntry, Path]) -> Iterator[Row]:
    """Create a row per instant, with the paths of its images."""
    for instant in instants:
        images: dict[str, Path] = {}
        views: list[PoseObservation | PixelObservation] = []
        for entry in instant.entries:
            if isinstance(entry.channel, str):
                images[entry.channel] = paths[entry]
                continue
            view = tracks.views[entry.channel]
            if view.tags is not None:
                views.append(PixelObservation(*entry.channel, *view.tags[entry.position]))
            elif view.poses is not None:
                views.append(PoseObservation(*entry.channel, view.poses[entry.position]))
        yield Row(instant.robots, tuple(views), images, stamp_s=instant.stamp_s)


def _state(track: Track, k: int) -> RobotState:
    if track.joints is not None:
        return RobotState(joints_rad=track.joints[k])
    assert track.poses is not None
    return RobotState(track.poses[k])


class ChannelEntry(NamedTuple):
    """An image of a camera or a view of a target: its channel, its position in the channel, and its time stamp [s]."""

    channel: Channel
    position: int
    stamp_s: float


@dataclass(frozen=True, eq=False)
class Instant:
    """A sample before its images are written: robot states, and the images and views."""

    stamp_s: float
    robots: Mapping[str, RobotState]
    entries: tuple[ChannelEntry, ...] = ()


def collect_entries(tracks: Tracks) -> list[ChannelEntry]:
    """All images and views, sorted by time; of images of a camera with the same time only the first."""
    times: dict[Channel, Array] = {key: view.times for key, view in tracks.views.items()}
    times.update(tracks.images)
    found = []
    for channel, stamps in times.items():
        _, first = np.unique(stamps, return_index=True)
        found += [ChannelEntry(channel, int(k), float(stamps[k])) for k in first]
    return sorted(found, key=lambda entry: entry.stamp_s)


def find_stops(tracks: Tracks) -> tuple[Instant, ...]:
    """Find the stops with images or views.

    Each channel contributes the image or view nearest to the middle of the stop. Robot states are those at the time of
    the first of these.
    """
    stops = []
    for entries in _entries_by_stop(tracks, collect_entries(tracks)):
        middle = (entries[0].stamp_s + entries[-1].stamp_s) / 2
        nearest: dict[Channel, ChannelEntry] = {}
        for entry in sorted(entries, key=lambda entry: abs(entry.stamp_s - middle)):
            nearest.setdefault(entry.channel, entry)
        chosen = tuple(nearest.values())
        robots = {}
        for name, track in tracks.robots.items():
            values = _state_at_rest(track, chosen[0].stamp_s)
            assert values is not None
            robots[name] = _state(track, 0).with_vector(values)
        stops.append(Instant(chosen[0].stamp_s, robots, chosen))
    return tuple(stops)


def explain_no_stop(tracks: Tracks) -> str:
    """Message about the absence of stops, with its cause and a fix."""
    if not collect_entries(tracks):
        return "there is no image, and no --view names a topic of poses or tags: --list shows the topics"
    do = "--streams imports all data in motion, each device with its own clock"
    rare = [name for name, track in tracks.robots.items() if _usual_gap(track) > _LARGEST_GAP_S]
    if rare:
        gap = _usual_gap(tracks.robots[rare[0]])
        return f"{rare[0]} was recorded every {gap:.2g} s; {_LARGEST_GAP_S} s or less is needed to detect stops: {do}"
    return f"the robots are never all at rest for {2 * _REST_MARGIN_S} s around an image: {do}"


def _usual_gap(track: Track) -> float:
    return float(np.median(np.diff(track.times))) if len(track.times) > 1 else np.inf


def _entries_by_stop(tracks: Tracks, entries: Sequence[ChannelEntry]) -> Iterator[list[ChannelEntry]]:
    """Images and views of each stop of all robots."""
    stop: list[ChannelEntry] = []
    first_states: dict[str, Array] = {}
    for entry in entries:
        states = {name: _state_at_rest(track, entry.stamp_s) for name, track in tracks.robots.items()}
        at_rest = {name: state for name, state in states.items() if state is not None}
        is_still = len(at_rest) == len(states)
        is_same_stop = is_still and all(
            np.abs(state - first_states.get(name, state)).max() < _STOP_TOLERANCE for name, state in at_rest.items()
        )
        if stop and not is_same_stop:
            yield stop
            stop = []
        if is_still:
            first_states = first_states if stop else at_rest
            stop.append(entry)
    if stop:
        yield stop


def _state_at_rest(track: Track, time: float) -> Array | None:
    """Mean of the states around a time, (k,); None if they differ by more than their noise, or are missing."""
    times = track.times
    if time - _REST_MARGIN_S < times[0] or time + _REST_MARGIN_S > times[-1]:
        return None
    before, after = int(np.searchsorted(times, time, side="right")) - 1, int(np.searchsorted(times, time))
    if max(time - times[before], times[after] - time) > _LARGEST_GAP_S:
        return None
    low = min(before, int(np.searchsorted(times, time - _REST_MARGIN_S)))
    high = max(after, int(np.searchsorted(times, time + _REST_MARGIN_S, side="right")) - 1)
    values = _vectors(track, slice(low, high + 1))
    noise = np.diff(values, n=2, axis=0).std(axis=0) / _SECOND_DIFFERENCE if len(values) > 3 else np.zeros(1)
    allowed = np.maximum(_STILL_RAD_M, _LARGEST_SPREAD_SIGMAS * np.minimum(noise, _LARGEST_NOISE))
    return None if np.any(np.ptp(values, axis=0) > allowed) else np.asarray(values.mean(axis=0))


def _vectors(track: Track, part: slice) -> Array:
    """Joints [rad], or positions [m] and rotation matrices, of a part of a track, (n, k)."""
    if track.joints is not None:
        return track.joints[part]
    assert track.poses is not None
    poses = track.poses[part]
    return np.concatenate([poses.translation, poses.rotation.reshape(-1, 9)], axis=1)
