"""A driver by others for `frail_controllers`: it waits without a deadline, as libraries of makers do."""

import json
import os
import socket
import time

import numpy as np

from basecal.acquisition.driver import Place, Reading
from basecal.cell import RobotState
from basecal.errors import DriverError

STOP_GUARANTEE = "watchdog"


class FrailArm:
    is_live = True

    def __init__(self, place: Place) -> None:
        self.name, self.port = place.name, place.options["port"]
        self.reconnect_s = place.options.get("reconnect_s", 1.0)
        self.is_deaf = place.options.get("is_deaf", False)
        self.stop_s = place.options.get("stop_s", 0.0)
        self.is_connected = True
        self.connect()

    def connect(self) -> None:
        self.line = socket.create_connection(("127.0.0.1", self.port), timeout=5)
        self.line.settimeout(None)
        self.line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.stream = self.line.makefile("rb")
        if not self.stream.readline():
            raise ConnectionError("closed")
        self.is_connected = True

    def reconnect(self) -> None:
        self.is_connected = False
        until = time.monotonic() + self.reconnect_s
        while time.monotonic() < until:
            try:
                return self.connect()
            except OSError:
                time.sleep(0.05)
        raise DriverError(f"{self.name}: its controller is gone; tried again for {self.reconnect_s:g} s")

    def state(self) -> Reading:
        while True:
            try:
                text = self.stream.readline()
            except OSError:
                text = b""
            if text:
                break
            self.reconnect()
        if text == b"crash\n":
            os.abort()
        said = json.loads(text)
        if said["safety"] != "normal":
            raise DriverError(f"{self.name}: {said['safety']} stop")
        if not said["program"]:
            raise DriverError(f"{self.name}: its program was stopped")
        return Reading(said["stamp_s"], RobotState(joints_rad=np.array(said["joints"], dtype=float)))

    def tell(self, **said: object) -> None:
        self.line.sendall(json.dumps(said).encode() + b"\n")

    def goal_refusal(self, to: RobotState) -> str:
        return "a joint is beyond its limits" if np.abs(to.joints_rad).max() > 6.3 else ""

    def move(self, to: RobotState, speed_rad_s: float) -> None:
        self.tell(do="move", joints=to.joints_rad.tolist(), speed=speed_rad_s)

    def keep_alive(self) -> None:
        if self.is_connected:
            self.tell(do="alive")

    def stop(self) -> None:
        if self.is_deaf:
            raise OSError("no link")
        time.sleep(self.stop_s)
        self.tell(do="stop")

    def close(self) -> None:
        self.line.close()


def open_robot(place: Place) -> FrailArm:
    return FrailArm(place)
