"""How often the chain from measured FRFs to parameters is right: python run.py [--each N] [--evidence DIR].

Simulated tests of a frame, of uneven damping and with noise, are identified, compared with one damping ratio, and then
compared as they were measured. Each finished trial is written at once, so that an interrupted run goes on where it
ended; each is a process of its own that ends after a few seconds.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

import numpy as np
from frame import EQUAL, FLOOR, GROUPS, KINDS, LINES, MASS, NOISE, SOFT, SPREAD, ZETA, Kind, Trial
from scipy.stats import beta

import femtune as ft

PAGE = "benchmark_chain.md"
Row = dict[str, Any]
INSIDE = 1.96
"""Half width of a 95 % interval in standard deviations."""
HARMFUL = 3.0
"""Error in standard deviations from which a final value is wrong, so that the reader should have been told."""
TOLD = frozenset({
    "update.raw-misfit", "update.raw-moved", "update.mode-not-identified", "update.mode-not-in-model", "judge.misfit",
    "judge.missing", "residual.frf-sign", "update.no-raw", "update.raw-open",
})  # fmt: skip
"""Warnings and reasons that doubt a model."""


def trial(kind: Kind, number: int) -> Row:
    """One test: its parameters in standard deviations from the truth, and what the reader is told."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        one = Trial(kind, number)
        results = ft.run(one.write(Path(folder))).results
    update, judged = results.update, results.judgement
    assert update is not None
    first = {} if update.raw is None else {v.parameter: v for v in update.raw.values}

    def off(value: float, sd: float | None, true: float) -> float | None:
        return None if sd is None else (value - true) / sd

    truth = dict(zip(GROUPS, one.truth.tolist()))
    equalised = [off(v.equalised, v.equalised_sd, truth[name]) for name, v in first.items()]
    alerts = {a.code for a in results.alerts if a.level != "info"}
    return {
        "kind": kind, "number": number, "ok": update.ok, "raw": update.raw is not None,
        "equalised": equalised, "final": [off(p.value, p.sd, truth[p.name]) for p in update.parameters],
        "relative": [p.value / truth[p.name] - 1.0 for p in update.parameters],
        "codes": sorted(alerts | ({r.code for r in judged.reasons} if judged else set())),
        "found": any(a.code == "update.mode-found" for a in results.alerts),
        "verdict": None if judged is None else judged.verdict, "seconds": time.process_time() - begun,
    }  # fmt: skip


def known(path: Path) -> dict[tuple[str, int], Row]:
    """Finished trials; a line that was cut is left out."""
    found = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except ValueError:
            continue
        found[row["kind"], row["number"]] = row
    return found


def finished(path: Path, each: int, until: float) -> list[Row]:
    """All trials, the missing ones each in a process of its own; none begins after `until` (monotonic clock)."""
    rows = known(path)
    for number in range(each):
        for kind in KINDS:
            if (kind, number) in rows or time.monotonic() >= until:
                continue
            asked = [sys.executable, __file__, "--one", kind, str(number)]
            done = subprocess.run(asked, capture_output=True, text=True, check=False)
            if done.returncode:
                print(f"{kind} {number}: {done.stderr.strip().splitlines()[-1]}", flush=True)
                continue
            with path.open("a", encoding="utf-8") as out:
                out.write(done.stdout.splitlines()[-1] + "\n")
            rows = known(path)
            row = rows[kind, number]
            print(f"{kind} {number}: {row['seconds']:.1f} s, largest {_largest(row['final']):.2f} sd", flush=True)
    return [row for (_, number), row in sorted(rows.items()) if number < each]


def _largest(values: list[float | None]) -> float:
    return max((abs(v) for v in values if v is not None), default=float("nan"))


def _share(count: int, of: int) -> str:
    """A part with its 95 % limits (Clopper and Pearson)."""
    if not of:
        return "-"
    low = beta.ppf(0.025, count, of - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, of - count) if count < of else 1.0
    return f"{count} of {of} ({100 * low:.0f} to {100 * high:.0f} %)"


def page(rows: list[Row], each: int) -> str:
    """The page of the documentation."""
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    of = {kind: [r for r in rows if r["kind"] == kind] for kind in KINDS}
    lines = [
        "# From measured FRFs to parameters: simulated tests",
        "",
        f"Written by `make bench-chain` on {today}: {len(rows)} of {each * len(KINDS)} trials. A free frame of 38",
        f"beams with five moduli, drawn within ±{100 * SPREAD:.0f} %; accelerances of eight outputs and two inputs",
        f"from {LINES[0]:g} to {LINES[-1]:g} Hz; damping ratios of {100 * ZETA[0]:g} to {100 * ZETA[1]:g} %, unknown",
        f"to the model; noise of {100 * NOISE:g} % of each value and of {100 * FLOOR:g} % of the largest one of its",
        f"FRF. Each test is identified, compared at a damping ratio of {100 * EQUAL:g} % (`[equalise]`), and then as",
        "it was measured.",
        "",
        "| model | inside their 95 % interval, equal damping | inside, measured FRFs | largest mean error in sd | told "
        "| wrong by more than 3 sd, of which told |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    names = {
        "right": "right",
        "compliance": f"lacks a soft corner (modulus of two beams × {SOFT:g})",
        "mass": f"lacks a mass of {MASS:g} kg (frame: 7.2 kg)",
        "missed": "right; the identification drops a mode",
    }
    for kind, own in of.items():
        cells = [_covered(own, "equalised"), _covered(own, "final"), _bias(own), _told(own)]
        harmful = [r for r in own if _largest(r["final"]) > HARMFUL]
        lines.append("| " + " | ".join([names[kind], *cells, _told(harmful)]) + " |")
    found = sum(bool(r["found"]) or "update.mode-not-identified" in r["codes"] for r in of["missed"])
    seconds = np.median([r["seconds"] for r in rows]) if rows else float("nan")
    lines += [
        "",
        f"A dropped mode is found again or named in {_share(found, len(of['missed']))}. A trial takes {seconds:.0f} s",
        "of processor time (median). Parameters: five of each trial. *Told* counts trials with at least one of these:",
        ", ".join(f"{name} ({count})" for name, count in _codes(rows)) + ".",
        "",
    ]
    return "\n".join(lines)


def _codes(rows: list[Row]) -> list[tuple[str, int]]:
    return Counter(code for r in rows for code in r["codes"] if code in TOLD).most_common()


def _covered(rows: list[Row], key: str) -> str:
    values = [v for r in rows for v in r[key] if v is not None]
    return _share(sum(abs(v) < INSIDE for v in values), len(values))


def _bias(rows: list[Row]) -> str:
    values = np.array([r["final"] for r in rows if None not in r["final"]], float)
    return f"{np.abs(values.mean(axis=0)).max():.2f}" if len(values) else "-"


def _told(rows: list[Row]) -> str:
    return _share(sum(not TOLD.isdisjoint(r["codes"]) for r in rows), len(rows))


def main() -> None:
    """Run what is missing, then write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=20, help="trials of each kind")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no trial after this time")
    parser.add_argument("--evidence", type=Path, help="folder for the documentation's page")
    parser.add_argument("--work", type=Path, default=Path(__file__).resolve().parent / "partial",
                        help="folder of partial results; delete it to measure again")  # fmt: skip
    parser.add_argument("--one", nargs=2, metavar=("KIND", "NUMBER"), help="only this trial, printed as JSON")
    options = parser.parse_args()
    if options.one:
        print(json.dumps(trial(options.one[0], int(options.one[1]))))
        return
    options.work.mkdir(parents=True, exist_ok=True)
    until = time.monotonic() + 60.0 * options.minutes
    text = page(finished(options.work / "trials.jsonl", options.each, until), options.each)
    print(text)
    if options.evidence:
        (options.evidence / PAGE).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
