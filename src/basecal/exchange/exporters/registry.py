"""Every exporter: a new one is a module, and a line here."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.exchange.exporters import (
    abb,
    camera_info,
    csv,
    denso,
    doosan,
    fanuc,
    json,
    kuka,
    matrix,
    mujoco,
    opencv,
    ros,
    ros2,
    staubli,
    ur,
    urdf,
    urdf_cell,
    urdf_joint,
    usd,
    xarm,
    yaskawa,
)
from basecal.exchange.exports.exporter import Exporter

EXPORTERS: Mapping[str, Exporter] = {
    "ur": ur.EXPORTER,
    "kuka": kuka.EXPORTER,
    "abb": abb.EXPORTER,
    "fanuc": fanuc.EXPORTER,
    "yaskawa": yaskawa.EXPORTER,
    "staubli": staubli.EXPORTER,
    "denso": denso.EXPORTER,
    "doosan": doosan.EXPORTER,
    "xarm": xarm.EXPORTER,
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
"""By their names in `basecal export`, in the order in which help lists them."""


def export_kinds() -> tuple[str, ...]:
    """Names of all that `basecal.export` writes."""
    return tuple(EXPORTERS)
