"""Limits of plausible robots, cameras and targets, wide enough for any usual cell.

The limits are assumed: a correct cell beyond them is treated as one in other units.
"""

from __future__ import annotations

import numpy as np

from basecal.accuracy.input_check.hypothesis_fit import HypothesisFit
from basecal.accuracy.readings.reading import Reading
from basecal.cell import (
    WORLD,
    Cell,
    CellCamera,
    CellTarget,
    PixelObservation,
    PointObservation,
    PoseObservation,
    Recording,
    Robot,
)
from basecal.estimation.view.points import PointMeasurement, is_touch
from basecal.estimation.view.poses import PoseMeasurement
from basecal.geometry import SE3, Array
from basecal.geometry.rotation import lengths
from basecal.kinematics.chain import LARGEST_JOINT_RAD, LIMIT_EXCESS_RAD

# Wide enough for any robot, cell and target that is calibrated; no such cell is still plausible after a factor of 1000.
_REACH_M = 0.02, 5.0  # [m] of the farthest flange from its base
_BASES_M = 0.02, 20.0  # [m] between bases
_MOUNT_M = 2.0  # [m] of a camera or target from the flange that carries it
_DISTANCE_M = 0.02, 20.0  # [m] from camera to target, the median
_TARGET_M = 2e-3, 5.0  # [m] of a target's longest side
UNITS_M = {"mm": 1e-3, "cm": 1e-2, "inch": 0.0254}
FARTHEST_M = 2.5
"""Largest usual distance of a flange from its base, or a target from its camera [m], to guess the unit of a length."""
_MOST_BEHIND = 0.8  # share of targets behind the camera that is implausible: a few may be outliers; assumed


def impossible_input(cell: Cell, recording: Recording) -> tuple[str, ...]:
    """Describe implausible input: distances of flanges, joints, sizes and positions of targets."""
    seen = [o for sample in recording.samples for o in sample.observations]
    as_points = {o.target for o in seen if isinstance(o, PixelObservation | PointObservation)}
    return (*_robot_faults(cell, recording), *_size_faults(cell, as_points), *_view_faults(cell, recording))


def impossible_reading(reading: Reading) -> tuple[str, ...]:
    """Describe implausible input of one reading of a recording; see `impossible_input`."""
    found = []
    for name, track in reading.tracks.items():
        if track.joints is None:
            found += _flange_faults(name, track.pose.translation[track.seen])
        else:
            found += _joint_faults(reading.cell.robots[name], track.joints[track.seen])
    positions = []
    as_points = {g.target for g in reading.problem.groups if not isinstance(g.measurement, PoseMeasurement)}
    for group in reading.problem.groups:
        views = group.measurement
        if isinstance(views, PoseMeasurement):
            positions.append(views.measured_camera_from_target.translation)
        elif isinstance(views, PointMeasurement):
            positions.append((views.points_in_camera * views.seen[..., None]).sum(1) / views.seen.sum(1)[:, None])
    return (
        *found,
        *_size_faults(reading.cell, as_points),
        *(_position_faults(np.concatenate(positions)) if positions else ()),
    )


def _robot_faults(cell: Cell, recording: Recording) -> list[str]:
    found = []
    for name, robot in cell.robots.items():
        states = [s.robots[name] for s in recording.samples if name in s.robots]
        poses = [s.base_from_flange.translation for s in states if s.base_from_flange is not None]
        joints = [s.joints_rad for s in states if s.joints_rad is not None]
        found += _flange_faults(name, np.array(poses)) + _joint_faults(robot, np.array(joints))
    return found


def likely_unit(length: float, most_m: float) -> tuple[str, str]:
    """Likely unit of a length that is implausible in metres, and advice on how to convert it.

    Args:
        length: The stated length.
        most_m: Largest usual length of this kind [m].
    """
    metres = {unit: length * size for unit, size in UNITS_M.items() if length * size <= most_m}
    if len(metres) > 1:
        options = ", ".join(f"{length:.0f} {unit} are {value:.2g} m" for unit, value in metres.items())
        return "another unit", f"Convert lengths to metres: {options}."
    if length * UNITS_M["mm"] > _BASES_M[1]:
        return "another unit", "State lengths in metres."
    return "millimetres", "Divide lengths by 1000 to convert them to metres."


def _flange_faults(name: str, positions_m: Array) -> list[str]:
    return _limit_faults(f"flange of {name}", float(lengths(positions_m).max()), _REACH_M) if len(positions_m) else []


def _joint_faults(robot: Robot, joints: Array) -> list[str]:
    name, chain = robot.name, robot.chain
    if chain is None or not len(joints):
        return []
    if float(np.abs(joints).max()) > LARGEST_JOINT_RAD:
        return [f"a joint of {name} at {np.abs(joints).max():.3g} rad"]
    beyond = float(np.maximum(chain.lower - joints, joints - chain.upper).max())
    return [f"a joint of {name} {beyond:.2g} rad beyond its limit"] if beyond > LIMIT_EXCESS_RAD else []


def _size_faults(cell: Cell, targets: set[str]) -> list[str]:
    found = []
    for name in sorted(targets):
        shape = cell.targets[name].target
        if shape is not None and len(shape.points) > 1:
            found += _limit_faults(f"size of {name}", float(np.ptp(shape.points, axis=0).max()), _TARGET_M)
    return found


def _view_faults(cell: Cell, recording: Recording) -> list[str]:
    """Describe implausible positions of targets observed as poses or 3-D points in metres."""
    metric = {name for name, target in cell.targets.items() if not target.has_free_scale}
    positions = [
        o.camera_from_target.translation if isinstance(o, PoseObservation) else o.points_in_camera.mean(0)
        for s in recording.samples
        for o in s.observations
        if isinstance(o, PoseObservation | PointObservation) and o.target in metric
    ]
    return _position_faults(np.array(positions)) if positions else []


def _position_faults(p_in_camera: Array) -> list[str]:
    """Describe implausible positions of targets, (n, 3) [m]; touches, at the origin of the tip, are ignored."""
    p_in_camera = p_in_camera[np.any(p_in_camera, axis=-1)]
    if not len(p_in_camera):
        return []
    found = _limit_faults("distance to the target", float(np.median(lengths(p_in_camera))), _DISTANCE_M)
    if np.mean(p_in_camera[:, 2] < 0) > _MOST_BEHIND:
        found.append("targets behind the camera")
    return found


def _limit_faults(quantity: str, value: float, limits: tuple[float, float]) -> list[str]:
    low, high = limits
    return [] if low <= value <= high else [f"{quantity} {_metres(value)}"]


def _metres(length: float) -> str:
    """A length with three digits and no exponent."""
    return f"{float(f'{length:.3g}'):g} m"


def impossible_answer(cell: Cell, fit: HypothesisFit) -> tuple[str, ...]:
    """Describe implausible answers: bases, mounts, and distances of targets from cameras."""
    transforms, found = fit.solution.state.transforms, []
    bases = {cell.base_name(robot): robot for robot in cell.robots if cell.base_name(robot) in transforms}
    for name, robot in bases.items():
        if cell.transforms[name].status != "fixed":
            # Robots given by joints may share a base link, such as a turntable or a torso.
            nearest = 0.0 if cell.robots[robot].chain is not None else _BASES_M[0]
            far = _length(transforms[name])
            # In a long row of robots the last is far from the first, but near to the previous one.
            others = [_length(transforms[name].inverse() @ transforms[other]) for other in bases if other != name]
            if far < nearest or min(far, *others, np.inf) > _BASES_M[1]:
                found.append(f"{name} {_metres(far)}")
    devices: list[CellCamera | CellTarget] = [*cell.cameras.values(), *cell.targets.values()]
    for device in devices:
        most = _BASES_M[1] if device.on == WORLD else _MOUNT_M
        name = cell.mount_name(device.name)
        if name in transforms and name in fit.solution.problem.columns:
            found += _limit_faults(name, _length(transforms[name]), (0.0, most))
    state, problem = fit.solution.state, fit.solution.problem
    seen = [g for g in problem.groups if len(g) and not is_touch(g.measurement)]
    positions = [np.zeros((0, 3)), *(state.camera_from_target(g, problem.stops).translation for g in seen)]
    return (*found, *_position_faults(np.concatenate(positions)))


def _length(transform: SE3) -> float:
    return float(np.linalg.norm(transform.translation))
