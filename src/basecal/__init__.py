"""Calibrate the poses of robot bases relative to each other, with covariance, from camera views of targets.

Public names are loaded when they are first used, so that `import basecal` is fast.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from basecal.methods import METHODS

TYPE_CHECKING = False  # not from `typing`: its import would delay the point from which a command can be interrupted
if TYPE_CHECKING:
    from basecal.accuracy.arrays.array_calibration import ArrayCalibration as ArrayCalibration
    from basecal.accuracy.arrays.functions import base_to_base as base_to_base
    from basecal.accuracy.arrays.functions import hand_eye as hand_eye
    from basecal.accuracy.arrays.functions import robot_world as robot_world
    from basecal.accuracy.calibrate import calibrate as calibrate
    from basecal.accuracy.compare import compare as compare
    from basecal.accuracy.drift.verify import verify as verify
    from basecal.accuracy.input_screening.importing import import_into as import_into
    from basecal.cell import Calibration as Calibration
    from basecal.cell import Cell as Cell
    from basecal.cell import Recording as Recording
    from basecal.cell import Sample as Sample
    from basecal.cell.files import calibration_to_dict as calibration_to_dict
    from basecal.cell.files import latest_run as latest_run
    from basecal.cell.files import read_calibration as read_calibration
    from basecal.cell.files import read_cell as read_cell
    from basecal.cell.files import read_recording as read_recording
    from basecal.cell.files import read_truth as read_truth
    from basecal.cell.files import write_calibration as write_calibration
    from basecal.cell.files import write_cell as write_cell
    from basecal.cell.files import write_recording as write_recording
    from basecal.errors import BasecalError as BasecalError
    from basecal.estimation.settings import Settings as Settings
    from basecal.estimation.solve import Solution as Solution
    from basecal.estimation.solve import solve as solve
    from basecal.estimation.stages import Stages as Stages
    from basecal.exchange.exporters.exporter import export as export
    from basecal.exchange.exporters.exporter import pasteable as pasteable
    from basecal.exchange.exporters.registry import export_kinds as export_kinds
    from basecal.exchange.importers.arrays import read_array_file as read_array_file
    from basecal.exchange.importers.bag import read_bag as read_bag
    from basecal.exchange.importers.camera_info import read_camera_info as read_camera_info
    from basecal.exchange.importers.colmap import read_colmap as read_colmap
    from basecal.exchange.importers.data_set import read_data_set as read_data_set
    from basecal.exchange.importers.easy_handeye import read_easy_handeye as read_easy_handeye
    from basecal.exchange.importers.images import read_images as read_images
    from basecal.exchange.importers.joints import read_joints as read_joints
    from basecal.exchange.importers.kalibr import read_kalibr as read_kalibr
    from basecal.exchange.importers.lerobot import read_lerobot as read_lerobot
    from basecal.exchange.importers.moveit_samples import read_moveit_samples as read_moveit_samples
    from basecal.exchange.importers.mrcal import read_mrcal as read_mrcal
    from basecal.exchange.importers.opencv import read_opencv as read_opencv
    from basecal.exchange.importers.pixels import read_pixels as read_pixels
    from basecal.exchange.importers.points import read_points as read_points
    from basecal.exchange.importers.poses import read_poses as read_poses
    from basecal.exchange.importers.touches import read_touches as read_touches
    from basecal.exchange.importing.described_target import Shape as Shape
    from basecal.geometry import SE3 as SE3
    from basecal.geometry import Camera as Camera
    from basecal.geometry import PoseEstimate as PoseEstimate
    from basecal.reporting.notebook import html_summary as html_summary
    from basecal.reporting.text import text_report as text_report
    from basecal.simulation.scenario import Scenario as Scenario
    from basecal.simulation.scenario import SimulatedCell as SimulatedCell
    from basecal.simulation.testbed import simulate as simulate
    from basecal.vision.detect import detect as detect

_HOME = {
    "ArrayCalibration": "accuracy.arrays.array_calibration",
    "BasecalError": "errors",
    "Calibration": "cell",
    "Camera": "geometry",
    "Cell": "cell",
    "PoseEstimate": "geometry",
    "Recording": "cell",
    "SE3": "geometry",
    "Sample": "cell",
    "Scenario": "simulation.scenario",
    "Settings": "estimation.settings",
    "Shape": "exchange.importing.described_target",
    "SimulatedCell": "simulation.scenario",
    "Solution": "estimation.solve",
    "Stages": "estimation.stages",
    "base_to_base": "accuracy.arrays.functions",
    "calibrate": "accuracy.calibrate",
    "calibration_to_dict": "cell.files",
    "compare": "accuracy.compare",
    "detect": "vision.detect",
    "export": "exchange.exporters.exporter",
    "export_kinds": "exchange.exporters.registry",
    "hand_eye": "accuracy.arrays.functions",
    "html_summary": "reporting.notebook",
    "import_into": "accuracy.input_screening.importing",
    "latest_run": "cell.files",
    "pasteable": "exchange.exporters.exporter",
    "read_array_file": "exchange.importers.arrays",
    "read_bag": "exchange.importers.bag",
    "read_calibration": "cell.files",
    "read_camera_info": "exchange.importers.camera_info",
    "read_cell": "cell.files",
    "read_colmap": "exchange.importers.colmap",
    "read_data_set": "exchange.importers.data_set",
    "read_easy_handeye": "exchange.importers.easy_handeye",
    "read_images": "exchange.importers.images",
    "read_joints": "exchange.importers.joints",
    "read_points": "exchange.importers.points",
    "read_touches": "exchange.importers.touches",
    "read_kalibr": "exchange.importers.kalibr",
    "read_lerobot": "exchange.importers.lerobot",
    "read_moveit_samples": "exchange.importers.moveit_samples",
    "read_mrcal": "exchange.importers.mrcal",
    "read_opencv": "exchange.importers.opencv",
    "read_pixels": "exchange.importers.pixels",
    "read_poses": "exchange.importers.poses",
    "read_recording": "cell.files",
    "read_truth": "cell.files",
    "robot_world": "accuracy.arrays.functions",
    "simulate": "simulation.testbed",
    "solve": "estimation.solve",
    "text_report": "reporting.text",
    "verify": "accuracy.drift.verify",
    "write_calibration": "cell.files",
    "write_cell": "cell.files",
    "write_recording": "cell.files",
}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'basecal' has no attribute {name!r}")
    value = getattr(import_module(f"basecal.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def _lazy_function(name: str) -> Callable[..., object]:
    """Make a public function that is loaded when it is called."""

    def call(*arguments: object, **options: object) -> object:
        """Load the function and call it."""
        function = __getattr__(name)
        assert callable(function)
        return function(*arguments, **options)

    return call


METHODS |= {name: _lazy_function(name) for name in ("export", "export_kinds", "html_summary")}


def __dir__() -> list[str]:
    return __all__
