"""Threads that a factorisation takes."""

from __future__ import annotations

import os

from femtune.model.distributed import launch


def threads() -> int:
    """Threads of the libraries: MKL_NUM_THREADS or OMP_NUM_THREADS, else one a core."""
    for variable in ("MKL_NUM_THREADS", "OMP_NUM_THREADS"):
        text = os.environ.get(variable, "")
        if text.isascii() and text.isdigit() and int(text) > 0:
            return min(int(text), launch.cores())
    return launch.cores()
