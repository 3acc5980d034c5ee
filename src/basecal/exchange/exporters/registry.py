"""Registry of exporters; a new one needs a module and a line here, or an entry in `pendants`."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.exchange.exporters import (
    camera_info,
    csv,
    json,
    matrix,
    mujoco,
    opencv,
    ros,
    ros2,
    urdf,
    urdf_cell,
    urdf_joint,
    usd,
)
from basecal.exchange.exporters.pendants import PENDANTS
from basecal.exchange.exports.exporter import Exporter

EXPORTERS: Mapping[str, Exporter] = {
    **PENDANTS,
    "ros": ros.EXPORTER,
    "ros2": ros2.EXPORTER,
    "matrix": matrix.EXPORTER,
    "json": json.EXPORTER,
    "csv": csv.EXPORTER,
    "opencv": opencv.EXPORTER,
    "camera_info": camera_info.EXPORTER,
    "usd": usd.EXPORTER,
    "mujoco": mujoco.EXPORTER,
    "urdf": urdf.EXPORTER,
    "urdf_joint": urdf_joint.EXPORTER,
    "urdf_cell": urdf_cell.EXPORTER,
}
"""Exporters by their name in `basecal export`, in the order of the help text."""


def export_kinds() -> tuple[str, ...]:
    """Names of all formats of `basecal.export`."""
    return tuple(EXPORTERS)
