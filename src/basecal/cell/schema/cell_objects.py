"""Conversion of validated entries of `cell.yaml` to the objects of a cell."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from basecal.cell.cell import Cell, CellCamera, CellTarget, Driver, Intrinsics, Robot, Unknown
from basecal.cell.schema.cell_schema import CameraEntry, CellEntry, RobotEntry
from basecal.cell.schema.lens import IntrinsicsEntry, distortion_terms
from basecal.cell.schema.touching import add_clamps, add_touching
from basecal.cell.targets.kind import TargetEntry
from basecal.fields.values import UnknownEntry, pose_se3
from basecal.geometry import Camera, read_only
from basecal.kinematics import SerialChain


def cell_from_entry(entry: CellEntry, chains: Mapping[str, SerialChain]) -> Cell:
    """Create a cell from its entry and the kinematic chains of its robots."""
    others = [name for name in entry.robots if name != entry.reference]
    bases = {name: _unknown(entry.bases[name]) if name in entry.bases else Unknown() for name in others}
    carried: dict[str, Any] = {
        "cameras": {name: _camera(name, camera) for name, camera in entry.cameras.items()},
        "targets": {name: _target(name, target) for name, target in entry.targets.items()},
        "plates": {},
    }
    add_touching(carried, entry.tips, entry.marks, _unknown)
    add_clamps(carried, entry.clamp)
    return Cell(
        reference=entry.reference,
        robots={name: _robot(name, robot, chains.get(name)) for name, robot in entry.robots.items()},
        bases=bases,
        **carried,
        pixel_px=entry.noise.pixel_px,
        correlated_px=entry.noise.correlated_px,
        keep_out={name: item.box(name) for name, item in entry.keep_out.items()},
        sees_scene=entry.target == "scene",
    )


def _target(name: str, entry: TargetEntry) -> CellTarget:
    size_sigma = 0.0 if entry.exact else math.inf if entry.scale else entry.size_sigma
    return CellTarget(name, entry.on, _unknown(entry.mount), entry.shape(), size_sigma)


def _unknown(entry: UnknownEntry) -> Unknown:
    if entry.status == "free":
        return Unknown("free", None if entry.guess is None else pose_se3(entry.guess))
    if entry.status == "fixed":
        return Unknown("fixed", pose_se3(entry))
    # The rotation of a single point is exactly the identity.
    sigma = [*(entry.sigma_t_m or ()), *(entry.sigma_r_rad or (0.0, 0.0, 0.0))]
    return Unknown("prior", pose_se3(entry), read_only(sigma, (6,), "sigma"))


def _robot(name: str, entry: RobotEntry, chain: SerialChain | None) -> Robot:
    noise = entry.noise
    return Robot(
        name=name,
        noise=None if noise is None else read_only([*noise.sigma_t_m, *noise.sigma_r_rad], (6,), "noise"),
        is_total_noise=noise is not None and noise.kind == "total",
        chain=chain,
        parameters=entry.parameters,
        urdf=entry.urdf,
        base_link=entry.base_link,
        flange_link=entry.flange_link,
        frames=entry.frames.model_dump(exclude_none=True),
        controller={} if entry.controller is None else entry.controller.model_dump(exclude_none=True),
        clock=entry.clock,
        driver=_driver(entry.driver),
        reach_m=entry.reach_m,
    )


def _camera(name: str, entry: CameraEntry) -> CellCamera:
    size = None if entry.size_px is None else (entry.size_px[0], entry.size_px[1])
    lens = None if entry.intrinsics is None else _intrinsics(entry.intrinsics, entry, size)
    driver = _driver(entry.driver)
    return CellCamera(
        name,
        entry.on,
        _unknown(entry.mount),
        entry.model,
        size,
        lens,
        entry.clock,
        driver,
        entry.rolling_shutter,
        entry.kind,
        entry.frame,
    )


def _driver(entry: dict[str, Any] | None) -> Driver | None:
    if entry is None:
        return None
    return Driver(entry["kind"], {key: value for key, value in entry.items() if key != "kind"})


def _intrinsics(entry: IntrinsicsEntry, camera: CameraEntry, size: tuple[int, int] | None) -> Intrinsics:
    terms = distortion_terms(entry, camera.model)
    if entry.fx is None:
        return Intrinsics(entry.status, None, None, terms)
    distortion = entry.distortion or [0.0] * terms
    parameters = np.array([entry.fx, entry.fy, entry.cx, entry.cy, *distortion], dtype=np.float64)
    sigma = None
    if entry.sigma_focal_px is not None and entry.sigma_center_px is not None:
        distortion_sigmas = np.broadcast_to(entry.sigma_distortion or [1.0], terms)
        sigma = read_only([*entry.sigma_focal_px, *entry.sigma_center_px, *distortion_sigmas])
    return Intrinsics(entry.status, Camera(camera.model, parameters, size), sigma, terms, entry.exact)
