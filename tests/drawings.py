"""Geometry in SVG drawings: boxes of labels and rectangles, and points of lines."""

from __future__ import annotations

import re
from itertools import combinations
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

_CHARACTER, _ABOVE, _BELOW, _LINE = 6.5, 9.0, 3.0, 13.8  # width, ascent, descent and line height of text of 12 px [px]
_STARTS = {"start": 0.0, "middle": 0.5, "end": 1.0}


class Box(NamedTuple):
    """Box of a label or a rectangle, with the text or the opacity."""

    left: float
    top: float
    right: float
    bottom: float
    text: str


def view(svg: str) -> Box:
    """Return the view box of a drawing."""
    left, top, width, height = map(float, ElementTree.fromstring(svg).attrib["viewBox"].split())
    return Box(left, top, left + width, top + height, "")


def labels(svg: str) -> list[Box]:
    """Boxes of all labels, in the order of the document."""
    return [_label(each) for each in ElementTree.fromstring(svg).iter("text")]


def _label(node: ElementTree.Element) -> Box:
    parts = [node.text or "", *(child.tail or "" for child in node.iter("title"))]
    lines = ["".join(parts).strip(), *(each.text or "" for each in node.iter("tspan"))]
    width = _CHARACTER * max(map(len, lines))
    x, y = float(node.attrib["x"]), float(node.attrib["y"]) + (4.0 if "dy" in node.attrib else 0.0)
    left = x - _STARTS[node.get("text-anchor", "start")] * width
    return Box(left, y - _ABOVE, left + width, y + _BELOW + _LINE * (len(lines) - 1), " ".join(lines))


def rectangles(svg: str, kind: str) -> list[Box]:
    """Boxes of all rectangles of a class, with their opacity."""
    nodes = [each for each in ElementTree.fromstring(svg).iter("rect") if each.get("class") == kind]
    boxes = [([float(each.attrib[key]) for key in ("x", "y", "width", "height")], each) for each in nodes]
    return [Box(x, y, x + width, y + height, each.get("fill-opacity", "")) for (x, y, width, height), each in boxes]


def ends(svg: str, kind: str) -> list[np.ndarray]:
    """Points (n, 2) of each line in all paths of a class."""
    lines = []
    for path in ElementTree.fromstring(svg).iter("path"):
        if path.get("class") == kind:
            lines += _ends(path.attrib["d"])
    return lines


def _ends(data: str) -> list[np.ndarray]:
    lines: list[list[np.ndarray]] = []
    position = np.zeros(2)
    for letter, words in re.findall(r"([A-Za-z])([^A-Za-z]*)", data):
        numbers = [float(word) for word in re.findall(r"-?[\d.]+", words)]
        if letter == "Z":
            continue
        axis = {"h": 0, "v": 1}.get(letter.lower())
        target = np.array(numbers) if axis is None else position.copy()
        if axis is not None:
            target[axis] = numbers[0] + (position[axis] if letter.islower() else 0.0)
        elif letter.islower():
            target = position + target
        if letter in "Mm":
            lines.append([])
        lines[-1].append(target)
        position = target
    return [np.array(line) for line in lines]


def check_labels(svg: str) -> None:
    """Check that all labels lie within the drawing, and that no two overlap."""
    drawing, boxes = view(svg), labels(svg)
    for box in boxes:
        assert drawing.left <= box.left, box
        assert drawing.top <= box.top, box
        assert box.right <= drawing.right, box
        assert box.bottom <= drawing.bottom, box
    for one, other in combinations(boxes, 2):
        assert not overlap(one, other), (one, other)


def overlap(one: Box, other: Box) -> bool:
    """Return whether two boxes share more than a border."""
    width = min(one.right, other.right) - max(one.left, other.left)
    return width > 0.05 and min(one.bottom, other.bottom) - max(one.top, other.top) > 0.05
