"""A UR controller with its published interfaces, as a process: `python -m shared.ur_controller HOST`.

RTDE (port 30004, protocol version 2) and the dashboard (29999) follow their guides. A program sent to port 30003 is not
run. Once it is complete, the controller reports a running program, and obeys the command registers as ur-rtde's program
does. Lines on the standard input are faults; each is answered by a line.

Source: Universal Robots, Real-Time Data Exchange Guide; Dashboard Server e-Series.
"""

from __future__ import annotations

import asyncio
import os
import struct
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

REQUEST_VERSION, CONTROLLER_VERSION, SETUP_OUTPUTS, SETUP_INPUTS = 86, 118, 79, 73
START, PAUSE, DATA = 83, 80, 85
RTDE, DASHBOARD, SCRIPT_PORTS = 30004, 29999, (30001, 30002, 30003)
TICK_S = 0.002
HOME = (0.0, -1.5, 1.5, 0.0, 0.5, 0.0)
FARTHEST = 6.2832  # a turn of a joint, either way [rad]
READY, DONE = 1, 2  # what the program writes into its first integer register
MOVEJ, MOVEJ_IK, STOPJ, POSE_WITHIN, JOINTS_WITHIN, FREEDRIVE, END_FREEDRIVE, STOP_SCRIPT = (
    1,
    2,
    34,
    36,
    37,
    52,
    53,
    255,
)
SET_WATCHDOG = 35
SAFETY_BITS = {
    "protective_stop": 2,
    "recovery": 3,
    "safeguard_stop": 4,
    "emergency_stop": 7,
    "violation": 8,
    "fault": 9,
}
WATCHDOG_PERIODS = 2  # without an input until the program stops, as in URSim
LAYOUT = {"DOUBLE": "d", "VECTOR6D": "6d", "INT32": "i", "UINT32": "I", "UINT64": "Q", "UINT8": "B"}
VECTORS = ("actual_q", "actual_qd", "target_q", "actual_TCP_pose")
WORDS = ("robot_status_bits", "safety_status_bits", "runtime_state")


def variable_type(name: str) -> str:
    """Type of a variable by its name; NOT_FOUND if the guide or this controller does not have it."""
    if name in VECTORS:
        return "VECTOR6D"
    if name in WORDS:
        return "UINT32"
    if name in ("robot_mode", "safety_mode") or "_int_register_" in name:
        return "INT32"
    if name in ("timestamp", "speed_scaling") or "_double_register_" in name or name == "external_force_torque":
        return "VECTOR6D" if name == "external_force_torque" else "DOUBLE"
    return "NOT_FOUND"


@dataclass
class Arm:
    """Six joints that move with limited speed, and the state of the controller."""

    q: list[float] = field(default_factory=lambda: list(HOME))
    goal: list[float] = field(default_factory=lambda: list(HOME))
    speed: float = 0.0
    began_s: float = field(default_factory=time.monotonic)
    playing: bool = False
    led: bool = False
    frozen: bool = False
    remote: bool = True
    safety_bits: int = 1
    least_wait_s: float = 0.0
    fastest: float = 0.0
    timestamp: float = 1000.0
    registers: dict[str, float] = field(default_factory=dict)
    seen: list[int] = field(default_factory=list)
    spins: bool = False
    link_frozen: bool = False
    sends_nan: bool = False
    watchdog_hz: float = 0.0
    heard_s: float = 0.0
    log: list[str] = field(default_factory=list)

    def note(self, event: str) -> None:
        """Log an event with the monotonic time, and whether the arm was moving."""
        self.log.append(f"{time.monotonic():.4f}:{event}:{'moving' if self.q != self.goal else 'still'}")

    def halt(self, event: str) -> None:
        """Stop the joints, and log the event."""
        self.note(event)
        self.goal, self.speed = list(self.q), 0.0

    def tick(self) -> None:
        """Advance by two milliseconds."""
        if self.playing and self.watchdog_hz and time.monotonic() - self.heard_s > WATCHDOG_PERIODS / self.watchdog_hz:
            self.halt("watchdog")
            self.playing = False
        if not self.frozen:
            self.timestamp = 1000.0 + time.monotonic() - self.began_s
        before = list(self.q)
        longest = max(abs(goal - angle) for goal, angle in zip(self.goal, self.q, strict=True))
        if longest > 0 and self.speed > 0:
            share = min(1.0, self.speed * TICK_S / longest)
            self.q = [angle + share * (goal - angle) for goal, angle in zip(self.goal, self.q, strict=True)]
        if self.spins:
            self.q = [*self.q[:5], self.timestamp]
        rotation = max(abs(now - then) for now, then in zip(self.q, before, strict=True))
        self.fastest = max(self.fastest, rotation / TICK_S)
        self.obey()

    def obey(self) -> None:
        """Execute the command in the registers, as ur-rtde's program would."""
        if not self.playing:
            return
        command = int(self.registers.get("input_int_register_0", 0))
        if command == 0:
            self.registers["output_int_register_0"] = READY
        elif self.registers.get("output_int_register_0") == READY:
            self.seen.append(command)
            numbers = [self.registers.get(f"input_double_register_{k}", 0.0) for k in range(8)]
            if command == MOVEJ:
                self.goal, self.speed = numbers[:6], numbers[6]
                self.note("move")
            elif command == SET_WATCHDOG:
                self.watchdog_hz = numbers[0]
            elif command == MOVEJ_IK:  # of its pose only the last number turns, with the last joint
                self.goal, self.speed = [*self.q[:5], numbers[5]], numbers[6]
            elif command in (POSE_WITHIN, JOINTS_WITHIN):
                self.registers["output_int_register_1"] = max(map(abs, numbers[:6])) < FARTHEST
            elif command == STOPJ:
                self.halt("stopj")
            elif command == FREEDRIVE:
                self.led = True
            elif command == END_FREEDRIVE:
                self.led = False
            elif command == STOP_SCRIPT:
                self.halt("script_ended")
                self.playing, self.watchdog_hz = False, 0.0
            self.registers["output_int_register_0"] = DONE

    def value(self, name: str) -> tuple[float, ...]:
        """Current value of a variable."""
        if name in ("actual_q", "target_q"):
            return (float("nan"),) * 6 if self.sends_nan else tuple(self.q)
        if name == "actual_TCP_pose":
            return (0.1, 0.2, 0.3, 0.0, 0.0, self.q[5])
        values = {
            "timestamp": self.timestamp,
            "robot_status_bits": 1 | (2 if self.playing else 0),
            "safety_status_bits": self.safety_bits,
            "runtime_state": 2 if self.playing else 1,
            "robot_mode": 7,
            "safety_mode": 1,
            "speed_scaling": 1.0,
        }
        if variable_type(name) == "VECTOR6D":
            return (0.0,) * 6
        return (values.get(name, self.registers.get(name, 0)),)


@dataclass(eq=False)
class Session:
    """One client of the RTDE port."""

    arm: Arm
    writer: asyncio.StreamWriter
    outputs: list[str] = field(default_factory=list)
    inputs: dict[int, list[str]] = field(default_factory=dict)
    every_s: float = TICK_S
    start: bool = False
    next_s: float = 0.0

    def answer(self, kind: int, payload: bytes) -> None:
        self.writer.write(struct.pack(">HB", 3 + len(payload), kind) + payload)

    def handle(self, kind: int, payload: bytes) -> None:
        """Answer a package of the client."""
        if kind == REQUEST_VERSION:
            self.answer(kind, bytes([struct.unpack(">H", payload)[0] == 2]))
        elif kind == CONTROLLER_VERSION:
            self.answer(kind, struct.pack(">4I", 5, 11, 0, 1))
        elif kind == SETUP_OUTPUTS:
            self.every_s = 1 / struct.unpack(">d", payload[:8])[0]
            self.outputs = [name for name in payload[8:].decode().split(",") if name]
            self.answer(kind, b"\x01" + ",".join(map(variable_type, self.outputs)).encode())
        elif kind == SETUP_INPUTS:
            recipe = len(self.inputs) + 1
            self.inputs[recipe] = [name for name in payload.decode().split(",") if name]
            self.answer(kind, bytes([recipe]) + ",".join(map(variable_type, self.inputs[recipe])).encode())
        elif kind in (START, PAUSE):
            self.answer(kind, b"\x01")
            self.start = kind == START
        elif kind == DATA:
            self.arm.heard_s = time.monotonic()
            names = self.inputs[payload[0]]
            layout = ">" + "".join(LAYOUT[variable_type(name)] for name in names)
            values = struct.unpack(layout, payload[1 : 1 + struct.calcsize(layout)])
            if len(values) == len(names):
                self.arm.registers.update(zip(names, values, strict=True))

    def tick(self, now_s: float) -> None:
        """Send the state if it is due."""
        if self.start and now_s >= self.next_s and not self.arm.link_frozen:
            self.next_s = max(self.next_s + max(self.every_s, self.arm.least_wait_s), now_s)
            layout = ">" + "".join(LAYOUT[variable_type(name)] for name in self.outputs)
            values = [value for name in self.outputs for value in self.arm.value(name)]
            self.answer(DATA, b"\x01" + struct.pack(layout, *values))


async def serve(host: str, switched_on_s: float) -> None:
    """Answer until the standard input ends; the controller was switched on this long ago."""
    arm = Arm(began_s=time.monotonic() - switched_on_s)
    sessions: set[Session] = set()

    async def rtde(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        session = Session(arm, writer)
        sessions.add(session)
        try:
            while True:
                size, kind = struct.unpack(">HB", await reader.readexactly(3))
                while arm.link_frozen:
                    await asyncio.sleep(TICK_S)
                session.handle(kind, await reader.readexactly(size - 3))
        except (asyncio.IncompleteReadError, ConnectionError):
            pass
        finally:
            sessions.discard(session)
            writer.close()

    async def program(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        text = b""
        while part := await reader.read(65536):
            text += part
            if text.rstrip().endswith(b"end"):
                arm.note("script")
                arm.playing, text, arm.heard_s = arm.remote, b"", time.monotonic()

    async def dashboard(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError):
            await answer_lines(reader, writer)

    async def answer_lines(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"Connected: Universal Robots Dashboard Server\n")
        while line := (await reader.readline()).decode().strip():
            answers: dict[str, Callable[[], str]] = {
                "PolyscopeVersion": lambda: "URSoftware 5.11.0.1 (Jan 01 2022)",
                "get serial number": lambda: "20225500001",
                "is in remote control": lambda: str(arm.remote).lower(),
                "stop": lambda: "Stopped",
                "running": lambda: f"Program running: {str(arm.playing).lower()}",
            }
            if line == "stop":
                arm.halt("dashboard_stop")
                arm.playing = False
            while arm.link_frozen:
                await asyncio.sleep(TICK_S)
            writer.write((answers.get(line, lambda: "ok")() + "\n").encode())

    listening = [(rtde, RTDE), (dashboard, DASHBOARD), *((program, port) for port in SCRIPT_PORTS)]
    for handler, port in listening:
        await asyncio.start_server(handler, host, port)
    print("ready", flush=True)
    stdin = asyncio.StreamReader()
    loop = asyncio.get_running_loop()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(stdin), sys.stdin)
    faults = asyncio.ensure_future(obey_faults(stdin, arm, sessions))
    while not faults.done():
        arm.tick()
        for session in list(sessions):
            session.tick(time.monotonic())
        await asyncio.sleep(TICK_S)
    os._exit(0)  # with clients still there, of whose tasks asyncio would complain


async def obey_faults(stdin: asyncio.StreamReader, arm: Arm, sessions: set[Session]) -> None:
    """Apply faults, one a line."""
    while line := (await stdin.readline()).decode().split():
        word, *rest = line
        answer = "ok"
        if word in SAFETY_BITS:
            arm.halt(word)
            arm.safety_bits = 1 << SAFETY_BITS[word]
            arm.playing = arm.playing and word == "safeguard_stop"
        elif word == "freeze_link":
            arm.note("freeze_link")
            arm.link_frozen = True
        elif word == "nan":
            arm.note("nan")
            arm.sends_nan = True
        elif word == "length_zero":
            arm.note("length_zero")
            for session in list(sessions):
                session.writer.write(struct.pack(">HB", 0, DATA))
        elif word == "log":
            answer = " ".join(arm.log)
        elif word == "reset":
            vars(arm).update(vars(Arm(began_s=arm.began_s)))
        elif word == "local":
            arm.remote = False
        elif word == "stop_program":
            arm.halt("stop_program")
            arm.playing = False
        elif word == "freeze":
            arm.frozen = rest == ["on"]
        elif word == "slow":
            arm.least_wait_s = float(rest[0])
        elif word == "turn":
            arm.q = [at + float(rest[0]) for at in arm.q]
            arm.goal = list(arm.q)
        elif word == "spin":
            arm.spins = True
        elif word == "hang_up":
            arm.note("hang_up")
            for session in list(sessions):
                session.writer.close()
        elif word == "tell":
            answer = f"{arm.fastest:.6f} {int(arm.led)} {' '.join(map(str, arm.seen))}"
        print(answer, flush=True)


if __name__ == "__main__":
    asyncio.run(serve(sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 0.0))
