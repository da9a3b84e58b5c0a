"""Random stories of disturbed runs: python benchmarks/stories/run.py [--count 500] [--from 0] [--evidence DIR].

A story is two to four starts of one or two studies, which are killed, hung up, terminated or interrupted at random
moments, run out of disk, meet a locked journal, a second start, inputs that are edited, and a solver that fails in ten
ways; then a start that nothing disturbs. Its numbers must be those of a run that was never disturbed, to the last bit.

Finished stories are kept in `build/stories.jsonl`, so that a run can be interrupted and continued; `--minutes` ends
one. The counts of each seed are kept beside the page, in `benchmark_stories.json`: the page sums them, also where
stories of a seed were played on another machine. Those of one seed replace the earlier ones of this seed.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(Path(__file__).parent)]
for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[_name] = "1"

from play import Story  # noqa: E402

STATE = ROOT / "build" / "stories.jsonl"


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1, help="number of the first story, in thousands")
    parser.add_argument("--minutes", type=float, default=1e9, help="end after so long; the next run continues")
    parser.add_argument("--from", type=int, default=0, dest="begin", help="leave out so many stories at the beginning")
    parser.add_argument("--every", type=int, default=1, help="only every nth story: for several at a time")
    parser.add_argument("--offset", type=int, default=0, help="of these")
    parser.add_argument("--evidence", type=Path, help="folder of the page")
    options = parser.parse_args()
    STATE.parent.mkdir(exist_ok=True)
    numbers = range(1000 * options.seed, 1000 * options.seed + options.count)
    end, quiet = time.monotonic() + 60.0 * options.minutes, {}
    for number in numbers[options.begin + options.offset :: options.every]:
        if number in done(numbers) or time.monotonic() > end:
            continue
        with tempfile.TemporaryDirectory() as folder:
            told = Story(Path(folder), number, quiet).play()
        facts = {
            "number": number, "faults": told.faults, "events": dict(told.events), "made": told.made,
            "needed": told.needed, "date": f"{datetime.now(UTC):%Y-%m-%d}",
        }  # fmt: skip
        with STATE.open("a") as out:
            out.write(json.dumps(facts) + "\n")
        print(number, "; ".join(told.faults) or "as a quiet run", file=sys.stderr)
    own = tally(list(done(range(1000 * options.seed, 1000 * (options.seed + 1))).values()))
    folder = options.evidence or ROOT / "docs" / "evidence"
    kept = folder / "benchmark_stories.json"
    parts = json.loads(kept.read_text()) if kept.exists() else {}
    if own["stories"]:
        name = f"seed {options.seed}"
        # written by hand: stories that failed and were played again after something was mended
        parts[name] = {**own, "notes": parts.get(name, {}).get("notes", [])}
    text = page(list(parts.values()))
    print(text)
    if options.evidence:
        kept.write_text(json.dumps(parts, indent=1) + "\n", encoding="utf-8")
        (folder / "benchmark_stories.md").write_text(text, encoding="utf-8")


def done(numbers: range) -> dict[int, dict[str, Any]]:
    """Stories that were told."""
    lines = STATE.read_text().splitlines() if STATE.exists() else []
    facts = [json.loads(line) for line in lines]
    return {f["number"]: f for f in facts if f["number"] in numbers}


def tally(stories: list[dict[str, Any]]) -> dict[str, Any]:
    """What the page needs of some stories: their number, dates, disturbances, failures and runs."""
    counted = [s for s in stories if s["needed"]]
    return {
        "stories": len(stories), "failed": sum(bool(s["faults"]) for s in stories),
        "dates": sorted({s["date"] for s in stories}),
        "events": sum((Counter(s["events"]) for s in stories), Counter()),
        "counted": len(counted), "made": sum(s["made"] for s in counted), "needed": sum(s["needed"] for s in counted),
    }  # fmt: skip


def page(parts: list[dict[str, Any]]) -> str:
    """The table as a page of the documentation."""
    total = {key: sum(part[key] for part in parts) for key in ("stories", "failed", "counted", "made", "needed")}
    events = sum((Counter(part["events"]) for part in parts), Counter())
    dates = sorted({date for part in parts for date in part["dates"]})
    made_on = dates[0] if len(dates) < 2 else f"{dates[0]} to {dates[-1]}"
    notes = "".join(f"\n{note}\n" for part in parts for note in part.get("notes", []))
    rows = "\n".join(f"| {label} | {events[key]:,} |" for key, label in _EVENTS.items())
    return f"""# Disturbed runs

{total["stories"]} random stories, made on {made_on}. In a story one or two studies are started two to
four times and disturbed each time; then each is started once more and is not disturbed. Two studies run an external
solver, which fails in random runs: it crashes, hangs, leaves a part of its result, none, an empty one, one that is not
a number, or a link; it says that it failed, removes its folder, or leaves a process in a session of its own. The third
is a deck that femtune solves itself, with three starts.

At the end of each story it is checked that

- parameters, intervals, modes and residuals are those of a run that was never disturbed, to the last bit,
- no run is counted that the solver did not make,
- no more runs were made than are needed and were under way when a start was ended (in stories of one study without
  edited inputs, full disks and `--fresh`),
- no start ended with an internal error or a traceback,
- no process is left, and no input was changed.

| disturbance | times |
| --- | ---: |
{rows}

Stories that failed a check: {total["failed"]} of {total["stories"]}. The runs beyond the needed were counted in
{total["counted"]} stories: {total["made"] - total["needed"]} beyond {total["needed"]}. Made by
`benchmarks/stories/run.py`.
{notes}"""


_EVENTS = {
    "starts": "disturbed starts", "kill": "SIGKILL", "term": "SIGTERM", "hup": "SIGHUP", "int": "SIGINT",
    "disk full": "files limited to 2 to 256 KiB", "journal locked": "journal locked for 0.2 to 4 s",
    "second start": "second start of the study at the same time", "edited meanwhile": "inputs edited in a start",
}  # fmt: skip


if __name__ == "__main__":
    main()
