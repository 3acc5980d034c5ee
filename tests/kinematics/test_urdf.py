import sys

import numpy as np
import pytest

from basecal.errors import DatasetError, FrameNotFound
from basecal.kinematics import parse_chain, read_chain
from basecal.kinematics.urdf import joint_origins, path_joint_names

LINKS = '<link name="base"/><link name="arm"/><link name="tool"/>'
TURN = """<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
  <origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 0 2"/><limit lower="-1" upper="2"/></joint>"""
HOLD = '<joint name="hold" type="fixed"><parent link="arm"/><child link="tool"/><origin xyz="0.1 0 0"/></joint>'
SECOND = HOLD.replace("hold", "again")
LOOSE = '<link name="loose"/>'
BACK = '<joint name="back" type="fixed"><parent link="tool"/><child link="base"/></joint>'


def robot(*parts):
    return f"<robot name='r'>{''.join(parts)}</robot>"


def test_chain_matches_the_urdf():
    """Fixed joints are merged, axes are normalised, limits and names are kept."""
    chain = parse_chain(robot(LINKS, TURN, HOLD), "base", "tool")
    assert chain.joint_names == ("turn",)
    np.testing.assert_array_equal(chain.axes, [[0, 0, 1]])
    np.testing.assert_array_equal([chain.lower, chain.upper], [[-1], [2]])
    flange = chain.forward(np.array([np.pi / 2]))
    np.testing.assert_allclose(flange.translation, [0, 0.1, 0.3], atol=1e-15)


def test_urdf_defaults_are_applied():
    """A joint without origin is at its parent, without axis it turns about x, and a continuous one has no limits."""
    text = robot(LINKS, HOLD, '<joint name="t" type="continuous"><parent link="base"/><child link="arm"/></joint>')
    chain = parse_chain(text, "base", "tool")
    np.testing.assert_array_equal(chain.axes, [[1, 0, 0]])
    np.testing.assert_array_equal([chain.lower, chain.upper], [[-np.inf], [np.inf]])
    np.testing.assert_array_equal(chain.origins.matrix, [np.eye(4)])


def test_chain_spans_base_to_flange(folder):
    """Joints above the base and beyond the flange are not part of the chain."""
    path = folder / "six_axis.urdf"
    part = read_chain(path, "shoulder", "wrist_2")
    assert part.joint_names == ("shoulder_lift", "elbow", "wrist_1_joint", "wrist_2_joint")
    whole = read_chain(path, "world", "tool0")
    from_base = read_chain(path, "base_link", "tool0")
    q = np.full(6, 0.3)
    world_from_base = whole.forward(q) @ from_base.forward(q).inverse()
    np.testing.assert_allclose(world_from_base.translation, [0.3, -0.2, 0.75], atol=1e-15)
    np.testing.assert_allclose(world_from_base.rotvec, [0, 0, 1.2], atol=1e-15)


def test_text_bytes_and_file_are_equal(folder):
    """A chain is the same from a path as text, from a Path, and from the file's text or bytes."""
    path = folder / "seven_axis.urdf"
    q = np.linspace(-1, 1, 7)
    want = read_chain(path, "pedestal", "hand").forward(q).matrix
    for chain in (
        read_chain(str(path), "pedestal", "hand"),
        parse_chain(path.read_text(), "pedestal", "hand"),
        parse_chain(path.read_bytes(), "pedestal", "hand"),
    ):
        np.testing.assert_array_equal(chain.forward(q).matrix, want)


@pytest.mark.parametrize(("base", "flange", "missing"), [("bas", "tool", "bas"), ("base", "tool0", "tool0")])
def test_missing_link_lists_existing_links(base, flange, missing):
    """A missing link raises FrameNotFound with the existing names."""
    with pytest.raises(FrameNotFound, match="base, arm, tool") as caught:
        parse_chain(robot(LINKS, TURN, HOLD), base, flange)
    assert caught.value.name == missing


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not well-formed"),
        ("<robot>\n<link", "arm.urdf:2: not well-formed"),
        ("<sdf/>", "root element is 'sdf'"),
        ('<?xml version="1.0" encoding="no-such"?><robot/>', "not"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "safely"),
        (robot("<link/>"), "link: has no 'name'"),
        (robot(LINKS, '<link name="arm"/>', TURN, HOLD), "link 'arm': given twice"),
        (robot(LINKS, LOOSE, TURN, HOLD, HOLD.replace('"tool"', '"loose"')), "joint 'hold': given twice"),
        (robot(LINKS, TURN, HOLD.replace("<parent", "<x")), "joint 'hold': has no element 'parent'"),
        (robot(LINKS, TURN, HOLD.replace('child link="tool"', "child")), "joint 'hold' child: has no 'link'"),
        (robot(LINKS, TURN, HOLD.replace('type="fixed"', "")), "joint 'hold': has no 'type'"),
        (robot(LINKS, TURN, HOLD.replace('"tool"', '"tol"')), "joint 'hold': names the link 'tol'"),
        (robot(LINKS, TURN, HOLD, SECOND), "joint 'again' child: 'tool' already has the parent joint 'hold'"),
        (robot(LINKS, LOOSE, TURN, HOLD), "not a tree: .* base, loose"),
        (robot(LINKS, TURN, HOLD, BACK), "not a tree: .* none"),
        (robot(LINKS, TURN.replace("0 0 0.3", "0 nan 0.3"), HOLD), "joint 'turn' origin xyz: expected 3 finite"),
        (robot(LINKS, TURN.replace("0 0 0.3", "0 0.3"), HOLD), "joint 'turn' origin xyz: expected 3 finite"),
        (robot(LINKS, TURN.replace('rpy="0 0 0"', 'rpy="${pi} 0 0"'), HOLD), "rpy: .* expand a xacro first"),
        (robot(LINKS, TURN.replace("0 0 2", "0 0 0"), HOLD), "joint 'turn' axis xyz: has no direction"),
        (robot(LINKS, TURN.replace("0 0 2", "0 0 inf"), HOLD), "joint 'turn' axis xyz: expected 3 finite"),
        (robot(LINKS, TURN.replace('"revolute"', '"prismatic"'), HOLD.replace("fixed", "continuous")), "'prismatic'"),
        (robot(LINKS, TURN.replace('"revolute"', '"floating"'), HOLD.replace("fixed", "continuous")), "'floating'"),
        (robot(LINKS, TURN.replace("<limit", '<mimic joint="x"/><limit'), HOLD), "joint 'turn' mimic"),
        (robot(LINKS, TURN.replace("<limit", "<x"), HOLD), "joint 'turn' limit: missing"),
        (robot(LINKS, TURN.replace('upper="2"', 'upper="-2"'), HOLD), "lower -1 is above upper -2"),
        (robot(LINKS, TURN.replace('upper="2"', 'upper="far"'), HOLD), "limit upper: expected a finite number"),
        (robot(LINKS, TURN.replace("revolute", "fixed"), HOLD), "no revolute joint between 'base' and 'tool'"),
    ],
)
def test_invalid_urdf_files_are_refused(text, message):
    """An unusable file raises DatasetError with the file, the element and the expected content."""
    with pytest.raises(DatasetError, match=message) as caught:
        parse_chain(text, "base", "tool", "arm.urdf")
    assert str(caught.value).startswith("arm.urdf")


def test_a_flange_above_the_base_is_refused():
    """A flange that is not below the base has no chain."""
    with pytest.raises(DatasetError, match="'base' is not below 'tool', but above it: exchange"):
        parse_chain(robot(LINKS, TURN, HOLD), "tool", "base")


def test_loop_beside_the_root_is_refused():
    """Links in a loop are reported, without an endless search."""
    ring = HOLD.replace('"arm"', '"ring"').replace('"tool"', '"arm"').replace("hold", "a")
    ring += HOLD.replace('"arm"', '"tool"').replace('"tool"/><o', '"ring"/><o').replace("hold", "b")
    ring += HOLD.replace("hold", "c")
    with pytest.raises(DatasetError, match=r"'tool' is not below 'base', but below '\w+'$"):
        parse_chain(robot(LINKS, '<link name="ring"/>', ring), "base", "tool")


def test_missing_file_is_refused(tmp_path):
    """A missing file raises DatasetError with its name."""
    with pytest.raises(DatasetError, match=r"arm\.urdf: cannot be read"):
        read_chain(tmp_path / "arm.urdf", "base", "tool")


def test_joints_off_the_chain_are_ignored(folder):
    """Prismatic fingers and mimic joints beside the chain are ignored, and within the chain they are refused."""
    path = folder / "six_axis.urdf"
    assert read_chain(path, "base_link", "tool0").n == 6
    with pytest.raises(DatasetError, match="joint 'left' type: 'prismatic' between base and flange"):
        read_chain(path, "base_link", "left_finger")


def test_short_axis_is_normalised():
    """An axis of 5e-9 is normalised, one of 5e-10 has no direction."""
    chain = parse_chain(robot(LINKS, TURN.replace("0 0 2", "0 0 -5e-9"), HOLD), "base", "tool")
    np.testing.assert_allclose(chain.axes, [[0.0, 0.0, -1.0]])
    with pytest.raises(DatasetError, match="has no direction"):
        parse_chain(robot(LINKS, TURN.replace("0 0 2", "0 0 5e-10"), HOLD), "base", "tool")


@pytest.mark.parametrize("number", ["1e200", "-1e7", "nan", "inf"])
def test_implausible_numbers_are_refused(number):
    """The error has the joint, the field and the bound."""
    text = robot(LINKS, TURN.replace("0 0 0.3", f"0 0 {number}"), HOLD)
    with pytest.raises(DatasetError, match="joint 'turn' origin xyz: expected 3 finite numbers within 1e\\+06"):
        parse_chain(text, "base", "tool")


@pytest.mark.journey
def test_parsing_time_is_linear_in_links():
    """Twice as many links, each with a mass, take about twice as many calls, not four times."""
    few, many = count_calls(300), count_calls(600)
    assert many < 2.2 * few


def count_calls(count):
    """The number of Python calls for reading a chain of `count` links."""
    mass = '<inertial><mass value="1"/></inertial>'
    links = "".join(f'<link name="l{k}">{mass}</link>' for k in range(count))
    fixed = '<joint name="j{0}" type="{2}"><parent link="l{0}"/><child link="l{1}"/></joint>'
    kinds = ("continuous", *["fixed"] * (count - 2))
    joints = "".join(fixed.format(k, k + 1, kind) for k, kind in enumerate(kinds))
    text, calls = robot(links, joints), []
    sys.setprofile(lambda frame, event, of: calls.append(event))
    chain = parse_chain(text, "l0", f"l{count - 1}")
    sys.setprofile(None)
    assert chain.n == 1
    assert chain.masses.kg[0] == count - 1
    return len(calls)


def test_chain_has_at_most_64_joints():
    """A chain of 100 revolute joints is refused, and messages list only some of a large file's names."""
    links = "".join(f'<link name="l{k}"/>' for k in range(101))
    turning = '<joint name="j{0}" type="continuous"><parent link="l{0}"/><child link="l{1}"/></joint>'
    text = robot(links, "".join(turning.format(k, k + 1) for k in range(100)))
    with pytest.raises(DatasetError, match="100 revolute joints between 'l0' and 'l100'; arms have up to 64"):
        parse_chain(text, "l0", "l100")
    with pytest.raises(FrameNotFound, match=r"l18, l19 and 81 more$"):
        parse_chain(text, "l0", "tool")


def test_joint_origins_by_child_link():
    """Every joint is returned with its origin by its child link, and the root has none."""
    above = joint_origins(robot(LINKS, TURN, HOLD))
    assert {link: (joint.name, joint.kind, joint.parent) for link, joint in above.items()} == {
        "arm": ("turn", "revolute", "base"),
        "tool": ("hold", "fixed", "arm"),
    }
    np.testing.assert_array_equal(above["tool"].parent_from_child.translation, [0.1, 0, 0])
    assert above["arm"].child == "arm"
    with pytest.raises(DatasetError, match="not a tree"):
        joint_origins(robot(LINKS, HOLD, LOOSE))


def test_path_joint_names_include_fixed_joints():
    """Joints from base to flange are in order, without those elsewhere."""
    aside = '<link name="aside"/><joint name="off" type="fixed"><parent link="arm"/><child link="aside"/></joint>'
    text = robot(LINKS, TURN, HOLD, aside)
    assert path_joint_names(text, "base", "tool") == ("turn", "hold")
    assert path_joint_names(text, "base", "aside") == ("turn", "off")
    with pytest.raises(FrameNotFound, match="elbow"):
        path_joint_names(text, "base", "elbow")


def test_flange_elsewhere_reports_its_root():
    """The error names the root above the flange, or suggests to exchange base and flange."""
    forked = '<link name="aside"/><joint name="off" type="fixed"><parent link="base"/><child link="aside"/></joint>'
    text = robot(LINKS, TURN, HOLD, forked)
    with pytest.raises(DatasetError, match=r"'tool' is not below 'aside'.*below 'base'"):
        parse_chain(text, "aside", "tool")
    with pytest.raises(DatasetError, match="exchange base_link and flange_link"):
        parse_chain(text, "tool", "base")
