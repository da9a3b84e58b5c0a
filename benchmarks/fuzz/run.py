"""Files damaged at random: python benchmarks/fuzz/run.py [--count 20000] [--seed 1] [--evidence docs/evidence].

Every mutant is read or refused with a message. A traceback, more than ten seconds of the processor or more than 1 GiB
is a failure. What was accepted is judged by another parser. Finished parts are kept in `build/fuzz.json`, so that a run
can be interrupted and continued; `--minutes` ends one. pyuff and h5py are required; decks are judged if pyNastran is on
the path (PYTHONPATH).
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "examples"), str(Path(__file__).parent)]

from sources import Kind, all_kinds  # noqa: E402
from tests.files.nastran import mutant_trial  # noqa: E402
from tests.files.nastran.mutations import mutant  # noqa: E402

from femtune.errors import FemtuneError  # noqa: E402

SECONDS, PART = 10.0, 125
_MOST_MEMORY = 4 << 30
_STATE = ROOT / "build" / "fuzz.json"


def plan(kinds: dict[str, Kind], count: int, seed: int) -> list[tuple[str, int, int]]:
    """Parts: kind, number of the first mutant, how many."""
    parts, total = [], sum(kind.share for kind in kinds.values())
    left = count
    for i, (name, kind) in enumerate(kinds.items()):
        own = left if i == len(kinds) - 1 else count * kind.share // total
        left -= own
        first = (1000 * seed + sorted(kinds).index(name)) * 100_000
        parts += [(name, first + k, min(PART, own - k)) for k in range(0, own, PART)]
    return parts


def run_part(name: str, first: int, count: int) -> dict[str, Any]:
    """Outcomes of some mutants of one kind."""
    resource.setrlimit(resource.RLIMIT_AS, (_MOST_MEMORY, _MOST_MEMORY))
    mutant_trial.SECONDS = SECONDS
    warnings.simplefilter("ignore")
    kind = all_kinds()[name]
    out: dict[str, Any] = {
        "accepted": 0, "refused": 0, "judged": 0, "failures": [], "differ": [], "slowest": 0.0, "codes": Counter(),
    }  # fmt: skip
    for number in range(first, first + count):
        start = time.process_time()
        with tempfile.TemporaryDirectory(dir=mutant_trial.FOLDER) as folder:
            _one(kind, number, Path(folder), out)
        out["slowest"] = max(out["slowest"], time.process_time() - start)
    out["mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return out


def _one(kind: Kind, number: int, folder: Path, out: dict[str, Any]) -> None:
    changed = mutant(kind.files, number)
    for name, content in changed.items():
        (folder / name).write_bytes(content)
    path, found = folder / next(iter(changed)), None
    if kind.deck:
        outcome, why = mutant_trial.trial(kind.files, number)
    else:
        outcome, why, found = _read(kind, path)
    out["codes"][outcome] += 1
    if outcome == "FAILURE":
        out["failures"].append([number, why])
    elif outcome != "result":
        out["refused"] += 1
    else:
        out["accepted"] += 1
        _judge(kind, path, found, number, out)


def _read(kind: Kind, path: Path) -> tuple[str, str, Any]:
    try:
        with mutant_trial.time_limit(SECONDS):
            return "result", "", kind.read(path)
    except FemtuneError as error:
        return error.code, "", None
    except BaseException:
        return "FAILURE", traceback.format_exc(), None


def _judge(kind: Kind, path: Path, found: Any, number: int, out: dict[str, Any]) -> None:
    try:
        with mutant_trial.time_limit(3.0 * SECONDS):
            verdict = kind.judge(path, found)
    except Exception:
        verdict = None
    if verdict is not None:
        out["judged"] += 1
        if not verdict:
            out["differ"].append(number)


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=1e9, help="end after so long; the next run continues")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--group", default="", help="one row of the table, such as records; --count is of this alone")
    parser.add_argument("--only", default="", help="kinds whose name contains a word")
    parser.add_argument("--evidence", type=Path, help="folder of the page")
    options = parser.parse_args()
    kinds = {name: kind for name, kind in all_kinds().items() if options.group in ("", kind.group)}
    parts = [p for p in plan(kinds, options.count, options.seed) if options.only in p[0]]
    state = json.loads(_STATE.read_text()) if _STATE.exists() else {}
    key = f"{options.count} {options.seed}" + (f" {options.group}" if options.group else "")
    done = state.setdefault(key, {})
    todo = [p for p in parts if f"{p[0]} {p[1]}" not in done]
    end = time.monotonic() + 60.0 * options.minutes
    for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
    _STATE.parent.mkdir(exist_ok=True)
    with ProcessPoolExecutor(options.processes, mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(run_part, *part): part for part in todo}
        for future in as_completed(futures):
            if future.cancelled():
                continue
            name, first, _ = futures[future]
            print(f"{name}: {future.result()['accepted']} accepted", file=sys.stderr)
            done[f"{name} {first}"] = {**future.result(), "kind": name}
            _STATE.write_text(json.dumps(state))
            if time.monotonic() > end:
                for other in futures:
                    other.cancel()
    text, complete = page(kinds, done, options.seed), len(done) >= len(parts)
    print(text if complete else f"{len(done)} of {len(parts)} parts")
    for number, why in (f for part in done.values() for f in part["failures"]):
        print(f"mutant {number}:\n{why}")
    for part in done.values():
        if part["differ"]:
            print("differ:", part["kind"], part["differ"])
    if options.evidence and complete:
        (options.evidence / "benchmark_fuzz.md").write_text(text, encoding="utf-8")


def page(kinds: dict[str, Kind], done: dict[str, Any], seed: int) -> str:
    """The table as a page of the documentation."""
    rows: dict[str, Counter[str]] = {}
    slowest: dict[str, float] = {}
    memory: dict[str, float] = {}
    for part in done.values():
        group = kinds[part["kind"]].group
        row = rows.setdefault(group, Counter())
        for word in ("accepted", "refused", "judged"):
            row[word] += part[word]
        row["failures"] += len(part["failures"])
        row["differ"] += len(part["differ"])
        slowest[group] = max(slowest.get(group, 0.0), part["slowest"])
        memory[group] = max(memory.get(group, 0.0), part["mb"])
    total = sum((row for row in rows.values()), Counter())
    mutants = total["accepted"] + total["refused"] + total["failures"]
    table = []
    for name, row in rows.items():
        files = row["accepted"] + row["refused"] + row["failures"]
        counts = f"{files:,} | {row['refused']:,} | {row['accepted']:,} | {row['failures']}"
        cost, opinion = f"{slowest[name]:.1f} | {memory[name]:.0f}", f"{row['judged']:,} | {row['differ']}"
        table.append(f"| {name} | {counts} | {cost} | {opinion} |")
    return f"""# Damaged files

{mutants:,} files with one to four random changes (bytes, fields, lines, cards, numbers, line ends): decks, Universal
Files, matrices, records, tables, studies and results. Seed {seed}. Each was read or refused with a message. A failure
is a traceback, more than {SECONDS:g} s of the processor for one file, or an error of a deck without file and line.
Decks are read, written unchanged and with one new value, and solved. The memory is the largest of a process that read
many such files, with the libraries. Made by `benchmarks/fuzz/run.py`.

What was accepted is judged by another parser: decks by pyNastran (coordinates, MAT1, PSHELL, PBAR, CONM2), Universal
Files by pyuff, arrays by NumPy, SciPy and h5py, tables by the module csv, studies by tomllib, results by json. Files
that the other parser does not read are not judged.

| kind | files | refused | accepted | failures | slowest, s | memory, MB | judged | different |
| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |
{chr(10).join(table)}

Together: {total["failures"]} failures, {total["judged"]:,} accepted files judged, {total["differ"]} different.
"""


if __name__ == "__main__":
    main()
