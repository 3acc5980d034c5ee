"""Every way to write a plan: a new one is a module, and a line here."""

from __future__ import annotations

from collections.abc import Mapping

from basecal.exchange.motions import csv, joints, ros2_trajectory, ur_script
from basecal.exchange.motions.way import Motion

MOTIONS: Mapping[str, Motion] = {
    "joints": joints.MOTION,
    "ur-script": ur_script.MOTION,
    "ros2-trajectory": ros2_trajectory.MOTION,
    "csv": csv.MOTION,
}
"""By their names in `basecal plan --to`."""
