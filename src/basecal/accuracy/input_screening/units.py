"""Implausible units, determined from the input before detection and solving.

`benchmarks.slips` judges its limits.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot

import numpy as np

from basecal.accuracy.input_check.plausibility import FARTHEST_M, likely_unit
from basecal.accuracy.phrases.sample_list import list_samples
from basecal.cell import Cell, Finding, PixelObservation, PointObservation, PoseObservation, Recording, Robot
from basecal.effects.faces.effect import FIX
from basecal.geometry import Array
from basecal.kinematics.chain import LARGEST_JOINT_RAD, LIMIT_EXCESS_RAD
from basecal.numerics.spectral import ROUNDING

# Larger than the reach of any robot and the size of any target, but smaller than a thousand times it.
_LARGEST_DISTANCE_M = 50.0  # [m] median distance of flanges from their base, or targets from their camera
_LARGEST_TARGET_M = 20.0  # [m] of a target's longest side
_WIDEST_M = 1.0  # [m] largest usual size of a target
_FAR_RATIO = 1000**0.5  # times the usual length, beyond which a length is nearer to 1000 times the usual one


def impossible_units(cell: Cell, recording: Recording) -> list[Finding]:
    """An error for each unit that is certainly wrong: degrees for radians, millimetres for metres.

    Only units that the size of the values decides are reported; `check_conventions` tests the others by fits.
    """
    return [
        *_angle_findings(cell, recording),
        *_length_findings(recording),
        *_view_findings(recording),
        *_target_findings(cell, recording),
        *_sigma_findings(recording),
    ]


def _angle_findings(cell: Cell, recording: Recording) -> Iterator[Finding]:
    names = [name for name, robot in cell.robots.items() if _is_in_degrees(robot, recording)]
    if names:
        who = " and ".join(names)
        reach = max(float(np.abs(_joints(recording, name)).max()) for name in names)
        what = f"The joints of {who} are in degrees: they reach {reach:.3g}."
        yield Finding("angle-unit", "error", tuple(names), what, ("Convert joints_rad to radians.", FIX))


def _is_in_degrees(robot: Robot, recording: Recording) -> bool:
    """Whether joints exceed any plausible range in radians, but are within the URDF's limits if read as degrees."""
    joints = _joints(recording, robot.name)
    if robot.chain is None or not len(joints):
        return False
    most = np.abs(joints).max(axis=0)
    beyond = int(np.sum(most > LARGEST_JOINT_RAD))
    in_radians = np.radians(joints)
    within = np.all(in_radians >= robot.chain.lower - LIMIT_EXCESS_RAD) and np.all(
        in_radians <= robot.chain.upper + LIMIT_EXCESS_RAD
    )
    return bool(beyond >= min(2, joints.shape[1]) and within)


def _joints(recording: Recording, robot: str) -> Array:
    """Recorded joint positions of a robot as written, (n, k); empty if there are none."""
    states = [s.robots[robot].joints_rad for s in recording.samples if robot in s.robots]
    return np.array([joints for joints in states if joints is not None])


def _length_findings(recording: Recording) -> Iterator[Finding]:
    reaches: dict[str, list[float]] = {}
    numbers: dict[str, list[int]] = {}
    for sample in recording.samples:
        for name, state in sample.robots.items():
            if state.base_from_flange is not None:
                reaches.setdefault(name, []).append(hypot(*state.base_from_flange.translation))
                numbers.setdefault(name, []).append(sample.sample)
    far = {name: float(np.median(each)) for name, each in reaches.items() if np.median(each) > _LARGEST_DISTANCE_M}
    if far:
        who = " and ".join(far)
        unit, advice = likely_unit(max(far.values()), FARTHEST_M)
        what = f"The poses of {who} are in {unit}: a flange is {np.round(max(far.values())):.6g} m from its base."
        yield Finding("length-unit", "error", tuple(far), what, _with_command(unit, advice))
    for name in reaches.keys() - far.keys():
        limit = max(_LARGEST_DISTANCE_M, _FAR_RATIO * float(np.median(reaches[name])))
        few = {number: reach for number, reach in zip(numbers[name], reaches[name], strict=True) if reach > limit}
        if few:
            unit, advice = likely_unit(max(few.values()), FARTHEST_M)
            what = f"{list_samples(list(few))} of {name} look{'s' if len(few) == 1 else ''} like {unit} among metres."
            yield Finding("length-unit", "error", (name,), what[:1].upper() + what[1:], (advice,))


def _with_command(unit: str, advice: str) -> tuple[str, ...]:
    """The advice to convert lengths, and the command that does so if the unit is certain."""
    return (advice, FIX) if unit == "millimetres" else (advice,)


def _view_findings(recording: Recording) -> Iterator[Finding]:
    seen = [o for s in recording.samples for o in s.observations]
    kinds = {
        "The observed poses": [o.camera_from_target.translation for o in seen if isinstance(o, PoseObservation)],
        "The observed 3-D points": [o.points_in_camera.mean(0) for o in seen if isinstance(o, PointObservation)],
    }
    for who, places in kinds.items():
        if places and (distance := float(np.median([hypot(*place) for place in places]))) > _LARGEST_DISTANCE_M:
            unit, advice = likely_unit(distance, FARTHEST_M)
            what = f"{who} are in {unit}: a target is {np.round(distance):.6g} m away."
            yield Finding("length-unit", "error", (), what, (advice,))


def _target_findings(cell: Cell, recording: Recording) -> Iterator[Finding]:
    pixel_targets = {o.target for s in recording.samples for o in s.observations if isinstance(o, PixelObservation)}
    has_images = any(s.images for s in recording.samples)
    for name, entry in cell.targets.items():
        shape = entry.target
        if shape is None or shape.is_point or not (name in pixel_targets or has_images):
            continue
        size = float(np.ptp(shape.points, axis=0).max())
        if size > _LARGEST_TARGET_M:
            unit, advice = likely_unit(size, _WIDEST_M)
            what = f"The size of {name} is in {unit}: it is stated to be {size:.0f} m wide."
            yield Finding("board-size", "error", (name,), what, _with_command(unit, advice))


def _sigma_findings(recording: Recording) -> Iterator[Finding]:
    """An error for stated sigmas whose range is so large that rounding loses the information of the largest."""
    sigmas: dict[str, list[Array]] = {}
    for observation in (o for sample in recording.samples for o in sample.observations):
        if isinstance(observation, PixelObservation) and not observation.detected:
            _collect_sigma(sigmas, "px", observation.sigma_px)
        elif isinstance(observation, PointObservation):
            _collect_sigma(sigmas, "m", observation.sigma_m)
        elif isinstance(observation, PoseObservation) and observation.sigma is not None:
            _collect_sigma(sigmas, "m", observation.sigma[:3])
            _collect_sigma(sigmas, "rad", observation.sigma[3:])
    for unit, parts in sigmas.items():
        least, most = (float(bound(np.concatenate(parts))) for bound in (np.min, np.max))
        if most > least / np.sqrt(ROUNDING):
            what = f"The stated sigmas of observations reach from {least:.2g} to {most:.2g} {unit}."
            why = "Beside the smallest, the information of the largest is lost in rounding."
            do = ("State each sigma in the unit of its field, or leave sigmas out: then they are estimated.",)
            yield Finding("sigma-range", "error", (), what, do, why)


def _collect_sigma(sigmas: dict[str, list[Array]], unit: str, sigma: Array | None) -> None:
    """Add the sigmas of an observation, if it states any."""
    if sigma is not None and sigma.size:
        sigmas.setdefault(unit, []).append(np.ravel(sigma))


def needs_search(cell: Cell, recording: Recording) -> bool:
    """Whether a recording has images and no implausible units."""
    return any(sample.images for sample in recording.samples) and not impossible_units(cell, recording)


def count_searchable_images(cell: Cell, recording: Recording) -> int:
    """Number of images from cameras with stated intrinsics, if the cell has a target that can be detected in images."""
    if not any(each.target is not None and each.target.found_by is not None for each in cell.targets.values()):
        return 0
    cameras = {name for name, camera in cell.cameras.items() if camera.intrinsics is not None}
    return sum(len(cameras & sample.images.keys()) for sample in recording.samples)
