"""A calibration as the plain data of `calibration.json`, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any, TypeVar

import numpy as np

from basecal.cell.calibration import (
    BudgetEntry,
    Calibration,
    Certificate,
    ClockOffset,
    ErrorMap,
    Finding,
    LineTime,
    LocalFit,
    Loop,
    Outlier,
    Residuals,
    SampleResidual,
    Tolerance,
    Validation,
)
from basecal.cell.format.plain import numbers
from basecal.cell.results.calibration_schema import LARGEST_NUMBER, check_calibration
from basecal.effects.faces.robot_parameter import RobotParameters
from basecal.effects.registry import ROBOT_PARAMETERS
from basecal.errors import InputError
from basecal.fields.problems import CAUSE, SHORT
from basecal.geometry import SE3, Array, Camera, PoseEstimate, read_only

SCHEMA = "basecal/calibration/1"
_UNITS = {"_m": ("_mm", 1e3), "_rad": ("_deg", math.degrees(1))}
N = TypeVar("N", Residuals, SampleResidual, Loop, Outlier, Validation, Finding)


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
    for name, each in ROBOT_PARAMETERS.items():
        of_robots |= each.to_dict(calibration.robot_parameters.get(name, {}))
    data = {
        "schema": SCHEMA,
        "version": program_version(),
        "verdict": calibration.verdict,
        "transforms": {name: _transform(name, calibration) for name in calibration.transforms},
        "intrinsics": {name: _lens(name, calibration) for name in calibration.cameras},
        **of_robots,
        "clock_offset_s": {name: clock.offset_s for name, clock in calibration.clocks.items()} or None,
        "clock_sigma_s": {name: clock.sigma_s for name, clock in calibration.clocks.items()} or None,
        "line_time_s": {name: line.line_time_s for name, line in calibration.line_times.items()} or None,
        "line_time_sigma_s": {name: line.sigma_s for name, line in calibration.line_times.items()} or None,
        "noise": dict(calibration.noise),
        "joint": None if joint is None else {"order": list(calibration.order), "covariance": joint},
        "residuals": _entry(calibration.residuals),
        "outliers": None if calibration.outliers is None else [asdict(outlier) for outlier in calibration.outliers],
        "validation": _entry(calibration.validation),
        "observability": {"condition": calibration.condition, "unobservable": list(calibration.unobservable)},
        "certificate": None if proof is None else {"gap": proof.gap, "global": proof.is_global, "reason": proof.reason},
        "budget": None if calibration.budget is None else [budget_entry(entry) for entry in calibration.budget],
        "error_map": None if calibration.error_map is None else _error_map(calibration.error_map),
        "local": None if calibration.local is None else [_local(each) for each in calibration.local],
        "findings": [finding_to_dict(finding) for finding in calibration.findings],
        "tolerance": None if calibration.tolerance is None else asdict(calibration.tolerance),
        "settings": dict(calibration.settings),
        "inputs": dict(calibration.inputs),
        "versions": dict(calibration.versions),
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
        check_calibration(data)
        return _calibration(data)
    except InputError as error:
        raise InputError(f"{error}; calibrate again") from None
    except KeyError as error:
        raise InputError(f"the field {error} is missing; calibrate again") from None
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        raise InputError(
            f"not a calibration as this program writes it ({str(error)[:CAUSE]}); calibrate again"
        ) from None


def _plain(value: Any) -> Any:
    """Nothing but what JSON holds: arrays as lists, and null for a number that is not finite, or as good as that."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        # Of a hundred robots the joint covariance has millions of numbers.
        is_plain = value.dtype.kind == "f" and bool(np.all(np.abs(value) <= LARGEST_NUMBER))
        return value.tolist() if is_plain else _plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if abs(value) <= LARGEST_NUMBER else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _transform(name: str, calibration: Calibration) -> dict[str, Any]:
    estimate = calibration.transforms[name]
    size = 3 if name in calibration.points else 6
    return {
        "t_m": numbers(estimate.mean.translation),
        "q_xyzw": numbers(estimate.mean.quaternion),
        "covariance": numbers(estimate.covariance[:size, :size]),
        "status": calibration.status.get(name),
        "verdict": calibration.verdicts.get(name, calibration.verdict),
    }


def _lens(name: str, calibration: Calibration) -> dict[str, Any]:
    camera, covariance = calibration.cameras[name]
    data = {"model": camera.model, **dict(zip(("fx", "fy", "cx", "cy"), numbers(camera.parameters[:4]), strict=True))}
    data |= {"distortion": numbers(camera.distortion), "size_px": camera.size_px, "covariance": covariance}
    return data | ({"status": calibration.status[name]} if name in calibration.status else {})


def _key(name: str) -> tuple[str, float | None]:
    """What a field is called in files, and by what its value is multiplied there: mm for m, deg for rad."""
    for ours, (theirs, factor) in _UNITS.items():
        if name.endswith(ours):
            return name.removesuffix(ours) + theirs, factor
    return name, None


def _entry(noun: Any) -> Any:
    """The fields of a dataclass, and of those in it, as files have them."""
    if isinstance(noun, tuple):
        return [_entry(one) for one in noun]
    if not is_dataclass(noun):
        return noun
    data = {}
    for field in fields(noun):
        (key, factor), value = _key(field.name), getattr(noun, field.name)
        data[key] = _entry(value) if factor is None or value is None else value * factor
    return data


def _noun(noun: type[N], data: Mapping[str, Any]) -> N:
    """The dataclass of fields as files have them; lists in it stay as they are."""
    values: dict[str, Any] = {}
    for field in fields(noun):
        key, factor = _key(field.name)
        value = math.nan if data[key] is None and field.type == "float" else data[key]
        values[field.name] = value if factor is None or value is None else value / factor
    return noun(**values)


def budget_entry(entry: BudgetEntry) -> dict[str, Any]:
    """A line of a budget as JSON holds it."""
    halved_mm = 1e3 * entry.halved_rms_m
    return {
        "source": entry.source,
        "mm": 1e3 * entry.rms_m,
        "percent": 100 * entry.share,
        "total_mm_if_halved": halved_mm,
    }


def _budget_of(data: Mapping[str, Any]) -> BudgetEntry:
    return BudgetEntry(data["source"], data["mm"] / 1e3, data["percent"] / 100, data["total_mm_if_halved"] / 1e3)


def _error_map(found: ErrorMap) -> dict[str, Any]:
    return {
        "points_m": numbers(found.points_m),
        "mm_95": numbers(1e3 * found.length_95_m),
        "deg_95": numbers(np.degrees(found.angle_95_rad)),
    }


def _error_map_of(data: Mapping[str, Any]) -> ErrorMap:
    points, mm, degrees = (np.array(data[key], dtype=np.float64) for key in ("points_m", "mm_95", "deg_95"))
    return ErrorMap(read_only(points.reshape(-1, 3)), read_only(mm / 1e3), read_only(np.radians(degrees)))


def _local(found: LocalFit) -> dict[str, Any]:
    return {
        "centre_m": numbers(found.centre_m),
        "samples": list(found.samples),
        "global_mm": None if found.global_m is None else 1e3 * found.global_m,
        "local_mm": None if found.local_m is None else 1e3 * found.local_m,
        "p": found.chance,
        "recommended": "local" if found.is_better else "global",
        "transforms": {
            name: {"t_m": numbers(pose.translation), "q_xyzw": numbers(pose.quaternion)}
            for name, pose in found.transforms.items()
        },
    }


def _local_of(data: Mapping[str, Any]) -> LocalFit:
    errors = [None if data[key] is None else data[key] / 1e3 for key in ("global_mm", "local_mm")]
    return LocalFit(
        read_only(np.array(data["centre_m"], dtype=np.float64)),
        tuple(data["samples"]),
        errors[0],
        errors[1],
        data["p"],
        data["recommended"] == "local",
        {name: SE3.from_quaternion(pose["q_xyzw"], pose["t_m"]) for name, pose in data["transforms"].items()},
    )


def finding_to_dict(finding: Finding) -> dict[str, Any]:
    """A finding as JSON holds it."""
    return {
        "code": finding.code,
        "severity": finding.severity,
        "about": list(finding.about),
        "what": finding.what,
        "why": finding.why,
        "do": list(finding.do),
        "message": finding.message,
    }


def _calibration(data: dict[str, Any]) -> Calibration:
    transforms, lenses = data["transforms"], data["intrinsics"] or {}
    joint, proof = data["joint"], data["certificate"]
    of_robots = {name: _parameters(each.from_dict(data), name) for name, each in ROBOT_PARAMETERS.items()}
    verdicts = {name: entry["verdict"] for name, entry in transforms.items() if entry.get("verdict")}
    status = {name: entry["status"] for name, entry in {**transforms, **lenses}.items() if entry.get("status")}
    return Calibration(
        verdict=data["verdict"],
        transforms={name: _estimate(entry) for name, entry in transforms.items()},
        verdicts=verdicts,
        status=status,
        points=frozenset(name for name, entry in transforms.items() if len(entry["covariance"]) == 3),
        cameras={name: (_camera(entry), _matrix(entry["covariance"])) for name, entry in lenses.items()},
        robot_parameters={kind: found for kind, found in of_robots.items() if found},
        clocks={n: ClockOffset(s, data["clock_sigma_s"][n]) for n, s in (data["clock_offset_s"] or {}).items()},
        line_times={n: LineTime(s, data["line_time_sigma_s"][n]) for n, s in (data["line_time_s"] or {}).items()},
        noise=data["noise"] or {},
        order=() if joint is None else tuple(joint["order"]),
        joint_covariance=None if joint is None else _matrix(joint["covariance"]),
        residuals=replace(
            _noun(Residuals, data["residuals"]),
            per_sample=tuple(_noun(SampleResidual, one) for one in data["residuals"]["per_sample"]),
            loops=tuple(_noun(Loop, {**one, "path": tuple(one["path"])}) for one in data["residuals"]["loops"]),
        ),
        outliers=None
        if data["outliers"] is None
        else tuple(_noun(Outlier, {**one, "ids": tuple(one["ids"])}) for one in data["outliers"]),
        validation=None if data["validation"] is None else _noun(Validation, data["validation"]),
        certificate=None if proof is None else Certificate(proof["gap"], proof["global"], proof["reason"]),
        condition=data["observability"]["condition"],
        unobservable=tuple(data["observability"]["unobservable"]),
        budget=None if data.get("budget") is None else tuple(map(_budget_of, data["budget"])),
        error_map=None if data.get("error_map") is None else _error_map_of(data["error_map"]),
        local=None if data.get("local") is None else tuple(map(_local_of, data["local"])),
        findings=tuple(map(_finding_of, data["findings"])),
        tolerance=None if data.get("tolerance") is None else Tolerance(**data["tolerance"]),
        settings=data["settings"] or {},
        inputs=data["inputs"] or {},
        versions=data.get("versions") or {},
    )


def _finding_of(data: dict[str, Any]) -> Finding:
    about, do = tuple(data["about"]), tuple(data["do"])
    return Finding(data["code"], data["severity"], about, data["what"], do, data["why"])


def _parameters(found: dict[str, RobotParameters], kind: str) -> dict[str, RobotParameters]:
    for robot, of in found.items():
        if not of.values.shape == of.sigma.shape == of.seen.shape or not all(isinstance(j, str) for j in of.joints):
            raise InputError(f"{kind} of {robot!r}: expected a value, a sigma and whether it is seen of each")
    return found


def _matrix(rows: Any) -> Array:
    """A square matrix; null reads as NaN."""
    return read_only(np.reshape(np.array(rows, dtype=np.float64), (len(rows), len(rows))))


def _estimate(entry: Mapping[str, Any]) -> PoseEstimate:
    covariance, full = _matrix(entry["covariance"]), np.zeros((6, 6))
    full[: len(covariance), : len(covariance)] = covariance
    return PoseEstimate(SE3.from_quaternion(entry["q_xyzw"], entry["t_m"]), full)


def _camera(entry: Mapping[str, Any]) -> Camera:
    parameters = np.array([*(entry[key] for key in ("fx", "fy", "cx", "cy")), *entry["distortion"]], dtype=np.float64)
    size = entry.get("size_px")
    return Camera(entry["model"], parameters, None if size is None else (int(size[0]), int(size[1])))
