"""femtune's search beside general solvers: python run.py [--quick] [--processes N] [--evidence DIR] [--work DIR].

Bounded problems of six families, ten starts each: the nominal values and a Latin hypercube over the bounds. All solvers
minimise the same residuals with the same derivatives from the same points; the rivals are also started from the ends
of femtune. Every finished problem is written at once, so that an interrupted run goes on where it ended.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from families import Named, problems
from objective import BestPairing
from page import STARTS, Measured, write_page
from solvers import MOST_AGAIN, OURS, RIVALS, SOLVERS, Ended

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.updating import SensitivityMethod, update
from femtune.updating.starts import StartRules, starting_points

Row = dict[str, Any]


def starts_of(problem: BestPairing) -> Reals:
    """(STARTS, k) the nominal values, and points of a Latin hypercube over the bounds."""
    k = len(problem.parameters.free)
    return np.vstack([np.zeros(k), starting_points(problem.parameters, StartRules(STARTS - 1, seed=0))])


@cache
def _named(name: str) -> tuple[Named, BestPairing]:
    named = next(p for p in problems() if p.name == name)
    return named, named.make()


def measured(name: str, number: int) -> Row:
    """All solvers from one start of a problem, number 0 from the nominal values, and rivals from the end of femtune."""
    named, problem = _named(name)
    begun = time.perf_counter()
    x = starts_of(problem)[number]
    ended = {solver: solve(problem, x) for solver, solve in SOLVERS.items()}
    ours = ended[OURS]
    again = {solver: solve(problem, ours.x, MOST_AGAIN) for solver, solve in RIVALS.items()}
    row: Row = {
        "name": name, "family": named.family, "text": named.text, "start": number, "residuals": problem.size,
        "parameters": len(problem.parameters.free), "solvers": {s: _summary(end) for s, end in ended.items()},
        "restarted": {s: _lowered(ours.objective, end) for s, end in again.items()},
        "at_bound": _share_at_bounds(problem, ours),
    }  # fmt: skip
    if number == 0:
        row["smallest_change"] = _smallest_change(problem)
    return row | {"seconds": round(time.perf_counter() - begun, 1)}


def _summary(end: Ended) -> Row:
    """What the tables need of a run: where the objective first came within some factors of its last value, and so on.

    `falls` are solutions at which the objective fell, with its value there.
    """
    lowest, falls = np.inf, []
    for number, value in enumerate(end.trace, start=1):
        if value < lowest:
            lowest = value
            falls.append([number, float(value)])
    return {
        "objective": end.objective, "solutions": len(end.trace), "status": end.status,
        "seconds": round(end.seconds, 3), "falls": falls,
    }  # fmt: skip


def _lowered(ours: float, end: Ended) -> float:
    """By how much a rival lowered our objective, relative to it."""
    return float((ours - end.objective) / ours) if ours > 0.0 else 0.0


def _share_at_bounds(problem: BestPairing, end: Ended) -> float:
    lower, upper = problem.parameters.bounds
    near = 1e-9 * np.minimum(upper - lower, 1.0 + np.maximum(np.abs(lower), np.abs(upper)))
    return float(np.mean((end.x - lower <= near) | (upper - end.x <= near)))


def _smallest_change(problem: BestPairing) -> Row:
    """The default settings of users from the nominal values: the smallest change and its certificate."""
    try:
        counted = problem.counted()
        found = update(counted, SensitivityMethod())
    except FemtuneError as error:
        return {"status": str(error.what)}
    small, certificate = found.smallest_change, found.certificate
    row: Row = {
        "status": found.status.name, "projected_gradient": certificate.projected_gradient,
        "predicted_decrease": certificate.predicted_decrease, "solutions": len(counted.trace.objectives),
        "least_multiplier": min(certificate.multipliers.values(), default=0.0),
        "largest_multiplier": max(certificate.multipliers.values(), default=0.0),
        "at_bound": len(certificate.multipliers), "objective": found.objective,
    }  # fmt: skip
    if small is not None:
        row |= {"allowed": small.allowed, "increase": small.increase, "optimum_size": small.optimum_size,
                "size": small.size, "optimum_at_bound": len(small.optimum_at_bound)}  # fmt: skip
    return row


def known(path: Path) -> dict[tuple[str, int], Row]:
    """Finished starts by problem and number; a line that was cut is left out."""
    found: dict[tuple[str, int], Row] = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except ValueError:
            continue
        found[row["name"], row["start"]] = row
    return found


def _finished(missing: Sequence[tuple[str, int]], processes: int) -> Iterator[Row]:
    with ProcessPoolExecutor(processes) as pool:
        yield from (job.result() for job in as_completed([pool.submit(measured, *job) for job in missing]))


def main() -> None:
    """Run what is missing, then write tables and figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the first problem of every family, two starts")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--evidence", type=Path, help="folder for the documentation's page")
    parser.add_argument("--work", type=Path, default=Path(__file__).resolve().parent / "partial",
                        help="folder of partial results; delete it to measure again")  # fmt: skip
    parser.add_argument("--page", action="store_true", help="measure nothing, write the page of what is measured")
    options = parser.parse_args()
    every = problems()
    first = {p.family: p.name for p in reversed(every)}
    names = list(first.values())[::-1] if options.quick else [p.name for p in every]
    options.work.mkdir(parents=True, exist_ok=True)
    path = options.work / "starts.jsonl"
    done = known(path)
    # first the nominal values of all problems, by turns of the families, so that an interrupted run has some of each
    by_turns = sorted(names, key=lambda name: int(name.split()[-1]))
    wanted = [(name, number) for number in range(2 if options.quick else STARTS) for name in by_turns]
    for row in _finished([job for job in wanted if job not in done and not options.page], options.processes):
        cut = path.exists() and not path.read_bytes().endswith(b"\n")
        with path.open("a", encoding="utf-8") as out:
            out.write(("\n" if cut else "") + json.dumps(row) + "\n")
        done[row["name"], row["start"]] = row
        counts = {solver: end["solutions"] for solver, end in row["solvers"].items()}
        print(f"{row['name']}, start {row['start']}: {row['seconds']:.0f} s, solutions {counts}", flush=True)
    found = [Measured(tuple(done[name, n] for n in range(STARTS) if (name, n) in done)) for name in names]
    print(write_page([m for m in found if m.runs], options.evidence))


if __name__ == "__main__":
    main()
