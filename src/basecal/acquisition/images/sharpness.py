"""Whether a view is blurred by motion, judged beside the other views of its cell: a lens or a print may be soft."""

from __future__ import annotations

import numpy as np

from basecal.geometry import Array
from basecal.vision.edge_width import EdgeWidth

_WIDTH_RATIO = 1.25  # across one direction than across another: motion, for a lens or a print is as soft in all
_MOTION_PX = 3.0  # that is seen in the width of edges, beside that of the sharpest view
_MELT_PX = 16.0  # width at which twice as wide is as good: neighbouring marks melt into one another


class Sharpness:
    """The narrowest edges so far, by camera and target: in the image [px], and on the target [m]."""

    def __init__(self) -> None:
        self._narrowest: dict[tuple[str, str], Array] = {}

    def is_blurred(self, view: tuple[str, str], width: EdgeWidth, pixels: Array, points: Array) -> bool:
        """Whether the edges of a view are wider than lens and print explain; a view that is not blurred counts later.

        Edges are as wide as in the sharpest view [px] if the lens is soft, or [m] if the print is.

        Args:
            view: Names of the camera and the target.
            width: Of the edges.
            pixels: (n, 2) the target's points in the image.
            points: (n, 3) on the target [m].
        """
        if len(points) < 2:  # one point has no size on either side
            return False
        scale = np.array([1.0, np.linalg.norm(pixels.std(0)) / np.linalg.norm(points.std(0))])
        narrowest = self._narrowest.get(view, np.full(2, np.inf))
        typical = (scale * narrowest).max()
        limit = max(np.hypot(typical, _MOTION_PX), typical * (1 + typical / _MELT_PX))
        if width.wide_px > min(limit, _WIDTH_RATIO * width.narrow_px):
            return True
        self._narrowest[view] = np.minimum(narrowest, width.wide_px / scale)
        return False
