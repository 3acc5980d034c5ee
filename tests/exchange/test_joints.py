"""Tests of files of joints, in the order of a chain and within its limits."""

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
def limited_arm(arm: SerialChain) -> SerialChain:
    """Return the arm with the limits of a small industrial one, narrow at the wrist."""
    limits = np.radians([170, 190, 150, 180, 120, 350])
    return replace(arm, lower=-limits, upper=limits)


def read(folder: Path, text: str, chain: SerialChain, in_degrees: bool = False) -> np.ndarray:
    (folder / "q.csv").write_text(text)
    rows = read_joints(str(folder / "q.csv"), "left", chain, in_degrees)
    return np.array([row.robots["left"].joints_rad for row in rows])


def lines(values: np.ndarray, separator: str = ",") -> str:
    return "".join(separator.join(f"{value:.12g}" for value in row) + "\n" for row in values)


def test_joints_are_read_by_order_name_or_number(tmp_path: Path, limited_arm: SerialChain) -> None:
    """Without a header joints are in the chain's order.

    With one they are found by name in any order, by numbers from 0 or 1, and with `.pos`.
    """
    names = list(limited_arm.joint_names)
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
        np.testing.assert_allclose(read(tmp_path, text, limited_arm), ROWS, atol=1e-10)


def test_unrelated_numbered_columns_are_ignored(tmp_path: Path, limited_arm: SerialChain) -> None:
    """A quaternion q1 to q4 beside the joints j1 to j6 is ignored, as in logs of ABB."""
    header = ",".join([*(f"j{i}" for i in range(1, 7)), "x", *(f"q{i}" for i in range(1, 5))])
    text = f"{header}\n" + "".join(f"{row},0.4,1,0,0,0\n" for row in lines(ROWS).splitlines())
    np.testing.assert_allclose(read(tmp_path, text, limited_arm), ROWS, atol=1e-10)


@pytest.mark.parametrize(
    "columns",
    [
        lambda names: [*names, *names],
        lambda names: [f"{name}.{kind}" for kind in ("position", "velocity") for name in names],
        lambda names: [f"{letter}{i}" for letter in "jq" for i in range(6)],
        lambda names: [f"j{i}" for _ in range(2) for i in range(6)],
    ],
)
def test_duplicate_joint_columns_are_refused(
    tmp_path: Path, limited_arm: SerialChain, columns: Callable[[tuple[str, ...]], list[str]]
) -> None:
    """Columns of two arms, of velocities or of torques are refused; before, the last ones were used."""
    header = columns(limited_arm.joint_names)
    text = ",".join(header) + "\n" + "".join(f"{row},0,0,0,0,0,0\n" for row in lines(ROWS).splitlines())
    expected = f"names the joint '{limited_arm.joint_names[0]}' twice, {header[0]}, {header[6]}: keep one"
    with pytest.raises(DatasetError, match=expected):
        read(tmp_path, text, limited_arm)


@pytest.mark.parametrize("column", ["j{}_{}", "j{} [{}]", "j{}({})", "j{}.{}"])
def test_header_units_must_match_option(tmp_path: Path, limited_arm: SerialChain, column: str) -> None:
    """Units of the header must agree with --deg; the error states what to give."""
    header = {unit: ",".join(column.format(i, unit) for i in range(1, 7)) + "\n" for unit in ("deg", "rad")}
    np.testing.assert_allclose(read(tmp_path, header["rad"] + lines(ROWS), limited_arm), ROWS, atol=1e-10)
    np.testing.assert_allclose(
        read(tmp_path, header["deg"] + lines(np.degrees(ROWS)), limited_arm, True), ROWS, atol=1e-10
    )
    with pytest.raises(DatasetError, match=r"j1.*the unit is deg, but another is expected: give --deg"):
        read(tmp_path, header["deg"] + lines(ROWS / 10), limited_arm)
    with pytest.raises(DatasetError, match=r"j1.*the unit is rad, but another is expected: remove --deg"):
        read(tmp_path, header["rad"] + lines(ROWS), limited_arm, True)


def test_joints_in_degrees_are_read(tmp_path: Path, limited_arm: SerialChain) -> None:
    """Joints in degrees are read with the option, also with decimal commas."""
    text = lines(np.degrees(ROWS), ";").replace(".", ",")
    np.testing.assert_allclose(read(tmp_path, text, limited_arm, True), ROWS, atol=1e-10)


def test_degrees_read_as_radians_are_reported(tmp_path: Path, limited_arm: SerialChain) -> None:
    """The error has the line, the joint, its limits and the option to give."""
    name = limited_arm.joint_names[0]
    expected = rf"q.csv:1: {name}: is at 10 rad, its limits are -2.967 to 2.967: give --deg, they look like degrees"
    with pytest.raises(DatasetError, match=expected):
        read(tmp_path, lines(np.degrees(ROWS)), limited_arm)


def test_reversed_joint_order_is_suggested(tmp_path: Path, limited_arm: SerialChain) -> None:
    """The reverse order is suggested if no unit explains a joint beyond its limits but the reverse order does."""
    order = re.escape(", ".join(limited_arm.joint_names[::-1]))
    assert np.abs(ROWS[:, 5]).max() > limited_arm.upper[0]
    with pytest.raises(DatasetError, match=f"may be in another order, such as {order}"):
        read(tmp_path, lines(np.degrees(ROWS)[:, ::-1]), limited_arm, True)


def test_radians_read_as_degrees_are_reported(tmp_path: Path, limited_arm: SerialChain) -> None:
    """Angles within three degrees of zero are refused, since no arm calibrates there."""
    with pytest.raises(DatasetError, match="they look like radians: remove --deg"):
        read(tmp_path, lines(ROWS / 2), limited_arm, True)


def test_unexplained_joint_values_are_reported(tmp_path: Path, limited_arm: SerialChain) -> None:
    """A joint that no unit or order explains, and columns of another arm, are errors."""
    wrong = ROWS.copy()
    wrong[2, 2] = wrong[2, 3] = 3.0
    wrong[0] = np.radians([10, 10, 160, 160, 10, 10])
    with pytest.raises(DatasetError, match=r"q.csv:1: .* check the order of the joints, and that the URDF is"):
        read(tmp_path, lines(wrong), limited_arm)
    with pytest.raises(DatasetError, match="or 6 numbered ones such as j1, q1 or A1"):
        read(tmp_path, "a1,a2,a3\n1,2,3\n", limited_arm)


def test_degrees_are_recognised_without_joint_limits(tmp_path: Path, arm: SerialChain) -> None:
    """Joints without limits in the URDF may rotate once, so degrees are still recognised."""
    free = replace(arm, lower=np.full(6, -np.inf), upper=np.full(6, np.inf))
    np.testing.assert_allclose(read(tmp_path, lines(ROWS), free), ROWS, atol=1e-10)
    with pytest.raises(DatasetError, match="give --deg"):
        read(tmp_path, lines(np.degrees(ROWS)), free)


def test_given_urdf_defines_joint_model(tmp_path: Path) -> None:
    """A given URDF yields the chain, the cell's entry for it, and the file to copy."""
    path = tmp_path / "hand.urdf"
    path.write_text(URDF)
    model = joint_model(tmp_path / "c", "left", path, "base", "tool0", None)
    assert len(model.chain.joint_names) == 2
    links = {"urdf": "hand.urdf", "base_link": "base", "flange_link": "tool0"}
    assert model.entry == {"robots": {"left": links}}
    assert model.files == {"hand.urdf": path}


def test_known_joint_model_is_taken_from_cell(tmp_path: Path) -> None:
    """A known model is not requested again; for an unknown one the error states what to give."""
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


def test_joint_offset_prior_is_added(tmp_path: Path) -> None:
    """The prior of each joint's offset (its zero) is in radians beside the robot's other fields.

    Sigmas outside 0 to 45 deg are refused.
    """
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
def test_joint_limits_have_small_tolerance(
    tmp_path: Path, limited_arm: SerialChain, off: float, is_inside: bool, sign: int
) -> None:
    """Joints may exceed their limits as far as controllers permit; beyond, the first such row is named."""
    rows = ROWS.copy()
    rows[1:, 1] = sign * (limited_arm.upper[1] + off * LIMIT_EXCESS_RAD)
    if is_inside:
        np.testing.assert_allclose(read(tmp_path, lines(rows), limited_arm), rows, atol=1e-10)
    else:
        with pytest.raises(DatasetError, match=rf"q.csv:2: {limited_arm.joint_names[1]}: is at -?3\.426 rad"):
            read(tmp_path, lines(rows), limited_arm)


@pytest.mark.parametrize(("most", "count", "is_told"), [(3.1, 3, True), (3.2, 3, False), (3.1, 2, False)])
def test_three_rows_of_small_angles_look_like_radians(most: float, count: int, is_told: bool) -> None:
    """The finding needs moving joints: fewer rows, or an arm at rest, may be near zero."""
    values = np.zeros((count, 2))
    values[0, 1] = -most
    assert bool(radians_finding(values)) == is_told
    assert radians_finding(np.full((5, 2), 1.0)) == ""
    if is_told:
        assert radians_finding(values).startswith("no joint of 3 rows is beyond 3.1 degrees")


def test_joint_offset_sigma_of_45_degrees_is_accepted(tmp_path: Path) -> None:
    """45 degrees is the largest accepted sigma."""
    path = tmp_path / "hand.urdf"
    path.write_text(URDF)
    for sigma in (45.0, 1e-3):
        entry = joint_model(tmp_path / "c", "left", path, "base", "tool0", sigma).entry["robots"]["left"]
        assert entry["joint_offsets"]["sigma_rad"] == pytest.approx(np.radians(sigma), abs=1e-5)


def test_values_beyond_limits_as_degrees_suggest_order(tmp_path: Path, limited_arm: SerialChain) -> None:
    """If values exceed the limits as degrees too, the error advises to check the order."""
    rows = np.degrees(ROWS)
    rows[1, 2] = -400.0
    with pytest.raises(DatasetError, match="check the order of the joints"):
        read(tmp_path, lines(rows), limited_arm)


@pytest.mark.parametrize("given", [(True, False, False), (True, True, False), (False, True, True), (True, False, True)])
def test_urdf_and_links_are_given_together(tmp_path: Path, given: tuple[bool, bool, bool]) -> None:
    """Each missing combination of the three options is refused."""
    words = [word if is_given else None for word, is_given in zip(("a.urdf", "base", "tool0"), given, strict=True)]
    with pytest.raises(UsageError, match="--urdf, --base-link and --flange-link go together: give all three"):
        joint_model(tmp_path, "left", *words, None)


@pytest.mark.parametrize(("largest", "is_inside"), [(6.9, True), (-6.9, True), (7.0, False), (-7.0, False)])
def test_unlimited_joint_accepts_little_more_than_one_turn(
    tmp_path: Path, arm: SerialChain, largest: float, is_inside: bool
) -> None:
    """Joints without limits accept angles below 7 rad in either direction."""
    free = replace(arm, lower=np.full(6, -np.inf), upper=np.full(6, np.inf))
    rows = ROWS.copy()
    rows[1, 3] = largest
    if is_inside:
        np.testing.assert_allclose(read(tmp_path, lines(rows), free), rows, atol=1e-10)
    else:
        with pytest.raises(DatasetError, match=rf"q.csv:2: {free.joint_names[3]}: is at {largest:.4g} rad, without"):
            read(tmp_path, lines(rows), free)
