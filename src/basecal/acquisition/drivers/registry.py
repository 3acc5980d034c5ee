"""Every driver: a new one is a module, and a function here that loads it; other packages offer theirs as entry points.

A driver is loaded when a cell names it: an arm's process starts with what its own driver needs alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from types import ModuleType

from basecal.acquisition.driver import DriverKind

GROUP = "basecal.drivers"
"""The group of entry points in which other packages offer modules with `open_robot` or `open_camera`."""


def _simulated_driver() -> DriverKind:
    from basecal.acquisition.drivers import simulated as module

    return DriverKind(
        module.open_robot, module.open_camera, module.STOP_GUARANTEE, module.NEEDS_OWN_PROCESS, module.reaches
    )


def _replay() -> DriverKind:
    from basecal.acquisition.drivers import replay as module

    return DriverKind(
        module.open_robot, module.open_camera, needs_own_process=module.NEEDS_OWN_PROCESS, reaches=module.reaches
    )


def _folder() -> DriverKind:
    from basecal.acquisition.drivers import folder as module

    return DriverKind(open_camera=module.open_camera, reaches=module.reaches)


def _typed_driver() -> DriverKind:
    from basecal.acquisition.drivers import typed as module

    return DriverKind(module.open_robot, needs_own_process=module.NEEDS_OWN_PROCESS, reaches=module.reaches)


def _opencv() -> DriverKind:
    from basecal.acquisition.drivers import opencv as module

    return DriverKind(open_camera=module.open_camera, reaches=module.reaches)


def _ur() -> DriverKind:
    from basecal.acquisition.drivers import ur as module

    return DriverKind(module.open_robot, stop_guarantee=module.STOP_GUARANTEE, reaches=module.reaches)


def _opcua() -> DriverKind:
    from basecal.acquisition.drivers import opcua as module

    return DriverKind(module.open_robot, reaches=module.reaches, secret=module.secret)


def _ros2() -> DriverKind:
    from basecal.acquisition.drivers import ros2 as module

    return DriverKind(module.open_robot, module.open_camera, reaches=module.reaches)


DRIVERS: Mapping[str, Callable[[], DriverKind]] = {
    "simulated": _simulated_driver,
    "replay": _replay,
    "folder": _folder,
    "typed": _typed_driver,
    "opencv": _opencv,
    "ur": _ur,
    "opcua": _opcua,
    "ros2": _ros2,
}
"""What loads each driver of this package."""


def driver_names() -> tuple[str, ...]:
    """Names of all drivers, those of this package first."""
    return (*DRIVERS, *sorted({point.name for point in entry_points(group=GROUP)} - set(DRIVERS)))


def driver_kind(name: str) -> DriverKind | None:
    """The driver of a name; None if nobody offers it."""
    if name in DRIVERS:
        return DRIVERS[name]()
    for point in entry_points(group=GROUP, name=name):
        module = point.load()
        return offered_driver(module) if isinstance(module, ModuleType) else None
    return None


def offered_driver(module: ModuleType) -> DriverKind:
    """The driver that a module of another package offers; it is trusted with what it declares alone."""
    return DriverKind(
        getattr(module, "open_robot", None),
        getattr(module, "open_camera", None),
        getattr(module, "STOP_GUARANTEE", "none"),
        bool(getattr(module, "NEEDS_OWN_PROCESS", True)),
        getattr(module, "reaches", None),
        getattr(module, "secret", None),
    )
