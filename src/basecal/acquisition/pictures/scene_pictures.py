"""Images of a scene as they are taken: whether each shows enough of it, and in which parts of the image."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from basecal.acquisition.coverage import COVERAGE_GRID, covered_cells, is_same_place
from basecal.acquisition.stillness import Unfit
from basecal.cell import WORLD, Cell, Sample
from basecal.planning.sketch import Sketch
from basecal.vision.image_file import grey_image, read_bytes
from basecal.vision.tracks.feature_cache import kept_features

_FEWEST_FEATURES = 100  # of an image: as many points as two cameras are to share


class ScenePictures:
    """The features of the images of a scene, which `calibrate` then finds in `derived/`.

    Attributes:
        cells: Where features were found so far, of `COVERAGE_GRID`.
    """

    def __init__(self, cell: Cell, folder: Path) -> None:
        self.cells = np.zeros(COVERAGE_GRID, dtype=bool)
        self._cell, self._folder = cell, folder

    def moved_cameras(self, sketch: Sketch, sample: Sample, samples: Sequence[Sample]) -> list[str]:
        """Cameras whose arm is at a new place: one that stood still while others moved sees what it saw.

        Raises:
            Unfit: if there is none.
        """
        seen = {
            name: [
                each.sample
                for each in samples
                if name in each.images and (at.on == WORLD or is_same_place(sketch, at.on, sample, each))
            ]
            for name, at in self._cell.cameras.items()
        }
        if all(seen.values()):
            raise Unfit(f"too like sample {next(iter(seen.values()))[0]}")
        return [name for name, alike in seen.items() if not alike]

    def check(self, sample: Sample) -> None:
        """Count the images of a sample.

        Raises:
            Unfit: if one of them shows too little.
        """
        for camera, path in sample.images.items():
            data = read_bytes(self._folder / path)
            image = data if isinstance(data, str) else grey_image(data, self._cell.cameras[camera].size_px)
            if isinstance(data, str) or isinstance(image, str):
                raise Unfit(f"{path}: {image}")
            found = kept_features(self._folder, hashlib.sha256(data).hexdigest(), image, ())
            if len(found) < _FEWEST_FEATURES:
                raise Unfit(
                    f"{camera} sees {len(found)} features of the scene, {_FEWEST_FEATURES} are needed: "
                    "put printed paper or tools where it looks"
                )
            self.cells |= covered_cells(found.pixels, (image.shape[1], image.shape[0]))
