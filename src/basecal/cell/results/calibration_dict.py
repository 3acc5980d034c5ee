"""A calibration as the plain data of `calibration.json`, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from basecal.cell.calibration import (
    Calibration,
    Certificate,
    Finding,
    Loop,
    Outlier,
    Residuals,
    SampleResidual,
    Validation,
)
from basecal.cell.format.plain import numbers
from basecal.cell.format.problems import CAUSE, SHORT
from basecal.cell.robot_parameters.kind import robot_parameter_kinds
from basecal.errors import InputError
from basecal.geometry import SE3, Array, Camera, PoseEstimate, read_only

SCHEMA = "basecal/calibration/1"
_MM = 1e3


def program_version() -> str:
    """The version of this program; `unknown` where it is not installed."""
    try:
        return version("basecal")
    except PackageNotFoundError:
        return "unknown"


def calibration_to_dict(calibration: Calibration) -> dict[str, Any]:
    """The data of `calibration.json`; what was not computed, or is not finite, is null."""
    joint, proof = calibration.joint_covariance, calibration.certificate
    of_robots: dict[str, Any] = {}
    for name, kind in robot_parameter_kinds().items():
        of_robots |= kind.to_dict(calibration.robot_parameters.get(name, {}))
    data = {
        "schema": SCHEMA,
        "version": program_version(),
        "verdict": calibration.verdict,
        "transforms": {name: _transform(name, calibration) for name in calibration.transforms},
        "intrinsics": {name: _lens(name, calibration) for name in calibration.cameras},
        **of_robots,
        "clock_offset_s": None,
        "noise": dict(calibration.noise),
        "joint": None if joint is None else {"order": list(calibration.order), "covariance": joint},
        "residuals": _residuals(calibration.residuals),
        "outliers": None if calibration.outliers is None else [asdict(outlier) for outlier in calibration.outliers],
        "validation": None if calibration.validation is None else _validation(calibration.validation),
        "observability": {"condition": calibration.condition, "unobservable": list(calibration.unobservable)},
        "certificate": None if proof is None else {"gap": proof.gap, "global": proof.is_global, "reason": proof.reason},
        "findings": [finding_to_dict(finding) for finding in calibration.findings],
        "settings": dict(calibration.settings),
        "inputs": dict(calibration.inputs),
    }
    plain: dict[str, Any] = _plain(data)
    return plain


def calibration_from_dict(data: Any) -> Calibration:
    """The calibration of the data of a `calibration.json`.

    Raises:
        InputError: if it is of another schema, or something is missing or of another kind.
    """
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        got = data.get("schema") if isinstance(data, dict) else type(data).__name__
        raise InputError(f"expected the schema {SCHEMA}, the one version this program reads, got {str(got)[:SHORT]!r}")
    try:
        return _calibration(data)
    except KeyError as error:
        raise InputError(f"the field {error} is missing; calibrate again") from None
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        raise InputError(
            f"not a calibration as this program writes it ({str(error)[:CAUSE]}); calibrate again"
        ) from None


def _plain(value: Any) -> Any:
    """Nothing but what JSON holds: arrays as lists, and null for a number that is not finite."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _transform(name: str, calibration: Calibration) -> dict[str, Any]:
    estimate = calibration.transforms[name]
    size = 3 if name in calibration.points else 6
    return {
        "t_m": numbers(estimate.mean.translation),
        "q_xyzw": numbers(estimate.mean.quaternion),
        "covariance": numbers(estimate.covariance[:size, :size]),
        "status": calibration.status.get(name),
    }


def _lens(name: str, calibration: Calibration) -> dict[str, Any]:
    camera, covariance = calibration.cameras[name]
    data = {"model": camera.model, **dict(zip(("fx", "fy", "cx", "cy"), numbers(camera.parameters[:4]), strict=True))}
    data |= {"distortion": numbers(camera.distortion), "size_px": camera.size_px, "covariance": covariance}
    return data | ({"status": calibration.status[name]} if name in calibration.status else {})


def _residuals(residuals: Residuals) -> dict[str, Any]:
    return {
        "rms_px": residuals.rms_px,
        "median_px": residuals.median_px,
        "loop_rms_mm": _scaled(residuals.loop_rms_m, _MM),
        "loop_rms_deg": _scaled(residuals.loop_rms_rad, math.degrees(1)),
        "per_sample": [_sample_residual(one) for one in residuals.per_sample],
        "loops": [
            {
                "path": list(loop.path),
                "views": loop.views,
                "rms_mm": loop.rms_m * _MM,
                "rms_deg": math.degrees(loop.rms_rad),
            }
            for loop in residuals.loops
        ],
    }


def _sample_residual(one: SampleResidual) -> dict[str, Any]:
    loop = {"loop_mm": _scaled(one.loop_m, _MM), "loop_deg": _scaled(one.loop_rad, math.degrees(1))}
    return {"sample": one.sample, "camera": one.camera, "target": one.target, "rms_px": one.rms_px, **loop}


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _validation(of: Validation) -> dict[str, Any]:
    target = {"target_mm": _scaled(of.target_m, _MM), "target_deg": _scaled(of.target_rad, math.degrees(1))}
    return {"kind": of.kind, "folds": of.folds, "rms_px": of.rms_px, **target, "base_change": of.base_change}


def finding_to_dict(finding: Finding) -> dict[str, Any]:
    """A finding as JSON holds it."""
    about = list(finding.about)
    return {"code": finding.code, "severity": finding.severity, "about": about, "message": finding.message}


def _calibration(data: dict[str, Any]) -> Calibration:
    transforms, lenses = data["transforms"], data["intrinsics"] or {}
    joint, proof = data["joint"], data["certificate"]
    of_robots = {name: kind.from_dict(data) for name, kind in robot_parameter_kinds().items()}
    status = {name: entry["status"] for name, entry in {**transforms, **lenses}.items() if entry.get("status")}
    return Calibration(
        verdict=_one_of(data["verdict"], ("good", "doubtful", "refused")),
        transforms={name: _estimate(entry) for name, entry in transforms.items()},
        status=status,
        points=frozenset(name for name, entry in transforms.items() if len(entry["covariance"]) == 3),
        cameras={name: (_camera(entry), _matrix(entry["covariance"])) for name, entry in lenses.items()},
        robot_parameters={kind: found for kind, found in of_robots.items() if found},
        noise=data["noise"] or {},
        order=() if joint is None else tuple(joint["order"]),
        joint_covariance=None if joint is None else _matrix(joint["covariance"]),
        residuals=_residuals_noun(data["residuals"]),
        outliers=None
        if data["outliers"] is None
        else tuple(
            Outlier(e["sample"], e["camera"], e["target"], tuple(e["ids"]), e["reason"]) for e in data["outliers"]
        ),
        validation=_validation_noun(data["validation"]),
        certificate=None if proof is None else Certificate(proof["gap"], proof["global"], proof["reason"]),
        condition=data["observability"]["condition"],
        unobservable=tuple(data["observability"]["unobservable"]),
        findings=tuple(Finding(f["code"], f["severity"], tuple(f["about"]), f["message"]) for f in data["findings"]),
        settings=data["settings"] or {},
        inputs=data["inputs"] or {},
    )


def _one_of(value: Any, known: tuple[str, ...]) -> Any:
    if value not in known:
        raise ValueError(f"expected {' or '.join(known)}, got {value!r}")
    return value


def _matrix(rows: Any) -> Array:
    """A square matrix; null reads as NaN."""
    matrix = read_only(rows, (None, None), "covariance")
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ValueError(f"a covariance has shape {matrix.shape}, expected a square")
    return matrix


def _estimate(entry: Mapping[str, Any]) -> PoseEstimate:
    covariance, full = _matrix(entry["covariance"]), np.zeros((6, 6))
    full[: len(covariance), : len(covariance)] = covariance
    return PoseEstimate(SE3.from_quaternion(entry["q_xyzw"], entry["t_m"]), full)


def _camera(entry: Mapping[str, Any]) -> Camera:
    parameters = np.array([*(entry[key] for key in ("fx", "fy", "cx", "cy")), *entry["distortion"]], dtype=np.float64)
    size = entry.get("size_px")
    return Camera(entry["model"], parameters, None if size is None else (int(size[0]), int(size[1])))


def _residuals_noun(data: Mapping[str, Any]) -> Residuals:
    return Residuals(
        rms_px=data["rms_px"],
        median_px=data["median_px"],
        loop_rms_m=_scaled(data["loop_rms_mm"], 1 / _MM),
        loop_rms_rad=_scaled(data["loop_rms_deg"], math.radians(1)),
        per_sample=tuple(_sample_residual_noun(one) for one in data["per_sample"]),
        loops=tuple(
            Loop(tuple(one["path"]), one["views"], one["rms_mm"] / _MM, math.radians(one["rms_deg"]))
            for one in data["loops"]
        ),
    )


def _sample_residual_noun(one: Mapping[str, Any]) -> SampleResidual:
    loop_m, loop_rad = _scaled(one["loop_mm"], 1 / _MM), _scaled(one["loop_deg"], math.radians(1))
    return SampleResidual(one["sample"], one["camera"], one["target"], one["rms_px"], loop_m, loop_rad)


def _validation_noun(entry: Any) -> Validation | None:
    if entry is None:
        return None
    target_m, target_rad = _scaled(entry["target_mm"], 1 / _MM), _scaled(entry["target_deg"], math.radians(1))
    return Validation(entry["kind"], entry["folds"], entry["rms_px"], target_m, target_rad, entry["base_change"])
