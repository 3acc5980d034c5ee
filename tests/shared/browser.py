"""A page in headless Chromium, watched through its own protocol: its words, its console, whom it asks."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import time
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
    words = [CHROMIUM, *FLAGS, f"--user-data-dir={profile}", "--window-size=1100,900", "about:blank"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as process:
        try:
            found = next(match for line in process.stderr if (match := _LISTENS.search(line)))
            return _visited(found[1], address, until)
        finally:
            process.kill()


def _visited(browser: str, address: str, until: str) -> Visit:
    came = Visit()
    with connect(browser, max_size=2**26) as line:
        tab = _Tab(line, came)
        target = tab.ask("Target.createTarget", url="about:blank")["targetId"]
        tab.session = tab.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Network", "Page"):
            tab.ask(f"{domain}.enable")
        tab.ask("Page.navigate", url=address)
        end = time.monotonic() + _LONGEST_S
        is_there = f"document.readyState === 'complete' && document.querySelector({json.dumps(until)}) !== null"
        while time.monotonic() < end and came.answers_s is None:
            came.answers_s = tab.value(f"{is_there} ? performance.now() / 1000 : null")
            time.sleep(0.05)
        came.words = tab.value("document.body.innerText")
    return came


class _Tab:
    def __init__(self, line, came: Visit) -> None:
        self.session, self._line, self._came, self._number = "", line, came, 0

    def ask(self, method: str, **given):
        self._number += 1
        about = {"sessionId": self.session} if self.session else {}
        self._line.send(json.dumps({"id": self._number, "method": method, "params": given, **about}))
        while True:
            message = json.loads(self._line.recv(_LONGEST_S))
            if message.get("id") == self._number:
                return message["result"]
            self._note(message.get("method"), message.get("params", {}))

    def value(self, expression: str):
        return self.ask("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def _note(self, method, params) -> None:
        if method == "Network.requestWillBeSent":
            self._came.asked.append(params["request"]["url"])
        elif method == "Network.webSocketCreated":
            self._came.asked.append(params["url"])
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self._came.errors.append(params["entry"]["text"])
        elif method == "Runtime.exceptionThrown":
            self._came.errors.append(params["exceptionDetails"]["text"])
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
            self._came.errors.append(str(params["args"]))
