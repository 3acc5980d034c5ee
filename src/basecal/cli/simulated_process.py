"""`basecal simulate CELL --process`: a simulated cell that runs until it is interrupted."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from basecal.cli.terminal import print_json, quote_path, say
from basecal.errors import InputError

if TYPE_CHECKING:
    from basecal.simulation.running.faults import Faults
    from basecal.simulation.running.server import CellServer
    from basecal.simulation.running.world import World
    from basecal.simulation.scenario import ObservedKind


RendererName = Literal["auto", "mujoco", "analytic"]
"""Renderer of a running cell: MuJoCo with arms and table, or the target alone; auto selects MuJoCo if available."""

_END_TIMEOUT_S = 10.0  # until a process has ended, which may be rendering an image


def run_process(
    folder: Path,
    target: ObservedKind,
    seed: int,
    port: int,
    speed: float,
    fault: tuple[str, ...],
    renderer: RendererName,
    until_eof: bool,
    json: bool,
) -> int:
    """Run a cell, which is made if it is missing, and serve requests on a port until interrupted.

    Raises:
        InputError: if the cell cannot be run, a fault is not known, or the port is in use.
    """
    from basecal.simulation.running.faults import read_faults
    from basecal.simulation.running.plant import Clock, Plant
    from basecal.simulation.running.protocol import Address, new_token, remove_address, write_address
    from basecal.simulation.running.server import CellServer

    world = _open_world(folder, target, seed, read_faults(fault))
    has_mujoco = _draws_surroundings(renderer)
    with CellServer(Plant(world, Clock(speed), has_mujoco), new_token(), port) as server:
        address = Address(port=server.port, token=server.token, pid=os.getpid())
        write_address(folder, address)
        _print_address(folder, server.port, has_mujoco, json)
        if until_eof:
            threading.Thread(target=_end_with_input, args=(server,), daemon=True).start()
        try:
            server.serve_forever(poll_interval=0.1)
        finally:
            server.refuse_requests()
            server.plant.close()
            remove_address(folder, address)
    return 0


@contextmanager
def simulated_process(folder: Path, target: str) -> Iterator[None]:
    """A context with a cell that runs in a separate process, whose time advances while a client waits.

    Raises:
        InputError: if the process does not start.
    """
    command = [sys.executable, "-m", "basecal", "simulate", str(folder), "--process", "--json", "--until-eof"]
    command += ["--speed", "0", "--target", target]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            if not process.stdout.readline():
                raise InputError(f"the simulated cell in {folder} did not start")
            yield
        finally:
            process.stdin.close()
            try:
                process.wait(_END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _open_world(folder: Path, target: ObservedKind, seed: int, faults: Faults) -> World:
    from basecal.simulation.running.two_arms import two_arms
    from basecal.simulation.running.world_file import read_world, write_world, write_world_truth

    if (folder / "cell.yaml").exists():
        world = read_world(folder, faults)
        write_world_truth(world, folder)
        return world
    if target == "pose" or target == "points3d":
        raise InputError(f"a running cell gives images, which show no {target!r}: choose another target")
    world = two_arms(target, seed, faults)
    write_world(world, folder)
    return world


def _draws_surroundings(renderer: RendererName) -> bool:
    """Whether MuJoCo draws the surroundings of the target.

    Raises:
        InputError: if MuJoCo is requested and not available.
    """
    if renderer == "analytic":
        return False
    from basecal.simulation.surroundings.graphics import missing_graphics

    why = missing_graphics()
    if why is not None and renderer == "mujoco":
        raise InputError(why)
    if why is not None:
        say(f"the target is drawn alone, without arms and table: {why}", sys.stderr)
    return why is None


def _print_address(folder: Path, port: int, has_mujoco: bool, json: bool) -> None:
    from basecal.simulation.running.protocol import ADDRESS_FILE, HOST

    if json:
        address = {"cell": str(folder), "host": HOST, "port": port, "address": str(folder / ADDRESS_FILE)}
        print_json({**address, "renderer": "mujoco" if has_mujoco else "analytic"})
    else:
        say(f"{folder} runs on {HOST}:{port}, its token is in {folder / ADDRESS_FILE}; Ctrl-C ends it")
        say(f"next, in another terminal: basecal capture {quote_path(folder)} --pattern poses --go")


def _end_with_input(server: CellServer) -> None:
    """Shut a server down when the standard input ends, so that it does not outlive its parent process."""
    if sys.stdin is not None:
        sys.stdin.buffer.read()
    server.shutdown()
