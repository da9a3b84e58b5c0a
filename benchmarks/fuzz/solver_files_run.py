"""Damaged files of other programs: python benchmarks/fuzz/solver_files_run.py [--count 5000] [--evidence DIR].

Every mutant is read or refused with a message. A traceback, a crash, more than ten seconds of the processor, more than
1 GiB, or a file that is opened outside of the mutant's folder is a failure. Processes that have read the sound file are
forked, so that a crash ends one of them only; system calls are recorded by strace where it is installed. Finished
parts are kept in `build/solver_files.json`, so that a run can be interrupted and continued; `--minutes` ends one.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import site
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "examples"), str(Path(__file__).parent)]
for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[_name] = "1"

from solver_files import Kind, all_kinds  # noqa: E402
from tests.files.nastran import mutant_trial  # noqa: E402

from femtune.errors import FemtuneError  # noqa: E402

SECONDS, BYTES = 10.0, 1 << 30
_MOST_ADDRESSES = 4 << 30
"""Addresses that a process may take in addition: libraries reserve memory that they never use."""
_PART, _BATCH = 200, 40
_WHOLE_WAY = 4
"""Mutants of a kind that starts a process for each file."""
_MARK = "/femtune-mutant/"
"""Beginning of a path that does not exist; that it is opened separates the mutants in the record of system calls."""
_STATE = ROOT / "build" / "solver_files.json"
_OPENED = re.compile(r'(?:openat2?|open|creat)\((?:[^,"]*, )?"((?:[^"\\]|\\.)*)"[^=]*= (-?\d+)')


def plan(kinds: dict[str, Kind], count: int, seed: int) -> list[tuple[str, int, int]]:
    """Parts: kind, number of the first mutant, how many."""
    total, parts = sum(kind.share for kind in kinds.values()), []
    for i, (name, kind) in enumerate(sorted(kinds.items())):
        own = -(-count * kind.share // total) if kind.share else _WHOLE_WAY
        first = (1000 * seed + i) * 100_000
        parts += [(name, first + k, min(_PART, own - k)) for k in range(0, own, _PART)]
    return parts


# ----------------------------------------------------------------------------------------------------
# In the process that is watched.


def run_part(name: str, first: int, count: int, folder: Path) -> dict[str, Any]:
    """Outcomes of some mutants of one kind."""
    warnings.simplefilter("ignore")
    kind = all_kinds()[name]
    tempfile.tempdir = mutant_trial.FOLDER = str(folder)
    mutant_trial.SECONDS = SECONDS
    for file, content in kind.files.items():
        (folder / file).write_bytes(content)
    # the libraries are loaded; where their process is bounded, this one must not be
    if kind.crashes:
        import_module("ansys.mapdl.reader")
    else:
        with suppress(FemtuneError):
            kind.read(folder / next(iter(kind.files)))
    out: dict[str, Any] = {"kind": name, "codes": Counter(), "failures": [], "slowest": 0.0, "mb": 0.0}
    number, end = first, first + count
    while number < end:
        number = _batch(kind, number, min(number + _BATCH, end), folder, out)
    return out


def _batch(kind: Kind, number: int, end: int, folder: Path, out: dict[str, Any]) -> int:
    """Mutants in a forked process, up to the first that crashes; the number of the next one."""
    source, target = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(source)
        _tried(kind, number, end, folder, target)
    os.close(target)
    with os.fdopen(source) as lines:
        for line in lines:
            told = json.loads(line)
            number = told["number"] + 1
            out["slowest"], out["mb"] = max(out["slowest"], told["s"]), max(out["mb"], told["mb"])
            if told["why"]:
                out["failures"].append([told["number"], told["why"]])
            out["codes"][told["outcome"]] += 1
    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    if status < 0 and kind.crashes:
        out["codes"]["crash"] += 1
        number += 1
    elif status:
        out["failures"].append([number, f"the process ended with {status}"])
        out["codes"]["FAILURE"] += 1
        number += 1
    return number


def _tried(kind: Kind, number: int, end: int, base: Path, target: int) -> None:
    """Read mutants and tell of each; the process ends."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + _MOST_ADDRESSES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    # for what does not return to Python, where the limit of each mutant is looked at
    resource.setrlimit(resource.RLIMIT_CPU, (int(SECONDS * 3), int(SECONDS * 3) + 1))
    with os.fdopen(target, "w") as out:
        for one in range(number, end):
            start, before, why = time.process_time(), _memory(), ""
            with tempfile.TemporaryDirectory(dir=base) as folder:
                with suppress(OSError):
                    os.open(f"{_MARK}{one}", os.O_RDONLY)
                try:
                    outcome = kind.trial(one, Path(folder))
                except (subprocess.SubprocessError, Exception):
                    outcome, why = "FAILURE", traceback.format_exc()
            took, held = time.process_time() - start, _memory() - before
            if took > SECONDS or held > BYTES:
                outcome, why = "FAILURE", f"{took:.1f} s, {held / 2**20:.0f} MB"
            told = {"number": one, "outcome": outcome, "why": why, "s": took, "mb": held / 2**20}
            out.write(json.dumps(told) + "\n")
            out.flush()
    os._exit(0)


def _memory() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


# ----------------------------------------------------------------------------------------------------
# Around it.


def watched(parts: list[tuple[str, int, int]], end: float) -> Iterator[tuple[str, dict[str, Any]]]:
    """Parts as they are finished, in a process of their own, whose system calls are recorded."""
    with tempfile.TemporaryDirectory() as name:
        folder, calls = Path(name) / "mutants", Path(name) / "calls"
        folder.mkdir()
        words, strace = [sys.executable, str(Path(__file__)), "--folder", str(folder)], shutil.which("strace")
        if strace:
            only = ["-f", "--seccomp-bpf", "-qq", "-e", "trace=open,openat,openat2,creat", "-o", str(calls)]
            words = [strace, *only, *words]
        with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as worker:
            assert worker.stdin is not None
            assert worker.stdout is not None
            for part in parts:
                if time.monotonic() > end:
                    break
                print(json.dumps(part), file=worker.stdin, flush=True)
                line = worker.stdout.readline()
                if not line:
                    raise RuntimeError(f"the process that reads {part} ended")
                told: dict[str, Any] = {**json.loads(line), "watched": bool(strace)}
                if strace:
                    numbers = range(part[1], part[1] + part[2])
                    told["failures"] += [one for one in opened_elsewhere(calls, folder) if one[0] in numbers]
                yield f"{part[0]} {part[1]}", told
            worker.stdin.close()


def opened_elsewhere(calls: Path, folder: Path) -> list[list[Any]]:
    """Files that were opened outside of the folder and are none of Python, its packages or the system's libraries."""
    own = {sys.prefix, sys.base_prefix, os.path.realpath(sys.prefix), *site.getsitepackages(), *sys.path[3:]}
    own |= {str(ROOT / "src"), str(ROOT / "tests"), str(ROOT / "benchmarks"), str(ROOT / "examples")}
    own |= {"/proc", "/sys", "/usr/lib", "/lib", "/etc/ld.so", "/dev", "/usr/share/locale", "/etc/mime", str(folder)}
    own |= {"/etc/localtime", str(Path.home() / ".cache" / "matplotlib")}
    allowed = tuple(path for path in own if path)
    number, found = None, []
    for line in calls.read_text(errors="replace").splitlines():
        match = _OPENED.search(line)
        if match is None:
            continue
        path, code = match[1], int(match[2])
        if path.startswith(_MARK):
            number = int(path.removeprefix(_MARK))
        elif number is not None and code >= 0 and path.startswith("/") and not path.startswith(allowed):
            found.append([number, f"opened {path}"])
    return found


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=1e9, help="end after so long; the next run continues")
    parser.add_argument("--only", default="", help="kinds whose name contains a word")
    parser.add_argument("--evidence", type=Path, help="folder of the page")
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.folder:
        for line in sys.stdin:
            print(json.dumps(run_part(*json.loads(line), options.folder)), flush=True)
        return
    kinds = all_kinds()
    parts = plan(kinds, options.count, options.seed)
    _STATE.parent.mkdir(exist_ok=True)
    state = json.loads(_STATE.read_text()) if _STATE.exists() else {}
    done, end = state.setdefault(f"{options.count} {options.seed}", {}), time.monotonic() + 60.0 * options.minutes
    todo = [part for part in parts if f"{part[0]} {part[1]}" not in done and options.only in part[0]]
    for key, told in watched(todo, end):
        done[key] = told
        _STATE.write_text(json.dumps(state))
        print(f"{key}: {dict(told['codes'])}", file=sys.stderr)
        for number, why in told["failures"]:
            print(f"mutant {number}: {why}", file=sys.stderr)
    # parts of another plan may be there, too: one with other kinds of files numbers its mutants differently
    planned = {key: done[key] for key in (f"{part[0]} {part[1]}" for part in parts) if key in done}
    complete = len(planned) == len(parts)
    text = page(kinds, planned)
    print(text if complete else f"{len(planned)} of {len(parts)} parts")
    if options.evidence and complete:
        (options.evidence / "benchmark_solver_files.md").write_text(text, encoding="utf-8")


def page(kinds: dict[str, Kind], done: dict[str, Any]) -> str:
    """The table as a page of the documentation."""
    rows: dict[str, list[dict[str, Any]]] = {}
    for part in done.values():
        rows.setdefault(kinds[part["kind"]].group, []).append(part)
    table, total, failed = [], 0, 0
    for group, some in rows.items():
        codes = sum((Counter(part["codes"]) for part in some), Counter())
        files, failures = sum(codes.values()), sum(len(part["failures"]) for part in some)
        total, failed = total + files, failed + failures
        slowest, mb = max(part["slowest"] for part in some), max(part["mb"] for part in some)
        accepted = codes["result"]
        refused = files - accepted - codes["FAILURE"]
        table.append(f"| {group} | {files:,} | {refused:,} | {accepted:,} | {failures} | {slowest:.1f} | {mb:.0f} |")
    traced = all(part["watched"] for part in done.values())
    calls = (
        "System calls were recorded: after a\nmutant was there, no file was opened outside of its folder but those of "
        "Python, its packages with their caches, and the\nlibraries of the system."
        if traced
        else "System calls were not recorded, because strace was not there."
    )
    return f"""# Damaged files of other programs

{total:,} files with one to four random changes (bits, words, counts, blocks, ends; lines and fields in texts), made on
{datetime.now(UTC):%Y-%m-%d}: arrays of HDF5, NumPy and Parquet, matrices and modes of Nastran and Ansys, outputs of
solvers, decks of superelements and under a load. Each was read or refused with a message; decks were read, written and
solved. A failure is a traceback, a crash of the process, more than {SECONDS:g} s of the processor or 1 GiB for one
file, or a file that was opened elsewhere. {calls}
The memory is the largest that one file took in addition to that of the process. Made by
`benchmarks/fuzz/solver_files_run.py`.

| kind | files | refused | accepted | failures | slowest, s | memory, MB |
| --- | ---: | ---: | ---: | ---: | ---: | ---: |
{chr(10).join(table)}

Together: {failed} failures.
"""


if __name__ == "__main__":
    main()
