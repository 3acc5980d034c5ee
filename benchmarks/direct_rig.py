"""Arms and camera of a simulated cell in this process, for benchmarks that do not measure the connection."""

from __future__ import annotations

from basecal.acquisition.driver import CameraImage, Reading
from basecal.acquisition.rig import Rig
from basecal.cell import RobotState
from basecal.simulation.running.plant import Plant


def direct_rig(plant: Plant, robots: tuple[str, ...], cameras: tuple[str, ...] = ("wrist",)) -> Rig:
    """The rig of a plant."""
    return Rig({name: _Arm(name, plant) for name in robots}, {name: _Eye(name, plant) for name in cameras})


class _Arm:
    is_live = True

    def __init__(self, name: str, plant: Plant) -> None:
        self._name, self._plant = name, plant

    def state(self) -> Reading:
        stamp_s, joints = self._plant.state(self._name)
        return Reading(stamp_s, RobotState(joints_rad=joints))

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        assert to.joints_rad is not None
        self._plant.move(self._name, to.joints_rad, speed_rad_s)

    def stop(self) -> None:
        self._plant.stop(self._name)

    def close(self) -> None:
        pass


class _Eye:
    is_live = True

    def __init__(self, name: str, plant: Plant) -> None:
        self._name, self._plant = name, plant

    def image(self) -> CameraImage:
        shot = self._plant.shot(self._name)
        return CameraImage(shot.stamp_s, shot.image)

    def light(self, on: bool) -> None:
        self._plant.light(on)

    def close(self) -> None:
        pass
