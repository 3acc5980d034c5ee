"""Tests of the survey of a running ROS 2 system."""

from __future__ import annotations

import pytest

from basecal.exchange.bags.bag import IMAGE, JOINTS, TF

pytest.importorskip("cyclonedds")
from basecal.acquisition.ros2.listening import listen_to_topics, survey_live_topics
from basecal.errors import DriverError

NOBODY = 100  # a domain that no test sends in


@pytest.mark.journey
def test_running_system_is_surveyed_like_a_bag(ros2_cell):
    """Topics with types and counts, one image of each, the URDF, and frames, of which those of /tf move."""
    bag = listen_to_topics(ros2_cell.domain, 1.5)
    assert {name: bag.topics[name].kind for name in ("/joint_states", "/tf", "/wrist/image_raw")} == {
        "/joint_states": JOINTS,
        "/tf": TF,
        "/wrist/image_raw": IMAGE,
    }
    assert bag.topics["/joint_states"].messages > 20
    assert len(list(bag.read(["/wrist/image_raw"]))) == 1
    survey = survey_live_topics(bag)
    assert list(survey.urdfs) == ["/robot_description"]
    assert {name: each.is_fixed for name, each in survey.tree.transforms.items()} == {
        "link": False,
        "tool0": True,
        "wrist": True,
    }
    assert survey.frame_ids == {"/wrist/image_raw": "wrist"}


def test_empty_domain_is_reported(ros2_cell):
    """In a domain without senders one line has advice."""
    with pytest.raises(DriverError, match=r"no publisher of joint states, tf or images in domain \d+\. Is ROS_DOMAIN"):
        listen_to_topics(NOBODY, 0.3)
