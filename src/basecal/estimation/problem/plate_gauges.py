"""The rotation of a plate about the line that all its marks are on: nothing depends on it, so that it is held."""

from __future__ import annotations

import numpy as np

from basecal.cell import Cell, Unknown
from basecal.geometry import SE3
from basecal.numerics.spectral import principal_axes

_GAUGE_RAD = 1e-3  # [rad] sigma of what is held: any other would do


def with_plate_gauges(cell: Cell) -> dict[str, Unknown]:
    """The transforms of a cell, those of free plates with a prior of the rotation that nothing depends on.

    With R = swing @ twist a twist about the line of the marks is free, so that one without costs nothing.
    """
    transforms = cell.transforms
    for plate, mount in cell.plates.items():
        places = [target.mount.mean for target in cell.targets.values() if target.on == plate]
        points = np.array([at.translation for at in places if at is not None])
        of = principal_axes(points - points.mean(0))
        if mount.status == "free" and of.dimension == 1:
            sigma = np.full(6, np.inf)
            sigma[3 + int(np.argmax(np.abs(of.axes[:, 0])))] = _GAUGE_RAD
            transforms[cell.plate_name(plate)] = Unknown("prior", SE3.identity(), sigma)
    return transforms
