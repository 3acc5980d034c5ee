"""The cells of the reference: real recordings, simulated cells of all kinds, and cells with faults."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from tests.shared.real_recordings import EXAMPLES, data_folder, moveit_cell, nao_cell

from basecal.cell import Cell, Recording
from basecal.cell.files import read_cell, read_recording
from basecal.simulation import Scenario, simulate
from basecal.vision.detect import detect
from benchmarks.wrong_answers import KINDS

Case = Callable[[], tuple[Cell, Recording]]
SIMULATED = 1000
SEEDS = 6  # of each kind of fault


def cases() -> dict[str, Case]:
    """All cases by name; real recordings that are missing are left out."""
    return {**dict(_real()), **{f"simulated {seed}": _simulated(seed) for seed in range(SIMULATED)}, **dict(_faulty())}


def _real() -> Iterator[tuple[str, Case]]:
    for folder in (EXAMPLES, data_folder()):
        for path in sorted(folder.glob("*/cell.yaml")):
            yield f"real {path.parent.name}", lambda path=path.parent: _read(path)
    if data_folder().exists():
        yield "real nao", nao_cell
        yield "real moveit", moveit_cell


def _read(path: Path) -> tuple[Cell, Recording]:
    cell = read_cell(path)
    return cell, detect(cell, read_recording(path))


def _simulated(seed: int) -> Case:
    def draw() -> tuple[Cell, Recording]:
        """The cell of the scenario that the seed draws."""
        drawn = simulate(Scenario(**scenario(seed)), seed)
        return drawn.cell, drawn.recording

    return draw


def scenario(seed: int) -> dict[str, Any]:
    """Draw a scenario: a compatible layout, target and statuses, and eight to thirty samples."""
    rng = np.random.default_rng([seed, 29])

    def one(*choices: Any, p: tuple[float, ...] | None = None) -> Any:
        """Choose one of these."""
        return choices[int(rng.choice(len(choices), p=p))]

    drawn: dict[str, Any] = {
        "samples": int(rng.integers(8, 31)),
        "layout": one("dual", "eye_in_hand", "eye_to_hand", "two_cameras", "two_world_cameras", "chain",
                      p=(0.5, 0.15, 0.15, 0.08, 0.07, 0.05)),
        "target": one("charuco", "chessboard", "circles", "apriltag", "aprilgrid", "points", "led", "pose", "points3d",
                      p=(0.3, 0.1, 0.05, 0.1, 0.05, 0.1, 0.1, 0.15, 0.05)),
        "robot_noise": one((0.0, 0.0), (1e-4, 2e-4), (5e-4, 1e-3)),
        "state_robot_noise": bool(rng.random() < 0.4),
        "state_pixel_noise": bool(rng.random() < 0.4),
        "state_observation_noise": bool(rng.random() < 0.6),
        "pixel_px": one(0.05, 0.2, 0.5),
        "intrinsics": one("fixed", "prior", "free", p=(0.7, 0.15, 0.15)),
        "spread_rad": one(0.3, 0.6, 0.9),
        "partial": bool(rng.random() < 0.2),
    }  # fmt: skip
    if drawn["target"] in ("led", "pose", "points3d"):
        drawn["intrinsics"] = "fixed"
    if drawn["layout"] == "dual":
        drawn["arms"] = one("both", "eye_still", "hand_still", "halves", p=(0.7, 0.1, 0.1, 0.1))
        drawn["camera_mount"], drawn["target_mount"] = one(
            ("free", "free"), ("prior", "prior"), ("fixed", "free"), ("free", "fixed"), ("fixed", "fixed")
        )
        if rng.random() < 0.3:
            status = one("fixed", "prior", "free")
            off = status != "fixed" or bool(rng.random() < 0.5)
            drawn |= {"joints": True, "joint_offset_rad": 2e-3 * off, "joint_offsets": status}
    return drawn


def _faulty() -> Iterator[tuple[str, Case]]:
    for name, kind in KINDS.items():
        for seed in range(SEEDS):
            yield f"faulty {name} {seed}", lambda kind=kind, seed=seed: kind.draw(seed)[:2]
