"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO


def write_whole(path: Path, content: bytes) -> None:
    """As `write_whole_by`, for content that is available."""
    write_whole_by(path, lambda stream: stream.write(content))


def write_whole_by(path: Path, write: Callable[[IO[bytes]], object], flush: bool = True) -> None:
    """Let `write` write beside `path`, flush to the disk, rename: readers see the old file or the new one.

    Without `flush` a loss of power may leave a file that is cut; a killed program does not.

    What `path` was before (a link to another file, too) is replaced and not written into.

    Raises
    ------
    OSError : the folder cannot be written, or `path` is a device or a pipe, which must not be replaced
    """
    _check_replaceable(path)
    # an ordinary file, with the rights that the system gives to new files: those of tempfile are private, and to change
    # them the process would have to set its umask, which is that of all its threads
    temporary = path.parent / f".{path.name[:40]}.{secrets.token_hex(8)}"
    try:
        with open(temporary, "xb") as stream:
            write(stream)
            stream.flush()
            if flush:
                os.fsync(stream.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def check_writable(path: Path) -> None:
    """Prove that a file could be written at `path`, before the work begins; nothing is changed.

    Raises
    ------
    OSError, ValueError : as `write_whole_by`; a name that no file can have
    """
    _check_replaceable(path)
    with tempfile.TemporaryFile(dir=path.parent):
        pass


def _check_replaceable(path: Path) -> None:
    try:
        mode = os.lstat(path).st_mode
    except FileNotFoundError:
        mode = stat.S_IFREG
    if stat.S_ISDIR(mode) or not path.name:
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not (stat.S_ISREG(mode) or stat.S_ISLNK(mode)):
        raise OSError(errno.EINVAL, "it is a device or a pipe")


def digest_of(path: Path) -> str:
    """SHA-256 of the bytes of a file, in hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


_DIGEST_BYTES = 4096
"""Bytes of a file that may be a line of ``sha256sum``; a longer one is none."""
_DIGEST_LINE = re.compile(rb"[0-9a-f]{64}  [^\n]+\n")


def is_digest(path: Path) -> bool:
    """Whether a file is a line of ``sha256sum``, which may be written again."""
    if path.is_symlink() or not path.is_file() or path.stat().st_size > _DIGEST_BYTES:
        return False
    return _DIGEST_LINE.fullmatch(path.read_bytes()) is not None
