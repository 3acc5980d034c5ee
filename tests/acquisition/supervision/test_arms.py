"""Tests of proxies of arms in separate processes."""

from __future__ import annotations

import json
import os
import pickle
import signal
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.acquisition.driver import ChecksGoals, Freedrives, Moves, Reading
from basecal.acquisition.rig import open_rig
from basecal.acquisition.supervision import arms
from basecal.acquisition.supervision.arms import stop_report
from basecal.acquisition.supervision.frames import Channel, Frame, Kind
from basecal.acquisition.supervision.standstill import Standstill
from basecal.cell import Cell, Driver, Robot, RobotState
from basecal.errors import DatasetError, DriverError
from safety.installed_driver import installed_driver
from shared.second_process import TESTS, second_process

pytestmark = pytest.mark.timed


@pytest.fixture(scope="module")
def frail(tmp_path_factory):
    """Controllers with a driver of another package: a cell of both arms."""
    with (
        installed_driver(tmp_path_factory.mktemp("packages"), "frail", TESTS / "safety" / "frail_driver.py"),
        second_process("safety.frail_controllers") as controllers,
    ):
        ports = json.loads(controllers.tell("ports"))
        yield {name: Robot(name, driver=Driver("frail", {"port": port})) for name, port in ports.items()}


def test_proxy_has_the_interface_of_its_driver(frail):
    """It yields newer states, passes refusals of its controller, and moves; an error keeps its type."""
    with open_rig(Cell("left", frail), Path(".")) as rig:
        left = rig.robots["left"]
        assert isinstance(left, Moves)
        assert isinstance(left, ChecksGoals)
        assert not isinstance(left, Freedrives)
        stamps = [left.state().stamp_s for _ in range(5)]
        assert np.all(np.diff(stamps) > 0)
        assert left.goal_refusal(RobotState(joints_rad=np.full(6, 7.0))) == "a joint is beyond its limits"
        left.move(RobotState(joints_rad=np.full(6, 0.05)), 1.0)
        reached = [left.state().state.joints_rad.max() for _ in range(30)]
        assert reached[-1] == pytest.approx(0.05)
        with pytest.raises(DriverError, match="AttributeError"):
            left.move("nowhere", 1.0)
        rig.stop()
        with pytest.raises(DriverError, match="an arm was ordered to stop"):
            left.move(RobotState(joints_rad=np.zeros(6)), 1.0)


def test_error_on_opening_is_raised_in_the_capture(frail, tmp_path):
    """An error of the cell file keeps type, path and field; a missing device is one line."""
    wrong = {"left": Robot("left", driver=Driver("opcua", {"url": "opc.tcp://127.0.0.1", "rate_hz": 1}))}
    with pytest.raises(DatasetError) as raised, open_rig(Cell("left", wrong), tmp_path):
        pass
    assert (raised.value.path, raised.value.field) == (str(tmp_path / "cell.yaml"), "robots.left.driver.rate_hz")
    nobody = {"left": Robot("left", driver=Driver("frail", {"port": 1}))}
    with pytest.raises(DriverError, match="ConnectionRefusedError"), open_rig(Cell("left", nobody), tmp_path):
        pass


def test_driver_that_does_not_open_is_reported(tmp_path, monkeypatch):
    """It has more than the reconnection time; it does not hide the error of another driver."""
    module = tmp_path / "slow.py"
    module.write_text(
        "import time\nfrom basecal.errors import DriverError\ndef open_robot(place):\n"
        "    if place.options.get('fails'):\n        raise DriverError('nobody there')\n    time.sleep(60)\n"
    )
    monkeypatch.setattr(arms, "_OPEN_TIMEOUT_S", 2.0)
    with installed_driver(tmp_path / "packages", "slow", module):
        right = Robot("right", driver=Driver("slow", {"reconnect_s": 0.5}))
        cell = Cell("right", {"right": right})
        with (
            pytest.raises(DriverError, match=r"^right: its driver did not open within 2\.5 s$"),
            open_rig(cell, tmp_path),
        ):
            pass
        left = Robot("left", driver=Driver("slow", {"fails": True}))
        cell = Cell("right", {"right": right, "left": left})
        with pytest.raises(DriverError, match="nobody there"), open_rig(cell, tmp_path):
            pass


def test_unreadable_state_ends_the_capture(tmp_path):
    """Its numbers may have a type of a library that only the driver imports: no caller waits forever."""
    library = tmp_path / "library"
    library.mkdir()
    (library / "maker.py").write_text("class Stamp(float):\n    pass\n")
    module = tmp_path / "strange.py"
    module.write_text(
        "import sys, time\nimport numpy as np\nfrom basecal.acquisition.driver import Reading\n"
        "from basecal.cell import RobotState\nclass Arm:\n    is_live = True\n    def state(self):\n"
        f"        sys.path.append({str(library)!r})\n        import maker\n        time.sleep(0.01)\n"
        "        return Reading(maker.Stamp(time.monotonic()), RobotState(joints_rad=np.zeros(6)))\n"
        "    def close(self):\n        pass\ndef open_robot(place):\n    return Arm()\n"
    )
    with installed_driver(tmp_path / "packages", "strange", module):
        cell = Cell("left", {"left": Robot("left", driver=Driver("strange", {}))})
        with pytest.raises(DriverError, match=r"cannot be read .*maker"), open_rig(cell, tmp_path) as rig:
            rig.robots["left"].state()


def test_unconfirmed_stop_is_reported(frail, caplog):
    """It is reported beside the error that ends the capture; the other arm, which stopped, is not."""
    deaf = replace(frail["left"], driver=Driver("frail", {**frail["left"].driver.options, "is_deaf": True}))
    with pytest.raises(ValueError, match=r"^first$"), open_rig(Cell("left", {**frail, "left": deaf}), Path(".")):
        raise ValueError("first")
    assert caplog.messages == ["left did not confirm a stop: look at the arm"]


def test_slow_stop_without_a_watchdog_is_not_cut_off(tmp_path):
    """Nothing else stops such an arm: its process is not killed after 0.3 s, before the stop is sent."""
    module = tmp_path / "slow.py"
    driver = (TESTS / "safety" / "frail_driver.py").read_text()
    module.write_text(driver.replace('"watchdog"', '"none"').replace("def keep_alive", "def _keep_alive"))
    with (
        installed_driver(tmp_path / "packages", "slow", module),
        second_process("safety.frail_controllers") as controllers,
    ):
        controllers.tell("fail", "left", "unwatched")
        options = {"port": json.loads(controllers.tell("ports"))["left"], "stop_s": 0.45}

        def move_and_fail(robot):
            robot.state()
            robot.move(RobotState(joints_rad=np.full(6, 3.0)), 0.3)
            raise ValueError("first")

        cell = Cell("left", {"left": Robot("left", driver=Driver("slow", options))})
        with pytest.raises(ValueError, match=r"^first$"), open_rig(cell, Path(".")) as rig:
            move_and_fail(rig.robots["left"])
        assert json.loads(controllers.tell("moving")) == []


def test_arm_that_is_only_read_confirms_no_stop(frail, tmp_path):
    """Another program may move it, which goes on."""
    module = tmp_path / "watched.py"
    driver = (TESTS / "safety" / "frail_driver.py").read_text()
    module.write_text(driver.replace("def move", "def _move").replace("def stop", "def _stop"))
    with installed_driver(tmp_path / "packages", "watched", module):
        watched = replace(frail["right"], driver=Driver("watched", frail["right"].driver.options))

        def press_stop(rig):
            rig.request_stop("Stop was pressed")
            time.sleep(5)

        with (
            pytest.raises(DriverError, match=r"^Stop was pressed\. left confirmed the stop\. Find the cause"),
            open_rig(Cell("left", {**frail, "right": watched}), Path(".")) as rig,
        ):
            press_stop(rig)


def test_request_after_an_interrupt_does_not_hide_it(frail):
    """A late request, such as the end of freedrive, raises no other error than Ctrl-C."""

    def wait_for_interrupt(robot):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5)
        finally:
            robot.goal_refusal(RobotState(joints_rad=np.zeros(6)))

    with pytest.raises(KeyboardInterrupt), open_rig(Cell("left", frail), Path(".")) as rig:
        wait_for_interrupt(rig.robots["left"])


def test_state_before_a_silence_is_not_returned(frail):
    """If the link of an arm at rest fell silent, there is no state: no motion begins from an old one."""
    with second_process("safety.frail_controllers") as controllers:
        options = {"port": json.loads(controllers.tell("ports"))["left"], "reconnect_s": 0.5}
        left = {"left": replace(frail["left"], driver=Driver("frail", options))}

        def fall_silent(robot):
            robot.state()
            time.sleep(0.3)
            controllers.tell("fail", "left", "freeze")
            time.sleep(1.0)
            robot.state()

        with pytest.raises(DriverError, match="left: no state came"), open_rig(Cell("left", left), Path(".")) as rig:
            fall_silent(rig.robots["left"])


def test_state_from_before_a_standstill_is_not_returned():
    """States that waited in the pipe while the capture did not run are old: no motion begins from them."""
    proxied = arms.Arms.__new__(arms.Arms)
    proxied._changed, proxied._readings, proxied._reason = threading.Condition(), {}, ""

    def receive(read_s):
        reading = Reading(read_s, RobotState(joints_rad=np.zeros(6)))
        proxied._handle(Frame(Kind.READING, 0, pickle.dumps((read_s, reading))))

    began_s = time.monotonic()
    receive(began_s - 45.0)
    threading.Timer(0.2, lambda: receive(time.monotonic())).start()
    count, reading = proxied.wait_for_newer(0, 0)
    assert count == 2
    assert reading.stamp_s > began_s


def test_capture_that_did_not_run_is_the_reason(frail, monkeypatch):
    """Not a timeout that ran out meanwhile; the arms are stopped."""

    def stand_still(robot):
        robot.state()
        monkeypatch.setattr(Standstill, "duration_s", 45.0)
        raise DriverError("wrist: no image came within 10 s")

    words = r"^the capture did not run for 45\.0 s\. left and right confirmed the stop\. "
    with pytest.raises(DriverError, match=words), open_rig(Cell("left", frail), Path(".")) as rig:
        stand_still(rig.robots["left"])


def proxied(**fields):
    """Proxies of three arms, of which the first moves, the second is guided, and the third is only read."""
    found = arms.Arms.__new__(arms.Arms)
    found._names, found._changed = ["left", "right", "watched"], threading.Condition()
    found._opened = {k: {"moves": k == 0, "freedrives": k == 1} for k in range(3)}
    found._reason, found._is_ending, found._is_interrupted, found._unreported = "", False, False, []
    found._standstill, found._standstill_reason = Standstill(), ""
    for name, value in fields.items():
        setattr(found, name, value)
    return found


def test_stop_is_confirmed_by_arms_that_can_be_stopped():
    """Those that move or are guided; not those that are only read, or that did not open."""
    found = proxied()
    found._set_stop_reason("left: protective stop", [])
    found._set_stop_reason("later", ["left"])
    assert found.interruption.startswith("left: protective stop. left and right confirmed the stop. ")
    found = proxied()
    found._opened[1] = (DriverError, "nobody there", {})
    found._set_stop_reason("left: protective stop", ["left"])
    assert found.interruption.startswith("left: protective stop. left did not confirm a stop: look at the arm. ")


@pytest.mark.parametrize("is_ending", [False, True])
def test_arm_that_did_not_confirm_is_reported_once(is_ending):
    """By the error that ends the capture; if another error ends it, by the order to stop."""
    found = proxied(_is_ending=is_ending, _channel=SimpleNamespace(send=lambda *frame: None))
    found._set_stop_reason("a person came", ["left"])
    assert found.interruption.startswith("a person came. right confirmed") != is_ending
    found.stop(1, "an arm was ordered to stop")
    if is_ending:
        with pytest.raises(DriverError, match=r"^left did not confirm a stop: look at the arm$"):
            found.stop(0, "an arm was ordered to stop")
    else:
        found.stop(0, "an arm was ordered to stop")


@pytest.mark.parametrize(("by_signal", "kind"), [(True, KeyboardInterrupt), (False, DriverError)])
def test_request_after_a_stop_is_refused(by_signal, kind):
    """A signal remains an interrupt, which reaches the main thread by itself; any other stop is an error."""
    event = {"reason": "SIGTERM" if by_signal else "right: its link is lost", "unconfirmed": [], "by_signal": by_signal}
    found = proxied()
    found._check()
    found._handle(Frame(Kind.EVENT, 0, json.dumps(event).encode()))
    assert bool(found.interruption) != by_signal
    with pytest.raises(kind, match=f"^{event['reason']}"):
        found.ask(0, "move")


def test_long_standstill_of_the_capture_is_the_reason():
    """It is one of more than ten seconds, and the report of a stop is then its own."""
    for duration_s, reason in ((9.5, ""), (10.5, "the capture did not run for 10.5 s")):
        found = proxied()
        found._standstill._cycle_s -= duration_s
        assert found._note_standstill() == reason
        found._set_stop_reason(reason or "right: its link is lost", [])
        assert bool(found.standstill_report) == bool(reason)


@pytest.mark.parametrize(("is_open", "reason"), [(True, "hangs"), (False, "ended")])
def test_missing_supervisor_ends_the_capture(monkeypatch, is_open, reason):
    """No arm confirmed a stop, and the process is killed, so that it does not come back."""
    monkeypatch.setattr(arms, "PARENT_HANG_LIMIT_S", 0.1)
    monkeypatch.setattr(arms, "START_S", 0.1)
    read_fd, hold_fd = os.pipe()
    idle_fd, write_fd = os.pipe()
    if not is_open:
        os.close(hold_fd)
    killed = []
    process = SimpleNamespace(kill=lambda: killed.append(time.monotonic()))
    found = proxied(_channel=Channel(read_fd, write_fd), _process=process)
    began_s = time.monotonic()
    found._listen()
    assert found._reason.startswith(
        f"the process that supervises the arms {reason}. left and right and watched did not"
    )
    assert len(killed) == 1
    assert (killed[0] - began_s > 0.2) == is_open
    beats = [frame.kind for frame in Channel(idle_fd, write_fd).receive()] if is_open else []
    assert set(beats) <= {Kind.ALIVE}
    assert (len(beats) > 0) == is_open
    assert len(beats) <= (killed[0] - began_s) / arms.HEARTBEAT_S


def test_reason_lists_confirmed_and_unconfirmed_stops():
    """The cause comes first, then the confirmed and unconfirmed stops, then the advice."""
    words = stop_report("right: its link is lost", ["left", "right"], ["right"])
    assert words == (
        "right: its link is lost. left confirmed the stop. right did not confirm a stop: look at the arm. "
        "Find the cause, then start again; what was recorded is kept."
    )
