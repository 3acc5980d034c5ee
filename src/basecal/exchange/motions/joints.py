"""Joints of all robots as JSON: names, and a row of radians for each sample."""

from __future__ import annotations

import json

from basecal.exchange.motions.way import Motion, Way


def write_motion(way: Way) -> str:
    """One object: numbers of the samples, and for each robot its joints.

    Raises:
        InputError: if a robot is known by poses alone.
    """
    robots = {
        name: {"joint_names": list(way.joint_names(name)), "joints_rad": way.joints(name).tolist()}
        for name in way.robots
    }
    return json.dumps({"samples": way.numbers, "robots": robots}, indent=1) + "\n"


MOTION = Motion("joints of all robots as JSON [rad]", write_motion)
