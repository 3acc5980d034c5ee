"""Exports of hostile names: what an independent parser of the format reads is what it reads of harmless ones."""

from __future__ import annotations

import ast
import csv
import io
import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any
from xml.dom import minidom

import cv2
import numpy as np
from ruamel.yaml import YAML

from basecal.cell import Calibration, Cell, Finding, RobotParameters
from basecal.exchange.exporters.exporter import export
from basecal.exchange.exporters.registry import EXPORTERS
from basecal.exchange.motions.way import RobotPath
from basecal.exchange.motions.writers import PLAN_FORMATS
from basecal.geometry import Camera
from basecal.kinematics import read_chain
from export_example import BASE, CALIBRATION, CELL
from shared.motion_ways import joint_way
from torment.damage import HOSTILE_TEXTS
from torment.outcome import TrialFailed, run_reader

Trial = Callable[[Random, Path], str]
_URDF = Path(__file__).parents[1] / "data" / "urdf" / "six_axis.urdf"
_SCENE = """<robot name="scene"><link name="left base's"/><link name="right_base"/>
<joint name="right" type="fixed"><parent link="left base's"/><child link="right_base"/></joint></robot>"""
_LENS = Camera("pinhole", np.array([800.0, 801, 320, 240, -0.1, 0.01, 1e-5, -1e-5]), (640, 480))
_CHAIN = read_chain(_URDF, "base_link", "tool0")
_INJECTIONS = (
    *("--->", "--><plugin name='x' filename='y'/><!--", "]]>", "]]><a/>", "*/ x /*", "\\", "'''", '"""', "x\\"),
    *("a]\n  points:\n  - {positions: [3], time_from_start: {sec: 0, nanosec: 1}}", "a, b", "a: b # c", "&a *a !!x"),
    *("a\u2028b", "a\x85b", "=1+1", "@SUM(1)", "+1", "-1", "\t=1", 'a","b', "\U0001f600", "$(x)", "-", "--"),
    *("%YAML:1.0\n---\n", "..."),
)
HOSTILE = tuple(text for text in (*HOSTILE_TEXTS, *_INJECTIONS) if text)
_COMMENTS = {"kuka": ";", "abb": "!", "fanuc": "!", "yaskawa": "'", "denso": "'", "staubli": "//"}


def _xml(text: str) -> Any:
    def told(node: Any) -> Any:
        inner = [told(child) for child in node.childNodes if child.nodeType == child.ELEMENT_NODE]
        return node.tagName, sorted(node.attributes.items()), inner

    return told(minidom.parseString(text.encode()).documentElement)


def _yaml(text: str) -> Any:
    return list(YAML(typ="safe", pure=True).load_all(text))


def _storage(text: str) -> Any:
    """All numbers of a file of OpenCV, by its own reader."""
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)

    def told(node: Any) -> Any:
        if not node.isMap():
            return node.real() if node.isReal() or node.isInt() else [node.at(k).real() for k in range(node.size())]
        return {key: told(node.getNode(key)) for key in node.keys() if key != "dt"}  # noqa: SIM118

    return told(storage.root())


def _stage(text: str) -> Any:
    from pxr import Usd

    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(text)
    return [(str(prim.GetPath()), prim.GetTypeName(), prim.GetPropertyNames()) for prim in stage.Traverse()]


def _json(text: str) -> Any:
    return {key: value for key, value in json.loads(text).items() if key != "from"}


def _table(text: str) -> Any:
    return [row[:-1] for row in csv.reader(io.StringIO(text, newline=""))]


def _lines(mark: str) -> Callable[[str], Any]:
    return lambda text: [line for line in text.split("\n") if not line.startswith(mark)]


PARSERS: dict[str, Callable[[str], Any]] = {
    **dict.fromkeys(("mujoco", "urdf", "urdf_joint", "urdf_cell"), _xml),
    **dict.fromkeys(("ros", "camera_info"), _yaml),
    "opencv": _storage,
    "usd": _stage,
    "json": _json,
    "csv": _table,
    "ros2": lambda text: ast.dump(ast.parse(text)),
    **{kind: _lines(_COMMENTS.get(kind, "#")) for kind in (*_COMMENTS, "ur", "doosan", "xarm", "matrix")},
}
"""By exporter, what a reader of its format that is not ours makes of a text, without comments."""


@cache
def _robots() -> Cell:
    links = {"chain": _CHAIN, "urdf": _URDF.name, "base_link": "base_link", "flange_link": "tool0"}
    return replace(CELL, robots={name: replace(robot, **links) for name, robot in CELL.robots.items()})


@cache
def _calibrated() -> Calibration:
    values = np.full(6, 0.01)
    offsets = RobotParameters(_CHAIN.joint_names, values, values, np.ones(6, bool))
    inputs = {**CALIBRATION.inputs, _URDF.name: f"sha256:{sha256(_URDF.read_bytes()).hexdigest()}"}
    found = replace(CALIBRATION, robot_parameters={"joint_offsets": {"hand": offsets}}, inputs=inputs)
    return replace(found, verdict="doubtful", cameras={"wrist": (_LENS, np.eye(8))})


def _text(kind: str, inputs: dict[str, str], code: str, scene: Path) -> str:
    calibration = _calibrated()
    findings = (*calibration.findings, Finding(code, "warning", (), "x"))
    calibration = replace(calibration, inputs={**calibration.inputs, **inputs}, findings=findings)
    choices: dict[str, dict[str, Any]] = {
        "urdf": {"robot": "hand"},
        "urdf_cell": {"urdf": [_URDF, _URDF]},
        "urdf_joint": {"urdf": [scene], "joint": "right", "transform": BASE},
        "camera_info": {"camera": "wrist"},
    }
    choice = choices.get(kind) or {"transform": BASE}
    return export(calibration, kind, **choice, cell=_robots(), folder=_URDF.parent)


def _exporting(kind: str) -> Trial:
    def trial(chance: Random, folder: Path) -> str:
        inputs = {chance.choice(HOSTILE): chance.choice(HOSTILE), chance.choice(HOSTILE): "sha256:0"}
        (folder / "scene.urdf").write_text(_SCENE)

        def read() -> None:
            said = _text(kind, inputs, chance.choice(HOSTILE), folder / "scene.urdf")
            if PARSERS[kind](said) != PARSERS[kind](_text(kind, {"a": "sha256:0"}, "b", folder / "scene.urdf")):
                raise TrialFailed(f"{kind} says something else by {inputs}")

        return run_reader(read)

    return trial


def _named(names: tuple[str, ...]) -> RobotPath:
    way = joint_way()
    robots = {
        name: replace(robot, chain=None if robot.chain is None else replace(robot.chain, joint_names=names))
        for name, robot in way.robots.items()
    }
    return replace(way, robots=robots)


_READ: dict[str, Callable[[str], Any]] = {
    "joints": json.loads,
    "ros2-trajectory": _yaml,
    "csv": lambda text: list(csv.reader(io.StringIO(text, newline=""))),
    "ur-script": lambda text: text,
}


def _moving(kind: str) -> Trial:
    def trial(chance: Random, folder: Path) -> str:
        hostile = tuple(chance.sample(HOSTILE, 6))
        harmless = tuple(f"joint_name_{k}" for k in range(6))

        def told(names: tuple[str, ...]) -> Any:
            way = _named(names)
            if kind == "ur-script":
                way = replace(way, robots={"hand": way.robots["hand"]})
            return _READ[kind](PLAN_FORMATS[kind].text(way))

        def read() -> None:
            if _renamed(told(hostile), hostile, harmless) != told(harmless):
                raise TrialFailed(f"{kind} says something else by {hostile}")

        return run_reader(read)

    return trial


def _renamed(data: Any, names: tuple[str, ...], others: tuple[str, ...]) -> Any:
    """Plain data with some names replaced by others wherever a text is one, or ends in one as a column does."""
    if isinstance(data, dict):
        return {key: _renamed(value, names, others) for key, value in data.items()}
    if isinstance(data, list):
        return [_renamed(value, names, others) for value in data]
    for name, other in zip(names, others, strict=True):
        for column in ("{}", "eye_{}_rad", "hand_{}_rad"):
            if data == column.format(name) and isinstance(data, str):
                return column.format(other)
    return data


EXPORTS: dict[str, Trial] = {
    **{f"export {kind}": _exporting(kind) for kind in EXPORTERS if kind != "usd" or find_spec("pxr")},
    **{f"plan --to {kind}": _moving(kind) for kind in PLAN_FORMATS},
}
