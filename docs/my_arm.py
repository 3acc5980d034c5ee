"""A driver: an arm that a vendor's program talks to, and pictures that another program leaves as files."""

import json
import time
import urllib.request

import numpy as np

from basecal.acquisition.driver import Place, Reading
from basecal.cell import RobotState


class MyArm:
    is_live = True  # states come by themselves, so that stillness can be judged from them

    def __init__(self, address: str) -> None:
        self.address = address

    def ask(self, path: str, **said: object) -> dict:
        data = json.dumps(said).encode()
        with urllib.request.urlopen(f"{self.address}/{path}", data, timeout=10) as answer:
            return json.load(answer)

    def state(self) -> Reading:  # waits for a state newer than the last one
        joints = np.radians(self.ask("joints")["degrees"])
        return Reading(time.monotonic(), RobotState(joints_rad=joints))

    def move(self, to: RobotState, speed_rad_s: float) -> None:  # begins, and comes back at once
        self.ask("move", degrees=np.degrees(to.joints_rad).tolist(), speed=np.degrees(speed_rad_s))

    def stop(self) -> None:
        self.ask("stop")

    def close(self) -> None:
        pass


def open_robot(place: Place) -> MyArm:
    return MyArm(place.options["address"])
