"""The files outside the folder of a run on which it depends: scripts, modules of Python, included files, data.

They are found by their names in the words of the command, in the environment, in the input files, and in the files that
are found so. A name counts if there is a file of that name, seen from the folder of a run, from the folder of the file
that names it, or from a folder of PYTHONPATH. Names that a program makes while it runs are not found.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

_MOST_FILES = 2000
"""Files that are followed; a run that names more has a list of data files."""
_MOST_SCANNED_BYTES = 1 << 24
"""Bytes at the beginning of a file in which names are looked for: 16 MiB."""
_LONGEST_NAME = 1000
"""Characters of a name of a file."""
_BLOCK_BYTES = 1 << 20
"""Bytes that are read at once for a digest."""
_BINARY_BYTES = 4096
"""Bytes at the beginning of a file in which a zero byte shows that it is no text."""

_QUOTED = re.compile(r"\"([^\"\n]{1,1000})\"|'([^'\n]{1,1000})'")
"""A text in quotes, which may have blanks."""
_WORD = re.compile(r"[^\s\"',;=()<>|\[\]{}]+")
"""A word outside of quotes."""
_INCLUDED = re.compile(
    r"^[ \t]*(?:\*?INCLUDE\b[ \t,]*(?:INPUT[ \t]*=)?|/INPUT[ \t]*,|source|\.)[ \t]*([^\s\"',]+)", re.I | re.M
)
"""The file that a line of a solver's input or of a shell script includes."""
_IMPORTED = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import|import[ \t]+([\w.]+(?:[ \t]*,[ \t]*[\w.]+)*))", re.M)
"""The modules that a line of Python imports."""
_WRITTEN = re.compile(
    r"[ \t]*\)?[ \t]*(?:(?:,[ \t]*|\.open\()(?:mode[ \t]*=[ \t]*)?[\"'][rb]*[wax]|\.write_(?:text|bytes)|\.touch)"
)
"""What stands after the name of a file that a script writes: `open(name, "w")`."""
_OF_SYSTEM = ("/dev/", "/proc/", "/sys/")
"""Folders of files that are none."""

Signature = tuple[int, int, int, int]
"""Device, number, size and time of change of a file."""


@dataclass(frozen=True)
class Watched:
    """Files that a run depends on.

    Parameters
    ----------
    files : their paths
    signatures : of the files, when they were read
    digest : of their contents
    unread : paths that are named, and whose contents are not in the digest: folders, devices, and what cannot be read
    """

    files: tuple[str, ...]
    signatures: tuple[Signature, ...]
    digest: str
    unread: tuple[str, ...]

    @property
    def changed(self) -> tuple[str, ...]:
        """Files that were changed since they were read."""
        return tuple(path for path, known in zip(self.files, self.signatures) if signature(path) != known)


def watched(
    words: Sequence[str], environment: Mapping[str, str], texts: Iterable[bytes], folder: Path, program: str
) -> Watched:
    """What a run depends on, beside its own input files.

    Parameters
    ----------
    words : arguments of the command
    environment : variables of the solver
    texts : contents of its input files
    folder : a folder of a run; it need not exist
    program : path of the program; its content is not part of the digest
    """
    python = [entry for entry in environment.get("PYTHONPATH", "").split(os.pathsep) if entry]
    search = [folder, *(folder / entry for entry in python)]
    paths: dict[str, None] = {}
    named: dict[str, None] = {}
    waiting: list[tuple[str, Sequence[Path]]] = []
    for word in words:
        waiting += [(name, search) for name in dict.fromkeys((word, *word.split("="), *_names(word)))]
    for at in (i for i, word in enumerate(words[:-1]) if word == "-m"):
        waiting += [(name, search) for name in _module_files(words[at + 1])]
    for value in environment.values():
        waiting += [(name, search) for name in (value, *value.split(os.pathsep))]
    for content in texts:
        waiting += [(name, search) for name in _names(_text(content))]
    waiting += [(name, (folder, Path(program).parent)) for name in _names(_text(_beginning(program)))]
    inside = os.path.normpath(folder) + os.sep
    while waiting:
        name, places = waiting.pop()
        for place in places:
            path = os.path.normpath(place / name)
            if path in paths or path in named or path == program or path.startswith((inside, *_OF_SYSTEM)):
                continue
            kind = _kind(path)
            if kind == "file" and len(paths) < _MOST_FILES:
                paths[path] = None
                near = (folder, Path(path).parent, *search[1:])
                waiting += [(other, near) for other in _names(_text(_beginning(path)))]
            elif kind and name in words:
                named[path] = None
    files = tuple(sorted(paths))
    signatures = tuple(map(signature, files))
    contents = sorted(content_digest(path, known) for path, known in zip(files, signatures))
    return Watched(files, signatures, sha256("".join(contents).encode()).hexdigest(), tuple(named))


def signature(path: str) -> Signature:
    """Tells whether a file was changed; zeros for a file that is not there."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return 0, 0, 0, 0
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


@lru_cache(maxsize=4096)
def content_digest(path: str, _: Signature) -> str:
    """SHA-256 of a file with a signature: a file that was changed has another one."""
    digest = sha256()
    try:
        with open(path, "rb") as stream:
            while block := stream.read(_BLOCK_BYTES):
                digest.update(block)
    except OSError:
        return path
    return digest.hexdigest()


def _kind(path: str) -> str:
    """ "file", "other" for a folder or a device, "" for what is not there."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return ""
    return "file" if stat.S_ISREG(mode) else "other"


def _beginning(path: str) -> bytes:
    try:
        with open(path, "rb") as stream:
            begin = stream.read(_BINARY_BYTES)
            return b"" if b"\0" in begin else begin + stream.read(_MOST_SCANNED_BYTES - len(begin))
    except OSError:
        return b""


def _text(content: bytes) -> str:
    return "" if b"\0" in content[:_BINARY_BYTES] else content[:_MOST_SCANNED_BYTES].decode("latin-1")


def _names(text: str) -> Iterator[str]:
    """What may be names of files in a text."""
    for match in _QUOTED.finditer(text):
        if not _WRITTEN.match(text, match.end()):
            yield match[1] or match[2]
    for line in text.splitlines() if "/" in text else ():
        if "/" in line:
            yield from _paths(line)
    yield from (match[1] for match in _INCLUDED.finditer(text))
    for match in _IMPORTED.finditer(text):
        for module in re.split(r"[ \t]*,[ \t]*", match[1] or match[2]):
            yield from _module_files(module.lstrip("."))


def _paths(line: str) -> Iterator[str]:
    """Words with a slash; those in quotes are met elsewhere, and what a shell writes to is no input."""
    for match in _WORD.finditer(line):
        quoted = line[match.end() : match.end() + 1] in ("'", '"')
        written = line[: match.start()].rstrip(" \t").endswith(">")
        if "/" in match[0] and not (quoted or written) and len(match[0]) <= _LONGEST_NAME:
            yield match[0]


def _module_files(module: str) -> tuple[str, str]:
    path = module.replace(".", "/")
    return f"{path}.py", f"{path}/__init__.py"
