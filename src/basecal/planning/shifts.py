"""Programmed shifts: at stations over the workspace, the target is shifted along its axes in front of a still camera.

Source: "Base Calibration for Dual Robot System", section 2: the shifts (2.2), and their repetition at different
positions (2.4). We differ: the camera points straight at the LED, and shifts have both signs. The error of the closed
form is then of second order. The length of shifts balances this error against pixel noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.planning import poses
from basecal.planning.candidates import RobotStates, candidates
from basecal.planning.feasible import blocked_samples, is_feasible, reach_pose
from basecal.planning.sketch import Sketch

_ASSUMED_PX = 0.1  # [px] noise of an LED's centre if the cell states none: that of a fitted spot
DIRECTIONS = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
"""Target positions at a station in units of the shift, (7, 3): the origin, and both signs along three axes."""

STATION_SAMPLES = len(DIRECTIONS)
"""Number of samples of a station."""

_PARALLEL_SINE = 1e-12  # sine below which vectors count as parallel
_STATION_TRIES = 40  # tried stations for each requested one
_ORIGIN_COUNT = 40  # at more than half of them, a shift leaves the image or the arm's reach
_LENGTH_FACTORS = (1.0, 2.0, 4.0)  # times the optimal length of `shift_length`


def plan(sketch: Sketch, home: Mapping[str, RobotState], samples: int, seed: int = 0) -> list[Sample]:
    """Plan stations with seven samples each: the target at its origin, and shifted both ways along its three axes.

    Args:
        sketch: Sketch of the cell.
        home: States of the robots, with the target in view.
        samples: Smallest number of samples; rounded up to whole stations.
        seed: Seed of the random draws.

    Raises:
        InputError: if no robot carries the target, or too few stations are feasible.
    """
    check_target(sketch)
    count = max(1, -(-samples // len(DIRECTIONS)))
    found: list[list[Sample]] = []
    for attempt in range(_STATION_TRIES):
        for drawn in poses.plan(sketch, home, count, seed + attempt):
            candidate = aim_camera(sketch, drawn)
            station = None if candidate is None else make_station(sketch, candidate, shift_length(sketch, candidate))
            start = found[-1][-1].robots if found else home
            if station is not None and not blocked_samples(sketch, start, station):
                found.append(station)
            if len(found) == count:
                return [Sample(k, robots=each.robots) for k, each in enumerate(s for station in found for s in station)]
    raise InputError(f"only {len(found)} of {count} stations are feasible: begin farther from the arms' limits")


def check_target(sketch: Sketch) -> None:
    """Check that a robot carries the target.

    Raises:
        InputError: if no robot carries it.
    """
    if sketch.target.on not in sketch.cell.robots:
        raise InputError(f"shifts need a target that a robot carries; {sketch.target.name!r} is on the world")


def aim_camera(sketch: Sketch, sample: Sample) -> Sample | None:
    """The sample with the camera rotated towards the target; None if the arm cannot reach it.

    A camera that no robot carries is not rotated. The closed form uses the camera's axis as the ray to the LED. Its
    error grows with the angle between them, however short the shifts are.
    """
    eye = sketch.camera.on
    if eye not in sketch.cell.robots:
        return sample
    target_in_camera = sketch.camera_from_target(sample) @ sketch.target_points.mean(0)
    axis, ray = np.array([0.0, 0.0, 1.0]), target_in_camera / np.linalg.norm(target_in_camera)
    normal = np.cross(axis, ray)
    sine = float(np.linalg.norm(normal))
    rotvec = np.arctan2(sine, float(ray[2])) / max(sine, _PARALLEL_SINE) * normal
    flange_from_camera = sketch.transforms[sketch.cell.mount_name(sketch.camera.name)]
    base_from_camera = sketch.base_from_flange(eye, sample.robots[eye]) @ flange_from_camera
    base_from_flange = base_from_camera @ SE3.from_rotvec(rotvec, np.zeros(3)) @ flange_from_camera.inverse()
    state = reach_pose(sketch.cell.robots[eye], base_from_flange, sample.robots[eye])
    return None if state is None else Sample(sample.sample, robots={**sample.robots, eye: state})


def make_station(sketch: Sketch, origin: Sample, length_m: float) -> list[Sample] | None:
    """The sample at the origin and its six shifts; None if one of them is not feasible.

    Args:
        sketch: Sketch of the cell.
        origin: Sample from which the target is shifted.
        length_m: Length of a shift [m].
    """
    hand = sketch.target.on
    flange_from_target = sketch.transforms[sketch.cell.mount_name(sketch.target.name)]
    base_from_flange = sketch.base_from_flange(hand, origin.robots[hand])
    samples: list[Sample] = []
    for direction in DIRECTIONS:
        shift = SE3(np.eye(3), length_m * direction)
        shifted = base_from_flange @ flange_from_target @ shift @ flange_from_target.inverse()
        state = reach_pose(sketch.cell.robots[hand], shifted, origin.robots[hand])
        if state is None:
            return None
        samples.append(Sample(len(samples), robots={**origin.robots, hand: state}))
    return samples if all(is_feasible(sketch, sample) for sample in samples) else None


def shift_length(sketch: Sketch, sample: Sample) -> float:
    """Length of shifts in both directions [m] with the smallest rotation error of the closed form.

    Noise of s px rotates the closed form by a = s d / (sqrt(2) f L) at depth d. The neglected change of depth cancels
    to first order between both directions, and rotates it by (L / d)^2. The sum is smallest at
    L = d (s / (2 sqrt(2) f))^(1/3).
    """
    depth = float(np.linalg.norm(sketch.camera_from_target(sample).translation))
    focal: Array = sketch.lens.focal
    sigma = sketch.cell.pixel_px or _ASSUMED_PX
    return depth * float(np.cbrt(sigma / (2 * np.sqrt(2) * focal.mean())))


def stations(sketch: Sketch, taught_states: Sequence[RobotStates], seed: int = 0) -> list[Sample]:
    """Samples of feasible stations, one station after another.

    Args:
        sketch: Sketch of the cell.
        taught_states: States of all robots at which the target was seen.
        seed: Seed of the random draws.

    Raises:
        InputError: if no robot carries the target, or no station is feasible.
    """
    check_target(sketch)
    found = list[Sample]()
    for drawn in candidates(sketch, taught_states, _ORIGIN_COUNT, seed):
        origin = aim_camera(sketch, drawn)
        for factor in _LENGTH_FACTORS if origin is not None else ():
            assert origin is not None
            station = make_station(sketch, origin, factor * shift_length(sketch, origin))
            if station is None:
                break
            if not blocked_samples(sketch, station[0].robots, station):
                found += station
    if not found:
        raise InputError("no station is feasible: teach poses farther from the arms' limits")
    return found
