"""The program of a worker process: it takes tasks from its standard input and answers on its standard output.

Both ends are processes of one user that the parent has started, so that pickles can be trusted. The program does not
import the main module of the parent: a script needs no guard against being run again.
"""

from __future__ import annotations

import io
import logging
import os
import pickle
import queue
import struct
import threading
import traceback
from types import FunctionType
from typing import IO, Any

from femtune.errors import FemtuneError

_SIZE = struct.Struct("<Q")


class _Pickler(pickle.Pickler):
    """Refuses what the main program defines, which another process cannot load."""

    def reducer_override(self, obj: Any) -> Any:
        """For classes and functions; everything else as usual."""
        if isinstance(obj, type | FunctionType) and obj.__module__ == "__main__":
            raise pickle.PicklingError(f"{obj.__qualname__} is defined in the script or notebook that runs")
        return NotImplemented


def packed(work: object) -> bytes:
    """Work or a task as it is sent to another process (error ``executor.not-sent``)."""
    stream = io.BytesIO()
    try:
        _Pickler(stream, protocol=5).dump(work)
    except Exception as error:
        raise FemtuneError("executor.not-sent", reason=error) from error
    return stream.getvalue()


def write(stream: IO[bytes], content: bytes) -> None:
    """A message: its length, then the bytes (errors OSError)."""
    stream.write(_SIZE.pack(len(content)))
    stream.write(content)
    stream.flush()


def read(stream: IO[bytes]) -> bytes:
    """The next message.

    Raises
    ------
    EOFError : the other end is gone
    """
    (size,) = _SIZE.unpack(_exactly(stream, _SIZE.size))
    return _exactly(stream, size)


def _exactly(stream: IO[bytes], size: int) -> bytes:
    content = stream.read(size)
    if len(content) < size:
        raise EOFError
    return content


def _listen(stream: IO[bytes], inbox: queue.SimpleQueue[bytes]) -> None:
    """All messages; the worker ends as soon as its parent is gone, in the middle of a run too."""
    while True:
        try:
            inbox.put(read(stream))
        except (EOFError, OSError):
            os._exit(0)


def main() -> None:
    """The work, then tasks."""
    tasks, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # what a run prints must not come between the answers
    os.dup2(2, 1)
    # warnings of Python are no messages for a user
    logging.getLogger("py.warnings").addHandler(logging.NullHandler())
    logging.captureWarnings(True)
    inbox: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(tasks, inbox), daemon=True).start()
    try:
        work = pickle.loads(inbox.get())
    except Exception as error:
        write(answers, pickle.dumps(("not-loaded", f"{type(error).__name__}: {error}")))
        return
    write(answers, pickle.dumps(("ready", None)))
    while True:
        write(answers, answer(work, inbox.get()))


def answer(work: Any, task: bytes) -> bytes:
    """Outcome of a task, to be sent back."""
    try:
        return pickle.dumps(("done", work(pickle.loads(task))), protocol=5)
    except FemtuneError as error:
        return pickle.dumps(("error", error))
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{os.path.basename(last.filename)}, line {last.lineno}"
        return pickle.dumps(("failed", f"{type(error).__name__}: {error} ({place})"))
