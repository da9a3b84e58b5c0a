"""One file of the journal: named arrays and a few facts, in an archive that is checked while it is read.

Nothing in it is compressed, so that it can hold no more than its own size, and nothing is ever unpickled.
"""

from __future__ import annotations

import json
import math
import os
import stat
import struct
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from femtune.files.whole_file import write_whole_by

_FACTS = "facts.json"
"""Member of an entry that has its numbers and texts; every other member is an array."""
_MOST_MEMBERS = 64
"""Members of an entry; none of femtune's has as many, and a file with more is damaged or forged."""
_MOST_FACT_BYTES = 1 << 20
"""Bytes of the facts, which are read at once: 1 MiB."""
_CHUNK_BYTES = 1 << 24
"""Bytes that are read at a time while a checksum is tested: 16 MiB."""
_DATE = (1980, 1, 1, 0, 0, 0)
"""Date of all members, the earliest that ZIP can state: equal entries are equal files."""
# a link is not followed, and a pipe is not waited for
_FLAGS = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)

# what the standard library and numpy raise on archives that are damaged or made to deceive
_TROUBLES = (
    OSError, ValueError, EOFError, KeyError, IndexError, TypeError, AttributeError, RuntimeError, MemoryError,
    OverflowError, SyntaxError, struct.error, zipfile.BadZipFile,
)  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """Arrays of numbers by name, and facts that JSON can hold."""

    arrays: Mapping[str, NDArray[Any]]
    facts: Mapping[str, Any]

    @property
    def n_bytes(self) -> int:
        """Approximate size of its file."""
        return 4096 + sum(a.nbytes for a in self.arrays.values())


class DamagedEntryError(ValueError):
    """A file of the journal cannot be used; the text says why."""


def write_entry(path: Path, entry: Entry, flush: bool = True) -> None:
    """Write the file whole or not at all; see `write_whole_by`.

    Raises
    ------
    OSError : the disk is full or refuses
    """
    write_whole_by(path, lambda stream: _pack(stream, entry), flush)


def _pack(stream: IO[bytes], entry: Entry) -> None:
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(zipfile.ZipInfo(_FACTS, _DATE), json.dumps(dict(entry.facts), allow_nan=False))
        for name in sorted(entry.arrays):
            with archive.open(zipfile.ZipInfo(f"{name}.npy", _DATE), "w", force_zip64=True) as member:
                array = np.asarray(entry.arrays[name], order="C")
                np.lib.format.write_array(member, array, version=(1, 0), allow_pickle=False)


def read_entry(path: Path, most_bytes: int) -> Entry | None:
    """What `write_entry` wrote; None if there is no file.

    Raises
    ------
    DamagedEntryError : it is not what this module writes
    """
    try:
        with _opened(path, most_bytes) as (stream, size), zipfile.ZipFile(stream) as archive:
            _check_members(archive, size)
            names = [name for name in archive.namelist() if name != _FACTS]
            facts = json.loads(archive.read(_FACTS))
            arrays = {name.removesuffix(".npy"): _array(archive, archive.getinfo(name)) for name in names}
    except FileNotFoundError:
        return None
    except DamagedEntryError:
        raise
    except _TROUBLES as error:
        raise DamagedEntryError(str(error) or type(error).__name__) from error
    if not isinstance(facts, dict):
        raise DamagedEntryError("its facts are no table")
    return Entry(arrays, facts)


@contextmanager
def _opened(path: Path, most_bytes: int) -> Iterator[tuple[IO[bytes], int]]:
    with os.fdopen(os.open(path, _FLAGS), "rb") as stream:
        state = os.fstat(stream.fileno())
        if not stat.S_ISREG(state.st_mode):
            raise DamagedEntryError("it is no ordinary file")
        if state.st_size > most_bytes:
            raise DamagedEntryError("it is larger than the whole journal may be")
        yield stream, state.st_size


def _check_members(archive: zipfile.ZipFile, size: int) -> None:
    members = archive.infolist()
    if len(members) > _MOST_MEMBERS or len({m.filename for m in members}) < len(members):
        raise DamagedEntryError("it has too many parts, or two of one name")
    if any(m.compress_type != zipfile.ZIP_STORED or m.flag_bits & 1 for m in members):
        raise DamagedEntryError("a part of it is compressed or encrypted")
    if sum(m.file_size for m in members) > size:
        raise DamagedEntryError("its parts claim to be larger than the file")
    if archive.getinfo(_FACTS).file_size > _MOST_FACT_BYTES:
        raise DamagedEntryError("its facts are too long")


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    with archive.open(info) as member:
        if np.lib.format.read_magic(member) != (1, 0):
            raise DamagedEntryError(f"{info.filename} is of another version")
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(member)
        if dtype.kind not in "fcbiu" or fortran:
            raise DamagedEntryError(f"{info.filename} holds no plain numbers")
        # the stated size must be that of the data, because an array of this size is allocated
        if math.prod(shape) * dtype.itemsize != info.file_size - member.tell() or min(shape, default=0) < 0:
            raise DamagedEntryError(f"{info.filename} has another size than it says")
        array = np.empty(shape, dtype)
        _fill(array.reshape(-1).view(np.uint8).data, member)
    if not np.isfinite(array).all():
        raise DamagedEntryError(f"{info.filename} has numbers that are not finite")
    return array


def _fill(room: memoryview, member: IO[bytes]) -> None:
    """Read a part to its end, where its check sum is compared."""
    at = 0
    while data := member.read(_CHUNK_BYTES):
        room[at : at + len(data)] = data
        at += len(data)
    if at != len(room):
        raise DamagedEntryError("it ends too early")
