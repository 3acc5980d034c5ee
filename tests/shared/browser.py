"""Pages in headless Chromium, watched through its own protocol: words, console, requests, images."""

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
_LONGEST_S = 60  # beside other programs
_LISTENS = re.compile(r"DevTools listening on (ws://\S+)")


@dataclass
class Visit:
    """What came of a visit: errors of the console, addresses that were asked for, words.

    `answers_s` is the time from the start of loading until all was loaded and scripts had the time to answer.
    """

    errors: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)
    words: str = ""
    answers_s: float | None = None


def visit(address: str, profile: Path, until: str) -> Visit:
    """A visit to a page, until it holds an element (by its selector) or a minute is over."""
    with browsing(profile) as tab:
        tab.go(address, until)
        return tab.visit


@contextmanager
def browsing(profile: Path, width: int = 1100, height: int = 900) -> Iterator[Tab]:
    """A tab of a browser with a profile of its own, in a window of a size [px]."""
    words = [CHROMIUM, *FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            found = next(match for line in process.stderr if (match := _LISTENS.search(line)))
            with connect(found[1], max_size=2**28) as line:
                yield Tab(line)
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # its children, too, which write into the profile


class Tab:
    """A tab; `visit` is what came of the last page."""

    def __init__(self, line) -> None:
        self.visit = Visit()
        self._session, self._line, self._number = "", line, 0
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Network", "Page"):
            self.ask(f"{domain}.enable")

    def go(self, address: str, until: str = "body") -> Visit:
        """Load a page until it holds an element, by its selector."""
        self.visit = Visit()
        self.ask("Page.navigate", url=address)
        end = time.monotonic() + _LONGEST_S
        there = json.dumps(address.partition("?")[0].partition("#")[0])
        is_there = f"document.readyState === 'complete' && document.querySelector({json.dumps(until)}) !== null"
        is_there += f" && location.href.startsWith({there})"
        while time.monotonic() < end and self.visit.answers_s is None:
            self.visit.answers_s = self.value(f"{is_there} ? performance.now() / 1000 : null")
            time.sleep(0.05)
        self.visit.words = self.value("document.body.innerText")
        return self.visit

    def resize(self, width: int, height: int, scheme: str = "light") -> None:
        """Show pages at a size [px], light or dark."""
        self.ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 500
        )
        self.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def picture(self, path: Path, whole: bool = True) -> None:
        """A PNG of the page, or of its first screen."""
        taken = self.ask(
            "Page.captureScreenshot", captureBeyondViewport=whole, **({"clip": self._clip()} if whole else {})
        )
        path.write_bytes(base64.b64decode(taken["data"]))

    def _clip(self) -> dict[str, float]:
        size = self.ask("Page.getLayoutMetrics")["cssContentSize"]
        return {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}

    def paper(self, path: Path) -> None:
        """The page as a printer gets it, a PDF."""
        path.write_bytes(base64.b64decode(self.ask("Page.printToPDF", preferCSSPageSize=True)["data"]))

    def ask(self, method: str, **given):
        """The answer of the browser to a command of its protocol."""
        self._number += 1
        about = {"sessionId": self._session} if self._session else {}
        self._line.send(json.dumps({"id": self._number, "method": method, "params": given, **about}))
        while True:
            message = json.loads(self._line.recv(_LONGEST_S))
            if message.get("id") == self._number:
                return message["result"]
            self._note(message.get("method"), message.get("params", {}))

    def value(self, expression: str):
        """The value of an expression of JavaScript in the page."""
        asked = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        return asked["result"].get("value")

    def _note(self, method, params) -> None:
        if method == "Network.requestWillBeSent":
            self.visit.asked.append(params["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.visit.asked.append(params["url"])
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.visit.errors.append(params["entry"]["text"])
        elif method == "Runtime.exceptionThrown":
            self.visit.errors.append(params["exceptionDetails"]["text"])
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
            self.visit.errors.append(str(params["args"]))
