"""Tests of ROS 2 topics over DDS on this computer."""

from __future__ import annotations

import os
import threading
import time
from types import SimpleNamespace

import pytest

from basecal.acquisition.ros2.types import type_hash
from basecal.errors import InputError

pytest.importorskip("cyclonedds")
from basecal.acquisition.ros2.dds import Discovery, Publisher, Subscriber, _publisher_process, choose_domain
from shared.ros2_domain import DOMAIN, LOOPBACK

TEXT = "std_msgs/msg/String"


@pytest.fixture(autouse=True)
def on_this_computer():
    os.environ["CYCLONEDDS_URI"] = LOOPBACK


def said(messages):
    return [message.data for message in messages]


def test_topic_is_offered_like_ros():
    """Name, type, hash and quality of service agree; a late listener receives latched messages."""
    latched = Publisher(DOMAIN, "/latched", TEXT, is_latched=True)
    plain = Publisher(DOMAIN, "/plain", TEXT, is_latched=False)
    latched.send(SimpleNamespace(data="before"))
    plain.send(SimpleNamespace(data="before"))
    offers = Discovery(DOMAIN)
    found = {name: offers.wait_for_topic(name, 5.0) for name in ("/latched", "/plain")}
    assert {name: offer.is_latched for name, offer in found.items()} == {"/latched": True, "/plain": False}
    assert {(offer.kind, offer.type_hash, offer.is_reliable) for offer in found.values()} == {
        (TEXT, type_hash(TEXT), True)
    }
    assert said(Subscriber(DOMAIN, found["/latched"], 5).messages(2.0)) == ["before"]
    late = Subscriber(DOMAIN, found["/plain"], 5)
    began = time.monotonic()
    assert said(late.messages(0.2)) == []
    assert time.monotonic() - began >= 0.2
    plain.send(SimpleNamespace(data="after"))
    assert said(late.messages(2.0)) == ["after"]


@pytest.mark.journey
def test_topic_is_waited_for():
    """A topic published later is found; a missing one is waited for until the timeout."""
    offers, publishers = Discovery(DOMAIN), []
    later = threading.Timer(0.3, lambda: publishers.append(Publisher(DOMAIN, "/later", TEXT, is_latched=False)))
    later.start()
    assert offers.wait_for_topic("/later", 10.0).name == "/later"
    later.join()
    began = time.monotonic()
    assert offers.wait_for_topic("/never", 0.2) is None
    assert time.monotonic() - began >= 0.2


def test_only_newest_messages_are_kept():
    """Without a reader, the requested number of messages is kept: memory stays constant."""
    speaker = Publisher(DOMAIN, "/many", TEXT, is_latched=False, depth=100)
    listener = Subscriber(DOMAIN, Discovery(DOMAIN).wait_for_topic("/many", 5.0), 3)
    for number in range(50):
        speaker.send(SimpleNamespace(data=str(number)))
    heard = said(listener.messages(2.0))
    while more := said(listener.messages(0.2)):
        heard += more
    assert heard[-1] == "49"
    assert len(heard) <= 50


def test_missing_topic_times_out():
    """After the timeout there is none."""
    assert Discovery(DOMAIN).wait_for_topic("/nothing", 0.1) is None


def test_domain_comes_from_the_environment(monkeypatch):
    """It is used if none is stated; an invalid variable is reported."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert (choose_domain(None), choose_domain(3)) == (7, 3)
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert choose_domain(None) == 0
    for wrong in ("x", "-1", "233"):
        monkeypatch.setenv("ROS_DOMAIN_ID", wrong)
        with pytest.raises(InputError, match=r"ROS_DOMAIN_ID is .*: expected a number from 0 to 232"):
            choose_domain(None)


def participant(key, **properties):
    """Participant of a domain with these properties."""
    return SimpleNamespace(key=key, qos=[SimpleNamespace(key=name, value=text) for name, text in properties.items()])


def test_publisher_is_named_by_its_own_process():
    """Of all participants that of the publisher gives its process; without one, the GUID of the publisher is given."""
    present = [
        participant("a", __Pid="11", __ProcessName="camera", __Hostname="left"),
        participant("b", __Pid="22", __ProcessName="arm", __Hostname="right"),
        participant("c"),
    ]
    participants = SimpleNamespace(read=lambda count: present)
    names = [
        _publisher_process(participants, SimpleNamespace(key="7", participant_key=key)) for key in ("a", "b", "c", "d")
    ]
    assert names == ["camera 11 on left", "arm 22 on right", "GUID 7", "GUID 7"]
