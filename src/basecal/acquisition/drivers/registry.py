"""Registry of drivers: add a module and its name here for a new driver; other packages use entry points.

A driver is loaded when a cell names it, so that an arm's process loads only its own driver.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points
from types import ModuleType

from basecal.acquisition.driver import DriverKind

GROUP = "basecal.drivers"
"""Group of entry points for drivers of other packages: modules with `open_robot` or `open_camera`."""


DRIVERS = (
    "simulated",
    "replay",
    "folder",
    "typed",
    "opencv",
    "ur",
    "opcua",
    "ros2",
)
"""Names of the drivers of this package: modules of this folder."""


def driver_names() -> tuple[str, ...]:
    """Names of all drivers, those of this package first."""
    return (*DRIVERS, *sorted({point.name for point in entry_points(group=GROUP)} - set(DRIVERS)))


def driver_kind(name: str) -> DriverKind | None:
    """Load a driver by name; None if it does not exist."""
    if name in DRIVERS:
        return offered_driver(import_module(f"basecal.acquisition.drivers.{name}"))
    for point in entry_points(group=GROUP, name=name):
        module = point.load()
        return offered_driver(module) if isinstance(module, ModuleType) else None
    return None


def offered_driver(module: ModuleType) -> DriverKind:
    """The driver that a module provides, according to its declarations."""
    return DriverKind(
        getattr(module, "open_robot", None),
        getattr(module, "open_camera", None),
        getattr(module, "STOP_GUARANTEE", "none"),
        bool(getattr(module, "NEEDS_OWN_PROCESS", True)),
        getattr(module, "reaches", None),
        getattr(module, "secret", None),
    )
