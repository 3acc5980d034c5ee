"""A running cell in the test's own process, reached as one in a separate process."""

from __future__ import annotations

import os
import threading
from contextlib import contextmanager

from basecal.cell import RobotState
from basecal.simulation.running.faults import read_faults
from basecal.simulation.running.plant import Clock, Plant
from basecal.simulation.running.protocol import Address, write_address
from basecal.simulation.running.server import CellServer
from basecal.simulation.running.world_file import write_world
from tests.shared.facing_arms import facing_arms


@contextmanager
def running(folder, *faults, target="charuco", seed=0):
    """The world of a cell that runs within the context, as its folder says; its time advances while a client waits."""
    world = facing_arms(target, seed, read_faults(faults))
    write_world(world, folder)
    with CellServer(Plant(world, Clock(0)), "token") as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        write_address(folder, Address(port=server.port, token="token", pid=os.getpid()))
        try:
            yield world
        finally:
            server.shutdown()
            thread.join()


def home(world):
    """Initial states of the arms of a world."""
    return {name: RobotState(joints_rad=joints) for name, joints in world.home.items()}
