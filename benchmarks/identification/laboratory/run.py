"""Identification of what laboratories record: run.py [--structures N] [--minutes M] [--only femtune] [--evidence DIR].

Each structure is tested under each excitation; femtune, sdypy-EMA and pyOMA2 identify the same samples. Every finished
test is written to a journal at once, so that a run can be interrupted and continued. Tests take a drawn order: a run
that is stopped early is a sample of all of them.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import numpy as np
from bounds import bounds
from page import page
from score import score
from simulated import KINDS, KNOWN_FORCE, STRUCTURES, recorded, structure
from ways import by_femtune, by_peer, peers, write_test

Key = tuple[int, str, str]
"""Structure, excitation, who."""


def keys(structures: int, only: str | None) -> list[Key]:
    """All tests in the order in which they are run."""
    tests = [(seed, kind) for seed in range(structures) for kind in KINDS]
    order = np.random.default_rng(32).permutation(len(tests))
    return [(*tests[i], who) for i in order for who in ways(tests[i][1]) if only in (None, who)]


def ways(kind: str) -> tuple[str, ...]:
    """Who identifies this excitation and is installed."""
    peer, module = ("sdypy-EMA", "sdypy.EMA") if kind in KNOWN_FORCE else ("pyOMA2", "pyoma2")
    return ("femtune", peer) if peers.installed(module) else ("femtune",)


def finished(path: Path) -> dict[Key, dict[str, Any]]:
    """Rows of the journal; a line that was cut is left out."""
    rows = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except ValueError:
            continue
        rows[row["seed"], row["kind"], row["who"]] = row
    return rows


def keep(path: Path, row: dict[str, Any]) -> None:
    """Write a row at once, on a line of its own."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cut = path.exists() and not path.read_bytes().endswith(b"\n")
    with path.open("a", encoding="utf-8") as out:
        out.write(("\n" if cut else "") + json.dumps(row) + "\n")


def one_test(key: Key) -> dict[str, Any]:
    """Simulate, identify and judge; the time is that of the identification with the reading of the file."""
    seed, kind, who = key
    one = structure(seed)
    test = recorded(one, kind)
    bound = bounds(one, test)
    with tempfile.TemporaryDirectory() as folder:
        path = write_test(test, Path(folder))
        begun = time.process_time()
        found, code = (by_femtune if who == "femtune" else by_peer)(test, path)
        seconds = time.process_time() - begun
    about = {"channels": len(one.shapes), "noise_db": one.noise_db, "apart": one.apart, "lines_hz": test.lines_hz}
    names = {"seed": seed, "kind": kind, "who": who, "seconds": seconds, "error": code}
    return {**names, **about, **score(one, bound, found)}


def run(wanted: list[Key], path: Path, until: float) -> Iterator[dict[str, Any]]:
    """Rows of all tests, those of the journal first; nothing is begun after `until` (monotonic clock)."""
    known = finished(path)
    yield from (known[key] for key in wanted if key in known)
    for key in wanted:
        if key in known:
            continue
        if time.monotonic() > until:
            return
        row = one_test(key)
        keep(path, row)
        false = sum(not mode["doubtful"] for mode in row["false"])
        seen = sum(mode["found"] is not None for mode in row["modes"])
        print(f"{key}: {seen} of {len(row['modes'])}, {false} false, {row['seconds']:.1f} s {row['error']}", flush=True)
        yield row


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--structures", type=int, default=STRUCTURES)
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no test after this time")
    parser.add_argument("--only", help="femtune, sdypy-EMA or pyOMA2")
    parser.add_argument("--journal", type=Path, default=Path("build/laboratory.jsonl"))
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    wanted = keys(options.structures, options.only)
    rows = list(run(wanted, options.journal, time.monotonic() + 60.0 * options.minutes))
    text = page(rows, len(wanted))
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "benchmark_laboratory.md").write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
