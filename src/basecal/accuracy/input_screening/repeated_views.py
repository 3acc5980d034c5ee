"""`repeated-view`: an image or a view that is recorded with two different robot poses."""

from __future__ import annotations

import numpy as np

from basecal.accuracy.phrases.sample_list import list_samples
from basecal.cell import Cell, Finding, PixelObservation, PointObservation, PoseObservation, Recording
from basecal.cell.recording import Sample
from basecal.geometry import Array

_READ_BACK_TOLERANCE = 5e-3  # [m, rad] repeatability of the recorded state of a robot at rest; assumed
_FEWEST_NUMBERS = 8  # numbers of a view: with fewer, two views may be equal by rounding
_SHOWN_PAIRS = 5  # pairs of samples in a sentence; assumed


def repeated_views(cell: Cell, recording: Recording) -> list[Finding]:
    """A warning if two views of a camera are equal to the last bit while its robot or the target's moved."""
    first: dict[tuple[str, str, bytes], Sample] = {}
    pairs: list[tuple[int, int]] = []
    for sample in recording.samples:
        for seen in sample.observations:
            content = _content(seen)
            if content is None:
                continue
            key = (seen.camera, seen.target, content)
            earlier = first.setdefault(key, sample)
            carriers = {cell.cameras[seen.camera].on, cell.targets[seen.target].on}
            if earlier is not sample and _has_moved(sample, earlier, carriers):
                pairs.append((earlier.sample, sample.sample))
    if not pairs:
        return []
    listed = ", ".join(f"{list_samples(pair).replace(', ', ' and ')}" for pair in pairs[:_SHOWN_PAIRS])
    more = f" and {len(pairs) - _SHOWN_PAIRS} more pairs" if len(pairs) > _SHOWN_PAIRS else ""
    what = f"The same image or view occurs twice with different robot poses, at {listed}{more}."
    about = tuple(str(number) for number in dict.fromkeys(number for pair in pairs for number in pair))
    return [Finding("repeated-view", "warning", about, what, ("Pair poses and images again, or remove the copies.",))]


def _content(observation: object) -> bytes | None:
    """Content of a view as bytes; None if it has too few numbers to be distinguished from another."""
    if isinstance(observation, PixelObservation) and observation.pixels.size >= _FEWEST_NUMBERS:
        return observation.ids.tobytes() + observation.pixels.tobytes()
    if isinstance(observation, PointObservation) and observation.points_in_camera.size >= _FEWEST_NUMBERS:
        return observation.ids.tobytes() + observation.points_in_camera.tobytes()
    if isinstance(observation, PoseObservation):
        return bytes(observation.camera_from_target.matrix.tobytes())
    return None


def _has_moved(first: Sample, second: Sample, robots: set[str]) -> bool:
    """Whether one of these robots moved between two samples by more than its repeatability."""
    shared = [name for name in robots if name in first.robots and name in second.robots]
    states = [(_state(first, name), _state(second, name)) for name in shared]
    return any(a.shape != b.shape or bool(np.abs(a - b).max() > _READ_BACK_TOLERANCE) for a, b in states)


def _state(sample: Sample, name: str) -> Array:
    state = sample.robots[name]
    if state.base_from_flange is not None:
        return state.base_from_flange.matrix.ravel()
    return np.asarray(state.joints_rad)
