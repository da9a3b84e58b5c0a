"""Free memory of the machine and of what limits this process, so that a shortage is reported before the work starts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from femtune.errors import FemtuneError

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

GIB = 1024**3
NEGLIGIBLE_BYTES = 1 << 20
"""Work that takes less is not checked: reading the kernel's files would take longer than a small factorisation."""


def free_memory(root: Path = Path("/")) -> int | None:
    """Bytes that this process can still take; None if it is not known.

    The machine, the control groups and the limit of the process's own addresses (``ulimit -v``) are asked.

    `root` is where ``proc`` and ``sys`` are.
    """
    limits = [*_machine(root), *_groups(root), *_addresses(root)]
    return max(min(limits), 0) if limits else None


def require_memory(needed_bytes: int, code: str, **facts: Any) -> None:
    """Refuse work that needs more memory than there is.

    Parameters
    ----------
    needed_bytes : forecast of what the work takes at its peak, beyond what is taken now
    code : message of what the work is: ``model.memory/assembling``
    facts : what fills the message besides the sizes

    Raises
    ------
    FemtuneError : ``model.memory``
    """
    if needed_bytes < NEGLIGIBLE_BYTES:
        return
    free = free_memory()
    if free is not None and needed_bytes > free:
        raise FemtuneError(
            code,
            values={"needed_bytes": int(needed_bytes), "free_bytes": free},
            needed_gib=needed_bytes / GIB,
            free_gib=free / GIB,
            **facts,
        )


def _machine(root: Path) -> Iterator[int]:
    """What the kernel calls available: free pages and those it can take back."""
    for line in _lines(root / "proc/meminfo"):
        name, _, rest = line.partition(":")
        if name == "MemAvailable" and rest.split()[:1]:
            yield int(rest.split()[0]) * 1024


def _addresses(root: Path) -> Iterator[int]:
    """What the limit of the process's address space leaves, beyond what is taken."""
    if resource is not None:
        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        taken = "".join(_lines(root / "proc/self/statm")[:1]).split()[:1]
        if most != resource.RLIM_INFINITY and taken:
            yield most - int(taken[0]) * resource.getpagesize()


def _groups(root: Path) -> Iterator[int]:
    """What is left in each control group that holds this process: of version 2 (no controllers named) and 1."""
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, path = line.split(":", 2)
        if not controllers:
            yield from _left(root / "sys/fs/cgroup", path, "memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            base = root / "sys/fs/cgroup/memory"
            yield from _left(base, path, "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")


def _left(base: Path, path: str, limit: str, usage: str, cached: str) -> Iterator[int]:
    """A group and those above it; inside a container the path may be seen from elsewhere, then its root counts."""
    relative = PurePosixPath(path.lstrip("/"))
    for folder in (base / relative, *(base / p for p in relative.parents)):
        most, taken = _number(folder / limit), _number(folder / usage)
        if most is not None and taken is not None:
            yield most - taken + _cached(folder / "memory.stat", cached)


def _cached(path: Path, name: str) -> int:
    """Bytes of files in memory, which the kernel takes back where the group is full."""
    return next((int(line.split()[1]) for line in _lines(path) if line.startswith(f"{name} ")), 0)


def _number(path: Path) -> int | None:
    """The number in a file; None where there is none or where it says "max"."""
    text = "".join(_lines(path)[:1]).strip()
    return int(text) if text.isdigit() else None


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return []
