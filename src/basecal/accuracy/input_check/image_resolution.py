"""Whether a camera matrix is that of images of another resolution, in words.

`benchmarks.slips` judges its limits.
"""

from __future__ import annotations

import numpy as np

from basecal.cell import CellCamera
from basecal.estimation.problem.problem import Problem
from basecal.estimation.view.pixels import PixelMeasurement

_AGREE = 0.15  # of one another, the factors along both sides: centres lie within a tenth of the middle
_OTHER_FACTOR = 1.25  # factor of a resolution that is another one


def other_resolution(camera: CellCamera, problem: Problem) -> str:
    """A clause that names the resolution of which a camera matrix seems to be; empty where it suits the images.

    Determined by its centre in images whose size is stated, else by how far the recorded pixels reach beyond it.
    """
    lens = None if camera.intrinsics is None else camera.intrinsics.camera
    if lens is None:
        return ""
    whole = 2 * (lens.center + 0.5)
    if camera.size_px is None:
        views = [g.measurement for g in problem.groups if g.camera == camera.name]
        seen = [of.pixels[of.seen] for of in views if isinstance(of, PixelMeasurement)]
        reach = np.concatenate([np.zeros((1, 2)), *seen]).max(axis=0)
        if not np.all(reach > _OTHER_FACTOR * whole):
            return ""
        return f": points reach to ({reach[0]:.0f}, {reach[1]:.0f}) px, its camera matrix is of smaller images"
    width, height = camera.size_px
    factors = whole / np.array([width, height])
    factor = float(np.sqrt(np.prod(np.maximum(factors, 0.0))))
    if np.ptp(factors) > _AGREE * factor or 1 / _OTHER_FACTOR < factor < _OTHER_FACTOR:
        return ""
    size = f"{width * factor:.0f} x {height * factor:.0f} px"
    return f": its camera matrix looks like that of images of about {size}, not of {width} x {height} px"
