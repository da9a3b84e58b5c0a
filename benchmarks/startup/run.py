"""How long femtune takes to start: python benchmarks/startup/run.py [--before CHECKOUT] [--evidence docs/evidence].

Each command runs in a process of its own, several times after one run that is not counted. Processor time, of user and
system together, says what a command costs where other work runs beside it. The modules are those of femtune that the
command loads. With --before the same commands run with an earlier checkout, in turn with this one, in the same
environment.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_TYPING_ERROR = 'schema = 1\n[model]\ndeck = "cantilever.bdf\n'
_WRONG_KEY = 'schema = 1\n[model]\ndeck = "cantilever.bdf"\n[solver]\nmaximum_iterations = 20\n'
_ELEMENTS = 20


@dataclass(frozen=True)
class Command:
    """What is timed.

    Parameters
    ----------
    title : in the table
    arguments : of Python
    code : with which it ends; that of the shell
    goal_seconds : of processor time; nan: no goal
    """

    title: str
    arguments: tuple[str, ...]
    code: int = 0
    goal_seconds: float = float("nan")


COMMANDS = (
    Command("`import femtune`", ("-c", "import femtune"), goal_seconds=0.1),
    Command("`femtune --help`", ("-m", "femtune", "--help")),
    Command("a quotation mark that is missing in a study", ("-m", "femtune", "run", "quote.toml"), 2, 0.7),
    Command("a key that does not exist in a study", ("-m", "femtune", "run", "key.toml"), 2, 0.7),
    Command("modes of a deck of 20 bars", ("-m", "femtune", "modes", "cantilever.bdf"), goal_seconds=1.5),
)
BARE = Command("Python alone, for comparison", ("-c", ""))


@dataclass(frozen=True)
class Cost:
    """Of one run, or the medians of several: seconds of processor time and by the clock."""

    processor: float
    clock: float


def run(command: Command, source: Path, folder: Path, *options: str) -> tuple[Cost, str]:
    """One run with the femtune of a source folder, and what it wrote to the standard error stream."""
    environment = {**os.environ, "PYTHONPATH": str(source), "NO_COLOR": "1", "PYTHONDONTWRITEBYTECODE": ""}
    before, start = _children_seconds(), time.perf_counter()
    done = subprocess.run(
        [sys.executable, *options, *command.arguments],
        cwd=folder, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    cost = Cost(_children_seconds() - before, time.perf_counter() - start)
    if done.returncode != command.code:
        raise SystemExit(f"{command.title} ended with {done.returncode}, not {command.code}:\n{done.stderr}")
    return cost, done.stderr


def _children_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def own_modules(command: Command, source: Path, folder: Path) -> int:
    """Number of modules of femtune that a command loads."""
    _, said = run(command, source, folder, "-X", "importtime")
    return len(re.findall(r"^import time:.*\| +femtune\b", said, flags=re.MULTILINE))


def measure(command: Command, sources: list[Path], folder: Path, repeats: int) -> list[Cost]:
    """Medians for each source folder; the folders take turns."""
    runs: list[list[Cost]] = [[] for _ in sources]
    for turn in range(repeats + 1):
        for costs, source in zip(runs, sources, strict=True):
            cost, _ = run(command, source, folder)
            if turn:
                costs.append(cost)
    return [
        Cost(statistics.median(c.processor for c in costs), statistics.median(c.clock for c in costs)) for costs in runs
    ]


def write_inputs(folder: Path) -> None:
    """The deck and two studies with an error."""
    (folder / "quote.toml").write_text(_TYPING_ERROR, encoding="utf-8")
    (folder / "key.toml").write_text(_WRONG_KEY, encoding="utf-8")
    lines = ["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", "MAT1,1,2.1E11,,.3,7850.", "PBAR,1,1,1.E-3,1.E-7,2.E-7,3.E-7"]
    lines += [f"GRID,{i + 1},,{i / _ELEMENTS:.2f},0.,0." for i in range(_ELEMENTS + 1)]
    lines += [f"CBAR,{i + 1},1,{i + 1},{i + 2},0.,0.,1." for i in range(_ELEMENTS)]
    (folder / "cantilever.bdf").write_text("\n".join([*lines, "SPC1,1,123456,1", "ENDDATA", ""]), encoding="utf-8")


def rows(sources: list[Path], folder: Path, repeats: int) -> Iterator[str]:
    """The table, a row a command."""
    (nothing,) = measure(BARE, sources[-1:], folder, repeats)
    yield _row([BARE.title, *[""] * (3 * len(sources) - 3), f"{nothing.processor:.2f}", f"{nothing.clock:.2f}", "", ""])
    for command in COMMANDS:
        cells = [command.title]
        for cost, source in zip(measure(command, sources, folder, repeats), sources, strict=True):
            cells += [f"{cost.processor:.2f}", f"{cost.clock:.2f}", str(own_modules(command, source, folder))]
        goal = command.goal_seconds
        yield _row([*cells, f"{goal:g}" if goal == goal else ""])  # noqa: PLR0124  nan: no goal


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def page(sources: list[Path], repeats: int) -> str:
    """All of it as Markdown."""
    heads = [f"{when}: processor, s | by the clock, s | own modules" for when in ("before", "now")[-len(sources) :]]
    lines = [
        "# How long femtune takes to start",
        "",
        f"Medians of {repeats} runs, each in a process of its own, after one run that is not counted; "
        f"Python {sys.version.split()[0]}, {os.cpu_count()} processors. Made by `benchmarks/startup/run.py`.",
        "",
        f"| command | {' | '.join(heads)} | goal: processor, s |",
        "| --- |" + " ---: |" * (3 * len(sources) + 1),
    ]
    with tempfile.TemporaryDirectory() as folder:
        write_inputs(Path(folder))
        lines += rows(sources, Path(folder), repeats)
    return "\n".join([*lines, ""])


def main() -> None:
    """Print the page, and write it where a folder is given."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=9, help="counted runs of each command")
    parser.add_argument("--before", type=Path, help="root of an earlier checkout")
    parser.add_argument("--evidence", type=Path, help="folder for the page benchmark_startup.md")
    chosen = parser.parse_args()
    earlier = [chosen.before.resolve() / "src"] if chosen.before else []
    text = page([*earlier, ROOT / "src"], chosen.repeats)
    print(text)
    if chosen.evidence:
        (chosen.evidence / "benchmark_startup.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
