"""A wire between two hosts, each a process with its own network, that delays and reorders packets.

UDP peers choose their own ports, so that a proxy of one port cannot be used. Here each host has a network namespace
with one device (TUN), whose packets this process transfers. As a separate process:
`python -m shared.wire SOCKET ADDRESS MODULE WORDS`, which sends its device over the socket, and runs the module.
"""

from __future__ import annotations

import ctypes
import fcntl
import heapq
import os
import random
import runpy
import selectors
import socket
import struct
import sys
import threading
import time
from contextlib import ExitStack, contextmanager

from shared.second_process import second_process

CLONE_NEWUSER, CLONE_NEWNET = 0x10000000, 0x40000000
TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
SIOCSIFADDR, SIOCSIFNETMASK, SIOCSIFFLAGS, IFF_UP = 0x8916, 0x891C, 0x8914, 0x1
DEVICE = "wire0"


class Wire:
    """A carrier between two devices: a share of the packets waits, and others overtake them."""

    def __init__(self, devices, late, most_s, seed=0):
        self.devices, self.late, self.most_s = devices, late, most_s
        self.random, self.waiting = random.Random(seed), []
        self.sent, self.overtaken, self.running = 0, 0, True

    def run(self):
        opposite = dict(zip(self.devices, reversed(self.devices), strict=True))
        with selectors.DefaultSelector() as selector:
            for device in self.devices:
                selector.register(device, selectors.EVENT_READ)
            while self.running:
                for key, _ in selector.select(timeout=0.001):
                    self._take(os.read(key.fd, 65536), opposite[key.fd])
                self._deliver()

    def _take(self, packet, device):
        wait_s = self.random.uniform(0, self.most_s) if self.random.random() < self.late else 0.0
        heapq.heappush(self.waiting, (time.monotonic() + wait_s, self.sent, device, packet))
        self.sent += 1

    def _deliver(self):
        while self.waiting and self.waiting[0][0] <= time.monotonic():
            _, number, to, packet = heapq.heappop(self.waiting)
            self.overtaken += any(other < number and device == to for _, other, device, _ in self.waiting)
            os.write(to, packet)


@contextmanager
def wire(late, most_s, *hosts):
    """Two processes, `(module, words, environment)` each, at `10.7.0.1` and `10.7.0.2`, and the wire between them.

    A share `late` of the packets waits for at most `most_s`. A PermissionError means that processes of this computer
    may not have their own network.
    """
    with ExitStack() as stack:
        processes, devices = [], []
        for number, (module, words, environment) in enumerate(hosts, 1):
            ours, theirs = socket.socketpair()
            command = (theirs.fileno(), f"10.7.0.{number}", module, *words)
            entered = second_process("shared.wire", *command, pass_fds=(theirs.fileno(),), **environment)
            processes.append(stack.enter_context(entered))
            theirs.close()
            with ours:
                said, files, _, _ = socket.recv_fds(ours, 1024, 1)
            if not files:
                raise PermissionError(said.decode())
            devices += files
            stack.callback(os.close, files[0])
            processes[-1].tell("go")
        between = Wire(devices, late, most_s)
        thread = threading.Thread(target=between.run, daemon=True)
        thread.start()
        try:
            yield between, *processes
        finally:
            between.running = False
            thread.join(timeout=5)


def own_network(address):
    """Move this process into its own network, and return the file of its only device."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(CLONE_NEWNET if os.geteuid() == 0 else CLONE_NEWUSER | CLONE_NEWNET):
        raise PermissionError(f"no network namespace: {os.strerror(ctypes.get_errno())}")
    device = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH22x", DEVICE.encode(), IFF_TUN | IFF_NO_PI))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        for request, number in ((SIOCSIFADDR, address), (SIOCSIFNETMASK, "255.255.255.0")):
            inet = struct.pack("16sHH4s8x", DEVICE.encode(), socket.AF_INET, 0, socket.inet_aton(number))
            fcntl.ioctl(control, request, inet)
        for name in (DEVICE, "lo"):
            fcntl.ioctl(control, SIOCSIFFLAGS, struct.pack("16sH22x", name.encode(), IFF_UP))
    return device


def main(descriptor, address, module, *words):
    """Run the module in its own network, whose device is sent over the socket with this descriptor."""
    print("ready", flush=True)
    with socket.socket(fileno=int(descriptor)) as parent:
        try:
            device = own_network(address)
        except OSError as error:
            parent.send(str(error).encode())
            return
        socket.send_fds(parent, [b"device"], [device])
        os.close(device)
    print(sys.stdin.readline().strip(), flush=True)
    sys.argv = [module, *words]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
