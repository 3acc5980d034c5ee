"""A network between a driver and its peer, with faults: a proxy of one TCP port.

As a separate process: `python -m shared.network HOST PORT AT_HOST AT_PORT`, with faults as lines of the standard input.
"""

from __future__ import annotations

import socket
import sys
import threading
import time
from contextlib import contextmanager, suppress


class Network:
    """A proxy that delays data by `delay_s`, holds it while `silent`, or rejects connections while `refuses`."""

    def __init__(self, server, host, port):
        self.server, self.to = server, (host, port)
        self.delay_s, self.silent, self.refuses = 0.0, False, False
        self.lines = []

    def cut(self):
        """Close every connection, as after the timeouts of a switch that is off."""
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
            peer = socket.create_connection(self.to)
            self.lines += [line, peer]
            for source, sink in ((line, peer), (peer, line)):
                threading.Thread(target=self._pass, args=(source, sink), daemon=True).start()

    def _pass(self, source, sink):
        with source, suppress(OSError):
            while data := source.recv(65536):
                if self.delay_s:
                    time.sleep(self.delay_s)
                while self.silent:
                    time.sleep(0.01)
                sink.sendall(data)
            sink.shutdown(socket.SHUT_RDWR)


@contextmanager
def network(host, port, address=("127.0.0.1", 0)):
    """A proxy of a port of a host, and the port of the proxy."""
    with socket.create_server(address) as server:
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
    """Run the proxy in a separate process: some clients hold the interpreter while they wait for an answer."""
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
