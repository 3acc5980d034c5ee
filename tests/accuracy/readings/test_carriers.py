"""What one robot's poses, inverted, fit as exactly as."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from basecal.accuracy.readings.carriers import describe_carriers, swap_carriers
from basecal.cell import RobotState, Unknown
from basecal.estimation.solve import solve
from basecal.geometry import SE3
from basecal.simulation import Scenario, simulate

STILL = simulate(Scenario(samples=9, layout="eye_to_hand", target="pose", pose_noise=(0.0, 0.0)), 2)


def test_the_other_carriers_fit_as_exactly() -> None:
    """Inverted poses, and the camera on the arm: the mount is then what the camera's place was, so nothing tells."""
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


def test_what_is_known_or_carried_by_two_has_no_equal() -> None:
    """A mount that is stated, or a second robot, tells the two apart."""
    name = STILL.cell.mount_name("board")
    fixed = STILL.cell.with_transform(name, Unknown("fixed", STILL.truth[name]))
    assert swap_carriers(fixed, ("arm",)) == {}
    two = simulate(Scenario(samples=3), 0).cell
    assert swap_carriers(two, ("arm",)) == {}
    assert swap_carriers(two, ("eye", "hand")) == {}


def test_carriers_that_hold_more_than_mounts_have_no_equal() -> None:
    """Neither have an unknown robot, cells that see a scene, plates, nor probes."""
    cell = STILL.cell
    assert swap_carriers(cell, ("arm",))
    assert swap_carriers(cell, ("other",)) == {}
    assert swap_carriers(cell, ()) == {}
    assert swap_carriers(replace(cell, plates={"table": Unknown()}), ("arm",)) == {}
    lookers = {name: replace(camera, kind="tip") for name, camera in cell.cameras.items()}
    assert swap_carriers(replace(cell, cameras=lookers), ("arm",)) == {}


def test_carriers_are_described_in_one_sentence() -> None:
    """Each after the first is without its verb."""
    one, two = ("cameras", "left", "on"), ("cameras", "right", "on")
    assert describe_carriers({one: "hand"}) == "left is on hand"
    assert describe_carriers({one: "hand", two: "world"}) == "left is on hand and right on world"
