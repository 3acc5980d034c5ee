"""Captures that are killed at random instants, and what is left of them."""

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

TOLD = re.compile(r"sample (\d+): taken")
LONGEST_S = 300.0
_DIGITS = 12  # [rad]: means of twelve joints round at 1e-16
_SHARE = 0.3  # of the time an unbroken capture takes, within which one is killed: machines are busy now and then


@dataclass(frozen=True)
class KillTrial:
    """What came of a capture that was killed again and again.

    Attributes:
        kills: How often it was killed before its end.
        lost: Samples that it had told were taken, and that were not in a journal that could be read then.
        twice: Samples that it told of more than once.
        is_equal: Whether the journal has in the end the samples and states of a capture that nobody killed.
        other_noise: Images whose noise is another: of a stop where another number of them was looked at.
    """

    kills: int
    lost: int
    twice: int
    is_equal: bool
    other_noise: int


def kill_trial(folder: Path, samples: int, kills: int, seed: int) -> KillTrial:
    """A capture killed up to so often, resumed each time, beside one that nobody killed."""
    rng, done, lost, told = np.random.default_rng(seed), 0, 0, list[int]()
    with running(folder / "whole") as world:
        sketch = sketch_cell(world.cell)
        write_plan(
            poses.plan(sketch, home(world), samples, seed),
            folder / "plan.jsonl",
            folder,
        )
        began = time.monotonic()
        _run(_words(folder, "whole"), LONGEST_S)
        whole_s = time.monotonic() - began
    with running(folder / "killed"):
        while True:
            wait_s = rng.uniform(0.0, _SHARE * whole_s) if done < kills else LONGEST_S
            said, was_killed = _run(_words(folder, "killed"), wait_s)
            told += said
            lost += len(set(told) - _in_journal(folder / "killed"))
            if not was_killed:
                break
            done += 1
    ends = [_contents(folder / name) for name in ("killed", "whole")]
    same = [sample[:2] for sample in ends[0]] == [sample[:2] for sample in ends[1]]
    other = sum(one[2] != two[2] for one, two in zip(*ends, strict=False))
    return KillTrial(done, lost, len(told) - len(set(told)), same, other)


def _words(folder: Path, cell: str) -> list[str]:
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


def _run(words: list[str], wait_s: float) -> tuple[list[int], bool]:
    """Numbers of the samples that a capture told were taken, and whether it was killed before it ended."""
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=dict(os.environ)) as process:
        until = time.monotonic() + wait_s
        while process.poll() is None and time.monotonic() < until:
            time.sleep(0.005)
        was_killed = process.poll() is None
        process.kill()
        told = process.stdout.read()
    return [int(number) for number in TOLD.findall(told)], was_killed


def _recording(folder: Path) -> Recording:
    return read_recording(folder) if (folder / "recording" / "samples.jsonl").exists() else Recording()


def _in_journal(folder: Path) -> set[int]:
    return {sample.sample for sample in _recording(folder).samples}


def _contents(folder: Path) -> list[tuple[object, ...]]:
    """Of every sample its number, its states but for the rounding of a mean, and its images."""
    return [
        (
            sample.sample,
            [(name, state.joints_rad.round(_DIGITS).tolist()) for name, state in sorted(sample.robots.items())],
            [(folder / path).read_bytes() for path in sample.images.values()],
        )
        for sample in _recording(folder).samples
    ]
