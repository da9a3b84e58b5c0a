"""The folders of runs: which run is in each of them, and which of them are kept.

A file in the folder of a run tells its values and what it is of. A run that failed is named in it; without that, the
run is under way, or was interrupted.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import stat
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from femtune.files.whole_file import write_whole_by
from femtune.runs.process import end_left, is_alive, start_of

FACTS_FILE = "femtune_run.json"
"""What femtune writes into the folder of every run, beside its input files."""
_NAME = re.compile(r"[0-9a-f]{16}-[A-Za-z0-9_]+")
_LARGEST_FACTS_BYTES = 1 << 20
"""Size above which a file of that name is not one of femtune."""
_LATE_S = 3600.0
"""Time beyond twice the time limit after which a run on another machine counts as interrupted."""


def begin(folder: Path, key: str, values: Mapping[str, float]) -> None:
    """Say what is run in a folder, and by whom (errors OSError)."""
    facts = {
        "key": key, "values": {name: float(v) for name, v in values.items()}, "host": platform.node(),
        "pid": os.getpid(), "since": start_of(os.getpid()), "started": time.time(),
    }  # fmt: skip
    _write(folder, facts)


def begun(folder: Path, pid: int) -> None:
    """Say which process the solver is, so that the next start can end it (what cannot be written is left)."""
    _add(folder, {"solver": pid, "solver_since": start_of(pid)})


def end(folder: Path, failure: str) -> None:
    """Say how the run ended: "" for a run that is used (what cannot be written is left)."""
    _add(folder, {"ended": time.time(), "failure": failure})


def _add(folder: Path, more: Mapping[str, Any]) -> None:
    try:
        _write(folder, {**_facts(folder), **more})
    except OSError:
        return


def _write(folder: Path, facts: Mapping[str, Any]) -> None:
    # a new file takes the place of whatever the solver has put there
    content = (json.dumps(facts, indent=1) + "\n").encode()
    write_whole_by(folder / FACTS_FILE, lambda stream: stream.write(content), flush=False)


def clean(parent: Path, most_failed: int, timeout_s: float) -> None:
    """Remove folders of runs that were interrupted, and of all but the newest runs that failed.

    A solver that an interrupted run has left is ended first; if it cannot be ended, its folder stays.

    Parameters
    ----------
    most_failed : number of folders of failed runs that stay
    timeout_s : after which a run is ended; one on another machine that began long before that is not under way
    """
    failed = []
    for folder, facts in _folders(parent):
        if facts.get("failure"):
            failed.append((_number(facts.get("ended")), folder))
        elif "ended" not in facts and not _under_way(facts, timeout_s) and _is_left_alone(folder, facts):
            shutil.rmtree(folder, ignore_errors=True)
    failed.sort(key=lambda pair: pair[0])
    for _, folder in failed[: max(len(failed) - most_failed, 0)]:
        shutil.rmtree(folder, ignore_errors=True)


def _folders(parent: Path) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    """Folders that femtune has made, with what is known of them; nothing else is ever removed."""
    try:
        candidates = [p for p in parent.iterdir() if _NAME.fullmatch(p.name) and p.is_dir() and not p.is_symlink()]
    except OSError:
        return
    for folder in candidates:
        facts = _facts(folder)
        if str(facts.get("key", ""))[:16] == folder.name[:16]:
            yield folder, facts


def _facts(folder: Path) -> Mapping[str, Any]:
    path = folder / FACTS_FILE
    try:
        known = path.lstat()
        if not stat.S_ISREG(known.st_mode) or known.st_size > _LARGEST_FACTS_BYTES:
            return {}
        facts = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return facts if isinstance(facts, dict) else {}


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else 0.0


def _under_way(facts: Mapping[str, Any], timeout_s: float) -> bool:
    """Whether the process that has made a folder may still be at work in it."""
    if facts.get("host") == platform.node():
        pid, since = facts.get("pid"), facts.get("since")
        if isinstance(pid, int) and since and start_of(os.getpid()):
            return start_of(pid) == since
        return is_alive(str(pid))
    return time.time() - _number(facts.get("started")) < 2.0 * timeout_s + _LATE_S


def _is_left_alone(folder: Path, facts: Mapping[str, Any]) -> bool:
    """Whether no process is at work in the folder of an interrupted run, once those of this machine are ended."""
    if facts.get("host") != platform.node():
        return True
    pid, since = facts.get("solver"), facts.get("solver_since")
    return end_left(folder, pid if isinstance(pid, int) else 0, since if isinstance(since, str) else "")
