"""Checks of images of a scene during a capture: number of features, and coverage of the image."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

import numpy as np

from basecal.accuracy.scene.images import read_features
from basecal.acquisition.coverage import COVERAGE_GRID, covered_cells, is_same_place
from basecal.acquisition.stillness import Unfit
from basecal.cell import WORLD, Cell, Sample
from basecal.errors import InputError, count_text
from basecal.planning.sketch import Sketch

_FEWEST_FEATURES = 100  # of an image: the required number of points that two cameras share


class SceneImages:
    """Features of the images of a scene; they are stored in `derived/` for `calibrate`.

    Attributes:
        cells: Cells of the image in which features were found so far, shape `COVERAGE_GRID`.
    """

    def __init__(self, cell: Cell, folder: Path) -> None:
        self.cells = np.zeros(COVERAGE_GRID, dtype=bool)
        self._cell, self._folder = cell, folder

    def check_carriers(self, cameras: Iterable[str], robots: Collection[str]) -> None:
        """Check that the poses of all arms that carry cameras are known.

        Raises:
            InputError: if such an arm has no driver.
        """
        for name in cameras:
            carrier = self._cell.cameras[name].on
            if carrier != WORLD and carrier not in robots:
                raise InputError(f"robot {carrier!r}, which carries {name}, has no `driver` in cell.yaml")

    def moved_cameras(
        self, cameras: Iterable[str], sketch: Sketch, sample: Sample, samples: Sequence[Sample]
    ) -> list[str]:
        """Cameras whose pose differs from all their poses in earlier samples.

        Raises:
            Unfit: if there are none.
        """
        carriers = {name: self._cell.cameras[name].on for name in cameras}
        earlier = {
            name: [
                each.sample
                for each in samples
                if name in each.images and (carrier == WORLD or is_same_place(sketch, carrier, sample, each))
            ]
            for name, carrier in carriers.items()
        }
        if all(earlier.values()):
            raise Unfit(f"too similar to sample {next(iter(earlier.values()))[0]}")
        return [name for name, numbers in earlier.items() if not numbers]

    def check(self, sample: Sample) -> None:
        """Check the images of a sample, and add them to the coverage.

        Raises:
            Unfit: if an image is unreadable or has too few features.
        """
        for camera, path in sample.images.items():
            result = read_features(self._cell, camera, sample, str(self._folder))
            if isinstance(result, str):
                raise Unfit(f"{path} {result}")
            features, size_px = result
            if len(features) < _FEWEST_FEATURES:
                raise Unfit(
                    f"{camera} sees {count_text(len(features), 'feature')} of the scene, {_FEWEST_FEATURES} are needed"
                    ": put printed paper or tools where it looks"
                )
            self.cells |= covered_cells(features.pixels, size_px)
