"""Plans: what they reach is what they say."""

from __future__ import annotations

import numpy as np
import pytest

from basecal.accuracy.calibrate import calibrate
from basecal.cell import Calibration, Recording, Sample
from basecal.errors import InputError
from basecal.geometry import PoseEstimate
from basecal.planning.plan import MOST_SAMPLES, OUTLOOK_COUNTS, draw_offers, outlook, plan_for_task, plan_stations
from basecal.planning.prospects import sketches
from basecal.planning.shifts import STATION_SAMPLES
from basecal.simulation import Scenario, simulate

BASE = "eye_base_from_hand_base"


@pytest.fixture(scope="module")
def cell():
    made = simulate(Scenario(samples=12, robot_noise=(1e-4, 2e-4)), 3)
    bare = Recording(tuple(Sample(s.sample, robots=s.robots) for s in made.recording.samples))
    point = (made.truth[BASE].translation / 2)[None]
    return made.cell, made.recording, bare, calibrate(made.cell, made.recording), point


@pytest.fixture(scope="module")
def planned(cell):
    """A plan from nothing recorded, for 0.6 mm."""
    described, _, bare, calibration, point = cell
    return plan_for_task(described, bare, calibration, point, tolerance_m=6e-4)


def test_a_tolerance_is_reached_with_as_many_as_are_needed(planned):
    """All of the samples are needed, none has an observation, and they are numbered beyond the recording."""
    assert planned.reachable is True
    assert planned.needed == len(planned.samples) > 0
    assert planned.expected_m <= 6e-4 * 1.001
    assert [sample.sample for sample in planned.samples] == list(range(12, 12 + planned.needed))
    assert not any(sample.observations for sample in planned.samples)
    assert sum(entry.share for entry in planned.budget) == pytest.approx(1.0, rel=1e-2)


def test_what_is_recorded_counts(cell, planned):
    """Fewer samples are needed beside a recording, and none where it is enough."""
    described, recording, _, calibration, point = cell
    beside = plan_for_task(described, recording, calibration, point, tolerance_m=6e-4)
    assert beside.recorded == 12
    assert beside.needed < planned.needed
    enough = plan_for_task(described, recording, calibration, point, tolerance_m=0.1)
    assert (enough.needed, enough.samples, enough.reachable) == (0, (), True)


def test_what_cannot_be_reached_is_said(cell):
    """A micrometre is beyond the most that is planned; the sources stand in the budget, the worst first."""
    described, _, bare, calibration, point = cell
    found = plan_for_task(described, bare, calibration, point, tolerance_m=1e-6)
    assert (found.reachable, found.needed, len(found.samples)) == (False, None, MOST_SAMPLES)
    shares = [entry.share for entry in found.budget]
    assert shares == sorted(shares, reverse=True)


def test_so_many_are_planned_as_are_asked_for(cell):
    """Another count than the tolerance needs, or without any; more of them leave a smaller error."""
    described, _, bare, calibration, point = cell
    twelve = plan_for_task(described, bare, calibration, point, count=12)
    assert (len(twelve.samples), twelve.needed, twelve.reachable) == (12, None, None)
    both = plan_for_task(described, bare, calibration, point, tolerance_m=6e-4, count=20)
    assert len(both.samples) == 20 != both.needed
    assert both.expected_m < twelve.expected_m


def test_a_plan_needs_a_taught_pose(cell):
    """An empty recording says what to do."""
    described, _, _, calibration, point = cell
    with pytest.raises(InputError, match="taught poses"):
        plan_for_task(described, Recording(()), calibration, point, tolerance_m=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"points_m": np.zeros((2, 2))}, r"^points_m has shape \(2, 2\), expected"),
        ({"points_m": np.zeros(3)}, r"^points_m has shape \(3,\), expected finite \(n, 3\)$"),
        ({"points_m": np.full((1, 3), np.nan)}, "expected finite"),
        ({"tolerance_m": np.nan}, r"^tolerance_m is nan, expected a length above zero \[m\]$"),
        ({"tolerance_m": -1e-3}, "above zero"),
        ({"count": 2.5}, r"^count is 2\.5, expected a whole number >= 0$"),
        ({"seed": -1}, "^seed is -1"),
        ({"group_size": 0}, "^group_size is 0"),
        ({"offers": []}, "^offers is empty"),
    ],
)
def test_what_is_no_task_is_refused(cell, options, message):
    """A NaN or a negative tolerance plans nothing that looks like a plan."""
    described, recording, _, calibration, point = cell
    with pytest.raises(InputError, match=message):
        plan_for_task(described, recording, calibration, **{"points_m": point, "count": 2, **options})


@pytest.mark.slow
def test_three_robots_are_planned_together():
    """Robots in a chain, of which none has seen another yet: both pairs are planned, and both bases are known then."""
    made = simulate(Scenario(samples=6, layout="chain", robots=3, robot_noise=(1e-4, 2e-4)), 3)
    bare = Recording(tuple(Sample(s.sample, robots=s.robots) for s in made.recording.samples))
    guessed = Calibration("doubtful", {name: PoseEstimate(mean, np.eye(6)) for name, mean in made.truth.items()})
    found = plan_for_task(made.cell, bare, guessed, np.array([[0.5, 0.0, 0.3]]), count=16)
    assert len(found.samples) == 16
    assert found.expected_m is not None
    assert found.expected_m < 5e-3
    taught = [sample.robots["r3"].base_from_flange for sample in bare.samples]
    moved = [s.robots["r3"].base_from_flange not in taught for s in found.samples]
    assert 0 < sum(moved) < 16


@pytest.mark.slow
def test_candidates_may_be_offered(cell):
    """Chosen are those that are offered, and no others."""
    described, _, bare, calibration, point = cell
    offered = draw_offers(sketches(described, calibration), bare, 30)
    found = plan_for_task(described, bare, calibration, point, count=8, offers=offered)
    places = [sample.robots["hand"].base_from_flange.translation.tolist() for sample in offered[0][1]]
    assert all(sample.robots["hand"].base_from_flange.translation.tolist() in places for sample in found.samples)


@pytest.mark.slow
def test_more_samples_bring_less_and_less(cell):
    """Errors fall with planned samples, beginning at what is recorded; 40 leave less than 12 at random do."""
    described, recording, _, calibration, point = cell
    told = outlook(described, recording, calibration, point)
    assert [count for count, _ in told] == list(OUTLOOK_COUNTS)
    lengths = [length for _, length in told]
    assert lengths == sorted(lengths, reverse=True)
    now = plan_for_task(described, recording, calibration, point, tolerance_m=1.0)
    assert lengths[0] == pytest.approx(now.expected_m, rel=0.02)
    assert lengths[-1] < 0.5 * lengths[0]


@pytest.mark.slow
def test_stations_of_shifts_are_planned_for_a_task(cell):
    """Whole stations are taken, each with its camera still, and more of them leave a smaller error."""
    described, _, bare, calibration, point = cell
    found = [plan_stations(described, bare, calibration, point, count=count) for count in (28, 42)]
    assert [len(plan.samples) for plan in found] == [28, 42]
    for at in range(0, 42, STATION_SAMPLES):
        station = found[1].samples[at : at + STATION_SAMPLES]
        assert len({sample.robots["eye"].base_from_flange.translation.tobytes() for sample in station}) == 1
        assert (
            len({sample.robots["hand"].base_from_flange.translation.tobytes() for sample in station}) == STATION_SAMPLES
        )
    assert found[1].expected_m < found[0].expected_m
