"""A calibrated cell, and samples of it that come later, with or without something moved."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Cell, Recording, RobotState
from basecal.geometry import SE3, Array
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


@dataclass(frozen=True, eq=False)
class Later:
    """A cell, its calibration, and samples taken afterwards."""

    cell: Cell
    calibration: Calibration
    recording: Recording

    def with_base_moved(self, tangent: Array) -> Recording:
        """The samples with the hand's base moved: its recorded poses are then those of another base."""
        back = SE3.exp(np.asarray(tangent, dtype=np.float64)).inverse()
        samples = []
        for sample in self.recording.samples:
            pose = sample.robots["hand"].base_from_flange
            assert pose is not None
            samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(back @ pose)}))
        return Recording(tuple(samples))

    def first(self, count: int) -> Later:
        """With so many of the samples."""
        return replace(self, recording=Recording(self.recording.samples[:count]))


@cache
def later(seed: int = 0, samples: int = 25, new: int = 6, **changed: object) -> Later:
    """A cell of two arms with stated noise, unless changed."""
    scenario = Scenario(**{"samples": samples + new, "robot_noise": (1e-4, 2e-4), **changed})  # type: ignore[arg-type]
    made = simulate(scenario, 3000 + seed)
    taken = made.recording.samples
    calibration = calibrate(made.cell, Recording(taken[:samples]))
    return Later(made.cell, calibration, Recording(taken[samples:]))
