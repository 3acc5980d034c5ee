"""What of a bag is taken, by names that are usual, by the cell, and as asked for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from basecal.cell import Cell, CellCamera, Robot
from basecal.cell.files import cell_from_dict
from basecal.errors import FrameNotFound, InputError
from basecal.exchange.bags.bag import IMAGE, JOINTS, POSE, Bag, Topic
from basecal.exchange.bags.choice import choose_sources
from basecal.exchange.bags.frames import FrameTransform, Tree
from basecal.exchange.bags.sources import BagRequest, ByFrames, ByJoints, ByPoses, ByTagPoses, ByTags
from basecal.exchange.bags.survey import Survey
from basecal.exchange.bags.tags import TAG_POSES, TAGS
from basecal.exchange.importing.imported import NO_CELL
from basecal.exchange.urdf import chain_urdf
from basecal.kinematics import SerialChain

NUMBERS = np.array([0.0, 0, 0, 0, 0, 0, 1])


def tree(*moving: tuple[str, str], fixed: tuple[tuple[str, str], ...] = ()) -> Tree:
    transforms = {child: FrameTransform(parent, NUMBERS, False, True) for parent, child in moving}
    return Tree({**transforms, **{child: FrameTransform(parent, NUMBERS, True, False) for parent, child in fixed}})


def bag_of(*topics: Topic) -> Bag:
    return Bag("x.bag", {topic.name: topic for topic in topics}, lambda names: iter(()))


def images(*names: str, frames: Mapping[str, str] | None = None) -> dict[str, object]:
    ids = {name: (frames or {}).get(name, "") for name in names}
    return {"images": tuple(Topic(name, IMAGE, 3) for name in names), "frame_ids": ids}


ARM = tree(("base_link", "link_1"), ("link_1", "tool0"))


@pytest.mark.parametrize(
    ("frames", "found"),
    [
        (ARM, {"arm": ("base_link", "tool0")}),
        (tree(("l_base_link", "l_wrist"), fixed=(("l_wrist", "l_tool0"),)), {"l": ("l_base_link", "l_tool0")}),
        (
            tree(("panda_link0", "panda_link7"), fixed=(("panda_link7", "panda_link8"),)),
            {"panda": ("panda_link0", "panda_link8")},
        ),
        # A flange and a tool0 of one arm: the first of the usual names is it.
        (tree(("base_link", "flange"), fixed=(("flange", "tool0"),)), {"arm": ("base_link", "tool0")}),
    ],
)
def test_robots_by_usual_names(frames: Tree, found: dict[str, tuple[str, str]]) -> None:
    taken = choose_sources(bag_of(), Survey(frames), BagRequest(), NO_CELL)
    assert taken.robots == {name: ByFrames(*each) for name, each in found.items()}


def test_no_usual_name() -> None:
    with pytest.raises(
        InputError, match=r"give --robot NAME=BASE,FLANGE or NAME=/TOPIC; frames of tf are: gripper, root"
    ):
        choose_sources(bag_of(), Survey(tree(("root", "gripper"))), BagRequest(), NO_CELL)
    with pytest.raises(InputError, match=r"topics of poses are: /left/pose$"):
        choose_sources(
            bag_of(Topic("/left/pose", POSE, 3), Topic("/x", JOINTS, 3)), Survey(tree()), BagRequest(), NO_CELL
        )


def test_a_cell_says_its_frames() -> None:
    cell = Cell("a", {"a": Robot("a", frames={"base": "root", "flange": "hand"})}, {}, {}, {})
    taken = choose_sources(bag_of(), Survey(tree(("root", "hand"))), BagRequest(), cell)
    assert taken.robots == {"a": ByFrames("root", "hand")}
    other = Cell("b", {"b": Robot("b")}, {}, {}, {})
    with pytest.raises(InputError, match="the frames of b"):
        choose_sources(bag_of(), Survey(ARM), BagRequest(), other)


def test_joints_before_tf(arm: SerialChain) -> None:
    """Where all joints of a URDF are told of; not where --tf says otherwise."""
    urdf = {"/robot_description": chain_urdf(arm, "base_link", "tool0")}
    joints = {"/joint_states": frozenset(arm.joint_names)}
    survey = Survey(ARM, urdfs={"/other_description": "<robot", **urdf}, joints=joints)
    source = choose_sources(bag_of(Topic("/joint_states", JOINTS, 9)), survey, BagRequest(), NO_CELL).robots["arm"]
    assert isinstance(source, ByJoints)
    assert (source.topic, source.urdf) == ("/joint_states", "/robot_description")
    assert isinstance(choose_sources(bag_of(), survey, BagRequest(by_tf=True), NO_CELL).robots["arm"], ByFrames)
    few = Survey(ARM, urdfs=urdf, joints={"/joint_states": frozenset(arm.joint_names[1:])})
    assert isinstance(choose_sources(bag_of(), few, BagRequest(), NO_CELL).robots["arm"], ByFrames)
    known = Cell(
        "arm", {"arm": Robot("arm", chain=arm, urdf="a.urdf", base_link="base_link", flange_link="tool0")}, {}, {}, {}
    )
    source = choose_sources(bag_of(), Survey(ARM, joints=joints), BagRequest(), known).robots["arm"]
    assert isinstance(source, ByJoints)
    assert source.urdf is None


def test_poses_by_topic() -> None:
    bag = bag_of(Topic("/arm/pose", POSE, 5), Topic("/tag", POSE, 5))
    asked = BagRequest(robots={"arm": "/arm/pose"}, views={("eye", "tag"): "/tag", ("eye", "box"): "tool0, base_link"})
    taken = choose_sources(bag, Survey(ARM), asked, NO_CELL)
    assert taken.robots == {"arm": ByPoses("/arm/pose")}
    assert taken.views == {("eye", "tag"): ByPoses("/tag"), ("eye", "box"): ByFrames("tool0", "base_link")}
    with pytest.raises(FrameNotFound):
        choose_sources(bag, Survey(ARM), BagRequest(robots={"arm": "/arm/poses"}), NO_CELL)


def test_cameras_by_usual_names() -> None:
    """One topic of each namespace, the raw one; depth is none."""
    topics = ("/w/image_raw", "/w/image_rect", "/w/image_raw/compressed", "/d/depth/image_raw", "/image", "/x/mask")
    taken = choose_sources(bag_of(), Survey(ARM, **images(*topics)), BagRequest(), NO_CELL)
    assert {name: source.topic for name, source in taken.cameras.items()} == {"camera": "/image", "w": "/w/image_raw"}
    assert taken.cameras["w"].info is None
    cell = Cell("arm", {"arm": Robot("arm")}, {}, {"wrist": CellCamera("wrist", "world")}, {})
    taken = choose_sources(bag_of(), Survey(ARM, **images("/w/image_raw")), BagRequest(), cell)
    assert (taken.cameras["wrist"].topic, taken.cameras["wrist"].on) == ("/w/image_raw", "world")
    with pytest.raises(InputError, match=r"the cell has .*: assign"):
        choose_sources(bag_of(), Survey(ARM, **images("/w/image_raw", "/v/image_raw")), BagRequest(), cell)
    with pytest.raises(FrameNotFound):
        choose_sources(bag_of(), Survey(ARM, **images("/w/image_raw")), BagRequest(cameras={"wrist": "/w/image"}), cell)


def test_what_carries_a_camera() -> None:
    """What goes with a flange is on the robot, what goes with nothing that moves on the world."""
    frames = tree(("base_link", "tool0"), fixed=(("tool0", "eye"), ("base_link", "post")))
    survey = Survey(
        frames, **images("/a/image_raw", "/b/image_raw", frames={"/a/image_raw": "eye", "/b/image_raw": "post"})
    )
    taken = choose_sources(bag_of(), survey, BagRequest(), NO_CELL)
    assert {name: source.on for name, source in taken.cameras.items()} == {"a": "arm", "b": "world"}
    assert choose_sources(bag_of(), survey, BagRequest(on={"b": "arm"}), NO_CELL).cameras["b"].on == "arm"
    with pytest.raises(InputError, match="there is no such robot"):
        choose_sources(bag_of(), survey, BagRequest(on={"b": "leg"}), NO_CELL)


def boards(*tagged: str) -> Cell:
    """A cell of one arm and targets; those that are named have tags with sizes, `board` has none."""
    grid = {"kind": "aprilgrid", "tags": [2, 1], "tag_m": 0.05, "spacing": 0.3, "family": "tag36h11"}
    plain = {"kind": "chessboard", "corners": [3, 4], "square_m": 0.03}
    targets = {name: {"on": "world", **(grid if name in tagged else plain)} for name in ("board", *tagged)}
    return cell_from_dict({"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": {}}, "targets": targets})


def test_corners_of_tags_need_sizes() -> None:
    """Those of the target in the cell; the message names targets that have them, or how to write one."""
    bag = bag_of(Topic("/corners", TAGS, 5), Topic("/poses", TAG_POSES[0], 5))

    def view(target: str, cell: Cell, topic: str = "/corners") -> object:
        asked = BagRequest(robots={"arm": "base_link,tool0"}, views={("eye", target): topic})
        return choose_sources(bag, Survey(ARM), asked, cell).views[("eye", target)]

    cell = boards("grid")
    source = view("grid", cell)
    assert isinstance(source, ByTags)
    assert source.topic == "/corners"
    shape = cell.targets["grid"].target
    assert shape is not None
    assert source.tags is shape.tags
    for missing in ("board", "other"):
        with pytest.raises(
            InputError, match=rf"/corners holds corners of tags: '{missing}' must be .*; there is grid$"
        ):
            view(missing, cell)
        with pytest.raises(InputError, match="; basecal new CELL --target apriltag --tag N --square SIZE writes one"):
            view(missing, boards())
    assert isinstance(view("other", boards(), "/poses"), ByTagPoses)


def test_a_topic_of_another_kind_is_no_pose() -> None:
    """It is named with its kind, and with the topics that would do."""
    bag = bag_of(Topic("/arm/pose", POSE, 5), Topic("/joint_states", JOINTS, 5))
    with pytest.raises(InputError, match=rf"/joint_states holds {JOINTS}, expected one of .*: /arm/pose"):
        choose_sources(bag, Survey(ARM), BagRequest(robots={"arm": "/joint_states"}), NO_CELL)


def test_a_camera_goes_with_the_flange_of_joints(arm: SerialChain) -> None:
    """The flange of a robot that is read by its joints carries what is fixed to it."""
    frames = tree(("base_link", "tool0"), fixed=(("tool0", "eye"),))
    urdf, joints = {"/robot_description": chain_urdf(arm, "base_link", "tool0")}, {"/j": frozenset(arm.joint_names)}
    seen = images("/a/image_raw", frames={"/a/image_raw": "/eye"})
    taken = choose_sources(bag_of(), Survey(frames, urdfs=urdf, joints=joints, **seen), BagRequest(), NO_CELL)
    assert isinstance(taken.robots["arm"], ByJoints)
    assert taken.cameras["a"].on == "arm"
    bag, asked = bag_of(Topic("/pose", POSE, 3)), BagRequest(robots={"arm": "/pose"})
    assert choose_sources(bag, Survey(frames, **seen), asked, NO_CELL).cameras["a"].on == "world"


def test_a_camera_without_a_frame_is_on_the_only_robot() -> None:
    """Of several robots its carrier must be given."""
    two = tree(("l_base", "l_tool0"), ("r_base", "r_tool0"))
    one = choose_sources(bag_of(), Survey(ARM, **images("/a/image_raw")), BagRequest(), NO_CELL)
    assert one.cameras["a"].on == "arm"
    for frame, said in (("", "of no name"), ("eye", "eye")):
        survey = Survey(two, **images("/a/image_raw", frames={"/a/image_raw": frame}))
        with pytest.raises(
            InputError, match=rf"camera 'a' is unknown, its frame {said} is not in tf: give --on a=ROBOT"
        ):
            choose_sources(bag_of(), survey, BagRequest(), NO_CELL)
    posed = bag_of(Topic("/pose", POSE, 3))
    alone = choose_sources(posed, Survey(tree(), **images("/a/image_raw")), BagRequest(robots={"x": "/pose"}), NO_CELL)
    assert alone.cameras["a"].on == "x"


def test_a_base_moves_against_its_flange() -> None:
    """Frames that are rigid to each other are no robot; the lowest of the usual bases above a flange is its base."""
    rigid = tree(("root", "base_link"), fixed=(("base_link", "tool0"),))
    with pytest.raises(InputError, match="no robot was found from the names of frames"):
        choose_sources(bag_of(), Survey(rigid), BagRequest(), NO_CELL)
    both = tree(("base", "base_link"), ("base_link", "tool0"))
    assert choose_sources(bag_of(), Survey(both), BagRequest(), NO_CELL).robots == {
        "arm": ByFrames("base_link", "tool0")
    }
    apart = tree(("a/base", "a/tool0"), ("_b_link0", "_b_link8"), ("link0", "c_flange"))
    found = choose_sources(bag_of(), Survey(apart), BagRequest(), NO_CELL).robots
    assert found == {"a": ByFrames("a/base", "a/tool0"), "b": ByFrames("_b_link0", "_b_link8")}


def test_a_camera_has_the_info_beside_its_images() -> None:
    """Of compressed images, too; compressed ones are taken where there are no others."""
    survey = Survey(ARM, infos={"/w/camera_info": None}, **images("/w/image_raw/compressed", "/v/image_rect"))
    taken = choose_sources(bag_of(), survey, BagRequest(), NO_CELL).cameras
    assert (taken["w"].topic, taken["w"].info) == ("/w/image_raw/compressed", "/w/camera_info")
    assert (taken["v"].topic, taken["v"].info) == ("/v/image_rect", None)


def test_strange_cameras_are_left_alone_where_views_are_given() -> None:
    """With views of targets, images that fit no camera of the cell are not needed."""
    cell = Cell("arm", {"arm": Robot("arm")}, {}, {"wrist": CellCamera("wrist", "world")}, {})
    survey = Survey(ARM, **images("/w/image_raw", "/v/image_raw"))
    asked = BagRequest(views={("wrist", "box"): "tool0,base_link"})
    assert choose_sources(bag_of(), survey, asked, cell).cameras == {}
    named = BagRequest(cameras={"wrist": "/v/image_raw"})
    assert choose_sources(bag_of(), survey, named, cell).cameras["wrist"].topic == "/v/image_raw"
