"""Names of a cell: well formed, unique, and each one that is referred to exists."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from basecal.cell.cell import WORLD, grip_name
from basecal.cell.schema.clamping import clamp_names
from basecal.cell.schema.touching import mark_names
from basecal.errors import nearest
from basecal.fields.problems import SHORT_LENGTH, Problem, shorten

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_SECTIONS = ("robots", "cameras", "targets", "tips", "marks")


def name_problems(data: dict[str, Any]) -> list[Problem]:
    """Problems of the names in the data of a cell, independent of its other problems."""
    return [*_unfit_names(data), *_unknown_robots(data)]


def _section(data: dict[str, Any], name: str) -> dict[str, Any]:
    section = data.get(name)
    return section if isinstance(section, dict) else {}


def _unfit_names(data: dict[str, Any]) -> Iterator[Problem]:
    robots = _section(data, "robots")
    owners = {f"{robot}_{end}": f"a frame of {robot!r}" for robot in robots for end in ("base", "flange")}
    named = [(section, name) for section in _SECTIONS for name in _section(data, section)]
    named += [("marks", name) for _, name in mark_names(data)]
    named += [("clamp", each) for name, _ in clamp_names(data) for each in (name, grip_name(name))]
    for section, name in named:
        if not (isinstance(name, str) and _NAME.fullmatch(name)) or "_from_" in name or "_in_" in name:
            what = "expected a name of a-z, 0-9 and _, a letter first, without _from_ or _in_"
            yield Problem((section, name), f"{what}; rename {shorten(name)}")
        elif name == WORLD:
            yield Problem((section, name), f"{WORLD!r} is the base of the reference robot; choose another name")
        if name in owners:
            yield Problem((section, name), f"the name {name!r} is taken by {owners[name]}; names are unique")
        owners[name] = f"{section}.{name}"


def _unknown_robots(data: dict[str, Any]) -> Iterator[Problem]:
    reference, robots = data.get("reference"), list(_section(data, "robots"))
    carriers = [*robots, WORLD]
    if isinstance(reference, str) and reference not in robots:
        yield Problem(("reference",), _no_robot(reference, robots))
    for section in ("cameras", "targets", "tips"):
        for name, entry in _section(data, section).items():
            on = entry.get("on") if isinstance(entry, dict) else None
            there = robots if section == "tips" else carriers
            if isinstance(on, str) and on not in there:
                yield Problem((section, name, "on"), _no_robot(on, there))
    for name, entry in clamp_names(data):
        for robot in entry.get("robots") or () if isinstance(entry, dict) else ():
            if isinstance(robot, str) and robot not in robots:
                yield Problem(("clamp", name, "robots"), _no_robot(robot, robots))
    for name in _section(data, "bases"):
        if name not in robots:
            yield Problem(("bases", name), _no_robot(name, robots))
        elif name == reference:
            yield Problem(("bases", name), f"the base of the reference {name!r} is `world` itself; remove it")


def _no_robot(name: str, robots: list[str]) -> str:
    listed = ", ".join(map(str, robots)) or "none"
    return f"no robot {shorten(name)}{nearest(str(name)[:SHORT_LENGTH], robots)}; there are: {listed}"
