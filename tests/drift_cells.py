"""A calibrated cell, and later samples of it, with or without a base moved."""

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
        """The samples after a motion of the hand's base by a right tangent; flange poses are then in the moved base."""
        moved_from_base = SE3.exp(np.asarray(tangent, dtype=np.float64)).inverse()
        samples = []
        for sample in self.recording.samples:
            pose = sample.robots["hand"].base_from_flange
            assert pose is not None
            samples.append(replace(sample, robots={**sample.robots, "hand": RobotState(moved_from_base @ pose)}))
        return Recording(tuple(samples))

    def first(self, count: int) -> Later:
        """Keep the first `count` samples."""
        return replace(self, recording=Recording(self.recording.samples[:count]))


@cache
def later(seed: int = 0, samples: int = 25, new: int = 6, **changes: object) -> Later:
    """Simulate two arms with stated noise; calibrate by the first `samples`, and keep the `new` last ones for later."""
    scenario = Scenario(**{"samples": samples + new, "robot_noise": (1e-4, 2e-4), **changes})  # type: ignore[arg-type]
    simulated = simulate(scenario, 3000 + seed)
    all_samples = simulated.recording.samples
    calibration = calibrate(simulated.cell, Recording(all_samples[:samples]))
    return Later(simulated.cell, calibration, Recording(all_samples[samples:]))
