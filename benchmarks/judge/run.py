"""How often the judge of a fit is right: python run.py [--each N] [--jobs N] [--evidence DIR].

Right and wrong models of six small structures are updated with noisy tests of structures whose values are known; each
with the true standard deviations, those that `femtune init` writes, and three times too small and too large ones.
Each finished model is written at once, so that an interrupted run goes on where it ended.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

from measure import Row, measured
from page import NAME, page
from trials import STATED, TrialKind

Job = tuple[TrialKind, int]


def jobs_of(each: int) -> list[Job]:
    """As many right as wrong models, half of the wrong ones with an error that is no field of the deck.

    They take turns, so that a run that is interrupted has some of all.
    """
    jobs: list[Job] = []
    for number in range(each):
        jobs.append(("right", number))
        jobs.append(("candidate" if number % 2 == 0 else "hidden", number // 2))
    return jobs


def known(path: Path, seed: int) -> dict[Job, Row]:
    """Finished models; a line that was cut is left out."""
    found: dict[Job, Row] = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except ValueError:
            continue
        if row["seed"] == seed:
            found[row["kind"], row["number"]] = row
    return found


def keep(path: Path, row: Row) -> None:
    """Write a row at once, on a line of its own."""
    cut = path.exists() and not path.read_bytes().endswith(b"\n")
    with path.open("a", encoding="utf-8") as out:
        out.write(("\n" if cut else "") + json.dumps(row) + "\n")


def finished(
    jobs: Sequence[Job], seed: int, stated: Sequence[str], starts_every: int, processes: int, until: float
) -> Iterator[Row]:
    """Rows as they end; nothing is begun after `until`, a time of the monotonic clock."""

    def arguments(job: Job) -> tuple[TrialKind, int, int, Sequence[str], bool]:
        return *job, seed, stated, job[1] % starts_every == 0

    if processes == 1:
        yield from (measured(*arguments(job)) for job in jobs if time.monotonic() < until)
        return
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(measured, *arguments(job)) for job in jobs}
        for done in as_completed(waiting):
            yield done.result()
            if time.monotonic() >= until:
                pool.shutdown(cancel_futures=True)
                return


def main() -> None:
    """Run what is missing, then write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=500, help="number of right models, and of wrong ones")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--stated", nargs="+", choices=list(STATED), default=list(STATED),
                        help="standard deviations that the studies state")  # fmt: skip
    parser.add_argument(
        "--starts-every", type=int, default=5, help="from how many models one is updated from 20 starts"
    )
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no model after this time")
    parser.add_argument("--evidence", type=Path, help="folder for the documentation's page")
    parser.add_argument("--work", type=Path, default=Path(__file__).resolve().parent / "partial",
                        help="folder of partial results; delete it to measure again")  # fmt: skip
    parser.add_argument("--page", action="store_true", help="measure nothing, write the page of what is measured")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    path = options.work / "models.jsonl"
    jobs, done = jobs_of(options.each), known(path, options.seed)
    missing = [job for job in jobs if job not in done and not options.page]
    until, begun = time.monotonic() + 60.0 * options.minutes, time.monotonic()
    rows = finished(missing, options.seed, options.stated, options.starts_every, options.jobs, until)
    for count, row in enumerate(rows, start=1):
        keep(path, row)
        done[row["kind"], row["number"]] = row
        elapsed = time.monotonic() - begun
        print(f"{count} of {len(missing)}, {elapsed:.0f} s: {row['kind']} {row['number']}, {row['structure']}, "
              f"{row['seconds']:.1f} s of the processor", flush=True)  # fmt: skip
    text = page([done[job] for job in jobs if job in done], len(jobs))
    if options.evidence is not None:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / f"{NAME}.md").write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
