"""One way on one workspace in a process of its own: python worker.py WAY FOLDER SHIFT RESULT.

SHIFT is a number, or - where there is none yet. What was measured goes to RESULT as JSON.
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))  # where structures/ lies

import way_calculix
import way_eigsh
import way_femtune
import way_slepc
from workspace import Workspace

WAYS: dict[str, Callable[[Workspace, float | None], dict[str, Any]]] = {
    "femtune": way_femtune.run,
    "eigsh-pardiso": way_eigsh.pardiso,
    "eigsh-superlu-symmetric": way_eigsh.superlu_symmetric,
    "eigsh-superlu": way_eigsh.superlu,
    "slepc": way_slepc.run,
    "calculix": way_calculix.run,
}


def main(arguments: list[str]) -> int:
    """Run it and write what it measured."""
    way, folder, shift, result = arguments
    found = WAYS[way](Workspace(Path(folder)), None if shift == "-" else float(shift))
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    found["peak_mib"] = max(stage["peak_mib"] for stage in found["stages"].values())
    found["largest_child_mib"] = round(children / 1024, 1)
    Path(result).write_text(json.dumps(found))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
