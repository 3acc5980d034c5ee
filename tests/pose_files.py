"""Files of poses of two robots, and of a target in a camera, in the format of other programs: one pose per sample."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from basecal.geometry import SE3

NAMES = ("eye-base-from-flange", "hand-base-from-flange", "camera-from-target")


def drawn(count: int, seed: int) -> SE3:
    """Draw random poses."""
    return SE3.exp(np.random.default_rng(seed).normal(size=(count, 6)))


def stack(path: Path, poses: SE3) -> str:
    """Write the matrices of poses below each other into a text file, and return its path."""
    np.savetxt(path, poses.matrix.reshape(-1, 4))
    return str(path)


def pose_files(folder: Path, count: int = 4) -> dict[str, str]:
    """Write `count` poses for each stream, and return the files by the names of their options."""
    return {name: stack(folder / f"{name}.txt", drawn(count, seed)) for seed, name in enumerate(NAMES)}


def options(files: dict[str, str]) -> list[str]:
    """Words of a command line that name the files."""
    return [word for name, path in files.items() for word in (f"--{name}", path)]
