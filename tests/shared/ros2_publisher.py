"""Messages of ROS 2 drivers, from a separate process: `python -m shared.ros2_publisher DOMAIN [HZ HZ W H]`.

The rates are those of joint states and of images of W x H pixels. Joint states contain their own stamp as positions,
images as the values of their first pixels. A reader can thus check that each message has its own stamp. Lines on the
standard input are faults.
"""

from __future__ import annotations

import sys
import threading
import time
from types import SimpleNamespace as Message

import numpy as np

from basecal.acquisition.ros2.dds import Publisher as TopicPublisher
from basecal.exchange.urdf import chain_urdf
from basecal.simulation.running.ur5e import ur5e

CHAIN = ur5e()
JOINTS = CHAIN.joint_names
HALF_TURN = (0.0, 0.0, 1.0, 0.0)


def header(stamp_ns, frame_id=""):
    return Message(stamp=Message(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9), frame_id=frame_id)


def positions(stamp_ns):
    """Joints within 1000 rad that contain their own stamp, in units of 1e8, 1e5, 100 and 0.01 seconds."""
    sec, nanosec = divmod(stamp_ns, 10**9)
    return np.array([sec // 10**8, sec // 10**5 % 1000, sec % 10**5 / 100, nanosec * 1e-7, 0.5, 1.0])


def joint_state(stamp_ns, names=JOINTS):
    backwards = slice(None, None, -1)  # drivers sort joints by name, not along the arm
    none = np.zeros(0)
    return Message(
        header=header(stamp_ns),
        name=["gripper", *list(names)[backwards]],
        position=np.array([0.04, *positions(stamp_ns)[backwards]]),
        velocity=none,
        effort=none,
    )


def image(stamp_ns, width, height, ground):
    """A grey image whose first eight pixels contain its stamp."""
    data = ground.copy()
    data[:8] = np.frombuffer(stamp_ns.to_bytes(8, "big"), np.uint8)
    return Message(
        header=header(stamp_ns, "wrist"),
        height=height,
        width=width,
        encoding="mono8",
        is_bigendian=0,
        step=width,
        data=data,
    )


def camera_info(stamp_ns, width, height):
    zero = Message(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    k = np.array([900.0, 0, (width - 1) / 2, 0, 900, (height - 1) / 2, 0, 0, 1])
    p = np.insert(k.reshape(3, 3), 3, 0, axis=1).ravel()
    return Message(
        header=header(stamp_ns, "wrist"), height=height, width=width, distortion_model="plumb_bob", d=np.zeros(5), k=k,
        r=np.eye(3).ravel(), p=p, binning_x=0, binning_y=0, roi=zero,
    )  # fmt: skip


def transform(stamp_ns, parent, child, x, q=(0.0, 0.0, 0.0, 1.0)):
    t = Message(translation=Message(x=x, y=0.0, z=0.0), rotation=Message(**dict(zip("xyzw", q, strict=True))))
    return Message(header=header(stamp_ns, parent), child_frame_id=child, transform=t)


class Publisher:
    def __init__(self, domain, joints_hz, images_hz, width, height):
        self.rates = {"joints": joints_hz, "images": images_hz}
        self.width, self.height = width, height
        self.ground = (np.arange(width * height) % 251).astype(np.uint8)
        self.frozen, self.partial, self.running = False, False, True
        self.sent = {"joints": 0, "images": 0}
        latched = {"is_latched": True, "depth": 10}
        plain = {"is_latched": False}
        self.joints = TopicPublisher(domain, "/joint_states", "sensor_msgs/msg/JointState", depth=50, **plain)
        self.tf = TopicPublisher(domain, "/tf", "tf2_msgs/msg/TFMessage", depth=50, **plain)
        self.images = TopicPublisher(domain, "/wrist/image_raw", "sensor_msgs/msg/Image", **plain)
        self.infos = TopicPublisher(domain, "/wrist/camera_info", "sensor_msgs/msg/CameraInfo", **plain)
        self.static = TopicPublisher(domain, "/tf_static", "tf2_msgs/msg/TFMessage", **latched)
        static_transforms = [transform(1, "link", "tool0", 0.25, HALF_TURN), transform(1, "tool0", "wrist", 0.1)]
        self.static.send(Message(transforms=static_transforms))
        self.description = TopicPublisher(domain, "/robot_description", "std_msgs/msg/String", **latched)
        self.description.send(Message(data=chain_urdf(CHAIN, "base_link", "tool0")))
        self.stopped_ns = time.time_ns()

    def now_ns(self):
        return self.stopped_ns if self.frozen else time.time_ns()

    def send_joints(self):
        stamp_ns = self.now_ns()
        self.joints.send(joint_state(stamp_ns, JOINTS[:3] if self.partial else JOINTS))
        x = stamp_ns % 10**9 * 1e-9
        self.tf.send(Message(transforms=[transform(stamp_ns, "base_link", "link", x)]))

    def send_image(self):
        stamp_ns = self.now_ns()
        self.images.send(image(stamp_ns, self.width, self.height, self.ground))
        self.infos.send(camera_info(stamp_ns, self.width, self.height))

    def repeat(self, name, send):
        due = time.monotonic()
        while self.running:
            rate = self.rates[name]
            due = max(due + 1 / rate, time.monotonic() - 1.0) if rate else time.monotonic() + 0.05
            time.sleep(max(0.0, due - time.monotonic()))
            if rate:
                send()
                self.sent[name] += 1

    def obey(self, words):
        """Obey a line, and return the answer."""
        word, *rest = words
        if word == "sent":
            return f"{self.sent['joints']} {self.sent['images']}"
        if word == "rate":
            self.rates[rest[0]] = float(rest[1])
        elif word == "freeze":
            self.stopped_ns, self.frozen = time.time_ns(), rest == ["on"]
        elif word == "partial":
            self.partial = rest == ["on"]
        return "ok"


def main(domain, joints_hz=100.0, images_hz=30.0, width=64, height=48):
    publisher = Publisher(int(domain), float(joints_hz), float(images_hz), int(width), int(height))
    for name, send in (("joints", publisher.send_joints), ("images", publisher.send_image)):
        threading.Thread(target=publisher.repeat, args=(name, send), daemon=True).start()
    print("ready", flush=True)
    for line in sys.stdin:
        print(publisher.obey(line.split()), flush=True)
    publisher.running = False


if __name__ == "__main__":
    main(*sys.argv[1:])
