"""The machine and the libraries that the numbers belong to."""

from __future__ import annotations

import os
import platform
import subprocess
from pathlib import Path

import numpy as np
import scipy
import way_calculix

import femtune
from femtune.model.solvers.listing import solver_list

_ROOT = Path(__file__).resolve().parents[2]


def described(threads: int) -> dict[str, str]:
    """Name and value, in words."""
    solvers = [f"{s.name} {s.version}" for s in solver_list() if s.at_hand]
    return {
        "processor": f"{_of_file('/proc/cpuinfo', 'model name') or platform.processor()}, {os.cpu_count()} cores",
        "memory": _memory(),
        "system": f"{platform.system()} {platform.release()}, {platform.machine()}",
        "threads": f"{threads} (OMP_NUM_THREADS, MKL_NUM_THREADS, OPENBLAS_NUM_THREADS; MKL_DYNAMIC=FALSE)",
        "libraries": f"Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}",
        "solvers": ", ".join([*solvers, *_calculix()]),
        "femtune": f"{femtune.__version__}, revision {_revision()}",
    }


def _memory() -> str:
    total = _of_file("/proc/meminfo", "MemTotal").split()
    return f"{int(total[0]) / 2**20:.1f} GiB" if total else "not known"


def _of_file(path: str, key: str) -> str:
    if not Path(path).exists():
        return ""
    lines = (line.partition(":") for line in Path(path).read_text().splitlines())
    return next((value.strip() for name, _, value in lines if name.strip() == key), "")


def _calculix() -> list[str]:
    program = way_calculix.program()
    return [" ".join(["CalculiX", _said([program, "-v"]).split()[-1]])] if program else []


def _revision() -> str:
    found = _said(["git", "-C", str(_ROOT), "rev-parse", "--short", "HEAD"]).strip() or "not known"
    changed = _said(["git", "-C", str(_ROOT), "status", "--porcelain", "--", "src"]).strip()
    return found + (" with changes" if changed else "")


def _said(command: list[str]) -> str:
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False).stdout
    except OSError:
        return ""
