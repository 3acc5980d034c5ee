"""A planar arm whose kinematics can be computed by hand."""

import numpy as np

from basecal.geometry import SE3
from basecal.kinematics import SerialChain


def planar(*lengths):
    """Return an arm in the plane z = 0: joint, link along x, joint, link along x, ..."""
    n = len(lengths)
    origins = SE3.stack([SE3.from_rotvec([0, 0, 0], [x, 0, 0]) for x in (0.0, *lengths[:-1])])
    tip = SE3.from_rotvec([0, 0, 0], [lengths[-1], 0, 0])
    names = tuple(f"j{i}" for i in range(n))
    return SerialChain(names, origins, np.tile([0.0, 0, 1], (n, 1)), tip, np.full(n, -np.pi), np.full(n, np.pi))
