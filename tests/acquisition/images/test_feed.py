"""Tests of live cameras that are read continuously."""

from __future__ import annotations

import re
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from basecal.acquisition.driver import Camera, CameraImage, Switches
from basecal.acquisition.images.feed import CameraFeed, feed_camera
from basecal.acquisition.images.latency import ArmMotion, Latency
from basecal.acquisition.stillness import Moving, wait_for_image_after
from basecal.errors import DriverError

pytestmark = pytest.mark.timed

SIZE = (120, 160)
GROUND = 40 + cv2.GaussianBlur(np.random.default_rng(0).integers(0, 170, SIZE).astype(np.uint8), (0, 0), 2.0)
NOISE = np.random.default_rng(1).integers(0, 3, (50, *SIZE)).astype(np.uint8)


class Film:
    """Camera with an image every 10 ms; images slide while `slides` is set."""

    is_live = True

    def __init__(self, period_s=0.01, slides=lambda now_s: False):
        self.period_s, self.slides, self.asked, self.closed, self.columns = period_s, slides, 0, False, 0

    def image(self):
        time.sleep(self.period_s)
        self.asked += 1
        now_s = time.monotonic()
        self.columns += 5 * self.slides(now_s)
        return CameraImage(now_s, np.roll(GROUND, self.columns, axis=1) + NOISE[self.asked % len(NOISE)])

    def close(self):
        self.closed = True


@pytest.fixture
def opened():
    """Feeds of cameras, closed at the end."""
    feeds = []

    def feed(camera, arms=None):
        feeds.append(feed_camera("wrist", camera, arms or ArmMotion()))
        return feeds[-1]

    yield feed
    for each in feeds:
        each.close()


def test_newest_image_is_returned(opened):
    """Images that arrived during a pause are skipped, except one that is a few periods old."""
    feed = opened(Film())
    feed.image()
    time.sleep(0.3)
    began_s = time.monotonic()
    assert feed.image().stamp_s > began_s - 0.1
    assert isinstance(feed, Camera)
    assert not isinstance(feed, Switches)


def test_cameras_with_exposure_on_request_are_not_polled(opened):
    """Such cameras, and those served by a person, are read only when an image is required."""
    asked, served = Film(), Film()
    asked.is_on_demand, served.is_live = True, False
    assert opened(asked) is asked
    assert opened(served) is served


def test_latency_is_two_seconds_until_measured(opened):
    """Before any motion, an image counts as exposed two seconds before its arrival."""
    image = opened(Film()).image()
    assert image.exposed_s == pytest.approx(image.stamp_s - 2.0, abs=0.1)
    assert image.note == ""


def test_latency_is_measured_from_the_arms_motion(opened):
    """Images that slide 0.2 s after the arms have that latency; it is reported once, and kept."""
    arms, begin_s = ArmMotion(), time.monotonic() + 0.3
    end_s = begin_s + 0.3
    feed = opened(Film(slides=lambda now_s: begin_s < now_s - 0.2 < end_s), arms)
    time.sleep(max(0.0, end_s + 0.3 - time.monotonic()))
    arms.spans = ((begin_s, end_s),)
    image = feed.image()
    assert 0.19 <= image.stamp_s - image.exposed_s < 0.35  # the latency has a sigma of 0.01 s
    assert "wrist: images arrive 0.2" in image.note
    arms.forget()
    again = feed.image()
    assert again.stamp_s - again.exposed_s < 0.35
    assert again.note == ""


def test_older_images_are_skipped(opened):
    """The image after an instant was exposed after it; a missing one is reported."""
    feed, now_s = opened(Film()), time.monotonic()
    assert wait_for_image_after(feed, now_s - 1.8, 5.0).exposed_s > now_s - 1.8
    with pytest.raises(Moving, match="image too old"):
        wait_for_image_after(feed, now_s + 1000, 0.1)


def test_buffered_images_are_skipped(opened):
    """Images that arrive without a wait, after waits for others, are old and not returned."""

    class Buffered(Film):
        def image(self):
            self.period_s = 0.0 if 10 < self.asked < 15 else 0.02
            return replace(super().image(), source=str(self.asked))

    film, given = Buffered(), []
    feed = opened(film)
    while film.asked < 30:
        given.append(int(feed.image().source))
    assert not {12, 13, 14, 15} & set(given)


def test_late_images_of_stamped_cameras_are_reported(opened):
    """An image older than a previous one is not returned; its file is reported."""

    class Stamped(Film):
        is_stamped = True

        def image(self):
            came = super().image()
            late_s = 5.0 if self.asked == 3 else 0.0
            return CameraImage(came.stamp_s - 1000.0 - late_s, came.grey, source=f"{self.asked}.png")

    film = Stamped()
    feed = opened(film)
    while film.asked < 5:
        time.sleep(0.01)
    image = feed.image()
    assert image.note == "camera wrist: 3.png came after a newer one; not used"
    assert image.exposed_s == pytest.approx(image.stamp_s + 1000.0 - 2.0, abs=0.1)


def test_many_late_images_are_one_note(opened):
    """Copies of old images between new ones are counted, and the count starts again with each report."""

    class Copying(Film):
        is_stamped = True

        def image(self):
            came = super().image()
            late_s = 60.0 if self.asked % 2 else 0.0
            return CameraImage(came.stamp_s - late_s, came.grey, source=f"{self.asked}.png")

    film = Copying(0.002)
    feed = opened(film)
    for _ in range(2):
        asked = film.asked + 40
        while film.asked < asked:
            time.sleep(0.01)
        note = feed.image().note
        count = int(re.fullmatch(r"camera wrist: (\d+) images came .*; not used\. The last is \d+\.png", note)[1])
        assert 15 < count < 40


def test_clock_that_goes_back_is_reported(opened, monkeypatch):
    """Images that stay older are no copies; until this is certain, the last ones are reported."""

    class SteppedBack(Film):
        is_stamped, wait_s = True, 0.3

        def image(self):
            came = super().image()
            return CameraImage(came.stamp_s - 3600.0 * (self.asked > 1), came.grey, source=f"{self.asked}.png")

    feed = opened(SteppedBack())
    feed.image()
    with pytest.raises(
        DriverError,
        match=r"no image came within 0\.3 s; .* \d+ images came after newer ones; not used\. The last is \d+\.png$",
    ):
        feed.image()
    monkeypatch.setattr("basecal.acquisition.images.feed._LATE_S", 0.1)
    with pytest.raises(DriverError, match=r"^wrist: the last \d+ images are older .* The clock of the camera went"):
        feed.image()


def test_error_is_raised_to_the_waiting_caller(opened):
    """An error of the driver is raised unchanged.

    An error while no caller waits is forgotten, and the driver is asked again.
    """

    class Ends(Film):
        def image(self):
            if self.asked == 2 and not self.closed:
                raise DriverError("pulled out")
            return super().image()

    film = Ends()
    feed = opened(film)
    feed.image()
    with pytest.raises(DriverError, match="pulled out"):
        [feed.image() for _ in range(3)]
    film.asked = 0
    assert feed.image().grey.shape == SIZE


def test_library_error_names_the_camera(opened):
    """An error of a maker's library is a driver error with its message."""

    class Unplugged(Film):
        def image(self):
            raise RuntimeError("Frame did not arrive")

    feed = opened(Unplugged())
    with pytest.raises(DriverError, match=r"^wrist: its driver failed \(RuntimeError: Frame did not arrive\)$"):
        feed.image()


def test_frozen_camera_is_reported(opened):
    """A driver that does not return is reported in time, and is not closed while it waits."""

    class Frozen(Film):
        wait_s = 0.1

        def image(self):
            thawed.wait()
            return super().image()

    thawed, film = threading.Event(), Frozen()
    feed = opened(film)
    with pytest.raises(DriverError, match=r"wrist: no image came within 0\.1 s"):
        feed.image()
    thawed.set()
    feed.close()
    assert film.closed


def test_led_is_switched_between_images(opened):
    """The reading thread switches it, so that a driver serves one thread; it is done on return."""

    class Lit(Film):
        def light(self, on):
            self.fit_light, self.thread = on, threading.current_thread()

    film = Lit()
    feed = opened(film)
    assert isinstance(feed, Switches)
    feed.light(False)
    assert film.fit_light is False
    assert film.thread is not threading.current_thread()


def test_continuous_saving_is_distinguished_from_a_person(opened):
    """Continuously saved files allow a check of rest; a file saved by a person counts from its time."""
    often, seldom = Film(0.02), Film(0.0)
    for film in (often, seldom):
        film.is_live, film.is_on_demand, film.is_stamped = False, False, True
    seldom.image = lambda: time.sleep(0.8) or Film().image()
    assert opened(often).is_live
    by_hand = opened(seldom)
    image = by_hand.image()
    assert not by_hand.is_live
    assert image.exposed_s == pytest.approx(image.stamp_s, abs=0.1)


@pytest.mark.parametrize(("ago_s", "is_live"), [
    ([4.9, 3, 2, 1], True), ([5.1, 3, 2, 1], False), ([99, 4.9, 3, 2, 1], True), ([3, 2, 1], False), ([], False),
])  # fmt: skip
def test_four_images_in_five_seconds_are_a_stream(ago_s, is_live):
    """Such files are saved by a program; fewer or slower ones by a person."""
    now_s, feed = time.monotonic(), CameraFeed.__new__(CameraFeed)
    feed._changed, feed._camera, feed._began_s = threading.Condition(), SimpleNamespace(is_live=False), now_s - 9.0
    feed._arrivals = [(now_s - each, False) for each in ago_s]
    assert feed.is_live == is_live
    feed._camera.is_live = True
    assert feed.is_live


@pytest.mark.parametrize(("is_live", "age_s", "waits"), [(False, 0.0, True), (False, 9.0, False), (True, 0.0, False)])
def test_only_a_new_feed_waits_for_a_stream(is_live, age_s, waits):
    """A camera that is not live by its driver waits in its first one and a half seconds only."""
    waited = []

    class Condition(threading.Condition):  # type: ignore[misc]
        """Condition that records its waiting times."""

        def wait_for(self, predicate, timeout=None):
            waited.append((timeout, predicate()))
            return False

    feed = CameraFeed.__new__(CameraFeed)
    feed._changed, feed._camera = Condition(), SimpleNamespace(is_live=is_live)
    feed._began_s, feed._arrivals = time.monotonic() - age_s, [(time.monotonic(), False)] * 3
    assert feed.is_live == is_live
    assert len(waited) == waits
    for timeout, is_stream in waited:
        assert 1.0 < timeout <= 1.5
        assert not is_stream


def unread(arms=None, **fields):
    """Feed without a thread, with an image every tenth of a second."""
    feed = CameraFeed.__new__(CameraFeed)
    feed._name, feed._arms, feed._changed = "wrist", arms or ArmMotion(), threading.Condition()
    feed._latencies, feed._reported, feed._notes, feed._late_count = {}, None, [], 0
    feed._waits_s, feed._late_s, feed._last_s, feed._is_stamped = [], [], -np.inf, True
    feed._camera, feed._requested_light = SimpleNamespace(is_live=True), None
    feed._began_s, feed._arrivals = time.monotonic() - 9.0, []
    for name, value in fields.items():
        setattr(feed, name, value)
    return feed


@pytest.mark.parametrize(
    ("interval_s", "count", "bound_s"), [(0.1, 20, 2.0), (0.5, 20, 6.0), (0.5, 1, 2.0), (0.5, 0, 2.0)]
)
def test_unknown_latency_is_two_seconds_or_twelve_images(interval_s, count, bound_s):
    """The longer counts; a camera that is not live has none."""
    arrivals = np.column_stack([interval_s * np.arange(count), np.zeros(count)])
    assert unread()._latency_s(arrivals) == pytest.approx(bound_s)
    old = unread(_camera=SimpleNamespace(is_live=False))
    assert old._latency_s(arrivals) == 0.0


@pytest.mark.parametrize("person_s", [(), (0.1, 1.2)])
def test_images_since_the_first_motion_count(person_s):
    """Images that move 0.04 s after the arms have that latency, whatever moved before the arms did."""
    at_s = np.arange(0.0, 4.0, 0.03)
    spans_s = [(1.54, 2.14), *([person_s] if person_s else [])]
    moves = [any(begin <= each <= end for begin, end in spans_s) for each in at_s]
    arms = ArmMotion()
    arms.spans = ((1.5, 2.1),)
    feed = unread(arms)
    assert 0.04 <= feed._latency_s(np.column_stack([at_s, moves])) < 0.1


def test_last_three_latencies_count():
    """The largest counts, also before the next motion; during motions the assumed latency is the minimum."""
    known = {float(k): Latency(0.0, high) for k, high in enumerate((9.0, 0.3, 0.4, 0.2))}
    arrivals = np.column_stack([0.1 * np.arange(20), np.zeros(20)])
    assert unread(_latencies=known)._latency_s(arrivals) == 0.4
    moving = ArmMotion()
    moving.spans = ((0.5, 0.8),)
    assert unread(moving, _latencies=known)._latency_s(arrivals) == 2.0


def test_increased_latency_is_reported():
    """It is reported beyond all earlier upper bounds."""
    feed = unread()
    for low_s, high_s in ((0.1, 0.2), (0.15, 0.3), (0.05, 0.1), (0.3, 0.4)):
        feed._report(Latency(low_s, high_s))
    assert feed._notes == [
        "camera wrist: images arrive 0.15 +- 0.05 s after exposure (measured)",
        "camera wrist: images arrive 0.35 +- 0.05 s after exposure, 0.15 +- 0.05 s before (measured)",
    ]


@pytest.mark.parametrize(("times_s", "is_error"), [
    ((0.0, 0.1, 0.2, 1.9), False), ((0.0, 2.1), False), ((0.0, 0.1, 2.1), True), ((0.0, 2.0, 2.05), True),
])  # fmt: skip
def test_three_older_images_in_two_seconds_mean_a_clock_step(monkeypatch, times_s, is_error):
    """Fewer, or within less time, were late; an image in order resets the count."""
    feed, clock = unread(), iter(times_s)
    monkeypatch.setattr("basecal.acquisition.images.feed.time", SimpleNamespace(monotonic=lambda: next(clock)))
    assert not feed._is_outdated(SimpleNamespace(stamp_s=5.0), 0.1)
    late = SimpleNamespace(stamp_s=4.9, source="a.png")
    assert all(feed._is_outdated(late, 0.1) for _ in times_s[:-1])
    if is_error:
        with pytest.raises(DriverError, match=f"wrist: the last {len(times_s)} images are older"):
            feed._is_outdated(late, 0.1)
    else:
        assert feed._is_outdated(late, 0.1)
        assert feed._late_count == len(times_s)
        assert feed._late_source == "a.png"
        assert not feed._is_outdated(SimpleNamespace(stamp_s=5.0), 0.1)
        assert feed._late_s == []


def test_leds_are_switched_once():
    """They are switched if a state is requested and the camera can switch."""
    switched = []

    class Lamp:
        """Camera with an LED."""

        def light(self, on):
            switched.append(on)

    feed = unread(_camera=Lamp())
    for state in (None, True, False):
        feed._requested_light = state
        feed._switch_led()
        feed._switch_led()
        assert feed._requested_light is None
    assert switched == [True, False]
    plain = unread(_requested_light=True)
    plain._switch_led()
    assert plain._requested_light is None
