"""A DDS domain on this computer alone, and a second process in it that sends as drivers of ROS 2 do."""

from __future__ import annotations

import itertools
import os
from contextlib import contextmanager
from pathlib import Path

from basecal.acquisition.driver import Place
from basecal.cell import Cell, CellCamera
from shared.facing_arms import facing_arms
from shared.second_process import second_process


def dds_configuration(device, peer, most_bytes=1400):
    """A configuration of Cyclone DDS: one device, one peer, and the size of packets."""
    return (
        f"<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='{device}' multicast='false'/></Interfaces>"
        f"<AllowMulticast>false</AllowMulticast><MaxMessageSize>{most_bytes}B</MaxMessageSize></General>"
        f"<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address='{peer}'/></Peers></Discovery>"
        "</Domain></CycloneDDS>"
    )


LOOPBACK = dds_configuration("lo", "127.0.0.1", 65500)
DOMAIN = 1 + os.getpid() % 60
"""Domain of tests without a second process; 100 stays silent, and second processes have domains above it."""
_COUNT = itertools.count(17 * os.getpid())
CELL = facing_arms("led").cell


@contextmanager
def ros2(*words, cell=CELL, **environment):
    """The process, with the place of its robot or camera in a cell; words are its rates and sizes."""
    os.environ["CYCLONEDDS_URI"] = LOOPBACK
    domain = 101 + next(_COUNT) % 100  # a new one, since messages of an earlier process may still arrive
    with second_process("shared.ros2_publisher", domain, *words, **environment) as process:
        process.domain = domain
        process.place = lambda name, **options: Place(
            name, cell, Path("."), {"domain": domain, "reconnect_s": 5.0, **options}
        )
        yield process


def watching(size_px):
    """A cell whose camera has images of a size, and robots as in the simulated one."""
    return Cell(CELL.reference, CELL.robots, cameras={"wrist": CellCamera("wrist", "eye", size_px=size_px)})
