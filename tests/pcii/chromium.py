"""A page in headless Chromium, driven by its DevTools protocol."""

import asyncio
import contextlib
import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

from tornado.websocket import WebSocketClientConnection, websocket_connect

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
FLAGS += ["--disable-component-update", "--disable-sync", "--remote-debugging-port=0"]
LONGEST_S = 60.0


class Page:
    """An open page: what it logged, what it asked the network for, and hands to use it."""

    def __init__(self, loop: asyncio.AbstractEventLoop, socket: WebSocketClientConnection) -> None:
        self._loop, self._socket, self._number = loop, socket, 0
        self.faults: list[Any] = []
        self.requests: list[str] = []

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The answer to one command of the protocol; events that come before it are noted."""
        self._number += 1
        number = self._number
        command = json.dumps({"id": number, "method": method, "params": parameters})
        self._run(lambda: self._socket.write_message(command))
        while True:
            message = json.loads(self._run(self._socket.read_message))
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]
            self._note(message)

    def _run(self, step: Callable[[], Awaitable[Any]]) -> Any:
        async def within() -> Any:
            return await asyncio.wait_for(step(), LONGEST_S)

        return self._loop.run_until_complete(within())

    def _note(self, event: dict[str, Any]) -> None:
        about = event.get("params", {})
        if event["method"] == "Runtime.exceptionThrown":
            self.faults.append(about["exceptionDetails"])
        elif event["method"] in ("Log.entryAdded", "Runtime.consoleAPICalled"):
            self.faults.append(about)
        elif event["method"] == "Network.requestWillBeSent":
            self.requests.append(about["request"]["url"])

    def open(self, file: Path, width: int = 1200, height: int = 1000) -> None:
        """Load the file in a window of this size, and wait until it is complete."""
        for part in ("Runtime", "Log", "Network", "Page"):
            self.call(f"{part}.enable")
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)
        self.call("Page.navigate", url=file.as_uri())
        end = time.monotonic() + LONGEST_S
        while self.value("document.readyState") != "complete" or self.value("location.href") != file.as_uri():
            assert time.monotonic() < end
            time.sleep(0.05)

    def value(self, expression: str) -> Any:
        """The value of an expression in the page."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def text(self, selector: str) -> str:
        """The text of the first element that a selector finds."""
        return self.value(f"document.querySelector({selector!r}).textContent")

    def click(self, selector: str) -> None:
        """Click on the middle of the first element that a selector finds, scrolled into the window."""
        script = f"""(() => {{ const part = document.querySelector({selector!r});
            part.scrollIntoView({{block: "center", behavior: "instant"}});
            const box = part.getBoundingClientRect();
            return [box.left + box.width / 2, box.top + box.height / 2]; }})()"""
        x, y = self.value(script)
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press_right(self) -> None:
        """Press the right arrow key."""
        key = {"key": "ArrowRight", "code": "ArrowRight", "windowsVirtualKeyCode": 39}
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, **key)


@contextlib.contextmanager
def browser_page(profile: Path) -> Iterator[Page]:
    """A blank page of a browser of its own, which keeps its profile in a new folder."""
    command = [str(CHROMIUM), *FLAGS, f"--user-data-dir={profile}", "about:blank"]
    loop = asyncio.new_event_loop()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        address = _address_of_page(profile / "DevToolsActivePort")

        async def connect() -> WebSocketClientConnection:
            return await websocket_connect(address, connect_timeout=LONGEST_S, max_message_size=1 << 28)

        socket = loop.run_until_complete(connect())
        yield Page(loop, socket)
        socket.close()
    finally:
        process.terminate()
        process.wait(LONGEST_S)
        loop.close()


def _address_of_page(port_file: Path) -> str:
    """Address of the first page, once the browser has written its port."""
    end = time.monotonic() + LONGEST_S
    while time.monotonic() < end:
        with contextlib.suppress(OSError, IndexError, ValueError):
            port = int(port_file.read_text().split()[0])
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=5) as answer:
                pages = [entry for entry in json.load(answer) if entry["type"] == "page"]
            return pages[0]["webSocketDebuggerUrl"]
        time.sleep(0.1)
    raise TimeoutError("Chromium did not start")
