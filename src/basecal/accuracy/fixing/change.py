"""Changes of a fix to a cell and its recording: changed samples, and changed lines of `cell.yaml`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from basecal.accuracy.input_check.hypotheses import ConventionHypothesis
from basecal.accuracy.readings.reading import Reading, Track
from basecal.cell import Cell, PoseObservation, Recording, RobotState, Sample
from basecal.cell.files import cell_to_dict
from basecal.estimation.problem.view_group import ViewGroup
from basecal.estimation.view.pixels import PixelMeasurement
from basecal.estimation.view.points import PointMeasurement
from basecal.estimation.view.poses import PoseMeasurement
from basecal.fields.problems import Loc
from basecal.geometry import SE3


@dataclass(frozen=True, eq=False)
class Change:
    """Changes to the files of a cell.

    Attributes:
        samples: All samples of the changed recording; None if it is unchanged.
        cell: Changed values of `cell.yaml`, by location.
    """

    samples: tuple[Sample, ...] | None = None
    cell: Mapping[Loc, Any] = field(default_factory=dict)

    @property
    def is_empty(self) -> bool:
        """Whether no file is changed."""
        return self.samples is None and not self.cell


def change_of_hypothesis(recording: Recording, reading: Reading, hypothesis: ConventionHypothesis) -> Change | None:
    """Changes that correct the files under a hypothesis; None if the files cannot represent it.

    Args:
        recording: The recording as written, without detections.
        reading: The declared reading, with detections.
        hypothesis: The hypothesis that is true.
    """
    if hypothesis.depends_on_order:
        return Change(_pair_samples(recording, reading, hypothesis))
    result = hypothesis.reread(reading)
    cell = change_cell(reading.cell, result.cell)
    if any(_is_unwritable(*both) for both in _groups(reading, result)):
        return None
    samples = _with_values(recording, reading, result)
    return Change(None if all(a is b for a, b in zip(samples, recording.samples, strict=True)) else samples, cell)


def _groups(reading: Reading, result: Reading) -> list[tuple[ViewGroup, ViewGroup]]:
    return list(zip(reading.problem.groups, result.problem.groups, strict=True))


def _is_unwritable(old: ViewGroup, new: ViewGroup) -> bool:
    """Whether pixels or 3-D points differ, which come from images, not from the recording."""
    for kind, name in ((PixelMeasurement, "pixels"), (PointMeasurement, "points_in_camera")):
        if isinstance(old.measurement, kind) and isinstance(new.measurement, kind):
            before, after = getattr(old.measurement, name), getattr(new.measurement, name)
            return not np.array_equal(before, after)
    return False


def _with_values(recording: Recording, reading: Reading, result: Reading) -> tuple[Sample, ...]:
    """Samples with robot states and target poses replaced by those of the reading `result`."""
    row = {int(number): k for k, number in enumerate(reading.order)}
    robots = {name: track for name, track in result.tracks.items() if track is not reading.tracks[name]}
    views: dict[tuple[int, str, str], SE3] = {}
    for old, new in _groups(reading, result):
        if isinstance(old.measurement, PoseMeasurement) and isinstance(new.measurement, PoseMeasurement):
            before, after = (each.measured_camera_from_target for each in (old.measurement, new.measurement))
            for k, number in enumerate(old.sample if not np.array_equal(before.matrix, after.matrix) else ()):
                views[int(number), old.camera, old.target] = after[k]

    def change_sample(sample: Sample) -> Sample:
        """Change one sample; the same object if nothing differs."""
        k = row.get(sample.sample, -1)
        own = {name: track for name, track in robots.items() if k >= 0 and name in sample.robots}
        states = {name: _state(track, k) for name, track in own.items() if _differs(reading.tracks[name], track, k)}
        seen = tuple(
            replace(each, camera_from_target=views[sample.sample, each.camera, each.target])
            if isinstance(each, PoseObservation) and (sample.sample, each.camera, each.target) in views
            else each
            for each in sample.observations
        )
        if not states and all(a is b for a, b in zip(seen, sample.observations, strict=True)):
            return sample
        return replace(sample, robots={**sample.robots, **states}, observations=seen)

    return tuple(change_sample(sample) for sample in recording.samples)


def _differs(old: Track, new: Track, k: int) -> bool:
    return not np.array_equal(old.pose.matrix[k], new.pose.matrix[k])


def _state(track: Track, k: int) -> RobotState:
    return RobotState(track.pose[k]) if track.joints is None else RobotState(joints_rad=track.joints[k])


def _pair_samples(recording: Recording, reading: Reading, hypothesis: ConventionHypothesis) -> tuple[Sample, ...]:
    """Samples with robot states and views paired as under a hypothesis.

    The hypothesis is applied to poses and views that contain only their position in the recording.
    """
    count, samples = len(reading.order), {sample.sample: sample for sample in recording.samples}
    positions = np.zeros((count, 6))
    positions[:, 0] = np.arange(count)
    marks = SE3(np.broadcast_to(np.eye(3), (count, 3, 3)), positions[:, :3])
    tracks = {name: replace(track, pose=marks, joints=None) for name, track in reading.tracks.items()}
    views = reading.problem.groups[0].take(np.zeros(count, dtype=np.int64))
    views = replace(views, sample=reading.order, motion=positions)
    marked = replace(reading, problem=reading.problem.with_groups((views,)), tracks=tracks)
    paired = hypothesis.reread(marked)
    (found,) = paired.problem.groups
    assert found.motion is not None
    source = dict(zip(found.sample.tolist(), found.motion[:, 0].astype(int).tolist(), strict=True))
    paired_samples = []
    for k, number in enumerate(paired.order.tolist()):
        if number not in source:
            continue
        seen, states = samples[int(reading.order[source[number]])], dict(samples[number].robots)
        for name, track in paired.tracks.items():
            states.pop(name, None)
            state = samples[int(reading.order[int(track.pose.translation[k, 0])])].robots.get(name)
            if track.seen[k] and state is not None:
                states[name] = state
        paired_samples.append(replace(seen, sample=number, stamp_s=samples[number].stamp_s, robots=states))
    return tuple(paired_samples)


def change_cell(cell: Cell, result: Cell) -> dict[Loc, Any]:
    """Values of `cell.yaml` in which `result` differs from `cell`, by location."""
    return dict(_differences(cell_to_dict(cell), cell_to_dict(result)))


def _differences(old: Mapping[str, Any], new: Mapping[str, Any], parent: Loc = ()) -> Iterator[tuple[Loc, Any]]:
    """Locations with different values: a transform as a whole, else each field; a removed field is false."""
    for key in {**old, **new}:
        before, after = old.get(key), new.get(key, False)
        is_whole = not isinstance(after, dict) or ("status" in after and key != "intrinsics")
        if isinstance(before, dict) and not is_whole:
            yield from _differences(before, after, (*parent, key))
        elif after != before:
            yield (*parent, key), after


def change_carriers(carriers: Mapping[Loc, str]) -> Change:
    """Change to other carriers, by location in `cell.yaml`, with free mounts."""
    mounts: dict[Loc, Any] = {(*place[:-1], "mount"): {"status": "free"} for place in carriers}
    return Change(cell={**carriers, **mounts})
