"""Captures that are killed at random instants, and their remains."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from basecal.cell import Recording
from basecal.cell.files import read_recording, write_plan
from basecal.planning import poses
from basecal.planning.sketch import sketch_cell
from tests.shared.running_cell import home, running

TAKEN = re.compile(r"sample (\d+): taken")
LONGEST_S = 300.0
_DIGITS = 12  # [rad]: means of twelve joints round at 1e-16
_KILL_SHARE = 0.3  # of the time of a whole capture, within which one is killed: the machine may be busy


@dataclass(frozen=True)
class KillTrial:
    """Result of a capture that was killed repeatedly.

    Attributes:
        kills: How often it was killed before its end.
        lost: Samples that were reported as taken, and were not in a readable journal then.
        twice: Samples that were reported more than once.
        is_equal: Whether the journal finally has the samples and states of a capture that was not killed.
        other_noise: Images with other noise: at these stops another number of images was taken.
    """

    kills: int
    lost: int
    twice: int
    is_equal: bool
    other_noise: int


def kill_trial(folder: Path, samples: int, kills: int, seed: int) -> KillTrial:
    """Kill a capture up to this often, resume it each time, and compare it with one that was not killed."""
    rng, kill_count, lost, reported = np.random.default_rng(seed), 0, 0, list[int]()
    with running(folder / "whole") as world:
        sketch = sketch_cell(world.cell)
        write_plan(
            poses.plan(sketch, home(world), samples, seed),
            folder / "plan.jsonl",
            folder,
        )
        began = time.monotonic()
        _run(_command(folder, "whole"), LONGEST_S)
        whole_s = time.monotonic() - began
    with running(folder / "killed"):
        while True:
            wait_s = rng.uniform(0.0, _KILL_SHARE * whole_s) if kill_count < kills else LONGEST_S
            numbers, was_killed = _run(_command(folder, "killed"), wait_s)
            reported += numbers
            lost += len(set(reported) - _journal_numbers(folder / "killed"))
            if not was_killed:
                break
            kill_count += 1
    ends = [_contents(folder / name) for name in ("killed", "whole")]
    is_equal = [sample[:2] for sample in ends[0]] == [sample[:2] for sample in ends[1]]
    other_noise = sum(one[2] != two[2] for one, two in zip(*ends, strict=False))
    return KillTrial(kill_count, lost, len(reported) - len(set(reported)), is_equal, other_noise)


def _command(folder: Path, cell: str) -> list[str]:
    plan = str(folder / "plan.jsonl")
    return [
        sys.executable,
        "-m",
        "basecal",
        "capture",
        str(folder / cell),
        "--pattern",
        plan,
        "--go",
        "--speed-limit-deg-s",
        "120",
    ]


def _run(command: list[str], wait_s: float) -> tuple[list[int], bool]:
    """Numbers of the samples that a capture reported as taken, and whether it was killed before its end."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=dict(os.environ)) as process:
        end_s = time.monotonic() + wait_s
        while process.poll() is None and time.monotonic() < end_s:
            time.sleep(0.005)
        was_killed = process.poll() is None
        process.kill()
        output = process.stdout.read()
    return [int(number) for number in TAKEN.findall(output)], was_killed


def _recording(folder: Path) -> Recording:
    return read_recording(folder) if (folder / "recording" / "samples.jsonl").exists() else Recording()


def _journal_numbers(folder: Path) -> set[int]:
    return {sample.sample for sample in _recording(folder).samples}


def _contents(folder: Path) -> list[tuple[object, ...]]:
    """Number, states without the rounding of a mean, and images of every sample."""
    return [
        (
            sample.sample,
            [(name, state.joints_rad.round(_DIGITS).tolist()) for name, state in sorted(sample.robots.items())],
            [(folder / path).read_bytes() for path in sample.images.values()],
        )
        for sample in _recording(folder).samples
    ]
