"""Tests of captures that are planned again after each sample."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from basecal.acquisition import replanning
from basecal.acquisition.capture import ABANDONED_FILE, abandoned_samples, capture, remaining_samples, store_plan
from basecal.acquisition.replanning import Replanner, replanner, stations_for_task
from basecal.acquisition.rig import open_rig
from basecal.acquisition.stillness import Unfit
from basecal.acquisition.taking import CaptureSettings, Taker
from basecal.cell import Calibration, MeetingError, Recording, RobotState, Sample, Unknown
from basecal.cell.files import read_recording
from basecal.errors import InputError
from basecal.planning.plan import plan_for_task
from basecal.planning.shifts import plan as shifts
from basecal.planning.sketch import sketch_cell
from basecal.simulation import Scenario, simulate
from basecal.vision.detect import detect
from shared.facing_arms import facing_arms
from shared.running_cell import home, running

FAST = CaptureSettings(speed_rad_s=2.0, tool_m_s=10.0, patience_s=3.0)
POINT = np.array([[0.5, 0.0, 0.3]])
TOLERANCE_M = 1e-3


WORLD = facing_arms()
ARMS = home(WORLD)


def turned(number, by_rad):
    """Sample with the eye rotated about its flange."""
    return Sample(number, robots={**ARMS, "eye": RobotState(joints_rad=WORLD.home["eye"] + by_rad * np.eye(6)[5])})


def test_taken_and_impossible_samples_are_not_offered(monkeypatch):
    """The limits are 2 mrad and 50 mrad; if no candidate remains, the message has advice."""
    offered, kept = [turned(k, 0.1 * k) for k in range(4)], []
    monkeypatch.setattr(replanning, "plan_for_task", lambda *_, offers: kept.extend(offers))
    view = sketch_cell(WORLD.cell).view
    planner = Replanner(WORLD.cell, POINT, TOLERANCE_M, Sample(0, robots=ARMS), {view: offered})
    planner._plan_from(None, [turned(9, 0.101)], [turned(8, 0.34)])
    ((sketch, left),) = kept
    assert sketch.view == view
    assert left == [offered[0], offered[2]]
    with pytest.raises(InputError, match="teach another pose"):
        planner._plan_from(None, offered, ())


@pytest.mark.parametrize(("meets", "passes"), [(True, 2), (False, 1)])
def test_empty_plan_is_judged_by_a_full_calibration(monkeypatch, meets, passes):
    """The error at the task is computed again; if it is unknown the first plan is kept."""
    made, asked = Calibration("good", meeting=MeetingError(1e-3, "task point", 1e-3) if meets else None), []
    plans = [SimpleNamespace(samples=(), recorded=(1,)), SimpleNamespace(samples=("more",), recorded=(1,))]
    monkeypatch.setattr(replanning, "calibrate", lambda *_: made)
    monkeypatch.setattr(
        Replanner, "_plan_from", lambda _, calibration, *__: asked.append(calibration) or plans[len(asked) - 1]
    )
    planner = Replanner(WORLD.cell, POINT, TOLERANCE_M, Sample(0, robots=ARMS), {})
    assert planner.plan((), ()) is plans[passes - 1]
    assert asked == [None, made][:passes]


class Shy(Taker):
    """Taker that gives up sample 0."""

    def take(self, wanted, taken):
        if wanted.sample == 0:
            raise Unfit("target not seen by wrist")
        return super().take(wanted, taken)


@pytest.mark.slow
def test_remaining_candidates_avoid_given_up_samples(monkeypatch):
    """Few candidates remain near a given-up sample; if the samples suffice, none is needed."""
    monkeypatch.setattr(replanning, "OFFERED_SAMPLES", 40)
    made = simulate(Scenario(samples=10, robot_noise=(1e-4, 2e-4)), 3)
    taken = made.recording.samples
    cell = guessed(made)
    planner = replanner(cell, taken[:1], taken[0].robots, POINT, 5e-4)
    first = planner.plan(taken[:1], ())
    bad = first.samples[0]
    after = planner.plan(taken[:1], (bad,))
    apart = [_apart(sketch_cell(cell), bad, sample) for sample in after.samples]
    assert first.samples
    assert min(apart) > 1
    assert replanner(cell, taken, taken[0].robots, POINT, 0.1).plan(taken, ()).samples == ()


def guessed(made):
    """Cell with its true free transforms as guesses."""

    def of(unknown, mean):
        """Unknown with a guess."""
        return replace(unknown, mean=mean)

    truth, cell = made.truth, made.cell
    bases = {"hand": of(cell.bases.get("hand", Unknown()), truth[cell.base_name("hand")])}
    cameras = {n: replace(c, mount=of(c.mount, truth[cell.mount_name(n)])) for n, c in cell.cameras.items()}
    targets = {n: replace(t, mount=of(t.mount, truth[cell.mount_name(n)])) for n, t in cell.targets.items()}
    return replace(cell, bases=bases, cameras=cameras, targets=targets)


@pytest.mark.slow
def test_stations_chosen_for_a_task_reduce_its_error_more():
    """Two of seven stations chosen for the task leave less uncertain there than two stations of a pattern."""
    made = simulate(Scenario(samples=10, robot_noise=(1e-4, 2e-4), camera_mount="prior", target_mount="prior"), 3)
    cell, robots = guessed(made), made.recording.samples[0].robots
    found = stations_for_task(cell, (), robots, POINT, None, 14, 0)
    assert len(found.samples) == 14
    sketch = sketch_cell(cell)
    anywhere = shifts(sketch, robots, 14, 0)
    taught = Recording((Sample(0, robots=robots),))
    other = plan_for_task(cell, taught, None, POINT, None, 14, offers=[(sketch, anywhere)], group_size=7)
    assert found.expected_m < other.expected_m
    needed = stations_for_task(cell, (), robots, POINT, 0.7 * found.expected_m, None, 0)
    assert needed.reachable
    assert len(needed.samples) in range(21, 61, 7)


def _apart(sketch, one, other):
    """Distance of two samples' arms, relative to the limit of near."""
    away = [
        (sketch.base_from_flange(r, one.robots[r]).inverse() @ sketch.base_from_flange(r, other.robots[r])).log()
        for r in ("eye", "hand")
    ]
    return max(
        np.linalg.norm(each[part]) / near for each in away for part, near in ((slice(3), 0.03), (slice(3, 6), 0.05))
    )


@pytest.fixture(scope="module")
def captured(tmp_path_factory):
    """Capture to a tolerance, interrupted after three samples and resumed: cell, folder, steps and last plan."""
    folder = tmp_path_factory.mktemp("cell")
    with running(folder) as world, open_rig(world.cell, folder) as rig:
        sketch, steps, plans = sketch_cell(world.cell), [], []

        def replan(taken, bad):
            """Return the remaining samples, and record them."""
            plans.append(planner.plan(taken, bad))
            return plans[-1].samples

        for most in (3, 60):
            taken = detect(world.cell, read_recording(folder)).samples if steps else ()
            planner = replanner(world.cell, taken, home(world), POINT, TOLERANCE_M)
            plan = store_plan(folder, world.cell, replan(taken, abandoned_samples(folder, world.cell)))
            for step in capture(Shy(rig, sketch, folder, FAST), plan, replan):
                steps.append(step)
                if step.taken == most:
                    break
        yield world, folder, steps, plans


@pytest.mark.slow
def test_capture_ends_when_the_tolerance_is_reached(captured):
    """The last plan is empty and the expected error is within the tolerance; shortly before it was not."""
    world, folder, steps, plans = captured
    assert (plans[-1].samples, plans[-1].needed, plans[-1].reachable) == ((), 0, True)
    assert plans[-1].expected_m <= TOLERANCE_M
    assert all(plan.samples for plan in plans[:-1])
    assert steps[-1].taken == steps[-1].planned == len(read_recording(folder).samples)
    assert remaining_samples(folder, world.cell) == ()


@pytest.mark.slow
def test_given_up_samples_are_not_tried_again(captured):
    """The file has their reasons and places, and no taken sample is near them."""
    world, folder, steps, _ = captured
    told, *_ = [json.loads(line) for line in (folder / ABANDONED_FILE).read_text().splitlines()]
    assert (told["sample"], told["why"]) == (steps[0].sample, "target not seen by wrist")
    bad, *_ = abandoned_samples(folder, world.cell)
    sketch = sketch_cell(world.cell)
    assert all(_apart(sketch, bad, sample) > 1 for sample in read_recording(folder).samples)


@pytest.mark.slow
def test_capture_resumes_from_taken_samples(captured):
    """After an interruption at three samples, new samples have new, unique numbers."""
    _, folder, steps, _ = captured
    numbers = [sample.sample for sample in read_recording(folder).samples]
    assert len(set(numbers)) == len(numbers) == sum(not step.why_not for step in steps)
    assert [step.taken for step in steps if not step.why_not] == list(range(1, len(numbers) + 1))


@pytest.mark.parametrize("count", [7, 8])
def test_estimate_needs_eight_samples_with_views(monkeypatch, count):
    """A sample without a view does not count; a failed solution is None."""
    asked = []

    def fail(*args):
        """Record the request for a solution, and fail."""
        asked.append(args)
        raise InputError("no solution")

    monkeypatch.setattr(replanning, "solve", fail)
    made = simulate(Scenario(samples=count), 0)
    samples = [*made.recording.samples, Sample(99, robots=made.recording.samples[0].robots)]
    task = replanning._task_settings(POINT)
    assert replanning._current_calibration(made.cell, samples, task) is None
    assert len(asked) == (count == 8)


def test_task_is_a_point_or_a_box():
    """A single point, or a centre with the box's corners, is used."""
    point = replanning._task_settings(POINT)
    assert (point.task_point, point.task_box) == ((0.5, 0.0, 0.3), None)
    corners = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [9.0, 9.0, 9.0], [2.0, 4.0, 6.0]])
    box = replanning._task_settings(corners)
    assert (box.task_point, box.task_box) == ((1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 2.0, 4.0, 6.0))


@pytest.mark.parametrize(("numbers", "home_number"), [([], 0), ([3], 4), ([7, 2], 8)])
def test_home_is_first_with_its_own_number(numbers, home_number):
    """The samples follow unchanged."""
    samples = [Sample(number) for number in numbers]
    found = replanning._with_home(Sample(0, robots=ARMS), samples).samples
    assert [sample.sample for sample in found] == [home_number, *numbers]
    assert found[0].robots == ARMS
