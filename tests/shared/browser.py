"""Pages in headless Chromium, observed through its protocol: text, console, requests, images."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from websockets.sync.client import connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--remote-debugging-port=0")
_LONGEST_S = 60  # while other programs use the machine
_LISTENS = re.compile(r"DevTools listening on (ws://\S+)")


@dataclass
class Visit:
    """Result of a visit: errors of the console, requested addresses, and the text of the page.

    `answers_s` is the time from the start of loading until all is loaded and the scripts answer.
    """

    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    words: str = ""
    answers_s: float | None = None


def visit(address: str, profile: Path, selector: str) -> Visit:
    """Visit a page until it holds an element, given by its selector, or a minute is over."""
    with browsing(profile) as tab:
        tab.go(address, selector)
        return tab.visit


@contextmanager
def browsing(profile: Path, width: int = 1100, height: int = 900) -> Iterator[Tab]:
    """A tab of a browser with its own profile, in a window of a size [px]."""
    command = [CHROMIUM, *FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            address = next(match for line in process.stderr if (match := _LISTENS.search(line)))
            with connect(address[1], max_size=2**28) as line:
                yield Tab(line)
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # its children, too, which write into the profile


class Tab:
    """A tab; `visit` is the result for the last page."""

    def __init__(self, line) -> None:
        self.visit = Visit()
        self._session, self._line, self._number = "", line, 0
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Network", "Page"):
            self.ask(f"{domain}.enable")

    def go(self, address: str, selector: str = "body") -> Visit:
        """Load a page until it holds an element, given by its selector."""
        self.visit = Visit()
        self.ask("Page.navigate", url=address)
        end = time.monotonic() + _LONGEST_S
        expected_address = json.dumps(address.partition("?")[0].partition("#")[0])
        is_there = f"document.readyState === 'complete' && document.querySelector({json.dumps(selector)}) !== null"
        is_there += f" && location.href.startsWith({expected_address})"
        while time.monotonic() < end and self.visit.answers_s is None:
            self.visit.answers_s = self.value(f"{is_there} ? performance.now() / 1000 : null")
            time.sleep(0.05)
        self.visit.words = self.value("document.body.innerText")
        return self.visit

    def resize(self, width: int, height: int, scheme: str = "light") -> None:
        """Show pages at a size [px], in light or dark."""
        self.ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500
        )
        self.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def screenshot(self, path: Path, full_page: bool = True) -> None:
        """Save a PNG of the page, or of its first screen."""
        capture = self.ask(
            "Page.captureScreenshot", captureBeyondViewport=full_page, **({"clip": self._clip()} if full_page else {})
        )
        path.write_bytes(base64.b64decode(capture["data"]))

    def _clip(self) -> dict[str, float]:
        size = self.ask("Page.getLayoutMetrics")["cssContentSize"]
        return {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}

    def print_pdf(self, path: Path) -> None:
        """Save the page as a PDF, as it is printed."""
        path.write_bytes(base64.b64decode(self.ask("Page.printToPDF", preferCSSPageSize=True)["data"]))

    def ask(self, method: str, **parameters):
        """Send a command of the browser's protocol, and return its answer."""
        self._number += 1
        session = {"sessionId": self._session} if self._session else {}
        self._line.send(json.dumps({"id": self._number, "method": method, "params": parameters, **session}))
        while True:
            message = json.loads(self._line.recv(_LONGEST_S))
            if message.get("id") == self._number:
                return message["result"]
            self._note(message.get("method"), message.get("params", {}))

    def value(self, expression: str):
        """Value of a JavaScript expression in the page."""
        answer = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        return answer["result"].get("value")

    def _note(self, method, params) -> None:
        if method == "Network.requestWillBeSent":
            self.visit.requests.append(params["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.visit.requests.append(params["url"])
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.visit.errors.append(params["entry"]["text"])
        elif method == "Runtime.exceptionThrown":
            self.visit.errors.append(params["exceptionDetails"]["text"])
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
            self.visit.errors.append(str(params["args"]))
