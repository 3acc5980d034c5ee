"""Files of joints, in the order of a chain and within its limits."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from basecal.cli import main
from basecal.errors import DatasetError, InputError, UsageError
from basecal.exchange.joints import joint_model, radians_finding, read_joints
from basecal.kinematics import SerialChain
from basecal.kinematics.chain import LIMIT_EXCESS_RAD
from cell_example import URDF

ROWS = np.radians([[10, -90, 100, -45, 60, 340], [-20, -80, 90, -40, 70, -170], [30, -70, 80, -35, 80, 0]])


@pytest.fixture
def limited(arm: SerialChain) -> SerialChain:
    """The arm with the limits of a small industrial one, narrow at the wrist."""
    limits = np.radians([170, 190, 150, 180, 120, 350])
    return replace(arm, lower=-limits, upper=limits)


def read(folder: Path, text: str, chain: SerialChain, in_degrees: bool = False) -> np.ndarray:
    (folder / "q.csv").write_text(text)
    rows = read_joints(str(folder / "q.csv"), "left", chain, in_degrees)
    return np.array([row.robots["left"].joints_rad for row in rows])


def lines(values: np.ndarray, separator: str = ",") -> str:
    return "".join(separator.join(f"{value:.12g}" for value in row) + "\n" for row in values)


def test_in_order_by_name_and_by_number(tmp_path: Path, limited: SerialChain) -> None:
    """Without a header in the chain's order; by its joints' names in any order; numbered from 0 or 1; with `.pos`."""
    names = list(limited.joint_names)
    turned = ROWS[:, ::-1]
    for text in (
        lines(ROWS),
        ",".join(names) + "\n" + lines(ROWS),
        ",".join(names[::-1]) + "\n" + lines(turned),
        ",".join(f"{name}.pos" for name in names[::-1]) + "\n" + lines(turned),
        ";".join(f"q{i}" for i in range(6)) + "\n" + lines(ROWS, ";"),
        "\t".join(f"A{i}" for i in range(6, 0, -1)) + "\n" + lines(turned, "\t"),
        "".join(f"[{row}]\n" for row in lines(ROWS).splitlines()),
    ):
        np.testing.assert_allclose(read(tmp_path, text, limited), ROWS, atol=1e-10)


def test_other_numbered_columns_are_left_out(tmp_path: Path, limited: SerialChain) -> None:
    """A quaternion q1 to q4 beside the joints j1 to j6, as in logs of ABB."""
    header = ",".join([*(f"j{i}" for i in range(1, 7)), "x", *(f"q{i}" for i in range(1, 5))])
    text = f"{header}\n" + "".join(f"{row},0.4,1,0,0,0\n" for row in lines(ROWS).splitlines())
    np.testing.assert_allclose(read(tmp_path, text, limited), ROWS, atol=1e-10)


@pytest.mark.parametrize(
    "columns",
    [
        lambda names: [*names, *names],
        lambda names: [f"{name}.{kind}" for kind in ("position", "velocity") for name in names],
        lambda names: [f"{letter}{i}" for letter in "jq" for i in range(6)],
        lambda names: [f"j{i}" for _ in range(2) for i in range(6)],
    ],
)
def test_joints_with_two_columns_are_refused(
    tmp_path: Path, limited: SerialChain, columns: Callable[[tuple[str, ...]], list[str]]
) -> None:
    """Of two arms, of velocities or of torques: the last ones were taken."""
    header = columns(limited.joint_names)
    text = ",".join(header) + "\n" + "".join(f"{row},0,0,0,0,0,0\n" for row in lines(ROWS).splitlines())
    expected = f"names the joint '{limited.joint_names[0]}' twice, {header[0]}, {header[6]}: keep one"
    with pytest.raises(DatasetError, match=expected):
        read(tmp_path, text, limited)


@pytest.mark.parametrize("column", ["j{}_{}", "j{} [{}]", "j{}({})", "j{}.{}"])
def test_units_of_the_header_hold(tmp_path: Path, limited: SerialChain, column: str) -> None:
    """They agree with --deg, or what to do is said."""
    header = {unit: ",".join(column.format(i, unit) for i in range(1, 7)) + "\n" for unit in ("deg", "rad")}
    np.testing.assert_allclose(read(tmp_path, header["rad"] + lines(ROWS), limited), ROWS, atol=1e-10)
    np.testing.assert_allclose(read(tmp_path, header["deg"] + lines(np.degrees(ROWS)), limited, True), ROWS, atol=1e-10)
    with pytest.raises(DatasetError, match=r"j1.*the unit is deg, but another is read: give --deg"):
        read(tmp_path, header["deg"] + lines(ROWS / 10), limited)
    with pytest.raises(DatasetError, match=r"j1.*the unit is rad, but another is read: remove --deg"):
        read(tmp_path, header["rad"] + lines(ROWS), limited, True)


def test_degrees_where_they_are_said(tmp_path: Path, limited: SerialChain) -> None:
    """With decimal commas too."""
    text = lines(np.degrees(ROWS), ";").replace(".", ",")
    np.testing.assert_allclose(read(tmp_path, text, limited, True), ROWS, atol=1e-10)


def test_degrees_taken_for_radians_are_named(tmp_path: Path, limited: SerialChain) -> None:
    """With the line, the joint, its limits and what to give."""
    name = limited.joint_names[0]
    expected = rf"q.csv:1: {name}: is at 10 rad, its limits are -2.967 to 2.967: give --deg, they look like degrees"
    with pytest.raises(DatasetError, match=expected):
        read(tmp_path, lines(np.degrees(ROWS)), limited)


def test_joints_the_other_way_round_are_named(tmp_path: Path, limited: SerialChain) -> None:
    """Where no unit explains a joint beyond its limits and the reverse order does."""
    order = re.escape(", ".join(limited.joint_names[::-1]))
    assert np.abs(ROWS[:, 5]).max() > limited.upper[0]
    with pytest.raises(DatasetError, match=f"may be in another order, such as {order}"):
        read(tmp_path, lines(np.degrees(ROWS)[:, ::-1]), limited, True)


def test_radians_taken_for_degrees_are_named(tmp_path: Path, limited: SerialChain) -> None:
    """No arm calibrates within three degrees of its zero."""
    with pytest.raises(DatasetError, match="they look like radians: remove --deg"):
        read(tmp_path, lines(ROWS / 2), limited, True)


def test_what_fits_nothing_is_said(tmp_path: Path, limited: SerialChain) -> None:
    """A joint that no unit and no order explains, and columns of another arm."""
    wrong = ROWS.copy()
    wrong[2, 2] = wrong[2, 3] = 3.0
    wrong[0] = np.radians([10, 10, 160, 160, 10, 10])
    with pytest.raises(DatasetError, match=r"q.csv:1: .* check the order of the joints, and that the URDF is"):
        read(tmp_path, lines(wrong), limited)
    with pytest.raises(DatasetError, match="or 6 numbered ones such as j1, q1 or A1"):
        read(tmp_path, "a1,a2,a3\n1,2,3\n", limited)


def test_a_joint_without_limits_may_turn_once(tmp_path: Path, arm: SerialChain) -> None:
    """Degrees are found where the URDF has no limits."""
    free = replace(arm, lower=np.full(6, -np.inf), upper=np.full(6, np.inf))
    np.testing.assert_allclose(read(tmp_path, lines(ROWS), free), ROWS, atol=1e-10)
    with pytest.raises(DatasetError, match="give --deg"):
        read(tmp_path, lines(np.degrees(ROWS)), free)


def test_of_a_urdf_that_comes_along(tmp_path: Path) -> None:
    """The chain, what the cell must have for it, and the file that goes there."""
    path = tmp_path / "hand.urdf"
    path.write_text(URDF)
    model = joint_model(tmp_path / "c", "left", path, "base", "tool0", None)
    assert len(model.chain.joint_names) == 2
    links = {"urdf": "hand.urdf", "base_link": "base", "flange_link": "tool0"}
    assert model.entry == {"robots": {"left": links}}
    assert model.files == {"hand.urdf": path}


def test_of_the_cell(tmp_path: Path) -> None:
    """What is known is not asked again; where nothing is known it is said what to give."""
    assert main(["simulate", str(tmp_path / "c"), "--samples", "3", "--joints"]) == 0
    model = joint_model(tmp_path / "c", "hand", None, None, None, None)
    assert (len(model.chain.joint_names), model.entry, model.files) == (6, {}, {})
    model = joint_model(tmp_path / "c", "hand", None, None, None, 2.0)
    prior = {"joint_offsets": {"status": "prior", "sigma_rad": 0.03491}}
    assert (model.entry, model.files) == ({"robots": {"hand": prior}}, {})
    with pytest.raises(InputError, match=r"has no URDF of 'arm', .*: give --urdf FILE --base-link"):
        joint_model(tmp_path / "c", "arm", None, None, None, None)
    with pytest.raises(UsageError, match="go together"):
        joint_model(tmp_path / "c", "hand", None, "base", None, None)


def test_offsets(tmp_path: Path) -> None:
    """A prior of each joint's zero, in radians, beside what the cell must have anyway."""
    path = tmp_path / "hand.urdf"
    path.write_text(URDF)
    entry = joint_model(tmp_path / "c", "left", path, "base", "tool0", 2.0).entry["robots"]["left"]
    assert entry["urdf"] == "hand.urdf"
    assert entry["joint_offsets"]["status"] == "prior"
    np.testing.assert_allclose(entry["joint_offsets"]["sigma_rad"], np.radians(2.0), atol=1e-5)
    for sigma in (0.0, 46.0, float("nan")):
        with pytest.raises(UsageError, match="expected more than 0 and at most 45"):
            joint_model(tmp_path / "c", "left", path, "base", "tool0", sigma)


@pytest.mark.parametrize(("off", "is_inside"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("sign", [1, -1])
def test_joints_may_pass_their_limits_by_a_little(
    tmp_path: Path, limited: SerialChain, off: float, is_inside: bool, sign: int
) -> None:
    """By what controllers let them; of several the first is named."""
    rows = ROWS.copy()
    rows[1:, 1] = sign * (limited.upper[1] + off * LIMIT_EXCESS_RAD)
    if is_inside:
        np.testing.assert_allclose(read(tmp_path, lines(rows), limited), rows, atol=1e-10)
    else:
        with pytest.raises(DatasetError, match=rf"q.csv:2: {limited.joint_names[1]}: is at -?3\.426 rad"):
            read(tmp_path, lines(rows), limited)


@pytest.mark.parametrize(("most", "count", "is_told"), [(3.1, 3, True), (3.2, 3, False), (3.1, 2, False)])
def test_three_rows_of_small_angles_look_like_radians(most: float, count: int, is_told: bool) -> None:
    """Where joints move at all; fewer rows, and an arm that stands still, may be near zero."""
    values = np.zeros((count, 2))
    values[0, 1] = -most
    assert bool(radians_finding(values)) == is_told
    assert radians_finding(np.full((5, 2), 1.0)) == ""
    if is_told:
        assert radians_finding(values).startswith("no joint of 3 rows is beyond 3.1 degrees")


def test_offsets_of_forty_five_degrees_are_the_widest(tmp_path: Path) -> None:
    """As much is taken."""
    path = tmp_path / "hand.urdf"
    path.write_text(URDF)
    for sigma in (45.0, 1e-3):
        entry = joint_model(tmp_path / "c", "left", path, "base", "tool0", sigma).entry["robots"]["left"]
        assert entry["joint_offsets"]["sigma_rad"] == pytest.approx(np.radians(sigma), abs=1e-5)


def test_numbers_beyond_all_degrees_are_no_degrees(tmp_path: Path, limited: SerialChain) -> None:
    """Where they would leave the limits as degrees, too, the order is to be checked."""
    rows = np.degrees(ROWS)
    rows[1, 2] = -400.0
    with pytest.raises(DatasetError, match="check the order of the joints"):
        read(tmp_path, lines(rows), limited)


@pytest.mark.parametrize("given", [(True, False, False), (True, True, False), (False, True, True), (True, False, True)])
def test_urdf_and_links_go_together(tmp_path: Path, given: tuple[bool, bool, bool]) -> None:
    """Whichever of the three is missing."""
    words = [word if is_given else None for word, is_given in zip(("a.urdf", "base", "tool0"), given, strict=True)]
    with pytest.raises(UsageError, match="--urdf, --base-link and --flange-link go together: give all three"):
        joint_model(tmp_path, "left", *words, None)


@pytest.mark.parametrize(("largest", "is_inside"), [(6.9, True), (-6.9, True), (7.0, False), (-7.0, False)])
def test_a_joint_without_limits_turns_little_more_than_once(
    tmp_path: Path, arm: SerialChain, largest: float, is_inside: bool
) -> None:
    """Either way, in radians."""
    free = replace(arm, lower=np.full(6, -np.inf), upper=np.full(6, np.inf))
    rows = ROWS.copy()
    rows[1, 3] = largest
    if is_inside:
        np.testing.assert_allclose(read(tmp_path, lines(rows), free), rows, atol=1e-10)
    else:
        with pytest.raises(DatasetError, match=rf"q.csv:2: {free.joint_names[3]}: is at {largest:.4g} rad, without"):
            read(tmp_path, lines(rows), free)
