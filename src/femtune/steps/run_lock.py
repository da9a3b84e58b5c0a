"""One run at a time in a run folder: a lock file, which the system releases whenever the run ends, even in a crash."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from femtune.errors import FemtuneError, Where
from femtune.journal.run_files import LOCK_FILE
from femtune.runs.process import is_alive
from femtune.steps.run_folder import unwritable

_LOCKED_BYTE = 1 << 30
"""Position of the byte that is locked on Windows.

Far behind the text, because a lock there also forbids others to read.
"""
_MOST_TEXT_BYTES = 4096
"""Bytes of the lock file that are read: its text is shorter, and a file that is no lock file may be long."""
_BOOT = Path("/proc/sys/kernel/random/boot_id")
"""What Linux calls itself since it was started: the same in all containers of a machine, whose host names differ."""
_OPEN_FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
"""Flags for opening the lock file: a link is not followed, and a pipe does not block."""


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the run folder; the file says who holds it. What a killed run left behind is taken over.

    Raises
    ------
    FemtuneError : ``run.locked`` where another run is at work there, ``run.unwritable``
    """
    path = folder / LOCK_FILE
    try:
        handle = _hold(path)
    except OSError as error:
        raise unwritable(folder, error) from error
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            _let_go(path, handle)


def _let_go(path: Path, handle: int) -> None:
    """Remove the file while it is locked, so that no other run loses its file; Windows cannot remove an open file."""
    if sys.platform != "win32" and _in_place(path, handle):
        os.unlink(path)
    os.close(handle)
    if sys.platform == "win32":
        os.unlink(path)


def _hold(path: Path) -> int:
    """An open lock file that is ours and still in its place."""
    while True:
        handle = os.open(path, _OPEN_FLAGS, 0o666)
        try:
            holder = _holder(handle)
            if not _is_free(handle, holder):
                raise _taken(path, holder)
            if _in_place(path, handle):
                _sign(handle)
                return handle
        except BaseException:
            os.close(handle)
            raise
        # its holder ended, and removed the file, between our opening and our locking
        os.close(handle)


def _is_free(handle: int, holder: dict[str, str]) -> bool:
    """Locked for us now. A run on another machine counts as alive: not every shared disk carries locks between them."""
    try:
        return try_lock(handle) and _is_here(holder)
    except OSError:
        # a disk without locks: what is signed has to do; numbers of processes in another container say nothing
        return _is_host(holder) and not is_alive(holder.get("pid", ""))


def _is_here(holder: dict[str, str]) -> bool:
    """Whether the holder is on this machine, in a container perhaps: its lock is seen here."""
    kernel = _kernel()
    return _is_host(holder) or (kernel != "" and holder.get("kernel") == kernel)


def _is_host(holder: dict[str, str]) -> bool:
    return holder.get("host", platform.node()) == platform.node()


def _kernel() -> str:
    try:
        return _BOOT.read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return ""


def _in_place(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.lstat(path), os.fstat(handle))
    except FileNotFoundError:
        return False


def _sign(handle: int) -> None:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    os.ftruncate(handle, 0)
    os.lseek(handle, 0, os.SEEK_SET)
    text = {"pid": str(os.getpid()), "host": platform.node(), "since": now, "kernel": _kernel()}
    os.write(handle, json.dumps(text).encode())


def _holder(handle: int) -> dict[str, str]:
    """Owner of the lock; empty if the text is not that of a lock file."""
    try:
        text = json.loads(os.read(handle, _MOST_TEXT_BYTES))
    except (ValueError, RecursionError):
        return {}
    # earlier versions did not name the kernel
    signed = isinstance(text, dict) and set(text) | {"kernel"} == {"pid", "host", "since", "kernel"}
    return text if signed and all(isinstance(v, str) for v in text.values()) else {}


def _taken(path: Path, holder: dict[str, str]) -> FemtuneError:
    return FemtuneError(
        "run.locked" if _is_here(holder) else "run.locked/other-host",
        where=Where(str(path)),
        values={"process": holder.get("pid", "not known"), **{k: holder[k] for k in ("host", "since") if k in holder}},
        host=holder.get("host"),
        lock=path.name,
    )


if sys.platform == "win32":
    import msvcrt

    def try_lock(handle: int) -> bool:
        os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def try_lock(handle: int) -> bool:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
