"""Who listens to `shared.ros2_publisher` from another host: `python -m shared.ros2_listener DOMAIN NUMBER W H`.

It takes a number of states and images by the drivers of ROS 2, and prints as one line of JSON what became of each.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from basecal.acquisition.driver import Place
from basecal.acquisition.drivers.ros2 import open_camera, open_robot
from shared.ros2_domain import watching


def of_state(reading):
    """Its stamp, and the one that its joints say [s]."""
    joints = reading.state.joints_rad
    return reading.stamp_s, joints[:4] @ [1e8, 1e5, 100, 0.01]


def of_image(image):
    """Its stamp, the one that is drawn into it [s], and whether all other pixels are as they were sent."""
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
    pairs = [(of_state(robot.state()), of_image(camera.image())) for _ in range(int(number))]
    states, images = zip(*pairs, strict=True)
    print(json.dumps({"states": states, "images": images}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
