"""A headless Chromium driven over the DevTools protocol through a pipe: no port, no package.

Messages are JSON, each ended by a zero byte, on file descriptors 3 (in) and 4 (out) of the browser.
"""

from __future__ import annotations

import fcntl
import itertools
import json
import os
import select
import shutil
import time
from pathlib import Path
from typing import Any

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--remote-debugging-pipe",
)
_PATIENCE_S = 60.0


def find_browser() -> str | None:
    """Path of a Chromium: that of TOWVAL_BROWSER, or one by its usual names; None where there is none."""
    for name in (os.environ.get("TOWVAL_BROWSER", ""), *_NAMES):
        if name and (path := shutil.which(name)):
            return path
    return None


class Browser:
    """One page of one browser, whose settings are kept in the folder ``profile``; use it as a context manager.

    Raises `FileNotFoundError` where there is no Chromium.
    """

    def __init__(self, profile: Path):
        program = find_browser()
        if program is None:
            raise FileNotFoundError("no Chromium found: install chromium, or set TOWVAL_BROWSER to its path")
        to_read, self._write = _high_pipe()
        self._read, to_write = _high_pipe()
        actions: list[tuple[Any, ...]] = [(os.POSIX_SPAWN_DUP2, to_read, 3), (os.POSIX_SPAWN_DUP2, to_write, 4)]
        actions += [(os.POSIX_SPAWN_OPEN, stream, os.devnull, os.O_WRONLY, 0) for stream in (1, 2)]
        arguments = [program, *_FLAGS, f"--user-data-dir={profile}", "about:blank"]
        self._process = os.posix_spawn(program, arguments, os.environ, file_actions=actions)
        os.close(to_read)
        os.close(to_write)
        self._buffer, self._numbers, self._session = b"", itertools.count(1), None
        self.events: list[dict[str, Any]] = []

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._session = None
        self.send("Browser.close")
        os.waitpid(self._process, 0)
        os.close(self._read)
        os.close(self._write)

    def send(self, method: str, **parameters: object) -> dict[str, Any]:
        """Call a method and wait for its result; events that come meanwhile are kept."""
        number = next(self._numbers)
        message: dict[str, object] = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while (answer := self._next()).get("id") != number:
            self.events.append(answer)
        assert "error" not in answer, f"{method}: {answer['error']}"
        return answer["result"]

    def open(self, address: str, width: int = 1280, height: int = 900) -> None:
        """Open a page in a window of a size and wait until it has loaded."""
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")
        mobile = width < 600
        self.send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=mobile)
        self.events.clear()
        self.send("Page.navigate", url=address)
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            self.events.append(self._next())

    def run(self, script: str) -> Any:
        """The value of a JavaScript expression, awaited where it is a promise."""
        answer = self.send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def handle(self, script: str) -> str:
        """The id of the object that a JavaScript expression gives."""
        return self.send("Runtime.evaluate", expression=script)["result"]["objectId"]

    def wait_for(self, script: str) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + _PATIENCE_S
        while not self.run(script):
            assert time.monotonic() < end, f"never true: {script}"
            time.sleep(0.05)

    def click(self, x: float, y: float) -> None:
        """Press and release the left button at a place of the window [px]."""
        for kind in ("mousePressed", "mouseReleased"):
            self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, key: str) -> None:
        """Press and release a key by its name."""
        for kind in ("keyDown", "keyUp"):
            self.send("Input.dispatchKeyEvent", type=kind, key=key)

    def complaints(self) -> list[dict[str, Any]]:
        """Errors and warnings of the page so far."""
        thrown = [e for e in self.events if e.get("method") == "Runtime.exceptionThrown"]
        thrown += [e for e in self.events if e.get("method") == "Log.entryAdded"]
        calls = [e for e in self.events if e.get("method") == "Runtime.consoleAPICalled"]
        return thrown + [e for e in calls if e["params"]["type"] in ("error", "warning", "assert")]

    def requests(self) -> list[str]:
        """Addresses that the page asked for, without data that it brought along."""
        sent = [e["params"]["request"]["url"] for e in self.events if e.get("method") == "Network.requestWillBeSent"]
        return [url for url in sent if not url.startswith("data:")]

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            assert select.select([self._read], [], [], _PATIENCE_S)[0], "the browser does not answer"
            part = os.read(self._read, 1 << 20)
            assert part, "the browser ended early"
            self._buffer += part
        message, self._buffer = self._buffer.split(b"\0", 1)
        return json.loads(message)


def _high_pipe() -> tuple[int, int]:
    """A pipe whose ends are no descriptor that the browser wants for itself."""
    ends = os.pipe()
    read, write = (fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10) for end in ends)
    for end in ends:
        os.close(end)
    return read, write
