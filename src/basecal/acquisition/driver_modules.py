"""Modules of drivers, by their names: those of this package, and those that other packages offer as entry points."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points
from types import ModuleType

from basecal.acquisition.driver import StopGuarantee
from basecal.registry import DRIVERS

GROUP = "basecal.drivers"
"""The group of entry points in which other packages offer modules with `open_robot` or `open_camera`."""


def driver_names() -> tuple[str, ...]:
    """Names of all drivers, those of this package first."""
    return (*DRIVERS, *sorted({point.name for point in entry_points(group=GROUP)} - set(DRIVERS)))


def driver_module(kind: str) -> ModuleType | None:
    """The module of a driver; None if nobody offers it."""
    if kind in DRIVERS:
        return import_module(f"basecal.acquisition.drivers.{kind}")
    for point in entry_points(group=GROUP, name=kind):
        module = point.load()
        return module if isinstance(module, ModuleType) else None
    return None


def stop_guarantee(module: ModuleType) -> StopGuarantee:
    """What stops an arm when this computer is silent; "none" if its driver does not declare it."""
    guarantee: StopGuarantee = getattr(module, "STOP_GUARANTEE", "none")
    return guarantee


def runs_alone(module: ModuleType) -> bool:
    """Whether a driver gets a process of its own: all but those that ask a person or simulate, which declare it."""
    return bool(getattr(module, "NEEDS_OWN_PROCESS", True))
