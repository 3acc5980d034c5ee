"""Tests of publishing results on /tf_static."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from basecal.exchange.bags.frames import pose_from_values, transform_values
from basecal.geometry import SE3
from basecal.geometry.se3 import rotation_exp

pytest.importorskip("cyclonedds")
from basecal.acquisition.ros2.dds import Discovery, Subscriber
from basecal.acquisition.ros2.static_frames import STATIC_TOPIC, send_static
from shared.ros2_domain import DOMAIN, LOOPBACK


def test_late_listener_receives_the_transforms():
    """Parent, child and transform arrive unchanged, although no listener existed when they were sent."""
    os.environ["CYCLONEDDS_URI"] = LOOPBACK
    domain = (DOMAIN + 23) % 200
    pose = SE3(rotation_exp(np.array([0.1, -0.2, 0.3])), np.array([1.0, 2.0, 3.0]))
    before_s = time.time()
    sender = send_static(domain, [("left_base", "right_base", pose), ("left_base", "camera", pose.inverse())])
    offer = Discovery(domain).wait_for_topic(STATIC_TOPIC, 5.0)
    assert offer.is_latched
    (message,) = Subscriber(domain, offer, 10).messages(3.0)
    found = {
        each.child_frame_id: (each.header.frame_id, transform_values(each.transform)) for each in message.transforms
    }
    assert {child: parent for child, (parent, _) in found.items()} == {"right_base": "left_base", "camera": "left_base"}
    np.testing.assert_allclose(pose_from_values(found["right_base"][1], "").matrix, pose.matrix, atol=1e-12)
    stamp = message.transforms[0].header.stamp
    assert before_s - 1e-6 <= stamp.sec + 1e-9 * stamp.nanosec <= time.time()
    del sender
