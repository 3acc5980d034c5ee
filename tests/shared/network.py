"""A network between a driver and what it talks to, with faults: a proxy of one TCP port.

As a process of its own: `python -m shared.network HOST PORT AT_HOST AT_PORT`, faults being lines on the standard input.
"""

from __future__ import annotations

import socket
import sys
import threading
import time
from contextlib import contextmanager, suppress


class Network:
    """What passes a port: late by `delay_s`, or not at all while it is `silent`; `cut` ends all lines."""

    def __init__(self, server, host, port):
        self.server, self.to = server, (host, port)
        self.delay_s, self.silent, self.refuses = 0.0, False, False
        self.lines = []

    def cut(self):
        """End every line, as a switch that is switched off does once its timeouts are over."""
        lines, self.lines = self.lines, []
        for line in lines:
            with suppress(OSError):
                line.shutdown(socket.SHUT_RDWR)

    def run(self):
        while True:
            try:
                line, _ = self.server.accept()
            except OSError:
                return
            if self.refuses:
                line.close()
                continue
            other = socket.create_connection(self.to)
            self.lines += [line, other]
            for one, two in ((line, other), (other, line)):
                threading.Thread(target=self._pass, args=(one, two), daemon=True).start()

    def _pass(self, one, two):
        with one, suppress(OSError):
            while data := one.recv(65536):
                if self.delay_s:
                    time.sleep(self.delay_s)
                while self.silent:
                    time.sleep(0.01)
                two.sendall(data)
            two.shutdown(socket.SHUT_RDWR)


@contextmanager
def network(host, port, at=("127.0.0.1", 0)):
    """A network before a host's port, and the port at which it is reached."""
    with socket.create_server(at) as server:
        net = Network(server, host, port)
        thread = threading.Thread(target=net.run, daemon=True)
        thread.start()
        try:
            yield net, server.getsockname()[1]
        finally:
            server.shutdown(socket.SHUT_RDWR)
            net.cut()
            thread.join(timeout=5)


def main(host, port, at_host, at_port):
    """A network in a process of its own: some clients hold Python while they wait for an answer."""
    with network(host, int(port), (at_host, int(at_port))) as (net, _):
        print("ready", flush=True)
        for line in sys.stdin:
            word, *rest = line.split()
            if word == "delay":
                net.delay_s = float(rest[0])
            elif word == "silent":
                net.silent = rest == ["on"]
            elif word == "cut":
                net.cut()
            print("ok", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
