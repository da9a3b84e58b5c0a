"""How often the judge of a fit is right: python run.py [--each N] [--jobs N] [--evidence DIR].

Right and wrong models of six small structures are updated with noisy tests of structures whose values are known; each
with the true standard deviations, those that `femtune init` writes, and three times too small and too large ones.
Each finished model is written at once, so that an interrupted run goes on where it ended.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

from decks import STRUCTURES
from measure import STARTS, Row, from_starts, measured
from page import NAME, page
from trials import STATED, TrialKind

Job = tuple[TrialKind, int]


def jobs_of(each: int) -> list[Job]:
    """As many right as wrong models, half of the wrong ones with an error that is no field of the deck.

    They take turns, so that a run that is stopped early is a fair table: twelve jobs have a right and a wrong model of
    each structure, 24 jobs a wrong one of each kind.
    """
    jobs: list[Job] = []
    for number in range(each):
        turn, place = divmod(number, len(STRUCTURES))
        wrong: TrialKind = "candidate" if (turn + place) % 2 == 0 else "hidden"
        jobs.append(("right", number))
        jobs.append((wrong, turn // 2 * len(STRUCTURES) + place))
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


def revision() -> str:
    """The commit of the program."""
    try:
        asked = ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short", "HEAD"]
        said = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:
        said = ""
    return said or "not known"


def keep(path: Path, row: Row) -> None:
    """Write a row at once, on a line of its own."""
    cut = path.exists() and not path.read_bytes().endswith(b"\n")
    with path.open("a", encoding="utf-8") as out:
        out.write(("\n" if cut else "") + json.dumps(row) + "\n")


def finished(
    work: Callable[..., Row], jobs: Sequence[Job], more: tuple[object, ...], processes: int, until: float
) -> Iterator[Row]:
    """Rows of `work(kind, number, *more)` as they end; nothing is begun after `until` (monotonic clock)."""
    if processes == 1:
        yield from (work(*job, *more) for job in jobs if time.monotonic() < until)
        return
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(work, *job, *more) for job in jobs]):
            yield done.result()
            if time.monotonic() >= until:
                pool.shutdown(cancel_futures=True)
                return


@dataclass(frozen=True)
class Series:
    """Models with their journal.

    Parameters
    ----------
    path : of the journal, a line a model
    work : kind, number, seed, more -> row
    more : further arguments of `work`
    """

    path: Path
    work: Callable[..., Row]
    seed: int
    more: tuple[object, ...] = ()

    def rows(self, jobs: Sequence[Job], processes: int, until: float) -> list[Row]:
        """What is known of some models, and what is missing measured, until a time of the monotonic clock."""
        done, of_program, begun = known(self.path, self.seed), revision(), time.monotonic()
        missing = [job for job in jobs if job not in done]
        for count, row in enumerate(finished(self.work, missing, (self.seed, *self.more), processes, until), start=1):
            row["revision"] = of_program
            keep(self.path, row)
            done[row["kind"], row["number"]] = row
            print(
                f"{self.path.stem} {count} of {len(missing)}, {time.monotonic() - begun:.0f} s: {row['kind']} "
                f"{row['number']}, {row['structure']}, {row['seconds']:.1f} s of the processor",
                flush=True,
            )
        return [done[job] for job in jobs if job in done]


def main() -> None:
    """Run what is missing, then write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=500, help="number of right models, and of wrong ones")
    parser.add_argument("--starts", type=int, default=100, help=f"number of models with {STARTS} starts")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--stated", nargs="+", choices=list(STATED), default=list(STATED),
                        help="standard deviations that the studies state")  # fmt: skip
    parser.add_argument("--wrong-every", type=int, default=1,
                        help="of how many models of a structure one has deviations that are 3 times wrong")  # fmt: skip
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no model after this time")
    parser.add_argument("--evidence", type=Path, help="folder for the documentation's page")
    parser.add_argument("--work", type=Path, default=Path(__file__).resolve().parent / "partial",
                        help="folder of partial results; delete it to measure again")  # fmt: skip
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    until, jobs = time.monotonic() + 60.0 * options.minutes, jobs_of(options.each)
    models = Series(options.work / "models.jsonl", measured, options.seed, (tuple(options.stated), options.wrong_every))
    starts = Series(options.work / "starts.jsonl", from_starts, options.seed)
    rows = models.rows(jobs, options.jobs, until)
    started = starts.rows(jobs[: options.starts], options.jobs, until)
    text = page(rows, started, len(jobs))
    if options.evidence is not None:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / f"{NAME}.md").write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
