"""Findings of errors that are no noise: of lengths, clocks, frames that moved, arms that bend."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from basecal.accuracy.cross_validation.robot_model_selection import suggested_sigma
from basecal.accuracy.findings.evidence import Evidence
from basecal.accuracy.findings.robot_model import robot_model
from basecal.accuracy.phrases.gravity import gravity_taken
from basecal.accuracy.phrases.rounded import rounded
from basecal.accuracy.systematic_errors.search import SystematicError
from basecal.accuracy.systematic_errors.table import PER_NM
from basecal.cell import Finding
from basecal.geometry import Array

_AGAIN = "calibrate again when it is mended: the answer leaves it out, and its covariance is the wider for it"


def systematic_error(of: Evidence) -> list[Finding]:
    """What explains the residuals far better than noise, a warning; an info where chance may do that, too.

    See `accuracy.systematic_errors`.

    Joints that are off are left to `robot_model` where that finds its robots off, too: it says how far by all joints.
    """
    found = of.systematic_error
    if found is None or (found.code in _OF_JOINTS and robot_model(of)):
        return []
    said = _WORDS[found.code](found)
    if found.unit == PER_NM:
        gravity = gravity_taken(of.cell, of.solution, (found.about,))
        said = replace(said, message=f"{said.message}; {gravity}")
    if found.is_certain:
        return [said]
    return [replace(said, severity="info", message=f"perhaps chance, and the covariance covers it: {said.message}")]


def _length_scale(found: SystematicError) -> Finding:
    percent, sigma = 100 * found.size[0], 100 * found.sigma
    amount = f"{rounded(abs(percent), sigma)} %"
    too = f"poses of {found.about} are {amount} too {'short' if percent > 0 else 'long'}"
    kinematics = f"the kinematic calibration of {found.about} and the length of its tool"
    if found.is_target:
        what = f"{found.about} is {amount} {'larger' if percent > 0 else 'smaller'} than stated: measure its print"
    elif found.or_target:
        other = f"{found.or_target} is {'smaller' if percent > 0 else 'larger'} than stated by as much"
        what = f"{too}, or {other}, which one robot does not tell: measure {found.or_target}, then check {kinematics}"
    else:
        what = f"{too}: check {kinematics}, and that the target is printed to scale"
    return Finding("length-scale", "warning", (found.about,), f"{what}; {_AGAIN}")


def _clock_offset(found: SystematicError) -> Finding:
    factor, unit = (1e3, "ms") if found.unit == "s" else (1.0, "samples")
    value, sigma = factor * found.size[0], factor * found.sigma
    way = "lag behind" if _is_late(found) else "run ahead of"
    what = (
        f"{'images' if found.is_camera else 'poses'} of {found.about} {way} the other devices by "
        f"{rounded(abs(value), sigma)} {unit}: record while all stand still, or correct the stamps"
    )
    return Finding("clock-offset", "warning", (found.about,), f"{what}; {_AGAIN}")


def _clock_drift(found: SystematicError) -> Finding:
    value, sigma = 1e3 * found.size[0], 1e3 * found.sigma
    way = "fall behind" if _is_late(found) else "run ahead of"
    what = (
        f"the clock of {found.about} drifts: its {'images' if found.is_camera else 'poses'} {way} the other devices by "
        f"{rounded(abs(value), sigma)} ms more at the last sample than at the first: synchronise the "
        "clocks, as by PTP or NTP, or record for a shorter time"
    )
    return Finding("clock-offset", "warning", (found.about,), f"{what}; {_AGAIN}")


def _is_late(found: SystematicError) -> bool:
    """Whether a camera or a robot is behind: pictures are to be stamped earlier, poses to be read later."""
    return bool(np.sign(found.size[0]) == (-1 if found.is_camera else 1))


def _base_moved(found: SystematicError) -> Finding:
    what = (
        f"{found.about} moved by {_tangent(found)} at about sample {found.since}: look what was bumped, loosened or "
        "exchanged there, and calibrate the parts of the recording by themselves"
    )
    return Finding("base-moved", "warning", (found.about,), what)


def _drift(found: SystematicError) -> Finding:
    what = (
        f"{found.about} drifts, by {_tangent(found)} from the first sample to the last: let robots and camera warm up, "
        "and look for a mount that creeps"
    )
    return Finding("drift", "warning", (found.about,), f"{what}; {_AGAIN}")


def _deflection(found: SystematicError) -> Finding:
    if found.unit == PER_NM:
        share = len(found.size) ** -0.5
        soft, sigma = _length(1e6 * share * found.size, (1e6 * share) ** 2 * found.covariance)
        what = (
            f"joints of {found.about} yield by {rounded(soft, sigma)} urad per Nm of the torque of the links' weight: "
            "estimate its `deflection`"
        )
        return Finding("deflection", "warning", (found.about,), f"{what}; {_AGAIN}")
    bend, sigma = _length(1e3 * found.size, 1e6 * found.covariance)
    what = (
        f"{found.about} bends by {rounded(bend, sigma)} mrad per metre of reach: record its joints and estimate its "
        "`deflection`, or record where it will work"
    )
    return Finding("deflection", "warning", (found.about,), f"{what}; {_AGAIN}")


def _joint_offset(found: SystematicError) -> Finding:
    assert found.joint is not None
    per_rad = 180 / np.pi
    offset = rounded(per_rad * found.size[0], per_rad * found.sigma)
    sigma = suggested_sigma(found.size)
    what = (
        f"joint {found.joint + 1} of {found.about} is off by {offset} deg, which is to be added to what it records: "
        f"check its zero, or write `joint_offsets: {{status: prior, sigma_rad: {sigma}}}` at {found.about}"
    )
    return Finding("robot-model", "warning", (found.about,), f"{what}; {_AGAIN}")


def _joint_offsets(found: SystematicError) -> Finding:
    per_rad = 180 / np.pi
    sigmas = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    clearest = int(np.argmax(np.abs(found.size) / np.where(sigmas > 0, sigmas, np.inf)))
    offset = rounded(per_rad * found.size[clearest], per_rad * float(sigmas[clearest]))
    what = (
        f"several joints of {found.about} are off, the clearest of them joint {clearest + 1}, by {offset} deg: check "
        f"their zeros, or write `joint_offsets: {{status: prior, sigma_rad: {suggested_sigma(found.size)}}}` at "
        f"{found.about}"
    )
    return Finding("robot-model", "warning", (found.about,), f"{what}; {_AGAIN}")


def _tangent(found: SystematicError) -> str:
    shift = rounded(*_length(1e3 * found.size[:3], 1e6 * found.covariance[:3, :3]))
    per_rad = 180 / np.pi
    turn = rounded(*_length(per_rad * found.size[3:], per_rad**2 * found.covariance[3:, 3:]))
    return f"{shift} mm and {turn} deg"


def _length(values: Array, covariance: Array) -> tuple[float, float]:
    """Length of a vector, and its sigma."""
    length = float(np.linalg.norm(values))
    along = values / max(length, 1e-300)
    return length, float(np.sqrt(max(float(along @ covariance @ along), 0.0)))


_OF_JOINTS = ("joint-offset", "joint-offsets")
_WORDS: dict[str, Callable[[SystematicError], Finding]] = {
    "length-scale": _length_scale,
    "clock-offset": _clock_offset,
    "clock-drift": _clock_drift,
    "base-moved": _base_moved,
    "drift": _drift,
    "deflection": _deflection,
    "joint-offset": _joint_offset,
    "joint-offsets": _joint_offsets,
}
