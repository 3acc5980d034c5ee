"""Tests of networks that delay, lose packets, fall silent and break: no recorded sample is lost."""

from __future__ import annotations

import json
import os
import threading

import numpy as np
import pytest

from basecal.acquisition.capture import capture, remaining_samples, store_plan
from basecal.acquisition.drivers.ur import open_robot
from basecal.acquisition.rig import open_rig
from basecal.acquisition.taking import CaptureSettings, Taker
from basecal.cell.files import read_recording
from basecal.errors import DriverError
from basecal.planning import poses
from basecal.planning.sketch import sketch_cell
from basecal.simulation.running.protocol import Address, read_address, write_address
from shared.network import network
from shared.running_cell import home, running
from shared.second_process import own_host, second_process
from shared.ur_place import controller
from shared.wire import DEVICE, wire

pytestmark = pytest.mark.timed

FAST = CaptureSettings(speed_rad_s=2.0, tool_m_s=10.0, patience_s=3.0)
LOSS = "<Internal><Test><XmitLossiness>200</XmitLossiness></Test></Internal>"  # of a thousand packets


def captured(sketch, folder, plan, when=lambda step: None):
    """Result of a plan in a running cell, with each step passed to `when`."""
    with open_rig(sketch.cell, folder) as rig:
        for step in capture(Taker(rig, sketch, folder, FAST), plan):
            when(step)


def test_capture_resumes_after_a_broken_link(tmp_path):
    """If the link breaks in the third sample, an error is reported.

    Two complete lines are in the journal, and the remaining samples are taken later.
    """
    with running(tmp_path) as world, network("127.0.0.1", read_address(tmp_path).port) as (net, port):
        write_address(tmp_path, Address(port=port, token="token", pid=os.getpid()))
        sketch = sketch_cell(world.cell)
        plan = store_plan(tmp_path, world.cell, poses.plan(sketch, home(world), 4, 0))
        with pytest.raises(DriverError) as raised:
            captured(sketch, tmp_path, plan, lambda step: net.cut() if step.taken == 2 else None)
        assert "\n" not in str(raised.value)
        lines = (tmp_path / "recording" / "samples.jsonl").read_text().splitlines()
        assert [json.loads(line)["sample"] for line in lines] == [0, 1]
        captured(sketch, tmp_path, remaining_samples(tmp_path, world.cell))
    assert [sample.sample for sample in read_recording(tmp_path).samples] == [0, 1, 2, 3]


@pytest.mark.slow
def test_capture_over_a_slow_network_succeeds(tmp_path):
    """A delay of ten milliseconds per answer does not change the recording."""
    with running(tmp_path) as world, network("127.0.0.1", read_address(tmp_path).port) as (net, port):
        net.delay_s = 0.01
        write_address(tmp_path, Address(port=port, token="token", pid=os.getpid()))
        sketch = sketch_cell(world.cell)
        plan = store_plan(tmp_path, world.cell, poses.plan(sketch, home(world), 1, 0))
        captured(sketch, tmp_path, plan)
    (sample,) = read_recording(tmp_path).samples
    for name, state in sample.robots.items():
        np.testing.assert_allclose(state.joints_rad, plan[0].robots[name].joints_rad, atol=1e-9)


def far(host, at_host):
    """Network in front of a controller's port for states."""
    return second_process("shared.network", host, 30004, at_host, 30004)


@pytest.mark.slow
def test_states_survive_network_faults():
    """Late states are complete and in order; they continue after a silence and after a broken link."""
    pytest.importorskip("rtde_receive")
    host = own_host()
    with controller() as (process, place), far(place().options["host"], host) as net:
        robot = open_robot(place(motion="watch", host=host, reconnect_s=10.0))
        process.tell("spin")
        [robot.state() for _ in range(20)]
        net.tell("delay", 0.02)
        readings = [robot.state() for _ in range(30)]
        net.tell("delay", 0)
        net.tell("silent", "on")
        threading.Timer(1.5, net.tell, ["silent", "off"]).start()
        readings += [robot.state() for _ in range(30)]
        net.tell("cut")
        readings += [robot.state() for _ in range(30)]
        robot.close()
    stamps = [reading.stamp_s for reading in readings]
    assert np.all(np.diff(stamps) > 0)
    assert [reading.state.joints_rad[5] for reading in readings] == stamps


@pytest.mark.slow
def test_ros2_with_lost_packets():
    """One of five packets is lost: each received state and image is complete, newer, and has its own stamp."""
    pytest.importorskip("cyclonedds")
    from basecal.acquisition.drivers.ros2 import open_camera as open_image
    from basecal.acquisition.drivers.ros2 import open_robot as open_joints
    from shared.ros2_domain import LOOPBACK, ros2, watching

    lossy = LOOPBACK.replace("</General>", f"</General>{LOSS}")
    with ros2(100, 15, 640, 480, cell=watching((640, 480)), CYCLONEDDS_URI=lossy) as process:
        robot = open_joints(process.place("eye"))
        camera = open_image(process.place("wrist", topic="/wrist/image_raw"))
        pairs = [(robot.state(), camera.image()) for _ in range(15)]
    for reading, image in pairs:
        joints = reading.state.joints_rad
        assert joints[:4] @ [1e8, 1e5, 100, 0.01] == pytest.approx(reading.stamp_s, abs=1e-6)
        drawn = int.from_bytes(image.grey[0, :8].tobytes(), "big") * 1e-9
        assert drawn == pytest.approx(image.stamp_s, abs=1e-6)
        np.testing.assert_array_equal(image.grey.ravel()[8:], (np.arange(640 * 480) % 251)[8:])
    for each in zip(*pairs, strict=True):
        assert np.all(np.diff([one.stamp_s for one in each]) > 0)


@pytest.mark.slow
def test_ros2_with_reordered_packets():
    """10 % of the packets are overtaken: each state and image is complete, newer, and has its own stamp."""
    pytest.importorskip("cyclonedds")
    from shared.ros2_domain import dds_configuration

    sender = (
        "shared.ros2_publisher",
        (101, 100, 15, 640, 480),
        {"CYCLONEDDS_URI": dds_configuration(DEVICE, "10.7.0.2")},
    )
    listener = ("shared.ros2_listener", (101, 30, 640, 480), {"CYCLONEDDS_URI": dds_configuration(DEVICE, "10.7.0.1")})
    try:
        with wire(0.1, 0.02, sender, listener) as (between, process, watcher):
            assert (process.line(), watcher.line()) == ("ready", "ready")
            heard = json.loads(watcher.tell("go"))
    except PermissionError as error:
        pytest.skip(f"no process can have a network of its own here ({error})")
    assert between.overtaken > 100
    states, images = np.array(heard["states"]), np.array(heard["images"])
    np.testing.assert_allclose(states[:, 0], states[:, 1], atol=1e-6)
    np.testing.assert_allclose(images[:, 0], images[:, 1], atol=1e-6)
    assert images[:, 2].all()
    assert np.all(np.diff(states[:, 0]) > 0)
    assert np.all(np.diff(images[:, 0]) > 0)
