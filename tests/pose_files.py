"""Files of poses of two robots and of a target in a camera, as other programs write them side by side."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from basecal.geometry import SE3

NAMES = ("eye-base-from-flange", "hand-base-from-flange", "camera-from-target")


def drawn(count: int, seed: int) -> SE3:
    """Any poses."""
    return SE3.exp(np.random.default_rng(seed).normal(size=(count, 6)))


def stack(path: Path, poses: SE3) -> str:
    """A text file of matrices one below the other."""
    np.savetxt(path, poses.matrix.reshape(-1, 4))
    return str(path)


def pose_files(folder: Path, count: int = 4) -> dict[str, str]:
    """Files of so many poses for each stream, by the name of its option."""
    return {name: stack(folder / f"{name}.txt", drawn(count, seed)) for seed, name in enumerate(NAMES)}


def options(files: dict[str, str]) -> list[str]:
    """The words that name the files."""
    return [word for name, path in files.items() for word in (f"--{name}", path)]
