"""The robots and cameras of a cell, opened by their drivers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from basecal.acquisition.driver import Camera, Moves, Place, Robot
from basecal.acquisition.pictures.feed import fed
from basecal.acquisition.pictures.latency import ArmMotion
from basecal.cell import Cell, Driver
from basecal.errors import DatasetError, nearest
from basecal.registry import DRIVERS

GROUP = "basecal.drivers"
"""The group of entry points in which other packages offer modules with `open_robot` or `open_camera`."""


@dataclass(frozen=True, eq=False)
class Rig:
    """The robots and cameras of a cell that have a driver, by name, and when its arms moved."""

    robots: Mapping[str, Robot]
    cameras: Mapping[str, Camera]
    arms: ArmMotion = field(default_factory=ArmMotion)

    def stop(self) -> None:
        """Have every robot that moves stand still, whatever any of them answers."""
        with ExitStack() as each:
            for robot in self.robots.values():
                if isinstance(robot, Moves):
                    each.callback(robot.stop)


def driver_names() -> tuple[str, ...]:
    """Names of all drivers, those of this package first."""
    return (*DRIVERS, *sorted({point.name for point in entry_points(group=GROUP)} - set(DRIVERS)))


@contextmanager
def open_rig(cell: Cell, folder: Path) -> Iterator[Rig]:
    """The rig of a cell, closed at the end; if that is an error, robots stop first.

    Raises:
        DatasetError: if a driver is not known, lacks the face that is asked of it, or an option is wrong.
        DriverError: if a robot or camera does not answer.
    """
    with ExitStack() as opened:
        robots, cameras, arms = dict[str, Robot](), dict[str, Camera](), ArmMotion()
        for name, robot in cell.robots.items():
            if robot.driver is not None:
                robots[name] = _opener(robot.driver, "robots", name, folder, "open_robot")(
                    Place(name, cell, folder, robot.driver.options)
                )
                opened.callback(robots[name].close)
        for name, camera in cell.cameras.items():
            if camera.driver is not None:
                given = _opener(camera.driver, "cameras", name, folder, "open_camera")(
                    Place(name, cell, folder, camera.driver.options)
                )
                cameras[name] = fed(name, given, arms)
                opened.callback(cameras[name].close)
        rig = Rig(robots, cameras, arms)
        try:
            yield rig
        except BaseException:
            rig.stop()
            raise


def _opener(driver: Driver, section: str, name: str, folder: Path, function: str) -> Callable[[Place], Any]:
    where = f"{section}.{name}.driver.kind"
    module = _module(driver.kind)
    if module is None:
        known = driver_names()
        message = f"no driver {driver.kind!r}{nearest(driver.kind, known)}; there are: {', '.join(known)}"
        raise DatasetError(str(folder / "cell.yaml"), message, field=where)
    if not hasattr(module, function):
        message = f"driver {driver.kind!r} is for {'cameras' if function == 'open_robot' else 'robots'} only"
        raise DatasetError(str(folder / "cell.yaml"), message, field=where)
    opener: Callable[[Place], Any] = getattr(module, function)
    return opener


def _module(kind: str) -> ModuleType | None:
    if kind in DRIVERS:
        return import_module(f"basecal.acquisition.drivers.{kind}")
    for point in entry_points(group=GROUP, name=kind):
        module = point.load()
        return module if isinstance(module, ModuleType) else None
    return None
