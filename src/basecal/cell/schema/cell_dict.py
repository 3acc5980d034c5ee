"""Conversion of a cell to the plain data of `cell.yaml`, with short numbers."""

from __future__ import annotations

from typing import Any

from basecal.cell.cell import (
    Cell,
    CellCamera,
    CellTarget,
    Clock,
    Driver,
    Intrinsics,
    Robot,
    RollingShutter,
    Unknown,
)
from basecal.cell.format.plain import numbers, one_or_all, pose_dict, sigma_dict
from basecal.cell.schema.cell_schema import SCHEMA
from basecal.cell.schema.keep_out import keep_out_dict
from basecal.cell.schema.touching import clamps_dict, touching_dict


def cell_to_dict(cell: Cell) -> dict[str, Any]:
    """Convert a cell to plain data; `cell_from_dict` gives the same cell again."""
    data: dict[str, Any] = {"schema": SCHEMA, "reference": cell.reference}
    data["robots"] = {name: _robot(robot) for name, robot in cell.robots.items()}
    data["bases"] = {name: _unknown(unknown) for name, unknown in cell.bases.items()}
    data["cameras"] = {name: _camera(camera) for name, camera in cell.cameras.items() if not camera.touches}
    data["targets"] = {name: _target(target) for name, target in cell.targets.items() if not target.is_touched}
    noise = {"pixel_px": cell.pixel_px, "correlated_px": cell.correlated_px}
    data["noise"] = {key: float(value) for key, value in noise.items() if value is not None}
    data["keep_out"] = {name: keep_out_dict(box) for name, box in cell.keep_out.items()}
    data["target"] = "scene" if cell.sees_scene else None
    data |= touching_dict(cell, _unknown) | clamps_dict(cell)
    return {key: value for key, value in data.items() if value or key == "robots"}


def _unknown(unknown: Unknown, point: bool = False) -> dict[str, Any]:
    pose = {} if unknown.mean is None else pose_dict(unknown.mean)
    sigma = {} if unknown.sigma is None else sigma_dict(unknown.sigma)
    if point:
        pose.pop("q_xyzw", None)
        sigma.pop("sigma_r_rad", None)
    if unknown.status == "free":
        return {"status": "free", "guess": pose} if pose else {"status": "free"}
    return {"status": unknown.status, **pose, **sigma}


def _robot(robot: Robot) -> dict[str, Any]:
    kind = {"kind": "total"} if robot.is_total_noise else {}
    data: dict[str, Any] = {} if robot.noise is None else {"noise": sigma_dict(robot.noise) | kind}
    if robot.urdf is not None:
        data |= {"urdf": robot.urdf, "base_link": robot.base_link, "flange_link": robot.flange_link}
    data |= {} if robot.reach_m is None else {"reach_m": robot.reach_m}
    stated = {kind: known for kind, known in robot.parameters.items() if known != type(known)()}
    data |= {kind: known.model_dump(exclude_none=True) for kind, known in stated.items()}
    return (
        data
        | ({"frames": dict(robot.frames)} if robot.frames else {})
        | ({"controller": dict(robot.controller)} if robot.controller else {})
        | _timing("clock", robot.clock)
        | _driver(robot.driver)
    )


def _timing(name: str, timing: Clock | RollingShutter | None) -> dict[str, Any]:
    if timing is None:
        return {}
    stated = {key: value for key, value in vars(timing).items() if value is not None}
    return {name: {key: value if key == "status" else float(value) for key, value in stated.items()}}


def _driver(driver: Driver | None) -> dict[str, Any]:
    return {} if driver is None else {"driver": {"kind": driver.kind, **driver.options}}


def _camera(camera: CellCamera) -> dict[str, Any]:
    data: dict[str, Any] = {"on": camera.on, "mount": _unknown(camera.mount), "model": camera.model}
    data |= {"kind": camera.kind} if camera.kind != "camera" else {}
    data |= {} if camera.frame is None else {"frame": camera.frame}
    if camera.size_px is not None:
        data["size_px"] = [int(side) for side in camera.size_px]
    if camera.intrinsics is not None:
        data["intrinsics"] = _intrinsics(camera.intrinsics, camera.distortion_terms)
    timing = _timing("clock", camera.clock) | _timing("rolling_shutter", camera.rolling_shutter)
    return data | timing | _driver(camera.driver)


def _intrinsics(lens: Intrinsics, terms: int) -> dict[str, Any]:
    data: dict[str, Any] = {"status": lens.status} | ({"exact": True} if lens.exact else {})
    if lens.camera is None:
        return data | {"distortion_terms": terms}
    data |= dict(zip(("fx", "fy", "cx", "cy"), numbers(lens.camera.parameters[:4]), strict=True))
    data["distortion"] = numbers(lens.camera.distortion)
    if lens.sigma is not None:
        data |= {"sigma_focal_px": one_or_all(lens.sigma[:2]), "sigma_center_px": one_or_all(lens.sigma[2:4])}
        data |= {"sigma_distortion": one_or_all(lens.sigma[4:])} if len(lens.sigma) > 4 else {}
    return data


def _target(entry: CellTarget) -> dict[str, Any]:
    point = entry.target is not None and entry.target.is_point
    data: dict[str, Any] = {"on": entry.on, "mount": _unknown(entry.mount, point)}
    if entry.has_free_scale:
        data |= {"scale": "free"}
    elif entry.size_sigma is not None:
        data |= {"size_sigma": entry.size_sigma} if entry.size_sigma else {"exact": True}
    return data if entry.target is None else data | {"kind": entry.target.kind, **entry.target.options}
