"""Modules of drivers by their names."""

from __future__ import annotations

from types import SimpleNamespace

from basecal.acquisition.driver_modules import driver_module, driver_names, runs_alone, stop_guarantee
from basecal.registry import DRIVERS
from safety.installed_driver import installed_driver
from shared.second_process import TESTS


def test_a_driver_of_another_package_is_found_as_pip_installs_it(tmp_path):
    """Its name comes after ours, its module declares what stops its arms, and it runs in a process of its own."""
    assert driver_module("frail") is None
    with installed_driver(tmp_path, "frail", TESTS / "safety" / "frail_driver.py"):
        assert driver_names() == (*DRIVERS, "frail")
        module = driver_module("frail")
        assert (stop_guarantee(module), runs_alone(module)) == ("watchdog", True)


def test_a_module_that_declares_nothing_is_trusted_with_nothing():
    """Nothing stops its arms, and it gets a process of its own."""
    assert (stop_guarantee(SimpleNamespace()), runs_alone(SimpleNamespace())) == ("none", True)
    assert not runs_alone(driver_module("typed"))
    assert stop_guarantee(driver_module("simulated")) == "watchdog"
