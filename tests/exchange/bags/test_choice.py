"""Tests of the selection from a bag: by usual names, by the cell, and by request."""

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
        # An arm with a flange and a tool0: the first of the usual names is chosen.
        (tree(("base_link", "flange"), fixed=(("flange", "tool0"),)), {"arm": ("base_link", "tool0")}),
    ],
)
def test_robots_are_found_by_usual_frame_names(frames: Tree, found: dict[str, tuple[str, str]]) -> None:
    """Usual base and flange names define a robot, which is named by their prefix."""
    taken = choose_sources(bag_of(), Survey(frames), BagRequest(), NO_CELL)
    assert taken.robots == {name: ByFrames(*each) for name, each in found.items()}


def test_unknown_frame_names_list_choices() -> None:
    """Without usual names the error states the option and lists frames of tf or topics of poses."""
    with pytest.raises(
        InputError, match=r"give --robot NAME=BASE,FLANGE or NAME=/TOPIC; frames of tf are: gripper, root"
    ):
        choose_sources(bag_of(), Survey(tree(("root", "gripper"))), BagRequest(), NO_CELL)
    with pytest.raises(InputError, match=r"topics of poses are: /left/pose$"):
        choose_sources(
            bag_of(Topic("/left/pose", POSE, 3), Topic("/x", JOINTS, 3)), Survey(tree()), BagRequest(), NO_CELL
        )


def test_cell_defines_robot_frames() -> None:
    """A robot's frames in the cell are used; without them the error requests them."""
    cell = Cell("a", {"a": Robot("a", frames={"base": "root", "flange": "hand"})}, {}, {}, {})
    taken = choose_sources(bag_of(), Survey(tree(("root", "hand"))), BagRequest(), cell)
    assert taken.robots == {"a": ByFrames("root", "hand")}
    other = Cell("b", {"b": Robot("b")}, {}, {}, {})
    with pytest.raises(InputError, match="the frames of b"):
        choose_sources(bag_of(), Survey(ARM), BagRequest(), other)


def test_joint_states_are_preferred_to_tf(arm: SerialChain) -> None:
    """Joint states are used if they include all joints of a URDF, unless --tf is given."""
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


def test_poses_are_selected_by_topic() -> None:
    """Robots and views may be topics of poses or pairs of frames; an unknown topic is an error."""
    bag = bag_of(Topic("/arm/pose", POSE, 5), Topic("/tag", POSE, 5))
    asked = BagRequest(robots={"arm": "/arm/pose"}, views={("eye", "tag"): "/tag", ("eye", "box"): "tool0, base_link"})
    taken = choose_sources(bag, Survey(ARM), asked, NO_CELL)
    assert taken.robots == {"arm": ByPoses("/arm/pose")}
    assert taken.views == {("eye", "tag"): ByPoses("/tag"), ("eye", "box"): ByFrames("tool0", "base_link")}
    with pytest.raises(FrameNotFound):
        choose_sources(bag, Survey(ARM), BagRequest(robots={"arm": "/arm/poses"}), NO_CELL)


def test_cameras_are_found_by_usual_topic_names() -> None:
    """Each namespace has one camera with the raw topic; depth images are not used.

    The cell's only camera gets the only topic.
    """
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


def test_camera_carrier_follows_tf() -> None:
    """A camera rigid to a flange is on the robot, one rigid to no moving frame is on the world."""
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
    """Return a cell of one arm and targets; the named ones have tags with sizes, `board` has none."""
    grid = {"kind": "aprilgrid", "tags": [2, 1], "tag_m": 0.05, "spacing": 0.3, "family": "tag36h11"}
    plain = {"kind": "chessboard", "corners": [3, 4], "square_m": 0.03}
    targets = {name: {"on": "world", **(grid if name in tagged else plain)} for name in ("board", *tagged)}
    return cell_from_dict({"schema": "basecal/cell/1", "reference": "arm", "robots": {"arm": {}}, "targets": targets})


def test_tag_corners_need_target_with_sizes() -> None:
    """Tag sizes come from the cell's target. The error lists targets that have them, or how to write one."""
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


def test_topic_of_other_type_is_refused() -> None:
    """The error names the topic's type and the suitable topics."""
    bag = bag_of(Topic("/arm/pose", POSE, 5), Topic("/joint_states", JOINTS, 5))
    with pytest.raises(InputError, match=rf"/joint_states holds {JOINTS}, expected one of .*: /arm/pose"):
        choose_sources(bag, Survey(ARM), BagRequest(robots={"arm": "/joint_states"}), NO_CELL)


def test_camera_is_on_flange_of_joint_robot(arm: SerialChain) -> None:
    """The flange of a robot read by its joints carries the cameras fixed to it."""
    frames = tree(("base_link", "tool0"), fixed=(("tool0", "eye"),))
    urdf, joints = {"/robot_description": chain_urdf(arm, "base_link", "tool0")}, {"/j": frozenset(arm.joint_names)}
    seen = images("/a/image_raw", frames={"/a/image_raw": "/eye"})
    taken = choose_sources(bag_of(), Survey(frames, urdfs=urdf, joints=joints, **seen), BagRequest(), NO_CELL)
    assert isinstance(taken.robots["arm"], ByJoints)
    assert taken.cameras["a"].on == "arm"
    bag, asked = bag_of(Topic("/pose", POSE, 3)), BagRequest(robots={"arm": "/pose"})
    assert choose_sources(bag, Survey(frames, **seen), asked, NO_CELL).cameras["a"].on == "world"


def test_camera_without_frame_is_on_only_robot() -> None:
    """The carrier must be given if there are several robots."""
    two = tree(("l_base", "l_tool0"), ("r_base", "r_tool0"))
    one = choose_sources(bag_of(), Survey(ARM, **images("/a/image_raw")), BagRequest(), NO_CELL)
    assert one.cameras["a"].on == "arm"
    for frame, message in (("", "of no name"), ("eye", "eye")):
        survey = Survey(two, **images("/a/image_raw", frames={"/a/image_raw": frame}))
        with pytest.raises(
            InputError, match=rf"camera 'a' is unknown, its frame {message} is not in tf: give --on a=ROBOT"
        ):
            choose_sources(bag_of(), survey, BagRequest(), NO_CELL)
    posed = bag_of(Topic("/pose", POSE, 3))
    alone = choose_sources(posed, Survey(tree(), **images("/a/image_raw")), BagRequest(robots={"x": "/pose"}), NO_CELL)
    assert alone.cameras["a"].on == "x"


def test_robot_base_must_move_relative_to_flange() -> None:
    """Rigidly connected frames are no robot; the base is the lowest of the usual bases above a flange."""
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


def test_camera_info_beside_images_is_used() -> None:
    """Compressed images have it too, and are used if there are no others."""
    survey = Survey(ARM, infos={"/w/camera_info": None}, **images("/w/image_raw/compressed", "/v/image_rect"))
    taken = choose_sources(bag_of(), survey, BagRequest(), NO_CELL).cameras
    assert (taken["w"].topic, taken["w"].info) == ("/w/image_raw/compressed", "/w/camera_info")
    assert (taken["v"].topic, taken["v"].info) == ("/v/image_rect", None)


def test_unknown_cameras_are_ignored_if_views_are_given() -> None:
    """Images that fit no camera of the cell are not needed if views of targets are given."""
    cell = Cell("arm", {"arm": Robot("arm")}, {}, {"wrist": CellCamera("wrist", "world")}, {})
    survey = Survey(ARM, **images("/w/image_raw", "/v/image_raw"))
    asked = BagRequest(views={("wrist", "box"): "tool0,base_link"})
    assert choose_sources(bag_of(), survey, asked, cell).cameras == {}
    named = BagRequest(cameras={"wrist": "/v/image_raw"})
    assert choose_sources(bag_of(), survey, named, cell).cameras["wrist"].topic == "/v/image_raw"
