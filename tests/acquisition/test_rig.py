"""Tests of opening a cell's drivers by name."""

from __future__ import annotations

import importlib.metadata
import sys
import threading
import time
import types

import pytest

from basecal.acquisition import rig
from basecal.acquisition.drivers import registry
from basecal.acquisition.drivers.registry import GROUP, driver_names
from basecal.acquisition.rig import Rig, check_cameras, check_guarantees, open_rig, openers
from basecal.cell import Cell, CellCamera, Driver, Robot
from basecal.errors import DatasetError, DriverError, InputError, UsageError


class Arm:
    """Foreign arm that records its calls."""

    is_live = True

    def __init__(self, place):
        self.place, self.asked = place, []

    def state(self):
        raise NotImplementedError

    def move(self, to, speed_rad_s):
        self.asked.append("move")

    def stop(self):
        self.asked.append("stop")

    def close(self):
        self.asked.append("close")


@pytest.fixture
def stranger(monkeypatch):
    """Module of another package that offers a driver `stranger` as an entry point."""
    module = types.ModuleType("strangers_driver")
    module.arms, module.NEEDS_OWN_PROCESS = [], False
    module.open_robot = lambda place: module.arms.append(Arm(place)) or module.arms[-1]
    monkeypatch.setitem(sys.modules, "strangers_driver", module)
    point = importlib.metadata.EntryPoint("stranger", "strangers_driver", GROUP)
    monkeypatch.setattr(
        registry, "entry_points", lambda **wanted: [point] if wanted.get("name", "stranger") == "stranger" else []
    )
    return module


def cell(kind, **options):
    return Cell("eye", {"eye": Robot("eye", driver=Driver(kind, options)), "still": Robot("still")})


def test_plain_text_needs_the_option(stranger, tmp_path):
    """A driver that is looked up, and one opened without the option, refuse plain text."""
    ((_, place),) = openers(cell("stranger"), tmp_path)
    assert not place.allow_plaintext
    with open_rig(cell("stranger"), tmp_path) as rig:
        assert not rig.robots["eye"].place.allow_plaintext


def test_foreign_driver_is_found_and_gets_its_options(stranger, tmp_path):
    """It is listed among the others, opened with its options, and closed at the end."""
    assert driver_names()[-1] == "stranger"
    with open_rig(cell("stranger", address="10.0.0.2"), tmp_path) as rig:
        assert set(rig.robots) == {"eye"}
        assert stranger.arms[0].place.options == {"address": "10.0.0.2"}
    assert stranger.arms[0].asked == ["close"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_arms_stop_first_after_an_error(stranger, tmp_path, error):
    """After an error or Ctrl-C, robots are stopped first and then closed."""
    with pytest.raises(error), open_rig(cell("stranger"), tmp_path):
        raise error
    assert stranger.arms[0].asked == ["stop", "close"]


def test_failed_stop_is_reported(stranger, tmp_path, caplog):
    """It is reported beside the error that ends the capture, which is unchanged."""

    class Runaway(Arm):
        def stop(self):
            raise OSError("no link")

    stranger.open_robot = Runaway
    with pytest.raises(ValueError, match=r"^first$"), open_rig(cell("stranger"), tmp_path):
        raise ValueError("first")
    assert caplog.messages == ["eye did not confirm a stop: look at the arm"]


def test_stop_can_be_requested_from_any_thread(stranger, tmp_path):
    """The capture ends with the reason at any point; its arms stop first."""

    def press_while_it_waits():
        with open_rig(cell("stranger"), tmp_path) as rig:
            threading.Thread(target=rig.request_stop, args=("Stop was pressed",)).start()
            time.sleep(10)

    with pytest.raises(DriverError, match=r"^Stop was pressed\. What was recorded is kept\.$"):
        press_while_it_waits()
    assert stranger.arms[0].asked == ["stop", "close"]


def test_unknown_drivers_are_named(tmp_path):
    """An unknown driver, or one for cameras only, is an error with its field."""
    with (
        pytest.raises(DatasetError, match=r"robots\.eye\.driver\.kind: no driver 'typd' \(did you mean 'typed'"),
        open_rig(cell("typd"), tmp_path),
    ):
        pass
    with pytest.raises(DatasetError, match="driver 'folder' is for cameras only"), open_rig(cell("folder"), tmp_path):
        pass
    with_camera = Cell(
        "eye", {"eye": Robot("eye")}, cameras={"wrist": CellCamera("wrist", "eye", driver=Driver("typed"))}
    )
    with pytest.raises(DatasetError, match="driver 'typed' is for robots only"), open_rig(with_camera, tmp_path):
        pass


def test_arms_without_a_watchdog_need_confirmation():
    """The error names the arm and the risk; arms with a watchdog, and arms that stay, need no confirmation."""
    for guarantee, refused in (("none", True), ("watchdog", False), ("short-horizon", False)):
        rig = Rig({"eye": Arm(None)}, {}, guarantees={"eye": guarantee})
        check_guarantees(rig, True)
        if refused:
            with pytest.raises(UsageError, match="eye: no watchdog stops this arm"):
                check_guarantees(rig, False)
        else:
            check_guarantees(rig, False)


def test_rig_without_a_camera_is_refused():
    """The error names the missing entry of cell.yaml; one camera suffices."""
    with pytest.raises(InputError, match="no camera of the cell has a `driver`"):
        check_cameras(Rig({"eye": Arm(None)}, {}))
    check_cameras(Rig({}, {"wrist": object()}))


def test_hanging_calls_are_abandoned():
    """All calls run at once within one timeout; those that fail or hang are reported."""
    ended, began_s = threading.Event(), time.monotonic()
    calls = {
        "hangs": lambda: ended.wait(3.0),
        "fails": lambda: 1 / 0,
        "works": lambda: None,
        "waits": lambda: ended.wait(3.0),
    }
    failed = rig._call_in_parallel(calls, 0.05)
    assert sorted(failed) == ["fails", "hangs", "waits"]
    assert time.monotonic() - began_s < 1.0
    ended.set()
    assert rig._call_in_parallel({"works": lambda: None}, 3.0) == []
    assert rig._call_in_parallel({}, 0.0) == []
