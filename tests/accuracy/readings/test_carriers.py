"""Tests of `swap_carriers`: the carriers that fit inverted poses of one robot equally well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.readings.carriers import describe_carriers, swap_carriers
from basecal.cell import RobotState, Unknown
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

STILL = simulate(Scenario(samples=9, layout="eye_to_hand", target="pose", pose_noise=(0.0, 0.0)), 2)


def test_swapped_carriers_fit_exactly() -> None:
    """Inverted poses fit exactly with the camera on the arm.

    Its mount is the camera's former pose, so no data can decide.
    """
    cell = STILL.cell
    carriers = swap_carriers(cell, ("arm",))
    assert describe_carriers(carriers) == "overhead is on arm and board on world"
    samples = tuple(
        replace(s, robots={"arm": RobotState(s.robots["arm"].base_from_flange.inverse())})
        for s in STILL.recording.samples
    )
    cameras = {n: replace(c, on=carriers["cameras", n, "on"], mount=Unknown()) for n, c in cell.cameras.items()}
    targets = {n: replace(t, on=carriers["targets", n, "on"], mount=Unknown()) for n, t in cell.targets.items()}
    swapped = replace(cell, cameras=cameras, targets=targets)
    found = solve(swapped, replace(STILL.recording, samples=samples)).state.transforms
    assert_close(found["arm_flange_from_overhead"], STILL.truth["arm_base_from_overhead"])
    assert_close(found["arm_base_from_board"], STILL.truth["arm_flange_from_board"])


def assert_close(found: SE3, true: SE3) -> None:
    np.testing.assert_allclose(found.matrix, true.matrix, atol=1e-6)


def test_known_mount_or_second_robot_decides() -> None:
    """A stated mount or a second robot distinguishes the carriers, so there is no swap."""
    name = STILL.cell.mount_name("board")
    fixed = STILL.cell.with_transform(name, Unknown("fixed", STILL.truth[name]))
    assert swap_carriers(fixed, ("arm",)) == {}
    two = simulate(Scenario(samples=3), 0).cell
    assert swap_carriers(two, ("arm",)) == {}
    assert swap_carriers(two, ("eye", "hand")) == {}


def test_other_devices_prevent_swap() -> None:
    """An unknown robot, plates or tips have no swapped carriers."""
    cell = STILL.cell
    assert swap_carriers(cell, ("arm",))
    assert swap_carriers(cell, ("other",)) == {}
    assert swap_carriers(cell, ()) == {}
    assert swap_carriers(replace(cell, plates={"table": Unknown()}), ("arm",)) == {}
    lookers = {name: replace(camera, kind="tip") for name, camera in cell.cameras.items()}
    assert swap_carriers(replace(cell, cameras=lookers), ("arm",)) == {}


def test_carriers_are_described_in_one_sentence() -> None:
    """Carriers are described in one sentence with a single verb."""
    one, two = ("cameras", "left", "on"), ("cameras", "right", "on")
    assert describe_carriers({one: "hand"}) == "left is on hand"
    assert describe_carriers({one: "hand", two: "world"}) == "left is on hand and right on world"
