"""What a running ROS 2 says, kept as a bag is."""

from __future__ import annotations

import pytest

from basecal.exchange.bags.bag import IMAGE, JOINTS, TF

pytest.importorskip("cyclonedds")
from basecal.acquisition.ros2.listening import listen_to_topics, survey_live_topics
from basecal.errors import DriverError

NOBODY = 100  # a domain that no test sends in


def test_what_runs_is_surveyed_as_a_bag_is(ros2_cell):
    """Topics with their types and counts, one image of each, the URDF, and frames, of which those of /tf move."""
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


def test_nobody_there(ros2_cell):
    """In a domain in which nobody sends anything, a line says what to look at."""
    with pytest.raises(DriverError, match=r"no publisher of joint states, tf or images in domain \d+\. Is ROS_DOMAIN"):
        listen_to_topics(NOBODY, 0.3)
