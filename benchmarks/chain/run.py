"""How often the chain from measured FRFs to parameters is right: python run.py [--each N] [--evidence DIR].

Simulated tests, of uneven damping and with noise, are identified, compared with one damping ratio, and then compared as
they were measured. Each finished trial is written at once, so that an interrupted run goes on where it ended; a process
makes a few of them. Reports are not written, and no other minima are looked for: these take two thirds of the time.
"""

from __future__ import annotations

import argparse
import datetime
import inspect
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
from frame import EQUAL, FLOOR, KINDS, LINES, MASS, NOISE, SETUPS, SOFT, SPREAD, ZETA, Kind, SetUp, Trial
from scipy.stats import beta

import femtune as ft
from femtune.steps.update import in_run
from femtune.steps.update import run as update_run
from femtune.uncertainty import common_test_of_estimates

PAGE = "benchmark_chain.md"
Row = dict[str, Any]
INSIDE = 1.96
"""Half width of a 95 % interval in standard deviations."""
HARMFUL = 3.0
"""Error in standard deviations from which a final value is wrong, so that the reader should have been told."""
TOLD = frozenset({
    "update.raw-misfit", "update.raw-moved", "update.mode-not-identified", "update.mode-not-in-model",
    "residual.frf-sign", "update.no-raw", "update.raw-open",
})  # fmt: skip
"""Warnings that doubt a model or a test."""
BATCH = 6
"""Trials of a process."""
REDRAWN = 4
"""Every such trial has a bootstrap."""
RUNS = 100
"""Runs of a bootstrap."""
ELSEWHERE = 0.05
"""Largest relative error of a parameter above which an update of exact FRFs has ended in another minimum."""
EXACT = 5
"""Trials of each set-up that are repeated without noise."""
MORE = """then = "raw"
[update]
look_further = false
[output]
live = false
"""
Key = tuple[SetUp, Kind, int, bool]
"""Set-up, kind, number, and whether the FRFs have noise."""


ends: dict[str, Any] = {}
"""Results of the updates of a trial: "equalised", of that with equal damping, and "final"."""


def keep_ends() -> None:
    """Keep the results of all updates, whose covariances are not written."""
    then_raw, find_parameters = update_run.then_raw, in_run.find_parameters

    def keep(name: str, result: Any) -> None:
        if name in ends:
            raise RuntimeError(f"a trial has two results: {name}")
        ends[name] = result

    def with_equal_damping(*given: Any, **named: Any) -> Any:
        keep("equalised", inspect.signature(then_raw).bind(*given, **named).arguments["equalised"])
        return then_raw(*given, **named)

    def found(*given: Any, **named: Any) -> Any:
        out = find_parameters(*given, **named)
        keep("final", out.result)
        return out

    update_run.then_raw, in_run.find_parameters = with_equal_damping, found


def together(one: Trial) -> dict[str, list[list[float]]]:
    """Errors of all normalised parameters, and below them their covariance, with equal damping and at the end."""
    out = {}
    for name, end in ends.items():
        if np.isfinite(end.covariance.matrix).all():
            out[name] = [(end.x - (one.truth - 1.0)).tolist(), *end.covariance.matrix.tolist()]
    return out


def trial(setup: SetUp, kind: Kind, number: int, *, noisy: bool) -> Row:
    """One test: its parameters in standard deviations from the truth, and what the reader is told."""
    begun = time.process_time()
    one = Trial(kind, number, noisy, setup)
    redrawn = noisy and not number % REDRAWN
    more = MORE + (f"[bootstrap]\nruns = {RUNS}\nchecked = 0\n" if redrawn else "")
    ends.clear()
    with tempfile.TemporaryDirectory() as folder:
        study = one.write(Path(folder), more)
        results = (ft.bootstrap if redrawn else ft.update)(study, output=Path(folder) / "out").results
    update = results.update
    assert update is not None
    first = {} if update.raw is None else {v.parameter: v for v in update.raw.values}

    def off(value: float, sd: float | None, true: float) -> float | None:
        return None if sd is None else (value - true) / sd

    truth = dict(zip(one.groups, one.truth.tolist()))
    drawn = () if results.bootstrap is None else results.bootstrap.parameters
    codes = sorted({a.code for a in results.alerts if a.level != "info"})
    return {
        "setup": setup, "kind": kind, "number": number, "noisy": noisy, "ok": update.ok, "raw": update.raw is not None,
        "equalised": [off(v.equalised, v.equalised_sd, truth[name]) for name, v in first.items()],
        "equalised_shift": [v.equalised / truth[name] - 1.0 for name, v in first.items()],
        "final": [off(p.value, p.sd, truth[p.name]) for p in update.parameters],
        "shift": [p.value / truth[p.name] - 1.0 for p in update.parameters],
        "bootstrap": [bool(p.interval_95[0] <= truth[p.parameter] <= p.interval_95[1]) for p in drawn],
        "together": together(one), "codes": codes,
        "verdict": None if results.judgement is None else results.judgement.verdict,
        "reasons": () if results.judgement is None else [r.code for r in results.judgement.reasons],
        "found": any(a.code == "update.mode-found" for a in results.alerts),
        "seconds": time.process_time() - begun,
    }  # fmt: skip


def key_of(row: Row) -> Key:
    """What a row was made of."""
    return row["setup"], row["kind"], row["number"], row["noisy"]


def known(path: Path) -> dict[Key, Row]:
    """Finished trials; a line that was cut is left out."""
    found = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except ValueError:
            continue
        found[key_of(row)] = row
    return found


def wanted(each: int, others: int) -> list[Key]:
    """All trials: every kind in the first set-up, right models in the others, and some without noise."""
    first, *further = SETUPS
    keys: list[Key] = []
    for number in range(max(each, others)):
        if number < each:
            keys += [(first, kind, number, True) for kind in KINDS]
        if number < others:
            keys += [(setup, "right", number, True) for setup in further]
        if number < min(EXACT, each):
            keys.append((first, "right", number, False))
    return keys


def finished(path: Path, keys: list[Key], until: float) -> list[Row]:
    """All trials, the missing ones a few in a process; none begins after `until` (monotonic clock)."""
    rows, failed = known(path), set[Key]()
    while time.monotonic() < until:
        left = [key for key in keys if key not in rows and key not in failed][:BATCH]
        if not left:
            break
        asked = [
            sys.executable,
            __file__,
            "--some",
            json.dumps(left),
            "--seconds",
            str(min(until - time.monotonic(), 1e9)),
        ]
        with path.open("a", encoding="utf-8") as out:
            done = subprocess.run(asked, stdout=out, stderr=subprocess.PIPE, text=True, check=False)
        rows = known(path)
        if done.returncode:
            failed.add(next(key for key in left if key not in rows))
            print(f"{done.stderr.strip().splitlines()[-1]}", flush=True)
        for key in left:
            if key in rows:
                row = rows[key]
                print(f"{key}: {row['seconds']:.1f} s, largest {_largest(row['final']):.2f} sd", flush=True)
    return [rows[key] for key in keys if key in rows]


def _largest(values: list[float | None]) -> float:
    return max((abs(v) for v in values if v is not None), default=float("nan"))


def _share(count: int, of: int) -> str:
    """A part with its 95 % limits (Clopper and Pearson)."""
    if not of:
        return "-"
    low = beta.ppf(0.025, count, of - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, of - count) if count < of else 1.0
    return f"{count} of {of} ({100 * low:.0f} to {100 * high:.0f} %)"


def page(rows: list[Row], asked: int) -> str:
    """The page of the documentation."""
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    noisy = [r for r in rows if r["noisy"]]
    exact = [r for r in rows if not r["noisy"]]
    first = SETUPS[0]
    of = {kind: [r for r in noisy if r["kind"] == kind and r["setup"] == first] for kind in KINDS}
    lines = [
        "# From measured FRFs to parameters: simulated tests",
        "",
        f"Written by `make bench-chain` on {today}: {len(rows)} of {asked} trials. A free frame of 38 beams with five",
        "moduli, or a free plate of 60 shells with six, drawn within "
        f"±{100 * SPREAD:.0f} %; accelerances from {LINES[0]:g} to {LINES[-1]:g} Hz of outputs × inputs;",
        f"damping ratios of {100 * ZETA[0]:g} to {100 * ZETA[1]:g} %, unknown to the model; noise of",
        f"{100 * NOISE:g} % of each value and of {100 * FLOOR:g} % of the largest one of its FRF. Each test is",
        f"identified, compared at a damping ratio of {100 * EQUAL:g} % (`[equalise]`), and then as it was measured.",
        f"Standard deviations are those that the run states. Every {REDRAWN}th trial has a bootstrap of {RUNS} runs.",
        "No other minima are looked for.",
        "",
        "| model | test | inside their 95 % interval, equal damping | inside, measured FRFs | inside, bootstrap "
        "| largest mean error in sd | told | wrong by more than 3 sd, of which told |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    names = {
        "right": "right",
        "compliance": f"lacks a soft corner (modulus of two beams × {SOFT:g})",
        "mass": f"lacks a mass of {MASS:g} kg (frame: 7.2 kg)",
        "missed": "right; the identification drops a mode",
    }
    sets = [(names[kind], first, own) for kind, own in of.items()]
    sets += [("right", s, [r for r in noisy if r["setup"] == s]) for s in SETUPS[1:]]
    for name, setup, own in sets:
        harmful = [r for r in own if _largest(r["final"]) > HARMFUL]
        cells = [
            _covered(own, "equalised"),
            _covered(own, "final"),
            _redrawn(own),
            _bias(own),
            _told(own),
            _told(harmful),
        ]
        lines.append("| " + " | ".join([name, setup.replace(" x ", " × "), *cells]) + " |")
    found = sum(bool(r["found"]) or "update.mode-not-identified" in r["codes"] for r in of["missed"])
    seconds = np.median([r["seconds"] for r in rows]) if rows else float("nan")
    lines += [
        "",
        f"A dropped mode is found again or named in {_share(found, len(of['missed']))}. A trial takes {seconds:.0f} s",
        "of processor time (median). Parameters: five or six of each trial. *Told* counts trials with at least one of",
        "these: " + (", ".join(f"{name} ({count})" for name, count in _codes(noisy)) or "none occurred") + ".",
        "",
    ]
    lines += [
        f"Common parameters over {SPECIMENS} specimens, tested at {100 * LEVEL:g} % by the errors of right models of "
        f"{first.replace(' x ', ' × ')}:",
        f"with equal damping {specimens(of['right'], 'equalised')};",
        f"with the measured FRFs {specimens(of['right'], 'final')}.",
        "",
    ]
    if exact:
        equal = [_largest(r["equalised_shift"]) for r in exact]
        last = [_largest(r["shift"]) for r in exact]
        lines += [
            f"Without noise ({len(exact)} trials of {first.replace(' x ', ' × ')}), the largest relative error of a",
            f"parameter is {np.median(equal):.1e} (median; largest {max(equal):.1e}) with equal damping and",
            f"{np.median(last):.1e} (largest {max(last):.1e}) with the measured FRFs. With equal damping "
            f"{sum(e > ELSEWHERE for e in equal)} ended in another minimum than that of the true values (an error",
            f"above {100 * ELSEWHERE:g} %); by default an update looks further (`look_further`).",
            "",
        ]
    return "\n".join(lines)


SPECIMENS = 3
LEVEL = 0.05
PLANTED = 5.0
"""Difference of one parameter of one specimen, in its standard deviations."""


def specimens(rows: list[Row], which: str) -> str:
    """How often the test of common parameters over specimens is right, by the errors of trials of a right model."""
    known = [r["together"][which] for r in rows if which in r["together"]]
    groups = [known[i : i + SPECIMENS] for i in range(0, len(known) - SPECIMENS + 1, SPECIMENS)]
    accused = found = 0
    for number, group in enumerate(groups):
        values, covariances = [np.array(g[0]) for g in group], [np.array(g[1:]) for g in group]
        accused += common_test_of_estimates(values, covariances).p_value < LEVEL
        at = number % len(values[0])
        values[0][at] += PLANTED * np.sqrt(covariances[0][at, at])
        found += common_test_of_estimates(values, covariances).p_value < LEVEL
    return (
        f"equal ones are rejected in {_share(accused, len(groups))}, a difference of {PLANTED:g} sd of one parameter "
        + (f"is found in {_share(found, len(groups))}")
    )


def _redrawn(rows: list[Row]) -> str:
    inside = [v for r in rows for v in r["bootstrap"]]
    return _share(sum(inside), len(inside))


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
    parser.add_argument("--each", type=int, default=200, help="trials of each kind with the first set-up")
    parser.add_argument("--others", type=int, default=200, help="trials of each other set-up")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no trial after this time")
    parser.add_argument("--evidence", type=Path, help="folder for the documentation's page")
    parser.add_argument("--work", type=Path, default=Path(__file__).resolve().parent / "partial",
                        help="folder of partial results; delete it to measure again")  # fmt: skip
    parser.add_argument("--some", help="only these trials, a JSON list of set-up, kind, number and noise; prints JSON")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="with --some: begin none after this time")
    options = parser.parse_args()
    if options.some:
        until = time.monotonic() + options.seconds
        keep_ends()
        for setup, kind, number, noisy in json.loads(options.some):
            if time.monotonic() < until:
                print(json.dumps(trial(setup, kind, number, noisy=noisy)), flush=True)
        return
    options.work.mkdir(parents=True, exist_ok=True)
    until = time.monotonic() + 60.0 * options.minutes
    keys = wanted(options.each, options.others)
    text = page(finished(options.work / "trials.jsonl", keys, until), len(keys))
    print(text)
    if options.evidence:
        (options.evidence / PAGE).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
