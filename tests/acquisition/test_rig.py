"""A cell's drivers, opened by name."""

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
    """A stranger's arm that notes what is asked of it."""

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
    """A module of another package that offers a driver `stranger` as an entry point."""
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


def test_nothing_is_sent_in_plain_text_unless_asked(stranger, tmp_path):
    """Of a driver that only is looked up, and of one that is opened without the option."""
    ((_, place),) = openers(cell("stranger"), tmp_path)
    assert not place.allow_plaintext
    with open_rig(cell("stranger"), tmp_path) as rig:
        assert not rig.robots["eye"].place.allow_plaintext


def test_a_stranger_is_found_and_told_its_options(stranger, tmp_path):
    """A driver of another package is named among ours, opened with its options, and closed at the end."""
    assert driver_names()[-1] == "stranger"
    with open_rig(cell("stranger", address="10.0.0.2"), tmp_path) as rig:
        assert set(rig.robots) == {"eye"}
        assert stranger.arms[0].place.options == {"address": "10.0.0.2"}
    assert stranger.arms[0].asked == ["close"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_arms_stop_before_anything_else(stranger, tmp_path, error):
    """Where something goes wrong, or somebody presses Ctrl-C, robots stop first and are closed then."""
    with pytest.raises(error), open_rig(cell("stranger"), tmp_path):
        raise error
    assert stranger.arms[0].asked == ["stop", "close"]


def test_an_arm_that_does_not_stop_is_named(stranger, tmp_path, caplog):
    """A stop that fails is reported beside the error that ends the capture, which stays as it is."""

    class Runaway(Arm):
        def stop(self):
            raise OSError("no link")

    stranger.open_robot = Runaway
    with pytest.raises(ValueError, match=r"^first$"), open_rig(cell("stranger"), tmp_path):
        raise ValueError("first")
    assert caplog.messages == ["eye did not confirm a stop: look at the arm"]


def test_a_stop_may_be_requested_from_anywhere(stranger, tmp_path):
    """The capture ends with the reason, wherever it is; its arms stop first."""

    def press_while_it_waits():
        with open_rig(cell("stranger"), tmp_path) as rig:
            threading.Thread(target=rig.request_stop, args=("Stop was pressed",)).start()
            time.sleep(10)

    with pytest.raises(DriverError, match=r"^Stop was pressed\. What was recorded is kept\.$"):
        press_while_it_waits()
    assert stranger.arms[0].asked == ["stop", "close"]


def test_unknown_drivers_are_named(tmp_path):
    """One that nobody offers, or that is for cameras only, is an error with its field."""
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


def test_arms_that_nothing_stops_are_not_moved_unless_accepted():
    """The error names the arm and what it would do; an arm with a watchdog, or one that is not sent, needs no word."""
    for guarantee, refused in (("none", True), ("watchdog", False), ("short-horizon", False)):
        rig = Rig({"eye": Arm(None)}, {}, guarantees={"eye": guarantee})
        check_guarantees(rig, True)
        if refused:
            with pytest.raises(UsageError, match="eye: no watchdog stops this arm"):
                check_guarantees(rig, False)
        else:
            check_guarantees(rig, False)


def test_a_rig_without_a_camera_is_refused():
    """The error names what cell.yaml lacks; one camera is enough."""
    with pytest.raises(InputError, match="no camera of the cell has a `driver`"):
        check_cameras(Rig({"eye": Arm(None)}, {}))
    check_cameras(Rig({}, {"wrist": object()}))


def test_calls_that_hang_are_left_behind():
    """All are made at once, within one time; those that fail or do not return are named."""
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
