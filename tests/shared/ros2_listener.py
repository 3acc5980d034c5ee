"""A listener to `shared.ros2_publisher` on another host: `python -m shared.ros2_listener DOMAIN NUMBER W H`.

It takes a number of states and images by the drivers of ROS 2, and prints the result of each as one line of JSON.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from basecal.acquisition.driver import Place
from basecal.acquisition.drivers.ros2 import open_camera, open_robot
from shared.ros2_domain import watching


def read_state(reading):
    """Stamp of a state, and the stamp that its joints contain [s]."""
    joints = reading.state.joints_rad
    return reading.stamp_s, joints[:4] @ [1e8, 1e5, 100, 0.01]


def read_image(image):
    """Stamp of an image, the stamp that its pixels contain [s], and whether all other pixels are unchanged."""
    drawn = int.from_bytes(image.grey[0, :8].tobytes(), "big") * 1e-9
    ground = np.arange(image.grey.size) % 251
    return image.stamp_s, drawn, bool(np.array_equal(image.grey.ravel()[8:], ground[8:]))


def main(domain, number, width, height):
    cell = watching((int(width), int(height)))
    options = {"domain": int(domain), "reconnect_s": 20.0}
    robot = open_robot(Place("eye", cell, Path("."), options))
    camera = open_camera(Place("wrist", cell, Path("."), {**options, "topic": "/wrist/image_raw"}))
    print("ready", flush=True)
    sys.stdin.readline()
    pairs = [(read_state(robot.state()), read_image(camera.image())) for _ in range(int(number))]
    states, images = zip(*pairs, strict=True)
    print(json.dumps({"states": states, "images": images}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
