"""Joint offsets, link parameters and compliances as the plain data of `calibration.json`, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from basecal.cell.calibration import Compliances, JointOffsets, LinkParameters
from basecal.geometry import Array, read_only

_KEYS = (
    "joint_offsets_rad",
    "joint_offsets_sigma_rad",
    "joint_offsets_covariance",
    "joint_offsets_seen",
    "joint_names",
)


def joint_offsets_to_dict(offsets: Mapping[str, JointOffsets]) -> dict[str, Any]:
    """The fields of `calibration.json` that hold joint offsets, by robot; all null where there are none."""
    if not offsets:
        return dict.fromkeys(_KEYS)
    rows = {robot: (of.rad, of.sigma_rad, of.covariance, of.seen, of.joints) for robot, of in offsets.items()}
    return {key: {robot: row[k] for robot, row in rows.items()} for k, key in enumerate(_KEYS)}


def joint_offsets_from_dict(data: Mapping[str, Any]) -> dict[str, JointOffsets]:
    """The joint offsets in the data of a `calibration.json`."""
    values, _, covariances, seen, names = (data.get(key) or {} for key in _KEYS)
    return {
        robot: JointOffsets(
            tuple(names[robot]),
            read_only(values[robot], (len(names[robot]),), "joint_offsets_rad"),
            read_only(covariances[robot], (len(names[robot]),) * 2, "joint_offsets_covariance"),
            np.array(seen[robot], dtype=bool),
        )
        for robot in values
    }


def link_parameters_to_dict(links: Mapping[str, LinkParameters]) -> dict[str, Any] | None:
    """Link parameters by robot: a row for each origin, then for the tip."""
    return {robot: {**_rows("", of.tangents), **_rows("sigma_", of.sigma)} for robot, of in links.items()} or None


def _rows(prefix: str, tangents: Array) -> dict[str, Array]:
    return {f"{prefix}t_m": tangents[:, :3], f"{prefix}r_rad": tangents[:, 3:]}


def link_parameters_from_dict(entries: Any) -> dict[str, LinkParameters]:
    """The link parameters in the data of a `calibration.json`."""
    return {
        robot: LinkParameters(_tangents(entry, ""), _tangents(entry, "sigma_"))
        for robot, entry in (entries or {}).items()
    }


def _tangents(entry: Mapping[str, Any], prefix: str) -> Array:
    parts = [read_only(entry[f"{prefix}{key}"], (None, 3), f"{prefix}{key}") for key in ("t_m", "r_rad")]
    return np.concatenate(parts, -1)


def deflection_to_dict(deflection: Mapping[str, Compliances]) -> dict[str, Any] | None:
    """Compliances by robot, a number for each joint."""
    return {
        robot: {
            "rad_per_nm": of.rad_per_nm,
            "sigma_rad_per_nm": of.sigma,
            "seen": of.seen,
            "joint_names": of.joints,
        }
        for robot, of in deflection.items()
    } or None


def deflection_from_dict(entries: Any) -> dict[str, Compliances]:
    """The compliances in the data of a `calibration.json`."""
    return {
        robot: Compliances(
            tuple(entry["joint_names"]),
            read_only(entry["rad_per_nm"], (len(entry["joint_names"]),), "rad_per_nm"),
            read_only(entry["sigma_rad_per_nm"], (len(entry["joint_names"]),), "sigma_rad_per_nm"),
            np.array(entry["seen"], dtype=bool),
        )
        for robot, entry in (entries or {}).items()
    }
