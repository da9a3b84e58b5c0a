"""A program that runs a command and ends it, with all that it started, when whoever started the program ends.

    python watch.py command argument …

Who started it holds the other end of the standard input and never writes there: the end of the file is the sign to
stop, whether the pipe was closed or the process was killed. Only the standard library is imported.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress

PATIENCE_SECONDS = 10
"""Time that a command has to end after SIGTERM, before it is killed."""


def main(command: list[str]) -> int:
    """The code that the command ends with; negative for a signal, 127 where it cannot be started."""
    try:
        child = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    except OSError as failed:
        print(f"the command could not be started: {failed}", file=sys.stderr, flush=True)
        return 127
    ended = threading.Event()
    watch = threading.Thread(target=_wait_for_the_end, args=(child, ended), daemon=True)
    watch.start()
    code = child.wait()
    ended.set()
    return code


def _wait_for_the_end(child: subprocess.Popen[bytes], ended: threading.Event) -> None:
    while os.read(0, 1):
        pass
    # launchers end their ranks when they are asked to end, not when they are killed
    _send(child, signal.SIGTERM)
    if not ended.wait(PATIENCE_SECONDS):
        _send(child, getattr(signal, "SIGKILL", signal.SIGTERM))


def _send(child: subprocess.Popen[bytes], number: int) -> None:
    with suppress(OSError):
        if hasattr(os, "killpg"):
            os.killpg(child.pid, number)
        else:
            child.send_signal(number)


def end(code: int) -> None:
    """End as the command did: by the same signal, or with the same code."""
    if code < 0:
        with suppress(OSError, ValueError):
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    sys.exit(code)


if __name__ == "__main__":
    end(main(sys.argv[1:]))
