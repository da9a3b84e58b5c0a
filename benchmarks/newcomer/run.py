"""How many commands and seconds a first result takes: python benchmarks/newcomer/run.py [--evidence docs/evidence].

Three tasks of users who have the README, and no more, each in an empty folder: the report of the example that comes
with the checkout, an own report from a deck and a test, and parameters with standard deviations from matrices of SciPy.
The commands are read from the README, and the script from the page for researchers, so that the count is theirs.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_TEN_MINUTES = "## The first ten minutes"
_BUILDING = "examples/01_building"
_ENDED = (0, 3, 4)
"""Exit codes of a run that has a verdict."""


@dataclass(frozen=True)
class Measured:
    """A task: what was typed, what it cost in seconds by the clock and of the processor, and what it left."""

    title: str
    typed: tuple[str, ...]
    clock: float
    processor: float
    left: str


def first_commands() -> list[str]:
    """The commands of the README for an own deck and test, without their remarks."""
    text = (ROOT / "README.md").read_text(encoding="utf-8").partition(_TEN_MINUTES)[2]
    (block,) = re.findall(r"```\n(femtune init.*?)```", text, re.S)
    return [line.partition("#")[0].strip() for line in block.splitlines()]


def researchers_script() -> str:
    """The first Python code of the page for researchers."""
    text = (ROOT / "docs" / "guide" / "researchers.md").read_text(encoding="utf-8")
    return str(re.findall(r"```python\n(.*?)```", text, re.S)[0])


def make_plate(folder: Path) -> None:
    """The deck and the test of the tutorial, under the names that they have in the README."""
    text = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.S)
    (command,) = re.findall(r"^(femtune modes true.bdf .*)$", text, re.M)
    _call([sys.executable, "-c", code], folder)
    _call([sys.executable, "-m", *shlex.split(command)], folder)
    (folder / "plate.bdf").rename(folder / "deck.bdf")
    (folder / "true.bdf").unlink()


def _call(words: list[str], folder: Path, allowed: tuple[int, ...] = (0,)) -> str:
    """Run a command in a folder; what it prints."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "NO_COLOR": "1"}
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in allowed:
        raise RuntimeError(f"{shlex.join(words)} ended with {done.returncode}:\n{done.stdout}\n{done.stderr}")
    return done.stdout


def _processor() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def own_report(folder: Path) -> Measured:
    """From a deck and a test to a report, by the three commands of the README."""
    make_plate(folder)
    commands, start, before = first_commands(), time.perf_counter(), _processor()
    printed = [_call([sys.executable, "-m", *shlex.split(c)], folder, _ENDED) for c in commands]
    spent = time.perf_counter() - start, _processor() - before
    report = folder / "run" / "report.html"
    if not report.is_file() or not (folder / "run" / "updated.bdf").is_file():
        raise RuntimeError(f"no report: {printed[-1]}")
    return Measured("an own deck and an own test", tuple(commands), *spent, "report.html, updated.bdf")


def shown_example(folder: Path) -> Measured:
    """The measured building, as `make demo` does it once its environment is there."""
    shutil.copytree(ROOT / _BUILDING, folder / _BUILDING, ignore=shutil.ignore_patterns("run", "*.bdf", "*.uff"))
    for name in ("structures", "__init__.py"):
        source, target = ROOT / "examples" / name, folder / "examples" / name
        if source.is_dir():
            shutil.copytree(source, target)
        elif source.is_file():
            shutil.copy(source, target)
    start, before = time.perf_counter(), _processor()
    _call([sys.executable, f"{_BUILDING}/make_inputs.py"], folder)
    _call([sys.executable, "-m", "femtune", "run", f"{_BUILDING}/study.toml"], folder, _ENDED)
    spent = time.perf_counter() - start, _processor() - before
    if not list(folder.rglob("report.html")):
        raise RuntimeError("no report of the building")
    return Measured("the example of the checkout", ("make demo",), *spent, "report.html")


def from_matrices(folder: Path) -> Measured:
    """Parameters with standard deviations from matrices, by the script of the page for researchers."""
    script, start, before = researchers_script(), time.perf_counter(), _processor()
    printed = _call([sys.executable, "-c", script], folder)
    spent = time.perf_counter() - start, _processor() - before
    if "±" not in printed:
        raise RuntimeError(f"no standard deviation: {printed}")
    return Measured("matrices of SciPy", tuple(script.strip().splitlines()), *spent, printed.strip())


TASKS = (shown_example, own_report, from_matrices)


def page(found: list[Measured]) -> str:
    """The page with what was measured."""
    rows = "\n".join(f"| {m.title} | {_count(m)} | {m.clock:.0f} | {m.processor:.0f} | {m.left} |" for m in found)
    said = " ".join((__doc__ or "").partition("\n\n")[2].split())
    return f"""# Time to a first result

{said}

| task | typed | s by the clock | s of the processor | what is there at the end |
| --- | --- | --- | --- | --- |
{rows}

The environment is installed before, and reading and thinking are not counted. Other work ran on the machine: the time
by the clock depends on it, that of the processor hardly. Each task was run once. The deck and the test are those of the
plate of the [tutorial](../tutorial.md).
"""


def _count(measured: Measured) -> str:
    lines = [line for line in measured.typed if line.strip()]
    if not lines[0].startswith(("femtune", "make")):
        return f"{len(lines)} lines of Python"
    return "<br>".join(f"`{line}`" for line in lines)


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--evidence", type=Path, help="folder for the page benchmark_newcomer.md")
    chosen = parser.parse_args()
    found = []
    for task in TASKS:
        with tempfile.TemporaryDirectory() as folder:
            found.append(task(Path(folder)))
    text = page(found)
    print(text)
    if chosen.evidence is not None:
        (chosen.evidence / "benchmark_newcomer.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
