"""Registry of importers by their name in `basecal import`; a new importer needs a module and a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from basecal.exchange.importers.arrays import read_array_file
from basecal.exchange.importers.bag import read_bag
from basecal.exchange.importers.camera_info import read_camera_info
from basecal.exchange.importers.colmap import read_colmap
from basecal.exchange.importers.data_set import read_data_set
from basecal.exchange.importers.easy_handeye import read_easy_handeye
from basecal.exchange.importers.images import read_images
from basecal.exchange.importers.joints import read_joints
from basecal.exchange.importers.kalibr import read_kalibr
from basecal.exchange.importers.lerobot import read_lerobot
from basecal.exchange.importers.moveit_samples import read_moveit_samples
from basecal.exchange.importers.mrcal import read_mrcal
from basecal.exchange.importers.opencv import read_opencv
from basecal.exchange.importers.pixels import read_pixels
from basecal.exchange.importers.points import read_points
from basecal.exchange.importers.poses import read_poses
from basecal.exchange.importers.touches import read_touches
from basecal.exchange.importing.imported import Imported

IMPORTERS: Mapping[str, Callable[..., Imported]] = {
    "images": read_images,
    "poses": read_poses,
    "joints": read_joints,
    "touches": read_touches,
    "points": read_points,
    "lerobot": read_lerobot,
    "bag": read_bag,
    "pixels": read_pixels,
    "arrays": read_array_file,
    "easy-handeye": read_easy_handeye,
    "moveit-samples": read_moveit_samples,
    "industrial-calibration": read_data_set,
    "robot-cal-tools": read_data_set,
    "camera-info": read_camera_info,
    "kalibr": read_kalibr,
    "opencv": read_opencv,
    "colmap": read_colmap,
    "mrcal": read_mrcal,
}
"""Importers in the order of the help text. Each reads a file for a cell's folder; its parameters are the options."""
