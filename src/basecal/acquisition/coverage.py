"""Coverage of the image by observed points, and of rotations by the arms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from basecal.cell import CandidateObservation, PixelObservation, Sample
from basecal.geometry import Array, BoolArray
from basecal.planning.sketch import Sketch

COVERAGE_GRID = (4, 6)
"""Numbers of rows and columns into which an image is divided."""

_EQUAL_M, _EQUAL_RAD = 2e-3, 2e-3  # distance below which two robot poses count as equal

_ENOUGH_ROTATION_RAD = np.radians(15.0)  # range of rotation about an axis, below which the advice is to rotate further
_FEWEST_SAMPLES = 5  # before the first advice


@dataclass(frozen=True, eq=False)
class Coverage:
    """The coverage of samples.

    Attributes:
        cells: Cells of the image in which points were seen, shape `COVERAGE_GRID`.
        rotation_ranges_rad: Range of each arm's rotation about its flange's axes, (3,) by robot [rad].
    """

    cells: BoolArray
    rotation_ranges_rad: dict[str, Array]

    @property
    def share(self) -> float:
        """Fraction of the image's cells in which points were seen."""
        return float(self.cells.mean())

    def advice(self, samples: int) -> str:
        """Advice to improve the coverage; empty if there is none."""
        if samples < _FEWEST_SAMPLES:
            return ""
        for robot, angles_rad in self.rotation_ranges_rad.items():
            axis = int(np.argmin(angles_rad))
            if angles_rad[axis] < _ENOUGH_ROTATION_RAD:
                return f"rotate {robot} further about {'xyz'[axis]}"
        return ""


def measure_coverage(sketch: Sketch, samples: Sequence[Sample]) -> Coverage:
    """Measure the coverage of samples for the camera and the robots of a sketch."""
    cells = np.zeros(COVERAGE_GRID, dtype=bool)
    size = sketch.lens.size_px
    for sample in samples:
        for observation in sample.observations:
            if (
                size is not None
                and isinstance(observation, PixelObservation | CandidateObservation)
                and observation.camera == sketch.view[0]
            ):
                cells |= covered_cells(observation.pixels, size)
    return Coverage(cells, rotation_ranges(sketch, samples))


def covered_cells(pixels: Array, size_px: tuple[int, int]) -> BoolArray:
    """Cells of an image that contain pixels, (n, 2), shape `COVERAGE_GRID`."""
    cells = np.zeros(COVERAGE_GRID, dtype=bool)
    positions = pixels[:, ::-1] / np.array(size_px[::-1]) * COVERAGE_GRID
    rows, columns = np.clip(positions.astype(int), 0, np.array(COVERAGE_GRID) - 1).T
    cells[rows, columns] = True
    return cells


def rotation_ranges(sketch: Sketch, samples: Sequence[Sample]) -> dict[str, Array]:
    """Range of each arm's rotation about its flange's axes, (3,) by robot [rad]."""
    ranges = {}
    for robot in sketch.movers:
        poses = [sketch.base_from_flange(robot, sample.robots[robot]) for sample in samples if robot in sample.robots]
        angles = [(poses[0].inverse() @ pose).rotvec for pose in poses]
        ranges[robot] = np.asarray(np.ptp(angles, axis=0)) if len(poses) > 1 else np.zeros(3)
    return ranges


def find_equal_sample(
    sketch: Sketch,
    sample: Sample,
    samples: Sequence[Sample],
    tolerance_m: float = _EQUAL_M,
    tolerance_rad: float = _EQUAL_RAD,
) -> int | None:
    """Number of a sample with all arms within the tolerances of a given sample; None if there is none."""
    for other in samples:
        if all(is_same_place(sketch, robot, sample, other, tolerance_m, tolerance_rad) for robot in sketch.movers):
            return other.sample
    return None


def is_same_place(
    sketch: Sketch,
    robot: str,
    first: Sample,
    second: Sample,
    tolerance_m: float = _EQUAL_M,
    tolerance_rad: float = _EQUAL_RAD,
) -> bool:
    """Whether the flange poses of a robot in two samples differ by less than the tolerances."""
    if robot not in first.robots or robot not in second.robots:
        return False
    first_pose, second_pose = (sketch.base_from_flange(robot, each.robots[robot]) for each in (first, second))
    motion = (first_pose.inverse() @ second_pose).log()
    return bool(np.linalg.norm(motion[:3]) < tolerance_m and np.linalg.norm(motion[3:]) < tolerance_rad)
