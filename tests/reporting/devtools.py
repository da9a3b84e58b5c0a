"""A page in headless Chromium that a test uses as a reader does: keys, clicks, texts. The standard library alone."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
_KEYS = {"Enter": (13, "\r"), "ArrowRight": (39, ""), "ArrowDown": (40, ""), " ": (32, " ")}


class OpenPage:
    """A page over the pipe of the browser, which takes JSON messages that end with a zero byte."""

    def __init__(self, to: int, back: int) -> None:
        self._to, self._back, self._number, self._session = to, back, 0, ""
        self._rest = b""

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The result of a command; events are passed over."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = json.loads(self._next())
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                result: dict[str, Any] = answer["result"]
                return result

    def _next(self) -> bytes:
        while b"\0" not in self._rest:
            part = os.read(self._back, 1 << 16)
            assert part, "the browser ended"
            self._rest += part
        message, _, self._rest = self._rest.partition(b"\0")
        return message

    def load(self, path: Path) -> None:
        """Open a file, and wait until its scripts have run."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.call("Page.navigate", url=path.as_uri())
        ready = "new Promise((done) => { const look = () => document.readyState === 'complete' && location.href !== "
        self.value(f"{ready}'about:blank' ? done(true) : setTimeout(look, 20); look(); }})")

    def value(self, expression: str) -> Any:
        """The value of an expression in the page, awaited."""
        found = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def click(self, selector: str, number: int = 0) -> None:
        """A click of the mouse in the middle of an element."""
        one = f"document.querySelectorAll({json.dumps(selector)})[{number}]"
        self.value(f"{one}.scrollIntoView({{ block: 'center', behavior: 'instant' }})")
        x, y = self.value(
            f"(({{ x, y, width, height }}) => [x + width / 2, y + height / 2])({one}.getBoundingClientRect())"
        )
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, key: str) -> None:
        """A key of the keyboard."""
        code, text = _KEYS[key]
        for kind in ("keyDown", "keyUp"):
            words = {"text": text} if text and kind == "keyDown" else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, **words)

    def write(self, text: str) -> None:
        """Text into what has the focus."""
        self.call("Input.insertText", text=text)


@contextmanager
def opened(path: Path, profile: Path) -> Iterator[OpenPage]:
    """The page of a file in a browser of its own."""
    (from_us, to), (back, from_it) = os.pipe(), os.pipe()

    # the browser reads descriptor 3 and writes descriptor 4
    begin = f"import os, sys; a, b = os.dup({from_us}), os.dup({from_it}); os.dup2(a, 3); os.dup2(b, 4); "
    begin += "os.set_inheritable(3, True); os.set_inheritable(4, True); "
    command = [
        sys.executable, "-c", begin + "os.execv(sys.argv[1], sys.argv[1:])",
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        "--window-size=1280,900", f"--user-data-dir={profile}", "--remote-debugging-pipe",
    ]  # fmt: skip
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    browser = subprocess.Popen(command, pass_fds=(from_us, from_it), **quiet)
    os.close(from_us)
    os.close(from_it)
    try:
        page = OpenPage(to, back)
        page.load(path)
        yield page
    finally:
        browser.kill()
        browser.wait()
        os.close(to)
        os.close(back)
