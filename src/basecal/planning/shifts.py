"""Programmed shifts: from stations over the workspace, the target is shifted along its axes before a still camera.

Source: "Base Calibration for Dual Robot System", section 2: the shifts (2.2), and that they are done several times at
different positions (2.4). We differ: the camera looks straight at the light, and shifts go to both sides. What the
closed form neglects is then of second order. The length of shifts balances it against the noise of pixels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from basecal.cell import RobotState, Sample
from basecal.errors import InputError
from basecal.geometry import SE3, Array
from basecal.planning import poses
from basecal.planning.candidates import Taught, candidates
from basecal.planning.feasible import blocked_samples, is_feasible, reach_pose
from basecal.planning.sketch import Sketch

_ASSUMED_PX = 0.1  # [px] of a light's centre where the cell states no noise: that of a fitted spot
DIRECTIONS = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
"""Where the target goes at a station, in units of the shift, (7, 3): its origin, and both sides along three axes."""

STATION_SAMPLES = len(DIRECTIONS)
"""Of a station."""

_PARALLEL_SINE = 1e-12  # sine of an angle that is none
_STATION_TRIES = 40  # stations that are looked at for each that is wanted
_ORIGIN_COUNT = 40  # half of them, and more, have a shift that leaves the image or the arm's reach
_LENGTH_FACTORS = (1.0, 2.0, 4.0)  # of the shift at which pixel noise and what the closed form neglects do least


def plan(sketch: Sketch, home: Mapping[str, RobotState], samples: int, seed: int = 0) -> list[Sample]:
    """Stations with seven samples each: the target at its origin, and shifted to both sides along its three axes.

    Args:
        sketch: What is known of the cell.
        home: Where the robots are, with the target in view.
        samples: How many at least; whole stations are made of them.
        seed: Of the draws.

    Raises:
        InputError: if the target is on the world, or hardly any station is feasible.
    """
    check_target(sketch)
    wanted = max(1, -(-samples // len(DIRECTIONS)))
    found: list[list[Sample]] = []
    for tried in range(_STATION_TRIES):
        for drawn in poses.plan(sketch, home, wanted, seed + tried):
            candidate = aim_camera(sketch, drawn)
            station = None if candidate is None else make_station(sketch, candidate, shift_length(sketch, candidate))
            before = found[-1][-1].robots if found else home
            if station is not None and not blocked_samples(sketch, before, station):
                found.append(station)
            if len(found) == wanted:
                return [Sample(k, robots=each.robots) for k, each in enumerate(s for station in found for s in station)]
    raise InputError(f"only {len(found)} of {wanted} stations can be shifted from: begin farther from the arms' limits")


def check_target(sketch: Sketch) -> None:
    """Check that a robot carries the target.

    Raises:
        InputError: if none does.
    """
    if sketch.target.on not in sketch.cell.robots:
        raise InputError(f"shifts need a target that a robot carries; {sketch.target.name!r} is on the world")


def aim_camera(sketch: Sketch, sample: Sample) -> Sample | None:
    """The sample with its camera turned towards the target; None if the arm does not reach, or nobody carries it.

    The closed form uses the camera's axis as the ray to the light. Its error grows with the angle between them, however
    short the shifts are.
    """
    eye = sketch.camera.on
    if eye not in sketch.cell.robots:
        return sample
    at = sketch.camera_from_target(sample) @ sketch.target_points.mean(0)
    ahead, ray = np.array([0.0, 0.0, 1.0]), at / np.linalg.norm(at)
    across = np.cross(ahead, ray)
    sine = float(np.linalg.norm(across))
    turn = np.arctan2(sine, float(ray[2])) / max(sine, _PARALLEL_SINE) * across
    flange_from_camera = sketch.transforms[sketch.cell.mount_name(sketch.camera.name)]
    base_from_camera = sketch.base_from_flange(eye, sample.robots[eye]) @ flange_from_camera
    turned = base_from_camera @ SE3.from_rotvec(turn, np.zeros(3)) @ flange_from_camera.inverse()
    state = reach_pose(sketch.cell.robots[eye], turned, sample.robots[eye])
    return None if state is None else Sample(sample.sample, robots={**sample.robots, eye: state})


def make_station(sketch: Sketch, origin: Sample, length_m: float) -> list[Sample] | None:
    """The origin and its six shifts; None if one of them cannot be taken.

    Args:
        sketch: What is known of the cell.
        origin: Where the shifts start from.
        length_m: Of a shift.
    """
    hand = sketch.target.on
    flange_from_target = sketch.transforms[sketch.cell.mount_name(sketch.target.name)]
    at = sketch.base_from_flange(hand, origin.robots[hand])
    samples: list[Sample] = []
    for direction in DIRECTIONS:
        shift = SE3(np.eye(3), length_m * direction)
        shifted = at @ flange_from_target @ shift @ flange_from_target.inverse()
        state = reach_pose(sketch.cell.robots[hand], shifted, origin.robots[hand])
        if state is None:
            return None
        samples.append(Sample(len(samples), robots={**origin.robots, hand: state}))
    return samples if all(is_feasible(sketch, sample) for sample in samples) else None


def shift_length(sketch: Sketch, sample: Sample) -> float:
    """The length of shifts to both sides [m] at which pixel noise and neglected depth rotate the answer the least.

    Noise of s px rotates the closed form by a = s d / (sqrt(2) f L) at depth d. The neglected change of depth, which to
    first order cancels between the two sides, rotates it by (L / d)^2. Their sum is least at L = d (s / (2 sqrt(2)
    f))^(1/3).
    """
    depth = float(np.linalg.norm(sketch.camera_from_target(sample).translation))
    focal: Array = sketch.lens.focal
    sigma = sketch.cell.pixel_px or _ASSUMED_PX
    return depth * float(np.cbrt(sigma / (2 * np.sqrt(2) * focal.mean())))


def stations(sketch: Sketch, views: Sequence[Taught], seed: int = 0) -> list[Sample]:
    """Samples of feasible stations, one station after another.

    Args:
        sketch: What is known of the cell.
        views: States of all robots where the target was seen.
        seed: Of the draws.

    Raises:
        InputError: if no robot carries the target, or no station is feasible.
    """
    check_target(sketch)
    found = list[Sample]()
    for drawn in candidates(sketch, views, _ORIGIN_COUNT, seed):
        origin = aim_camera(sketch, drawn)
        for times in _LENGTH_FACTORS if origin is not None else ():
            assert origin is not None
            station = make_station(sketch, origin, times * shift_length(sketch, origin))
            if station is None:
                break
            if not blocked_samples(sketch, station[0].robots, station):
                found += station
    if not found:
        raise InputError("no station can be shifted from: teach poses farther from the arms' limits")
    return found
