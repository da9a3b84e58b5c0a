"""A series of simulated tests that is kept: each finished one is written at once, an interrupted run goes on."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def known(path: Path, key: str, seed: int) -> dict[tuple[str, int], Row]:
    """Finished tests of a journal by the word of `key` and by number; a line that was cut is left out."""
    found: dict[tuple[str, int], Row] = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except ValueError:
            continue
        if row["seed"] == seed:
            found[row[key], row["number"]] = row
    return found


def run_series(
    description: str | None, name: str, key: str, words: Sequence[str], each: int,
    measured: Callable[[str, int, int], Row], page: Callable[[Sequence[Row], int], Iterator[str]],
) -> None:  # fmt: skip
    """Run what the journal does not have, as the command line asks, and write the page.

    Parameters
    ----------
    name : of the journal in build/ and of the page, benchmark_<name>.md
    key : of a row, which has one of the `words`
    each : number of tests of each word by default
    measured : word, number, seed -> row
    page : rows, seed -> lines
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--each", type=int, default=each, help="tests of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--shard", default="1/1", help="1/2 and 2/2 share the tests between two runs of one journal")
    parser.add_argument("--minutes", type=float, default=float("inf"))
    parser.add_argument("--journal", type=Path, default=Path(f"build/{name}.jsonl"))
    parser.add_argument("--evidence", type=Path)
    arguments = parser.parse_args()
    arguments.journal.parent.mkdir(parents=True, exist_ok=True)
    done, begun = known(arguments.journal, key, arguments.seed), time.monotonic()
    shard, shards = map(int, arguments.shard.split("/"))
    for number in range(shard - 1, arguments.each, shards):
        for word in words:
            if (word, number) in done or time.monotonic() - begun > 60.0 * arguments.minutes:
                continue
            row = measured(word, number, arguments.seed)
            with arguments.journal.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
    text = "\n".join(page(list(known(arguments.journal, key, arguments.seed).values()), arguments.seed)) + "\n"
    print(text)
    if arguments.evidence:
        (arguments.evidence / f"benchmark_{name}.md").write_text(text, encoding="utf-8")
