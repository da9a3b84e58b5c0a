"""The library that reads files of Ansys, in a process of its own: on damaged files it may crash or never finish."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from femtune._optional import require
from femtune.errors import FemtuneError, Where

Arrays = Mapping[str, np.ndarray]
_SECONDS = 8.0
"""Processor time that reading a small file may take."""
_BYTES_PER_S = 5e6
"""Bytes of a large file that are read in a second at the least."""
_MEMORY_BYTES = 512 << 20
"""Memory that reading may take besides that of the library."""
_COPIES = 8
"""How often the file may be held in memory besides."""


def arrays_of(path: Path, convert: Callable[[Any], Arrays], code: str, where: Where) -> Arrays:
    """What a function of a module makes of the file as the library reads it.

    Parameters
    ----------
    convert : is called in the other process with the file of the library; what it raises is an error of the file
    code : of that error, whose wording has a `reason`

    Raises
    ------
    FemtuneError : `code`, ``install.missing``, ``install.broken``
    """
    require("ansys.mapdl.reader", extra="ansys")
    with TemporaryDirectory() as folder:
        target = Path(folder) / "arrays.npz"
        program = f"import sys; from {__name__} import write_arrays; write_arrays(*sys.argv[1:])"
        # -P: no module is taken from the current folder
        command = [sys.executable, "-P", "-c", program, str(path.resolve()), str(target)]
        done = subprocess.run(
            [*command, convert.__module__, convert.__name__],
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        if not target.is_file():
            raise FemtuneError(code, where=where, reason=_reason(done))
        with np.load(target, allow_pickle=False) as data:
            return dict(data)


def _reason(done: subprocess.CompletedProcess[str]) -> str:
    """Why the process has left no arrays."""
    last = done.stderr.strip().splitlines()[-1:] if done.returncode == 1 else []
    if last:
        return last[0][:200]
    late = done.returncode == -getattr(signal, "SIGXCPU", 0)
    return "the reading library did not finish in time" if late else "the reading library crashed"


def write_arrays(source: str, target: str, module: str, function: str) -> None:
    """Write what a function makes of a file to an .npz file (errors of the library)."""
    convert: Callable[[Any], dict[str, Any]] = getattr(import_module(module), function)
    library = require("ansys.mapdl.reader", extra="ansys")
    _limit(Path(source).stat().st_size)
    part = Path(target).with_suffix(".part.npz")
    np.savez(part, **convert(library.read_binary(source)))
    part.rename(target)


def _limit(size: int) -> None:
    """Bound what the library may take in this process, by the size of the file, where the system allows it."""
    if sys.platform == "win32":
        return
    import resource  # noqa: PLC0415  not there on Windows

    def limit(kind: int, most: int) -> None:
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))

    used = resource.getrusage(resource.RUSAGE_SELF)
    limit(resource.RLIMIT_CPU, int(used.ru_utime + used.ru_stime + _SECONDS + size / _BYTES_PER_S) + 1)
    pages = Path("/proc/self/statm")
    if pages.exists():
        held = int(pages.read_text(encoding="utf-8").split()[0]) * resource.getpagesize()
        limit(resource.RLIMIT_AS, held + _MEMORY_BYTES + _COPIES * size)
