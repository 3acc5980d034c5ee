"""Two arms on their way, as a capture holds them, as a process: `python -m safety.moving_arms FOLDER PORT PORT [hang]`.

It prints the numbers of its processes once both arms move, then reads their states. With `hang` its main thread
ignores what it is told: it computes without end in one call that holds Python's lock. A line on the standard input is a
stop that another thread requests, as the page of a capture does.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from pathlib import Path

import numpy as np

from basecal.acquisition.rig import open_rig
from basecal.acquisition.stillness import wait_for_arms
from basecal.cell import Cell, Driver, Robot, RobotState

FAR = RobotState(joints_rad=np.full(6, 3.0))


def processes(parent: int) -> dict[str, list[int]]:
    """Numbers of the supervisor and of the processes of arms that descend from a process."""
    supervisors = children(parent)
    return {"supervisor": supervisors, "arms": [arm for each in supervisors for arm in children(each)]}


def children(parent: int) -> list[int]:
    """Numbers of the processes that a process started."""
    threads = Path(f"/proc/{parent}/task").iterdir()
    return sorted({int(n) for thread in threads for n in (thread / "children").read_text().split()})


def main() -> None:
    sys.path.insert(0, sys.argv[1])
    robots = {
        name: Robot(name, driver=Driver("frail", {"port": int(port)}))
        for name, port in zip(("left", "right"), sys.argv[2:4], strict=True)
    }
    with open_rig(Cell("left", robots), Path(".")) as rig:
        wait_for_arms(rig.robots, {}, 5.0)
        for robot in rig.robots.values():
            robot.move(FAR, 0.3)

        def press() -> None:
            if sys.stdin.readline():
                rig.request_stop("Stop was pressed")

        threading.Thread(target=press, daemon=True).start()
        print(json.dumps(processes(os.getpid())), flush=True)
        if "hang" in sys.argv:
            sum(range(10**15))  # holds Python's lock for days
        while True:
            for robot in rig.robots.values():
                robot.state()


if __name__ == "__main__":
    main()
