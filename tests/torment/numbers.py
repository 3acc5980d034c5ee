"""Recordings whose numbers a machine, a unit or a careless plan makes strange, through `calibrate`.

An answer, or a finding: no fault of linear algebra, and a good answer is where it was.
"""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from basecal.cell.files import read_truth
from basecal.geometry import SE3
from torment.cells import KINDS, made, moved_or_good, write
from torment.damage import at, places
from torment.outcome import run_command

Samples = list[dict[str, Any]]
Fault = Callable[[Samples, Random], None]
_MOST_DECADES = 9
_LENGTHS = ("t_m", "points_in_camera_m")
_SIGMAS = {
    "pixels": ["sigma_px"],
    "points_in_camera_m": ["sigma_m"],
    "camera_from_target": ["sigma_t_m", "sigma_r_rad"],
}
_TASKS = (
    (),
    (),
    ("--task-point", "0.5", "0.1", "0.3"),
    ("--task-box", "-9", "-9", "-9", "9", "9", "9"),
    ("--task-box", "0.2", "-0.5", "0", "0.8", "0.5", "0.8"),
    ("--certify",),
    ("--start", "thorough"),
    ("--robot-noise", "stated"),
    ("--tolerance", "1mm"),
)


def _decade(chance: Random) -> float:
    return float(10 ** chance.uniform(-_MOST_DECADES, _MOST_DECADES))


def _observations(samples: Samples) -> Iterator[dict[str, Any]]:
    return (seen for sample in samples for seen in sample["observations"])


def _mix_sigmas(samples: Samples, chance: Random) -> None:
    """State sigmas that differ by decades."""
    decades = [_decade(chance) for _ in range(chance.randint(1, 3))]
    for seen in _observations(samples):
        for kind, names in _SIGMAS.items():
            within = seen[kind] if isinstance(seen.get(kind), dict) else seen
            within |= {name: chance.choice(decades) for name in names} if kind in seen else {}


def _few(samples: Samples, chance: Random) -> None:
    """Keep one to four samples."""
    samples[:] = chance.sample(samples, min(len(samples), chance.randint(1, 4)))


def _repeat(samples: Samples, chance: Random) -> None:
    """Repeat some samples, to the last bit, under new numbers."""
    some = chance.choices(samples, k=chance.choice([1, 3, 12]))
    samples += [copy.deepcopy(sample) | {"sample": 100 + k} for k, sample in enumerate(some)]


def _stamp(samples: Samples, chance: Random) -> None:
    """Stamps that are huge, equal, or go back."""
    first, step = chance.choice([0, 1.7e9, 1e12 - 1e5, -9e11]), chance.choice([0, 1e-9, -1, 1e3])
    for k, sample in enumerate(samples):
        sample["stamp_s"] = first + k * step


def _scale(samples: Samples, chance: Random) -> None:
    """Lengths in another unit, of all or of some samples."""
    factor, some = _decade(chance), [sample for sample in samples if chance.random() < chance.choice([0.1, 1])]
    for place in [place for place in places(some) if place and place[-1] in _LENGTHS]:
        at(some, place[:-1])[place[-1]] = _times(at(some, place), factor)


def _times(value: Any, factor: float) -> Any:
    return [_times(each, factor) for each in value] if isinstance(value, list) else value * factor


def _rotate(samples: Samples, chance: Random) -> None:
    """Rotations of one robot that are one, half turns, or about one axis."""
    name, kind = chance.choice(["eye", "hand"]), chance.randrange(3)
    for sample in samples:
        pose = sample["robots"][name].get("base_from_flange")
        if pose is None:
            sample["robots"][name]["joints_rad"] = [chance.choice([0, math.pi, -math.pi, 1e9]) for _ in range(6)]
            continue
        angle = [0.0, math.pi, chance.uniform(-4, 4)][kind]
        axis = [(0, 0, 1.0), chance.choice([(1.0, 0, 0), (0, 1.0, 0)]), (0, 0, 1.0)][kind]
        pose["q_xyzw"] = [*(each * math.sin(angle / 2) for each in axis), math.cos(angle / 2)]


def _hold(samples: Samples, chance: Random) -> None:
    """A robot, or a coordinate of it, that never moves."""
    name, kept = chance.choice(["eye", "hand"]), copy.deepcopy(samples[0])
    if chance.random() < 0.5:
        for sample in samples:
            sample["robots"][name] = kept["robots"][name]
        return
    axis = chance.randrange(3)
    for sample in samples:
        state = sample["robots"][name]
        numbers = state["base_from_flange"]["t_m"] if "base_from_flange" in state else state["joints_rad"]
        numbers[axis] = 0.25


def _flatten(samples: Samples, chance: Random) -> None:
    """Points that are nearly on one line, or in one place."""
    share, axis = chance.choice([0, 1e-12, 1e-6, 1e-3]), chance.choice([0, 1])
    for seen in _observations(samples):
        for name in ("pixels", "points_in_camera_m"):
            for point in seen.get(name, ()) if chance.random() < 0.9 else ():
                first = seen[name][0]
                point[axis] = first[axis] + share * (point[axis] - first[axis])


def _outlie(samples: Samples, chance: Random) -> None:
    """A number that is far from what it was."""
    numbers = [place for place in places(samples) if isinstance(at(samples, place), float)]
    for place in chance.sample(numbers, chance.randint(1, 4)):
        at(samples, place[:-1])[place[-1]] *= chance.choice([-1, 1]) * _decade(chance)


_HARMLESS: tuple[Fault, ...] = (_mix_sigmas, _few, _repeat, _stamp)  # by which the truth is what it was
_HARMFUL: tuple[Fault, ...] = (_scale, _rotate, _hold, _flatten, _outlie)


def _see_again(samples: Samples, chance: Random) -> None:
    """Poses of the target as the camera would have seen them, so that the numbers agree."""
    truth = read_truth(made("pose").folder)
    for sample in samples:
        eye, hand = (_pose(sample["robots"][name]["base_from_flange"]) for name in ("eye", "hand"))
        eye_from_board = truth["eye_base_from_hand_base"] @ hand @ truth["hand_flange_from_board"]
        noise = SE3.exp(np.array([chance.gauss(0, 1e-3) for _ in range(6)]))
        seen = (eye @ truth["eye_flange_from_wrist"]).inverse() @ eye_from_board @ noise
        for each in sample["observations"]:
            each["camera_from_target"] |= {"t_m": seen.translation.tolist(), "q_xyzw": seen.quaternion.tolist()}


def _pose(data: dict[str, Any]) -> SE3:
    return SE3.from_quaternion(data["q_xyzw"], data["t_m"])


def _more(samples: Samples, chance: Random) -> None:
    """Twice as many samples, the others turned and moved."""
    for k, sample in enumerate(copy.deepcopy(samples)):
        for state in sample["robots"].values():
            if "base_from_flange" in state:
                pose = _pose(state["base_from_flange"]) @ SE3.exp(np.array([chance.gauss(0, 0.2) for _ in range(6)]))
                state["base_from_flange"] = {"t_m": pose.translation.tolist(), "q_xyzw": pose.quaternion.tolist()}
        samples.append(sample | {"sample": 200 + k})


def calibrate_strange(chance: Random, folder: Path) -> str:
    """One to three faults in the numbers of a recording."""
    kind = chance.choice(list(KINDS))
    cell, samples = copy.deepcopy(made(kind).cell), copy.deepcopy(made(kind).samples)
    is_consistent = kind == "pose" and chance.random() < 0.7
    known = [fault for fault in (*_HARMLESS, *_HARMFUL) if not (is_consistent and fault is _outlie)]
    faults = chance.choices(known, k=chance.randint(1, 3))
    for fault in (_more, *faults) if is_consistent else faults:
        fault(samples, chance)
    if is_consistent:
        _see_again(samples, chance)
    if chance.random() < 0.2:
        cell["noise"] = {"pixel_px": min(_decade(chance), 1e6)} if "noise" in cell else cell.get("noise", {})
    write(folder, cell, samples, made(kind).urdfs)
    what, code, out = run_command(["calibrate", str(folder), "--json", *chance.choice(_TASKS)])
    is_base_known = is_consistent or set(faults) <= {*_HARMLESS, _outlie}
    return moved_or_good(kind, json.loads(out)) if code == 0 and is_base_known else what
