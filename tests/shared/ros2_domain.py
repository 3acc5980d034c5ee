"""A domain of DDS on this computer alone, and in it a second process that sends what drivers of ROS 2 send."""

from __future__ import annotations

import itertools
import os
from contextlib import contextmanager
from pathlib import Path

from basecal.acquisition.driver import Place
from basecal.cell import Cell, CellCamera
from shared.facing_arms import facing_arms
from shared.second_process import second_process


def over(device, peer, most_bytes=1400):
    """A configuration of Cyclone DDS: one device, one peer, and packets of so many bytes."""
    return (
        f"<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='{device}' multicast='false'/></Interfaces>"
        f"<AllowMulticast>false</AllowMulticast><MaxMessageSize>{most_bytes}B</MaxMessageSize></General>"
        f"<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address='{peer}'/></Peers></Discovery>"
        "</Domain></CycloneDDS>"
    )


LOOPBACK = over("lo", "127.0.0.1", 65500)
DOMAIN = 1 + os.getpid() % 60
"""Of tests without a second process. Those to 99 are free beside it, nobody sends in 100, second processes do above."""
_COUNT = itertools.count(17 * os.getpid())
CELL = facing_arms("led").cell


@contextmanager
def ros2(*words, cell=CELL, **environment):
    """The process, and where a robot or camera of it is in a cell; words are rates and sizes as it takes them."""
    os.environ["CYCLONEDDS_URI"] = LOOPBACK
    domain = 101 + next(_COUNT) % 100  # its own: what an earlier process sent may still be on its way
    with second_process("shared.ros2_publisher", domain, *words, **environment) as process:
        process.domain = domain
        process.place = lambda name, **options: Place(
            name, cell, Path("."), {"domain": domain, "reconnect_s": 5.0, **options}
        )
        yield process


def watching(size_px):
    """A cell whose camera has images of a size, and robots as in the simulated one."""
    return Cell(CELL.reference, CELL.robots, cameras={"wrist": CellCamera("wrist", "eye", size_px=size_px)})
