"""A new cell from the messages of a running ROS 2 system: `basecal new CELL --from ros2`."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from basecal.cli.connecting import allow_places
from basecal.cli.terminal import say

if TYPE_CHECKING:
    from basecal.cell import Cell
    from basecal.exchange.bags.sources import BagSources

LISTEN_S = 3.0
"""Time to listen: the slowest useful messages are sent once a second, and discovery takes a second."""


@dataclass(frozen=True)
class NewCell:
    """The text of a `cell.yaml`, the cell that it describes, and URDFs by file name."""

    text: str
    cell: Cell
    urdfs: Mapping[str, str] = field(default_factory=dict)


def ros2_cell(
    cell: Path,
    yes: bool,
    domain: int | None,
    robots: Mapping[str, str],
    fields: Mapping[str, Any] | None,
    target: str,
) -> NewCell:
    """A cell with drivers and lenses.

    Args:
        cell: Folder of the cell.
        yes: Whether to listen without a question.
        domain: DDS domain; None for that of the environment.
        robots: `BASE,FLANGE` or a topic for each robot; if empty, the usual names are searched.
        fields: Fields of the target; None for those of an example.
        target: Kind of the target.

    Raises:
        DriverError: if no messages are received.
        InputError: if the messages contain no robot.
        UsageError: if listening is not allowed.
    """
    from basecal.acquisition.ros2.dds import choose_domain, describe_domain
    from basecal.acquisition.ros2.listening import listen_to_topics, survey_live_topics
    from basecal.cell.files import cell_from_dict
    from basecal.cell.format.yaml_text import yaml_text
    from basecal.exchange.bags.choice import choose_sources
    from basecal.exchange.bags.entry import bag_entry, urdf_name
    from basecal.exchange.bags.sources import BagRequest, ByJoints
    from basecal.exchange.importing.imported import NO_CELL

    allow_places(cell, [describe_domain(choose_domain(domain))], yes)
    bag = listen_to_topics(choose_domain(domain), LISTEN_S)
    say(f"messages heard in {LISTEN_S:g} s:")
    for topic in sorted(bag.topics.values()):
        say(f"  {topic.messages:>8}  {topic.name}  {topic.kind}")
    survey, request = survey_live_topics(bag), BagRequest(robots=robots)
    selection = choose_sources(bag, survey, request, NO_CELL)
    for line in selection.words:
        say(f"taking {line}")
    sizes = {name: size for name, each in selection.cameras.items() if (size := _size(bag, each.topic))}
    entry = bag_entry(NO_CELL, bag.path, survey, selection, request, sizes)
    data: dict[str, Any] = {"schema": "basecal/cell/1", **entry}
    _add_drivers(data, selection, domain)
    _add_target(data, fields, target)
    urdfs = {
        urdf_name(name): survey.urdfs[source.urdf]
        for name, source in selection.robots.items()
        if isinstance(source, ByJoints) and source.urdf is not None
    }
    with TemporaryDirectory() as folder:
        for name, urdf in urdfs.items():
            (Path(folder) / name).write_text(urdf, encoding="utf-8")
        return NewCell(yaml_text(data), cell_from_dict(data, bag.path, folder), urdfs)


def _add_drivers(data: dict[str, Any], selection: BagSources, domain: int | None) -> None:
    from basecal.exchange.bags.sources import ByFrames

    domain_option = {} if domain is None else {"domain": domain}
    for name, source in selection.robots.items():
        options = {"frames": [source.parent, source.child]} if isinstance(source, ByFrames) else {"topic": source.topic}
        driver = {"kind": "ros2", **options, **domain_option}
        data["robots"][name] = {**data["robots"].get(name, {}), "driver": driver}
    for name, camera in selection.cameras.items():
        data["cameras"][name]["driver"] = {"kind": "ros2", "topic": camera.topic, **domain_option}
    if len(data["robots"]) > 1:
        data["bases"] = {name: {"status": "free"} for name in data["robots"] if name != data["reference"]}


def _add_target(data: dict[str, Any], fields: Mapping[str, Any] | None, kind: str) -> None:
    """Add a target on a robot that does not carry the camera, or fixed in the world if there is none."""
    from basecal.cell.format.yaml_text import parse_yaml
    from basecal.cell.targets.registry import TARGETS

    if fields is None:
        template = "" if kind == "pose" else textwrap.dedent(TARGETS[kind].template)
        fields = parse_yaml(template, "target").data if template else {}
    for camera in data.get("cameras", {}).values():
        others = [name for name in data["robots"] if name != camera["on"]]
        on = others[0] if others else "world"
        data.setdefault("targets", {"target": {"on": on, "mount": {"status": "free"}, **fields}})


def _size(bag: Any, topic: str) -> tuple[int, int] | None:
    """Width and height of a topic's image; None if it is compressed, when the camera_info contains them."""
    first = next(iter(bag.read([topic]))).data
    return (int(first.width), int(first.height)) if hasattr(first, "width") else None
