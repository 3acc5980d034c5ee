"""Choice of a bag's frames and topics: as requested, as stated in the cell, or by their usual names."""

from __future__ import annotations

import re
from collections.abc import Mapping

from basecal.cell import WORLD
from basecal.errors import BasecalError, FrameNotFound, InputError, list_names
from basecal.exchange.bags.bag import POSE, Bag
from basecal.exchange.bags.frames import Tree, frame_hint
from basecal.exchange.bags.sources import (
    BagRequest,
    BagSources,
    ByFrames,
    ByJoints,
    ByPoses,
    ByTagPoses,
    ByTags,
    CameraSource,
)
from basecal.exchange.bags.survey import Survey, plain_frame
from basecal.exchange.bags.tags import TAG_POSES, TAGS, frames_of_tags
from basecal.exchange.importing.imported import KnownCell
from basecal.kinematics import SerialChain, parse_chain

# Names in URDFs of Universal Robots, Franka, KUKA, ABB, FANUC, Yaskawa, UFACTORY and Doosan, in order of preference.
_FLANGES = ("tool0", "flange", "link8", "link_eef", "ee_link", "link_ee", "link_6")
_BASES = ("base_link", "base", "link0", "link_base")
_TAIL = re.compile(rf"^(.*?)({'|'.join(_FLANGES)})$")
_USUAL = ("image_raw", "image_mono", "image_color", "image", "image_rect", "image_rect_color")  # in order of preference
_COMPRESSED = "/compressed"
_DEPTH_WORD = "depth"


def choose_sources(bag: Bag, survey: Survey, request: BagRequest, cell: KnownCell) -> BagSources:
    """Choose the sources of robots, cameras and views.

    Raises:
        FrameNotFound: if a requested topic or frame does not exist.
        InputError: if no robot is found, or the carrier of a camera is ambiguous.
    """
    frames = _frames_of_robots(bag, survey.tree, request, cell)
    robots = {name: _robot(bag, survey, name, words, request, cell) for name, words in frames.items()}
    topics = _topics_of_cameras(survey, request, cell)
    cameras = {name: _camera(survey, robots, name, topic, request, cell) for name, topic in topics.items()}
    views = {key: _view(bag, survey.tree, key[1], words, cell) for key, words in request.views.items()}
    return BagSources(robots, cameras, views)


def _frames_of_robots(bag: Bag, tree: Tree, request: BagRequest, cell: KnownCell) -> dict[str, str]:
    """Texts `BASE,FLANGE`, or a topic, by robot."""
    if request.robots:
        return dict(request.robots)
    known = cell.robots
    stated = {}
    for name, robot in known.items():
        base, flange = robot.frames.get("base", robot.base_link), robot.frames.get("flange", robot.flange_link)
        if base is not None and flange is not None:
            stated[name] = f"{base},{flange}"
    if stated and len(stated) == len(known):
        return stated
    found = _usual_frames(tree)
    if known and set(found) != set(known):
        raise InputError(
            f"the frames of {list_names(list(known))} are unknown: "
            f"give --robot NAME=BASE,FLANGE for each; {frame_hint(tree)}"
        )
    if not found:
        topics = [topic.name for topic in bag.topics.values() if topic.kind == POSE]
        topics_text = f"; topics of poses are: {list_names(topics)}" if topics else ""
        raise InputError(
            "no robot was found from the names of frames: give --robot NAME=BASE,FLANGE or NAME=/TOPIC; "
            f"{frame_hint(tree)}{topics_text}"
        )
    return found


def _usual_frames(tree: Tree) -> dict[str, str]:
    """Robots found by the usual names of their frames; the prefix of the names is the robot's name."""
    found: dict[str, str] = {}
    tips = [(match[1], match[2], frame) for frame in tree.names if (match := _TAIL.match(frame))]
    for prefix, _, tip in sorted(tips, key=lambda each: _FLANGES.index(each[1])):
        ancestors = tree.ancestors(tip)
        base = next((prefix + name for name in _BASES if prefix + name in ancestors), None)
        name = prefix.strip("_/").replace("/", "_") or "arm"
        if base is not None and base not in tree.rigid_ancestors(tip) and name not in found:
            found[name] = f"{base},{tip}"
    return dict(sorted(found.items()))


def _robot(
    bag: Bag, survey: Survey, name: str, words: str, request: BagRequest, cell: KnownCell
) -> ByFrames | ByPoses | ByJoints:
    """Source of a robot: joints if available with a URDF, else tf; or the stated topic."""
    known = cell.robots.get(name)
    base, comma, flange = words.partition(",")
    if not comma:
        return _parse_source(bag, survey.tree, words)
    if not request.by_tf and known is not None and known.chain is not None:
        topic = _joint_topic(survey, known.chain)
        if topic is not None:
            return ByJoints(topic, known.chain, known.base_link or base, known.flange_link or flange)
    for urdf, text in {} if request.by_tf else survey.urdfs.items():
        try:
            chain = parse_chain(text, base, flange)
        except BasecalError:  # no such links, or not a URDF
            continue
        topic = _joint_topic(survey, chain)
        if topic is not None:
            return ByJoints(topic, chain, base, flange, urdf)
    return _parse_source(bag, survey.tree, words)


def _joint_topic(survey: Survey, chain: SerialChain) -> str | None:
    """Topic of joint states with all joints of a chain; None if there is none."""
    return next((topic for topic, names in sorted(survey.joints.items()) if names.issuperset(chain.joint_names)), None)


def _parse_source(bag: Bag, tree: Tree, words: str) -> ByFrames | ByPoses:
    """Parse a source given as `PARENT,CHILD` or as a topic."""
    parent, comma, child = words.partition(",")
    if comma:
        source = ByFrames(plain_frame(parent.strip()), plain_frame(child.strip()))
        tree.path(source.parent, source.child)
        return source
    poses = [topic.name for topic in bag.topics_of_type(POSE)]
    if words not in poses:
        if words in bag.topics:
            raise InputError(f"{words} holds {bag.topics[words].kind}, expected one of {POSE}: {list_names(poses)}")
        raise FrameNotFound(words, sorted(bag.topics))
    return ByPoses(words)


def _view(bag: Bag, tree: Tree, target: str, words: str, cell: KnownCell) -> ByFrames | ByPoses | ByTags | ByTagPoses:
    """Source of a view, which may be a topic of tags; corners of tags need a target with sizes."""
    kind = bag.topics[words].kind if words in bag.topics else ""
    shape = cell.targets[target].target if target in cell.targets else None
    if kind in TAG_POSES:
        return ByTagPoses(words, frames_of_tags(shape))
    if kind != TAGS:
        return _parse_source(bag, tree, words)
    if shape is None or shape.tags is None:
        known = [name for name, each in cell.targets.items() if each.target and each.target.tags]
        do = (
            f"there is {list_names(known)}"
            if known
            else "basecal new CELL --target apriltag --tag N --square SIZE writes one"
        )
        raise InputError(f"{words} holds corners of tags: {target!r} must be in cell.yaml, with tag sizes; {do}")
    return ByTags(words, shape.tags)


def _topics_of_cameras(survey: Survey, request: BagRequest, cell: KnownCell) -> dict[str, str]:
    """Topics of images by camera."""
    topics = [topic.name for topic in survey.images]
    for topic in request.cameras.values():
        if topic not in topics:
            raise FrameNotFound(topic, topics)
    if request.cameras:
        return dict(request.cameras)
    found = _usual_cameras(topics)
    known = list(cell.cameras)
    if len(known) == len(found) == 1:
        return {known[0]: next(iter(found.values()))}
    unknown = [name for name in found if known and name not in known]
    if unknown and not request.views:
        found_topics = list_names(list(found.values()))
        raise InputError(f"the cell has {list_names(known)}: assign {found_topics} with --camera NAME=TOPIC for each")
    return {} if unknown else found


def _usual_cameras(topics: list[str]) -> dict[str, str]:
    """One topic of images per namespace; raw is preferred to compressed, and unrectified to rectified."""
    best: dict[str, tuple[tuple[int, bool], str]] = {}
    for topic in topics:
        base_topic = topic.removesuffix(_COMPRESSED)
        namespace, _, last = base_topic.rpartition("/")
        if _DEPTH_WORD in topic.lower() or last not in _USUAL:
            continue
        rank = (_USUAL.index(last), base_topic != topic)
        best[namespace] = min(best.get(namespace, (rank, topic)), (rank, topic))
    return {namespace.strip("/").replace("/", "_") or "camera": topic for namespace, (_, topic) in sorted(best.items())}


def _camera(
    survey: Survey,
    robots: Mapping[str, ByFrames | ByPoses | ByJoints],
    name: str,
    topic: str,
    request: BagRequest,
    cell: KnownCell,
) -> CameraSource:
    namespace = topic.removesuffix(_COMPRESSED).rpartition("/")[0]
    info = f"{namespace}/camera_info"
    known = cell.cameras.get(name)
    on = request.on.get(name) if known is None else known.on
    if on is None:
        on = _carrier(survey.tree, robots, survey.frame_ids[topic])
    if on is None:
        frame = survey.frame_ids[topic] or "of no name"
        why = f"its frame {frame} is not in tf" if len(robots) > 1 else "it is new"
        raise InputError(f"the carrier of camera {name!r} is unknown, {why}: give --on {name}=ROBOT or {name}={WORLD}")
    if on != WORLD and on not in robots and on not in cell.robots:
        raise InputError(f"camera {name!r} on {on!r}: there is no such robot; there are {list_names([*robots, WORLD])}")
    return CameraSource(topic, info if info in survey.infos else None, on)


def _carrier(tree: Tree, robots: Mapping[str, ByFrames | ByPoses | ByJoints], frame: str) -> str | None:
    """Robot whose flange is rigidly connected to a frame, or the world; None if tf does not have the frame."""
    frame = plain_frame(frame)
    if frame not in tree.names:
        return next(iter(robots)) if len(robots) == 1 else None
    rigid = tree.rigid_ancestors(frame)
    for name, source in robots.items():
        flange = source.child if isinstance(source, ByFrames) else source.flange if isinstance(source, ByJoints) else ""
        if flange in tree.names and set(rigid) & set(tree.rigid_ancestors(flange)):
            return name
    return WORLD
