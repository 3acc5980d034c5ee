"""A recording from streams that other programs measured side by side, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from basecal.cell import Observation, PixelObservation, PoseObservation, Recording, RobotState, Sample
from basecal.errors import InputError
from basecal.exchange.controller_poses import PoseStream
from basecal.geometry import Array, IntArray


def recording_from_streams(
    robots: Mapping[str, PoseStream],
    camera: str,
    target: str,
    camera_from_target: PoseStream | None = None,
    pixels: Mapping[int, tuple[IntArray, Array]] | None = None,
    sigma_px: float | None = None,
) -> Recording:
    """A recording whose sample i is the i-th pose of every stream; a robot of one pose stands still.

    Args:
        robots: `base_from_flange` by robot.
        camera: Which camera saw the target.
        target: Which target it saw.
        camera_from_target: Its pose, where another program found it.
        pixels: Ids and pixels by sample, where only its points were found; a sample may have none.
        sigma_px: Of the pixels, per coordinate [px]; None if not stated.

    Raises:
        InputError: if the streams differ in length, or pixels belong to a sample that is not there.
    """
    streams = [*robots.values(), *([camera_from_target] if camera_from_target else [])]
    lengths = {stream.path: len(stream.poses) for stream in streams}
    if not lengths:
        raise InputError("no pose file: at least one robot's poses are needed")
    count = max(lengths.values())
    moving = [stream for stream in streams if stream is camera_from_target or len(stream.poses) > 1]
    if any(len(stream.poses) != count for stream in moving):
        found = ", ".join(f"{path} holds {length}" for path, length in lengths.items())
        raise InputError(f"the pose files differ in length: {found}; pose i of each must belong to the same instant")
    strangers = sorted(set(pixels or ()) - set(range(count)))
    if strangers:
        raise InputError(f"pixels of sample {strangers[0]}, but the poses end at sample {count - 1}")
    timed = [stream.stamps_s for stream in streams if stream.stamps_s is not None and len(stream.poses) == count]
    stamps_s = next(iter(timed), None)
    samples = []
    for i in range(count):
        seen: list[Observation] = []
        if camera_from_target:
            seen.append(PoseObservation(camera, target, camera_from_target.poses[i]))
        if pixels and i in pixels:
            ids, at = pixels[i]
            sigmas = None if sigma_px is None else np.full(len(ids), sigma_px)
            seen.append(PixelObservation(camera, target, ids, at, sigmas))
        states = {robot: RobotState(stream.poses[min(i, len(stream.poses) - 1)]) for robot, stream in robots.items()}
        stamp_s = None if stamps_s is None else float(stamps_s[i])
        samples.append(Sample(i, stamp_s, states, tuple(seen)))
    return Recording(tuple(samples))
