"""Two controllers in one process, with a watchdog each, that fail as told: `python -m safety.frail_controllers`.

Each arm listens on a port of its own and speaks lines of JSON: states a hundred times a second one way, commands the
other. Lines on the standard input are faults; every line is answered by one. All times are of the system's monotonic
clock, which processes of one machine share.
"""

from __future__ import annotations

import json
import queue
import socket
import sys
import threading
import time

PERIOD_S = 0.01
WATCHDOG_S = 0.3
NAMES = ("left", "right")


class Arm:
    """Six joints, and what goes wrong with them."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.joints, self.goal, self.speed = [0.0] * 6, [0.0] * 6, 0.0
        self.log: list[tuple[float, str]] = []
        self.safety, self.has_program = "normal", True
        self.alive_s = time.monotonic()
        self.is_frozen = self.lies = self.sends_nan = self.crashes = self.refuses = self.is_unwatched = False
        self.delay_s = 0.0
        self.shown = list(self.joints)
        self.lines: list[socket.socket] = []
        self.server = socket.create_server(("127.0.0.1", 0))
        for work in (self.accept, self.run):
            threading.Thread(target=work, daemon=True).start()

    @property
    def is_moving(self) -> bool:
        return self.joints != self.goal

    def note(self, what: str) -> None:
        self.log.append((time.monotonic(), what))

    def halt(self, why: str) -> None:
        if self.is_moving:
            self.note(f"halted {why}")
        self.goal = list(self.joints)

    def run(self) -> None:
        before = time.monotonic()
        while True:
            time.sleep(PERIOD_S / 2)
            now = time.monotonic()
            longest = max(abs(goal - at) for goal, at in zip(self.goal, self.joints, strict=True))
            if longest:
                share = min(1.0, self.speed * (now - before) / longest)
                self.joints = (
                    list(self.goal)
                    if share == 1
                    else [at + share * (goal - at) for goal, at in zip(self.goal, self.joints, strict=True)]
                )
            if now - self.alive_s > WATCHDOG_S and not self.is_unwatched:
                self.halt("watchdog")
            before = now

    def accept(self) -> None:
        while True:
            line, _ = self.server.accept()
            if self.refuses:
                line.close()
                continue
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.lines.append(line)
            late: queue.SimpleQueue[tuple[float, bytes]] = queue.SimpleQueue()
            for work in (self.send, self.deliver):
                threading.Thread(target=work, args=(line, late), daemon=True).start()
            threading.Thread(target=self.hear, args=(line,), daemon=True).start()

    def state(self) -> bytes:
        if not self.lies:
            self.shown = list(self.joints)
        joints = ["NaN"] * 6 if self.sends_nan else self.shown
        state = {"stamp_s": time.monotonic(), "joints": joints, "safety": self.safety, "program": self.has_program}
        return b"crash\n" if self.crashes else json.dumps(state).encode() + b"\n"

    def send(self, line: socket.socket, late: queue.SimpleQueue) -> None:
        while line in self.lines:
            time.sleep(PERIOD_S)
            if not self.is_frozen:
                late.put((time.monotonic() + self.delay_s, self.state()))

    def deliver(self, line: socket.socket, late: queue.SimpleQueue) -> None:
        try:
            while True:
                due_s, text = late.get()
                time.sleep(max(due_s - time.monotonic(), 0))
                line.sendall(text)
        except OSError:
            return

    def hear(self, line: socket.socket) -> None:
        try:
            for text in line.makefile("r"):
                while self.is_frozen:
                    time.sleep(PERIOD_S)
                time.sleep(self.delay_s)
                self.obey(json.loads(text))
        except (OSError, ValueError):
            return

    def obey(self, said: dict) -> None:
        if said["do"] != "alive":
            self.note(said["do"])
        self.alive_s = time.monotonic()
        if said["do"] == "move" and self.safety == "normal" and self.has_program:
            self.goal, self.speed = said["joints"], said["speed"]
        elif said["do"] == "stop":
            self.halt("stop")

    def fail(self, fault: str, size: str) -> None:
        self.note(f"fault {fault}")
        if fault in ("protective", "safeguard", "emergency"):
            self.safety = fault
            self.halt(fault)
        elif fault == "drop":
            self.has_program = False
            self.halt("drop")
        elif fault == "cut":
            self.refuses = True
            lines, self.lines = self.lines, []
            for line in lines:
                line.shutdown(socket.SHUT_RDWR)
        elif fault == "delay":
            self.delay_s = float(size)
        else:
            names = {"freeze": "is_frozen", "lie": "lies", "nan": "sends_nan", "crash": "crashes"}
            setattr(self, {**names, "unwatched": "is_unwatched"}[fault], True)

    def mend(self) -> None:
        """Take connections again."""
        self.refuses = False


def main() -> None:
    arms = {name: Arm(name) for name in NAMES}
    print("ready", flush=True)
    for text in sys.stdin:
        word, *rest = text.split()
        answer: object = "ok"
        if word == "ports":
            answer = {name: arm.server.getsockname()[1] for name, arm in arms.items()}
        elif word == "fail":
            arms[rest[0]].fail(rest[1], rest[2] if len(rest) > 2 else "")
        elif word == "mend":
            arms[rest[0]].mend()
        elif word == "moving":
            answer = [name for name, arm in arms.items() if arm.is_moving]
        elif word == "log":
            answer = {name: arm.log for name, arm in arms.items()}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
