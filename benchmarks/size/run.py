"""Speed and memory against size, beside what one would take instead: python benchmarks/size/run.py [--quick].

Every run is a process of its own, and its row goes to a journal at once: a second start goes on where the first one
ended. Ends with code 1 where a result is wrong.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))  # where structures/ lies

from figure import write_figure
from journal import Journal
from machine import described
from plan import EVERYWHERE, PEERS, QUICK, Plan
from process import Limits
from summary import summaries
from tables import page, short

from cases import CASES, Case
from femtune.model.distributed import launch

_FOLDER = Path("build/benchmark_size")


def arguments() -> argparse.Namespace:
    """Options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="20,000 and 5,000 degrees of freedom, one run each")
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--sizes", nargs="+", type=int, help="degrees of freedom instead of each case's own")
    parser.add_argument("--ways", nargs="+", choices=[*EVERYWHERE, *PEERS], default=[*EVERYWHERE, *PEERS])
    parser.add_argument("--repeats", type=int, default=3, help="runs at the sizes where all ways are compared")
    parser.add_argument("--size-repeats", type=int, default=1, help="runs at the other sizes")
    parser.add_argument("--threads", type=int, default=launch.cores())
    parser.add_argument("--limit-seconds", type=float, default=1800.0, help="a run with its checks is ended there")
    parser.add_argument("--limit-gib", type=float, default=12.0, help="and there")
    parser.add_argument("--folder", type=Path, help=f"journal and files between ({_FOLDER})")
    parser.add_argument("--fresh", action="store_true", help="forget the journal")
    parser.add_argument("--tables-only", action="store_true", help="write the page from the journal")
    parser.add_argument("--evidence", type=Path, help="folder for the page, its numbers and its figure")
    return parser.parse_args()


def planned(chosen: argparse.Namespace, folder: Path) -> Plan:
    """What the options ask for."""
    cases = [CASES[name] for name in chosen.cases]
    if chosen.quick:
        sizes = tuple((case, size) for case, size in QUICK if case in cases)
        compared = {(case.name, size) for case, size in sizes}
    else:
        sizes = tuple((case, size) for case in cases for size in chosen.sizes or case.sizes)
        compared = {(case.name, size) for case, size in sizes if _is_compared(case, size, chosen.sizes)}
    repeats = 1 if chosen.quick else chosen.repeats
    limits = Limits(chosen.limit_seconds, chosen.limit_gib)
    ways = tuple(chosen.ways)
    return Plan(folder, sizes, frozenset(compared), ways, repeats, chosen.size_repeats, chosen.threads, limits)


def _is_compared(case: Case, size: int, asked: list[int] | None) -> bool:
    """All ways at the main size and at the smallest; at all sizes where they were asked for by number."""
    return asked is not None or size in (case.main_size, min(case.sizes))


def report(plan: Plan, evidence: Path | None) -> None:
    """Print the page, and write it where asked."""
    rows = plan.journal.rows
    if not rows:
        print("nothing is measured yet")
        return
    found, machine = summaries(rows), described(plan.threads)
    limits = f"after {plan.limits.seconds:.0f} s with its checks, or above {plan.limits.gib:g} GiB"
    print(page(found, machine, limits, None))
    if evidence:
        evidence.mkdir(parents=True, exist_ok=True)
        (evidence / "benchmark_size.md").write_text(page(found, machine, limits, "benchmark_size.svg"))
        (evidence / "benchmark_size.json").write_text(json.dumps({"machine": machine, "rows": _slim(rows)}, indent=1))
        write_figure(found, evidence / "benchmark_size.svg")


def _slim(rows: list[dict]) -> list[dict]:
    return [{name: value for name, value in row.items() if name != "freq_hz"} for row in rows]


def main() -> int:
    """Measure and report; 1 where a row is wrong or failed."""
    chosen = arguments()
    passing = chosen.quick and chosen.folder is None
    folder = Path(tempfile.mkdtemp(prefix="benchmark-size-")) if passing else chosen.folder or _FOLDER
    plan = planned(chosen, folder)
    if chosen.fresh:
        Journal(plan.journal.path).path.unlink(missing_ok=True)
    try:
        bad = [row for row in ([] if chosen.tables_only else plan.measure()) if _told(row)]
        report(plan, chosen.evidence)
    finally:
        if passing:
            shutil.rmtree(folder, ignore_errors=True)
    return 1 if bad else 0


def _told(row: dict) -> bool:
    """Print a row; True where it is bad."""
    print(short(row), flush=True)
    return row["status"] in ("wrong", "failed")


if __name__ == "__main__":
    raise SystemExit(main())
