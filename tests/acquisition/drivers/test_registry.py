"""Drivers by their names."""

from __future__ import annotations

from types import ModuleType

from basecal.acquisition.drivers.registry import DRIVERS, driver_kind, driver_names, offered_driver
from safety.installed_driver import installed_driver
from shared.second_process import TESTS


def test_a_driver_of_another_package_is_found_as_pip_installs_it(tmp_path):
    """Its name comes after ours, its module declares what stops its arms, and it runs in a process of its own."""
    assert driver_kind("frail") is None
    with installed_driver(tmp_path, "frail", TESTS / "safety" / "frail_driver.py"):
        assert driver_names() == (*DRIVERS, "frail")
        kind = driver_kind("frail")
        assert (kind.stop_guarantee, kind.needs_own_process) == ("watchdog", True)
        assert kind.open_camera is None


def test_a_module_that_declares_nothing_is_trusted_with_nothing():
    """Nothing stops its arms, and it gets a process of its own."""
    kind = offered_driver(ModuleType("stranger"))
    assert (kind.open_robot, kind.open_camera, kind.stop_guarantee, kind.needs_own_process) == (
        None,
        None,
        "none",
        True,
    )


def test_ours_are_what_their_modules_declare():
    """Each function of the table gives what its module would be as an entry point."""
    for name, load in DRIVERS.items():
        module = __import__(f"basecal.acquisition.drivers.{name}", fromlist=["x"])
        assert load() == offered_driver(module)
