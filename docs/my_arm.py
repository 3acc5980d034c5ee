"""A driver: an arm that a vendor's program talks to over HTTP; the base class connects again when it is lost."""

import json
import time
import urllib.request

import numpy as np

from basecal.acquisition.driver import Place, Reading
from basecal.acquisition.links.reconnecting import ReconnectingRobot
from basecal.cell import RobotState

STOP_GUARANTEE = "none"  # this controller finishes its move when this computer is silent


class MyArm(ReconnectingRobot):
    def __init__(self, name: str, address: str) -> None:
        self.address = address
        super().__init__(name)

    def ask(self, path: str, **said: object) -> dict[str, list[float]]:
        with urllib.request.urlopen(f"{self.address}/{path}", json.dumps(said).encode(), timeout=1) as answer:
            return dict(json.load(answer))

    def connect(self) -> None:  # HTTP connects with each request: ask once
        self.ask("joints")

    def read(self) -> Reading:
        joints = np.radians(self.ask("joints")["degrees"])
        return Reading(time.monotonic(), RobotState(joints_rad=joints))

    def move(self, to: RobotState, speed_rad_s: float) -> None:  # begins, and comes back at once
        self.ask("move", degrees=np.degrees(to.vector).tolist(), speed=np.degrees(speed_rad_s))

    def stop(self) -> None:  # called by another thread
        self.ask("stop")


def open_robot(place: Place) -> MyArm:
    return MyArm(place.name, place.options["address"])
