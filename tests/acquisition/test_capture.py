"""Tests of captures of a running cell."""

from __future__ import annotations

import json
import time
from dataclasses import replace

import numpy as np
import pytest

from basecal.acquisition import taking as module
from basecal.acquisition.capture import ABANDONED_FILE, PLAN_FILE, capture, remaining_samples, store_plan
from basecal.acquisition.rig import Rig, open_rig
from basecal.acquisition.taking import CaptureSettings, Taker
from basecal.cell import RobotState, Sample
from basecal.cell.files import read_recording
from basecal.errors import DriverError
from basecal.planning import poses, shifts
from basecal.planning.sketch import sketch_cell
from basecal.vision.edge_width import EdgeWidth
from shared.running_cell import home, running

FAST = CaptureSettings(speed_rad_s=2.0, tool_m_s=10.0, patience_s=3.0)


def planned(world, folder, count, pattern=poses):
    sketch = sketch_cell(world.cell)
    plan = pattern.plan(sketch, home(world), count, 0)
    return sketch, store_plan(folder, world.cell, plan)


def journal(folder):
    return (folder / "recording" / "samples.jsonl").read_text().splitlines()


@pytest.mark.journey
def test_plan_is_captured(tmp_path):
    """Each reported sample is in the journal with its image, states near its plan, and observations."""
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        sketch, plan = planned(world, tmp_path, 5)
        for count, step in enumerate(capture(Taker(rig, sketch, tmp_path, FAST), plan), start=1):
            assert (step.sample, step.why_not, step.taken, step.planned) == (count - 1, "", count, 5)
            assert len(journal(tmp_path)) == count
        assert step.sigma is not None
        assert step.doubts == ()
        assert remaining_samples(tmp_path, world.cell) == ()
    recording = read_recording(tmp_path)
    for sample, wanted in zip(recording.samples, plan, strict=True):
        assert (tmp_path / sample.images["wrist"]).exists()
        for name, state in sample.robots.items():
            np.testing.assert_allclose(state.joints_rad, wanted.robots[name].joints_rad, atol=1e-9)
    assert sorted(recording.samples, key=lambda s: s.stamp_s) == list(recording.samples)


@pytest.mark.journey
def test_led_is_captured_on_and_off(tmp_path):
    """Each stop has an image with the LED on and one with it off, and the LED is on at the end."""
    with running(tmp_path, target="led") as world, open_rig(world.cell, tmp_path) as rig:
        sketch, plan = planned(world, tmp_path, 7, shifts)
        assert [step.why_not for step in capture(Taker(rig, sketch, tmp_path, FAST), plan[:2])] == ["", ""]
        assert rig.cameras["wrist"].image().grey.max() > 100
    for sample in read_recording(tmp_path).samples:
        assert sample.background["wrist"].endswith("_off.png")
        assert (tmp_path / sample.background["wrist"]).exists()


@pytest.mark.journey
def test_capture_resumes_without_duplicates(tmp_path):
    """A capture that ended after one of two samples takes the other, and reports a truncated line."""
    with running(tmp_path) as world:
        with open_rig(world.cell, tmp_path) as rig:
            sketch, plan = planned(world, tmp_path, 2)
            for step in capture(Taker(rig, sketch, tmp_path, FAST), plan):
                if step.taken == 1:
                    break
        before = journal(tmp_path)
        (tmp_path / "recording" / "samples.jsonl").write_text(f'{before[0]}\n{{"sample": 1, "st')
        left, reports = remaining_samples(tmp_path, world.cell), []
        assert [sample.sample for sample in left] == [1]
        with open_rig(world.cell, tmp_path) as rig:
            taker = Taker(rig, sketch, tmp_path, FAST, report=reports.append)
            assert [step.sample for step in capture(taker, left)] == [1]
    assert [words.partition(" The ")[0].rpartition("/")[2] for words in reports] == [
        "samples.jsonl:2: the last line was cut off while it was written."
    ]
    assert journal(tmp_path)[:1] == before
    assert [sample.sample for sample in read_recording(tmp_path).samples] == [0, 1]


class Frozen:
    """Camera that always returns the same image, with newer stamps."""

    is_live = is_on_demand = True

    def __init__(self, image):
        self._image = image

    def image(self):
        return replace(self._image, stamp_s=time.monotonic())


@pytest.mark.journey
def test_image_of_an_earlier_capture_is_not_reused(tmp_path):
    """A camera that froze before an interruption yields no sample after it."""
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        sketch, plan = planned(world, tmp_path, 2)
        frozen = Rig(rig.robots, {"wrist": Frozen(rig.cameras["wrist"].image())})
        next(capture(Taker(frozen, sketch, tmp_path, FAST), [replace(plan[0], robots={})]))
        with pytest.raises(DriverError, match=r"^wrist: its image at sample 1 repeats that of sample 0, though arms"):
            next(capture(Taker(frozen, sketch, tmp_path, FAST), plan[1:]))
    assert len(journal(tmp_path)) == 1


class LedArm:
    """Arm in freedrive: a person guides it to the next of some places whenever it is free."""

    is_live = True

    def __init__(self, arm, places):
        self.arm, self.places, self.said = arm, iter(places), []

    def state(self):
        return self.arm.state()

    def freedrive(self, on):
        self.said.append(on)
        if on:
            self.arm.move(next(self.places), 2.0)

    def close(self):
        self.arm.close()


@pytest.mark.journey
def test_hand_guided_arm_is_recorded_at_its_place(tmp_path):
    """The arm is free before each sample and held again; the recorded place is the guided, not the proposed one."""
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        sketch, plan = planned(world, tmp_path, 2)
        led_to = [sample.robots["hand"] for sample in plan[::-1]]
        led = LedArm(rig.robots["hand"], led_to)
        mixed = Rig({"eye": rig.robots["eye"], "hand": led}, rig.cameras)
        steps = list(capture(Taker(mixed, sketch, tmp_path, FAST), plan))
    assert led.said == [True, False] * 2
    assert [step.sample for step in steps] == [0, 1]
    for sample in read_recording(tmp_path).samples:
        wanted = led_to[sample.sample].joints_rad
        np.testing.assert_allclose(sample.robots["hand"].joints_rad, wanted, atol=1e-3)


@pytest.mark.journey
def test_unusable_samples_are_given_up(tmp_path):
    """A place without the board in view, and a repeated place, are given up with reasons, and not tried again."""
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        sketch = sketch_cell(world.cell)
        away = {**home(world), "hand": RobotState(joints_rad=world.home["hand"] + [0, 0, 0, 0, 1.2, 0])}
        plan = store_plan(tmp_path, world.cell, [Sample(0, robots=each) for each in (home(world), away, home(world))])
        steps = list(capture(Taker(rig, sketch, tmp_path, FAST), plan))
        assert [step.why_not for step in steps] == ["", "target not seen by wrist", "too similar to sample 0"]
        assert remaining_samples(tmp_path, world.cell) == ()
        assert [json.loads(line)["sample"] for line in (tmp_path / ABANDONED_FILE).read_text().splitlines()] == [1, 2]
        assert store_plan(tmp_path, world.cell, plan[:1])[0].sample == 3


@pytest.mark.journey
def test_blurred_images_are_refused(tmp_path, monkeypatch):
    """An image whose edges are wider in one direction than in another is too blurred, and not recorded."""
    monkeypatch.setattr(module, "edge_width", lambda grey, pixels: EdgeWidth(3.0, 5.2))
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        sketch, plan = planned(world, tmp_path, 1)
        (step,) = capture(Taker(rig, sketch, tmp_path, FAST), plan)
    assert step.why_not == "too blurred: edges of board are 5.2 px wide"
    assert not (tmp_path / "recording" / "samples.jsonl").exists()


@pytest.mark.journey
def test_arm_that_does_not_arrive_is_reported(tmp_path, monkeypatch):
    """With less patience than the motion takes, the arm is not at its goal."""
    monkeypatch.setattr(module, "_joint_travel_rad", lambda start, end: 0.0)
    with running(tmp_path) as world, open_rig(world.cell, tmp_path) as rig:
        sketch, plan = planned(world, tmp_path, 1)
        (step,) = capture(Taker(rig, sketch, tmp_path, CaptureSettings(0.01, 10.0, 0.5)), plan)
    assert step.why_not.startswith("arm not at its goal: ")


@pytest.mark.journey
@pytest.mark.parametrize("torn", ["", '{"sample": 7', '{"why": 3}\n'])
def test_truncated_line_of_a_given_up_sample_is_ignored(tmp_path, torn):
    """A sample whose line was truncated is tried again."""
    with running(tmp_path) as world:
        planned(world, tmp_path, 1)
        (tmp_path / ABANDONED_FILE).write_text(torn)
        assert len(remaining_samples(tmp_path, world.cell)) == 1
    assert (tmp_path / PLAN_FILE).exists()


@pytest.mark.journey
def test_damaged_lines_of_given_up_samples_are_ignored(tmp_path):
    """Samples of lines that are no text, have huge numbers, or are nested too deeply are tried again."""
    with running(tmp_path) as world:
        _, plan = planned(world, tmp_path, 3)
        lines = [b'{"sample": 1, "why": "x"}', b"\xe5\xff", b'{"sample": 1e999}', b"[" * 100_000, b'{"sample": [0]}']
        (tmp_path / ABANDONED_FILE).write_bytes(b"\n".join(lines))
        assert [sample.sample for sample in remaining_samples(tmp_path, world.cell)] == [plan[0].sample, plan[2].sample]
