"""Numbers of SVG drawings: boxes of labels and rectangles, and ends of lines."""

from __future__ import annotations

import re
from itertools import combinations
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

_CHARACTER, _ABOVE, _BELOW, _LINE = 6.5, 9.0, 3.0, 13.8  # [px] of text of 12 px about its baseline
_STARTS = {"start": 0.0, "middle": 0.5, "end": 1.0}


class Box(NamedTuple):
    """Borders of a label or a rectangle, with its text or its opacity."""

    left: float
    top: float
    right: float
    bottom: float
    text: str


def view(svg: str) -> Box:
    """The view box of a drawing."""
    left, top, width, height = map(float, ElementTree.fromstring(svg).attrib["viewBox"].split())
    return Box(left, top, left + width, top + height, "")


def labels(svg: str) -> list[Box]:
    """Boxes of all labels, in their order."""
    return [_label(each) for each in ElementTree.fromstring(svg).iter("text")]


def _label(node: ElementTree.Element) -> Box:
    words = [node.text or "", *(child.tail or "" for child in node.iter("title"))]
    lines = ["".join(words).strip(), *(each.text or "" for each in node.iter("tspan"))]
    width = _CHARACTER * max(map(len, lines))
    x, y = float(node.attrib["x"]), float(node.attrib["y"]) + (4.0 if "dy" in node.attrib else 0.0)
    left = x - _STARTS[node.get("text-anchor", "start")] * width
    return Box(left, y - _ABOVE, left + width, y + _BELOW + _LINE * (len(lines) - 1), " ".join(lines))


def rectangles(svg: str, kind: str) -> list[Box]:
    """Boxes of rectangles of a class, with their opacity."""
    found = [each for each in ElementTree.fromstring(svg).iter("rect") if each.get("class") == kind]
    boxes = [([float(each.attrib[key]) for key in ("x", "y", "width", "height")], each) for each in found]
    return [Box(x, y, x + width, y + height, each.get("fill-opacity", "")) for (x, y, width, height), each in boxes]


def ends(svg: str, kind: str) -> list[np.ndarray]:
    """Points of each line, (n, 2), of all paths of a class."""
    found = []
    for each in ElementTree.fromstring(svg).iter("path"):
        if each.get("class") == kind:
            found += _ends(each.attrib["d"])
    return found


def _ends(data: str) -> list[np.ndarray]:
    lines: list[list[np.ndarray]] = []
    at = np.zeros(2)
    for letter, words in re.findall(r"([A-Za-z])([^A-Za-z]*)", data):
        numbers = [float(word) for word in re.findall(r"-?[\d.]+", words)]
        if letter == "Z":
            continue
        axis = {"h": 0, "v": 1}.get(letter.lower())
        to = np.array(numbers) if axis is None else at.copy()
        if axis is not None:
            to[axis] = numbers[0] + (at[axis] if letter.islower() else 0.0)
        elif letter.islower():
            to = at + to
        if letter in "Mm":
            lines.append([])
        lines[-1].append(to)
        at = to
    return [np.array(line) for line in lines]


def check_labels(svg: str) -> None:
    """All labels lie on the drawing, and none lies on another."""
    whole, boxes = view(svg), labels(svg)
    for box in boxes:
        assert whole.left <= box.left, box
        assert whole.top <= box.top, box
        assert box.right <= whole.right, box
        assert box.bottom <= whole.bottom, box
    for one, other in combinations(boxes, 2):
        assert not overlap(one, other), (one, other)


def overlap(one: Box, other: Box) -> bool:
    """Whether two boxes share more than a border."""
    across = min(one.right, other.right) - max(one.left, other.left)
    return across > 0.05 and min(one.bottom, other.bottom) - max(one.top, other.top) > 0.05
