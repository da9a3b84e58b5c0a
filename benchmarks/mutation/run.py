"""Do the tests notice small faults in the numerical code? python benchmarks/mutation/run.py [--count 300] [--seed 1].

A sample of mutants (one operator, number, sign, name … of the numerical folders changed) is tried one by one against
the tests that run the changed line, the fastest first; what these let pass is tried against all tests that run the
function. Which tests run which line is recorded once, see --record. What was tried stands in a journal: a second start
goes on where the first one ended, and a mutant that survived is tried again where tests were recorded anew.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import pytest
from operators import Mutant, mutants, sample
from page import judgements, page
from record import Record, record, recorded
from trial import Outcome, function_around, imported_anew, with_other_code

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src"
FOLDERS = (
    "parameters", "modal", "fem", "model", "identification", "correlation", "residuals", "selection", "updating",
    "uncertainty", "validation", "testdata",
)  # fmt: skip
OTHER_PROGRAMS = ("model/distributed", "model/eigen/slepc.py", "model/solvers/mumps.py", "model/solvers/cholmod.py")
"""Reach programs and libraries that are not among the requirements."""
NO_NUMBERS = (
    "tests/study",
    "tests/reporting",
    "tests/results",
    "tests/cli",
    "tests/front",
    "tests/messages",
    "tests/benchmarks",
)
"""Folders of tests that run whole studies, for seconds each, or no numerical code."""
FIRST = 25
"""Tests that a mutant is tried against at first."""
CONTROLS = 10
"""Mutants whose tests are run without the fault, too."""
MOST_SECONDS = 90.0
"""Recorded time of the further tests that a survivor is tried against."""


@dataclass(frozen=True)
class Choice:
    """Which tests a mutant is tried against.

    Parameters
    ----------
    known : of the tests
    """

    known: Record

    def of(self, mutant: Mutant) -> tuple[list[str], list[str]]:
        """Those to be tried at first, and further ones; each file of tests has its turn."""
        of_line = self.known.covering(mutant.file, mutant.line, mutant.last)
        if not of_line and not (mutant.function and self.known.covering(mutant.file, *mutant.around)):
            # what runs only when the module is imported belongs to no test, and may matter to all tests of the file
            of_line = self.known.of_file(mutant.file)
        by_file: dict[str, list[str]] = {}
        for test in of_line:
            by_file.setdefault(test.split("::")[0], []).append(test)
        in_turn = [test for tests in zip_longest(*by_file.values()) for test in tests if test]
        of_function = [t for t in self.known.covering(mutant.file, *mutant.around) if t not in set(of_line)]
        return in_turn[:FIRST], self._within_time([*in_turn[FIRST:], *of_function])

    def limit(self, tests: Sequence[str]) -> float:
        """Processor time in seconds."""
        return 30.0 + 5.0 * sum(self.known.seconds[test] for test in tests)

    def _within_time(self, tests: Sequence[str]) -> list[str]:
        left, chosen = MOST_SECONDS, []
        for test in tests:
            left -= self.known.seconds[test]
            if left > 0.0:
                chosen.append(test)
        return chosen


@dataclass(frozen=True)
class Journal:
    """Lines of JSON, one a trial; the last one of a mutant counts."""

    path: Path

    def outcomes(self, way: str) -> dict[str, Outcome]:
        """By the key of the mutant."""
        if not self.path.exists():
            return {}
        rows = [json.loads(line) for line in self.path.read_text(encoding="utf-8").splitlines()]
        return {row["mutant"]: Outcome(row["outcome"]) for row in rows if row["way"] == way}

    def add(self, way: str, mutant: Mutant, outcome: Outcome) -> None:
        """One more."""
        row = {"way": way, "mutant": mutant.key, "line": mutant.line, "outcome": outcome.value}
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row, ensure_ascii=False) + "\n")
        print(f"{way:9s} {outcome.value:10s} {mutant.line:4d} {mutant.key}", flush=True)


@dataclass(frozen=True)
class Collected:
    """Plugin for pytest: instead of the tests it runs the trials, and ends."""

    chosen: Sequence[Mutant]
    choice: Choice
    journal: Journal

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        items = {item.nodeid: item for item in session.items}
        self._control(items)
        before = self.journal.outcomes("exchanged")
        for mutant in self.chosen:
            text = mutant.applied((ROOT / mutant.file).read_bytes())
            if mutant.key not in before and function_around(text, mutant.line) is not None:
                self.journal.add("exchanged", mutant, self._tried(mutant, text, items))
        return True

    def _control(self, items: dict[str, pytest.Item]) -> None:
        """Without a fault the tests of a trial pass: otherwise every kill would be in doubt."""
        for mutant in self.chosen[:CONTROLS]:
            text = (ROOT / mutant.file).read_bytes()
            if function_around(text, mutant.line) and self._tried(mutant, text, items) is not Outcome.SURVIVED:
                raise SystemExit(f"tests fail without a mutant: {mutant.key}")

    def _tried(self, mutant: Mutant, text: bytes, items: dict[str, pytest.Item]) -> Outcome:
        for tests in self.choice.of(mutant):
            some = [items[test] for test in tests if test in items]
            outcome = with_other_code(ROOT / mutant.file, text, mutant.line, some, self.choice.limit(tests))
            if outcome is not Outcome.SURVIVED:
                return outcome
        return Outcome.SURVIVED


def collected(chosen: Sequence[Mutant], choice: Choice, journal: Journal, tests: Sequence[str]) -> None:
    """Trials with the code of functions exchanged, in a process that has imported everything."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            plugin = Collected(chosen, choice, journal)
            code = int(pytest.main([*tests, "-p", "no:cacheprovider", "-p", "no:xdist"], [plugin]))
        finally:
            os._exit(code)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) not in (0, pytest.ExitCode.NO_TESTS_COLLECTED):
        raise SystemExit("the tests could not be collected, or fail without a mutant")


def anew(chosen: Sequence[Mutant], choice: Choice, journal: Journal) -> None:
    """Trials with modules imported anew, of what no exchange has killed."""
    exchanged, before = journal.outcomes("exchanged"), journal.outcomes("imported")
    for mutant in chosen:
        if mutant.key not in before and exchanged.get(mutant.key, Outcome.SURVIVED) is Outcome.SURVIVED:
            journal.add("imported", mutant, _imported(mutant, choice))


def _imported(mutant: Mutant, choice: Choice) -> Outcome:
    text = mutant.applied((ROOT / mutant.file).read_bytes())
    module = ".".join(Path(mutant.file).relative_to("src").with_suffix("").parts)
    for tests in choice.of(mutant):
        if tests:
            outcome = imported_anew(module, ROOT / mutant.file, text, tests, choice.limit(tests))
            if outcome is not Outcome.SURVIVED:
                return outcome
    return Outcome.SURVIVED


def warm() -> None:
    """Import what is slow and not ours, before processes are split off."""
    for name in ("numpy", "scipy.linalg", "scipy.sparse.linalg", "scipy.optimize", "scipy.stats", "scipy.signal",
                 "scipy.spatial", "pydantic"):  # fmt: skip
        __import__(name)
    assert not any(name.split(".")[0] == "femtune" for name in sys.modules)


def sampled(folders: Sequence[str], count: int, seed: int) -> tuple[list[Mutant], int]:
    """Mutants, and how many there are to choose from."""
    files = [f for folder in folders for f in sorted((SOURCE / "femtune" / folder).rglob("*.py"))]
    left_out = tuple(str(SOURCE / "femtune" / part) for part in OTHER_PROGRAMS)
    everything = [m for f in files if not str(f).startswith(left_out) for m in mutants(ROOT, f)]
    return sample(everything, count, seed), len(everything)


def tests_of_numbers() -> list[str]:
    """Folders of tests."""
    folders = sorted(str(p.relative_to(ROOT)) for p in (ROOT / "tests").iterdir() if p.is_dir())
    return [f for f in folders if f not in NO_NUMBERS and not f.endswith("__pycache__")]


def arguments() -> argparse.Namespace:
    """Options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300, help="mutants")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--folders", nargs="+", default=list(FOLDERS))
    parser.add_argument("--tests", nargs="+", default=tests_of_numbers(), help="files or folders of tests")
    parser.add_argument("--marked", default="", help="of these tests those with such marks: 'not slow'")
    parser.add_argument("--part", default="1/1", help="2/3 tries the second of every three, beside other processes")
    parser.add_argument("--record", action="store_true", help="record anew which tests run which line")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "mutation", help="folder of record and journal")
    parser.add_argument("--evidence", type=Path, help="folder for the page")
    return parser.parse_args()


def main() -> int:
    """Code 1 where a mutant survives that is not among the judged ones."""
    chosen = arguments()
    kept = chosen.work / "tests.json"
    chosen.work.mkdir(parents=True, exist_ok=True)
    if chosen.record or not kept.exists():
        # in a process of its own: what is imported there must not be here
        code = [sys.executable, __file__, "--only-record", str(kept), *chosen.tests, "-m", chosen.marked]
        subprocess.run(code, cwd=ROOT, check=False, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"})
    known = recorded(kept)
    warm()
    os.chdir(ROOT)
    some, of = sampled(chosen.folders, chosen.count, chosen.seed)
    choice, journal = Choice(known), Journal(chosen.work / f"seed{chosen.seed}.jsonl")
    part, parts = (int(number) for number in chosen.part.split("/"))
    mine = some[part - 1 :: parts]
    collected(mine, choice, journal, [*chosen.tests, "-m", chosen.marked])
    anew(mine, choice, journal)
    outcomes = {**journal.outcomes("exchanged"), **journal.outcomes("imported")}
    found = [(mutant, outcomes[mutant.key]) for mutant in some if mutant.key in outcomes]
    judged = judgements(Path(__file__).with_name("survivors.toml"))
    text = page(found, of, chosen.seed, judged)
    print(text)
    if chosen.evidence:
        (chosen.evidence / "mutation.md").write_text(text, encoding="utf-8")
    return int(any(o is Outcome.SURVIVED and m.key not in judged for m, o in found))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--only-record"]:
        record(ROOT, SOURCE / "femtune", sys.argv[3:], Path(sys.argv[2]))
        sys.exit(0)
    sys.exit(main())
