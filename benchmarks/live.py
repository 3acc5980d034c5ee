"""A running ROS 2, watched for minutes: whether states and images have their own stamps, and the resources it takes.

Another process sends 500 joint states and 30 images of 1280 x 720 a second over DDS on this computer, each with its
own stamp written into it. The drivers in this process take them as a capture does, in two threads.

    python -m benchmarks.live --minutes 5
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from basecal.acquisition.drivers.ros2 import open_camera, open_robot
from benchmarks.common import table, write

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from shared.ros2_domain import ros2, watching
from shared.ros2_listener import read_state

JOINTS_HZ, IMAGES_HZ, SIZE_PX = 500, 30, (1280, 720)
WARM_S = 10.0  # before memory is measured
TOLERANCE_S = 1e-6  # of a stamp as a float of seconds
HEAD = ("what", "sent", "taken", "wrong stamps", "largest gap [s]")


class Stream:
    """Counts of one thread: messages taken, those with a wrong stamp, and the largest gap between stamps."""

    def __init__(self, take: Any) -> None:
        self.take, self.taken, self.wrong, self.gap_s, self.last_s = take, 0, 0, 0.0, None
        self.error = ""

    def run(self, until_s: float) -> None:
        """Take messages until a time [s]; an error ends it."""
        try:
            while time.monotonic() < until_s:
                stamp_s, written_s = self.take()
                self.taken += 1
                self.wrong += int(abs(stamp_s - written_s) > TOLERANCE_S)
                self.gap_s = max(self.gap_s, 0.0 if self.last_s is None else stamp_s - self.last_s)
                self.last_s = stamp_s
        except Exception as error:
            self.error = str(error)


def read_image(camera: Any) -> tuple[float, float]:
    """Stamp of an image, and the stamp that its pixels contain [s]."""
    image = camera.image()
    return image.stamp_s, int.from_bytes(image.grey[0, :8].tobytes(), "big") * 1e-9


def resident_mb(pid: int) -> float:
    """Resident memory of a process [MB]."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


def cpu_s(pid: int) -> float:
    """CPU time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def watch(minutes: float) -> dict[str, Any]:
    """Watch for a number of minutes, and return counts, memory and CPU shares."""
    with ros2(JOINTS_HZ, IMAGES_HZ, *SIZE_PX, cell=watching(SIZE_PX)) as process:
        robot = open_robot(process.place("eye"))
        camera = open_camera(process.place("wrist", topic="/wrist/image_raw"))
        seconds = 60 * minutes
        streams = {
            "joint states": Stream(lambda: read_state(robot.state())),
            "pictures": Stream(lambda: read_image(camera)),
        }
        began_s, until_s = time.monotonic(), time.monotonic() + WARM_S + seconds
        threads = [threading.Thread(target=each.run, args=(until_s,)) for each in streams.values()]
        for thread in threads:
            thread.start()
        time.sleep(WARM_S)
        pids = {"this": os.getpid(), "sender": process.process.pid}
        before_mb, before_s = resident_mb(pids["this"]), {name: cpu_s(pid) for name, pid in pids.items()}
        memory_mb = []
        while time.monotonic() < until_s - 1:
            time.sleep(1.0)
            memory_mb.append(resident_mb(pids["this"]))
        spent_s = time.monotonic() - began_s - WARM_S
        cores = {name: (cpu_s(pid) - before_s[name]) / spent_s for name, pid in pids.items()}
        for thread in threads:
            thread.join()
        sent = [int(word) for word in process.tell("sent").split()]
    counts = zip(streams.items(), sent, strict=True)
    memory = {"after_warm_up": before_mb, "largest": max(memory_mb), "end": memory_mb[-1]}
    return {
        "minutes": minutes,
        "load": round(os.getloadavg()[0], 1),
        "niceness": os.nice(0),
        "rows": [[name, count, each.taken, each.wrong, round(each.gap_s, 3)] for (name, each), count in counts],
        "errors": [each.error for each in streams.values() if each.error],
        "memory_mb": {name: round(value, 1) for name, value in memory.items()},
        "cores": {name: round(share, 3) for name, share in cores.items()},
        "slope_mb_per_minute": round(float(60 * np.polyfit(range(len(memory_mb)), memory_mb, 1)[0]), 3),
    }


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--minutes", type=float, default=1.0)
    result = watch(asked.parse_args().minutes)
    print(table(HEAD, result["rows"]))
    print({key: value for key, value in result.items() if key != "rows"})
    print(f"written: {write('live', result)}")


if __name__ == "__main__":
    main()
