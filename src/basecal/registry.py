"""What can be chosen by name, a line each; all else about it stands in the module of that name.

It names and imports nothing, so that the command line can list choices without loading them.
"""

from __future__ import annotations

from typing import Literal

TargetKindName = Literal[
    "charuco",
    "chessboard",
    "circles",
    "apriltag",
    "aprilgrid",
    "points",
    "led",
]
"""Kinds of targets: modules of `basecal.cell.targets`."""

LENSES = (
    "pinhole",
    "fisheye",
    "thin_prism",
)
"""Lenses: modules of `basecal.geometry.lenses`; several may be one model with other numbers of terms."""

CONTROLLERS = (
    "ur",
    "kuka",
    "abb",
    "fanuc",
    "yaskawa",
    "staubli",
    "doosan",
    "xarm",
)
"""Robots' controllers whose way to write poses is known: modules of `basecal.exchange.controllers`."""

EXPORTERS = {
    "urdf": "ROBOT: its URDF with its joint offsets and link errors in the origins of its joints",
}
"""Options of `basecal export` with what each takes and gives: modules of `basecal.exchange.exporters`."""

ROBOT_PARAMETERS = (
    "joint_offsets",
    "link_parameters",
    "deflection",
)
"""What can be estimated of a robot's own kinematics: modules of `basecal.cell.robot_parameters`."""

DRIVERS = (
    "replay",
    "folder",
    "typed",
    "opencv",
)
"""What talks to robots and cameras: modules of `basecal.acquisition.drivers`; others come as entry points."""
