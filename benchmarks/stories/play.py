"""One story: starts of femtune that are disturbed, then one that is not, whose numbers are those of a quiet run."""

from __future__ import annotations

import gc
import importlib
import os
import random
import resource
import shutil
import signal
import sqlite3
import sys
import threading
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from project import FAULTS, KINDS, Kind, Variant, numbers, write_inputs

from femtune.cli import main
from femtune.files.study_file import read_study_file
from femtune.runs.process import end_all
from femtune.steps.run_folder import read_results

VARIANTS = (Variant(), Variant(mass=1.1), Variant(spring=200.0), Variant(test=1.02))
_ENDED = (0, 1, 2, 129, 130, 143, -signal.SIGKILL)
"""Exit codes that a disturbed start may have; an internal error (70) is none of them."""
_LONGEST_S = 1800.0
"""Time in s after which a start hangs; on a busy machine a quiet one takes minutes."""
_WORDS = 4
"""Words of a line of the solver's log: what happened, where, and two frequencies."""
_QUIET = "quiet"
"""Name of a start that nothing disturbs, and that tells which modules it has loaded."""
_SIGNALS = {"kill": signal.SIGKILL, "term": signal.SIGTERM, "hup": signal.SIGHUP, "int": signal.SIGINT}


@dataclass
class Start:
    """One start of femtune and what happens to it.

    Parameters
    ----------
    kind : the study
    asked : a signal, "" for none
    after : when it is sent, as a fraction of the time of a quiet start
    disk : bytes that a file may have; 0 without a limit
    lock_s : how long another program holds the journal of the runs; 0 if none does
    second : a second start of the same study while the first one is at work
    fresh : whether earlier runs are thrown away
    jobs : runs at a time
    edit : the inputs as they are when it begins
    meanwhile : the inputs as they become after it has begun; None if they stay
    """

    kind: Kind
    asked: str = ""
    after: float = 0.5
    disk: int = 0
    lock_s: float = 0.0
    second: bool = False
    fresh: bool = False
    jobs: int = 1
    edit: Variant = field(default_factory=Variant)
    meanwhile: Variant | None = None


@dataclass
class Told:
    """What happened in a story.

    Parameters
    ----------
    faults : what must not happen, in words
    events : how often each kind of disturbance occurred
    made, needed : runs of the solver that ended well, and the number of a quiet run
    """

    faults: list[str] = field(default_factory=list)
    events: Counter[str] = field(default_factory=Counter)
    made: int = 0
    needed: int = 0


def plot(seed: int) -> tuple[tuple[Kind, ...], list[Start], list[str]]:
    """The studies of a story, which have their input files in common, its starts, and the faults of its solver."""
    chance = random.Random(seed)
    # the beam takes ten times as long
    kinds = tuple(chance.sample(KINDS[:2], chance.choice((1, 1, 2)))) if chance.random() < 0.9 else KINDS[2:]
    variant = VARIANTS[0]
    starts = []
    for _ in range(chance.randint(2, 4)):
        kind = chance.choice(kinds)
        start = Start(kind, jobs=chance.choice((1, 2)), edit=variant, fresh=chance.random() < 0.1)
        if chance.random() < 0.65:
            start.asked, start.after = chance.choice(list(_SIGNALS)), chance.uniform(0.02, 1.2)
        if chance.random() < 0.15:
            start.disk = int(2 ** chance.uniform(11.0, 18.0))
        if chance.random() < 0.15:
            start.lock_s = chance.uniform(0.2, 4.0)
        start.second = chance.random() < 0.2
        if chance.random() < 0.3:
            start.edit = variant = chance.choice(VARIANTS)
        if chance.random() < 0.15:
            # and back before the next start, now and then: the numbers of the state between must not return
            start.meanwhile = chance.choice(VARIANTS)
            variant = chance.choice((start.meanwhile, start.edit))
        starts.append(start)
    faults = chance.sample(FAULTS, chance.randint(0, 3))
    if "hang" in faults and chance.random() < 0.6:
        # it takes its whole time
        faults.remove("hang")
    return kinds, starts, faults


@contextmanager
def _forked(words: list[str], folder: Path, name: str, environment: Mapping[str, str], disk: int) -> Iterator[int]:
    """A process of femtune that this one has loaded already; it is not there any more afterwards."""
    sys.stdout.flush(), sys.stderr.flush()
    # it may be killed before it writes
    (folder / f"{name}.out").touch()
    pid = os.fork()
    if pid == 0:
        code = 99
        try:
            os.setsid()
            # its environment, as the system shows it, is that of a program that was started
            out = os.open(folder / f"{name}.out", os.O_CREAT | os.O_WRONLY | os.O_APPEND)
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0), os.dup2(out, 1), os.dup2(out, 2)
            os.environ.update(environment)
            os.chdir(folder)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            if disk:
                resource.setrlimit(resource.RLIMIT_FSIZE, (disk, disk))
            try:
                main(words)
            except SystemExit as end:
                code = int(end.code or 0)
            if name == _QUIET:
                (folder / "modules").write_text("\n".join(sys.modules))
            # what is done at the exit of a process; this one's other exit functions are those of its parent
            for thread in threading.enumerate():
                if thread is not threading.current_thread() and not thread.daemon:
                    thread.join()
            end_all()
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    try:
        yield pid
    finally:
        try:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
        except (ProcessLookupError, ChildProcessError):
            pass


def _load(folder: Path, study: str, output: str) -> None:
    """Load what a quiet start has loaded, so that a forked one begins at once: it would take most of its time."""
    for name in (folder / "modules").read_text().split("\n"):
        if name not in sys.modules and name != "__main__":
            with suppress(ImportError):
                importlib.import_module(name)
    read_study_file(folder / f"{study}.toml"), read_results(folder / output)
    # what lives from here on is not searched for garbage by each of the forked ones
    gc.collect(), gc.freeze()


def _code(pid: int, until: float) -> int | None:
    """The exit code of a process, or minus the signal that ended it; None if it goes on."""
    while True:
        found, status = os.waitpid(pid, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() >= until:
            return None
        time.sleep(0.01)


@dataclass
class Story:
    """A story in a folder of its own.

    Parameters
    ----------
    folder : of the studies; `state` is beside it
    number : of the story
    quiet : numbers, and runs of the solver, of quiet runs by kind and variant; they are made where they are not known
    """

    folder: Path
    number: int
    quiet: dict[tuple[str, Variant], tuple[Any, int, float]]
    told: Told = field(default_factory=Told)

    def play(self) -> Told:
        """All starts, and what is left of them."""
        kinds, starts, faults = plot(self.number)
        # they take their time: not in the middle of the story
        for start in starts:
            self._quiet(start.kind, start.edit)
        work, state = self.folder / "work", self.folder / "state"
        work.mkdir(), state.mkdir()
        (state / "faults").write_text(" ".join(faults))
        environment = {"STORY": str(self.number), "STORY_STATE": str(state)}
        for i, start in enumerate(starts):
            self._write(kinds, start.edit)
            self._play(start, f"start{i}", environment, kinds)
        final = starts[-1].meanwhile or starts[-1].edit
        inputs = self._write(kinds, final)
        for kind in dict.fromkeys(start.kind for start in starts):
            self._morning(kind, final, f"morning_{kind.name}", environment, starts)
        if left := _with(f"STORY={self.number}".encode()):
            self._fault(f"processes are left: {left}")
        for pid in left:
            os.kill(pid, signal.SIGKILL)
        changed = [name for name, content in inputs.items() if (work / name).read_bytes() != content]
        if changed:
            self._fault(f"inputs were changed: {', '.join(changed)}")
        return self.told

    def _output(self, kind: Kind) -> str:
        return f"run_{kind.name}"

    def _write(self, kinds: tuple[Kind, ...], variant: Variant) -> dict[str, bytes]:
        """Write the input files of all studies; their contents by name."""
        return {
            name: content
            for kind in kinds
            for name, content in write_inputs(self.folder / "work", kind, variant, self._output(kind)).items()
        }

    def _fault(self, text: str) -> None:
        self.told.faults.append(f"story {self.number}: {text}")

    def _quiet(self, kind: Kind, variant: Variant) -> tuple[Any, int, float]:
        """Numbers, runs of the solver, and time of a run that nothing disturbs."""
        key = (kind.name, variant)
        if key not in self.quiet:
            folder = self.folder / f"quiet_{kind.name}"
            (folder / "state").mkdir(parents=True)
            write_inputs(folder, kind, variant, self._output(kind))
            begin = time.monotonic()
            words = [kind.command, f"{kind.name}.toml", "--quiet"]
            with _forked(words, folder, _QUIET, {"STORY_STATE": str(folder / "state")}, 0) as pid:
                code = _code(pid, begin + _LONGEST_S)
            if code != 0:
                raise RuntimeError(f"a quiet run ended with {code}: {(folder / f'{_QUIET}.out').read_text()}")
            _load(folder, kind.name, self._output(kind))
            made = _log(folder / "state").count("end")
            self.quiet[key] = numbers(folder / self._output(kind)), made, time.monotonic() - begin
            shutil.rmtree(folder)
        return self.quiet[key]

    def _play(self, start: Start, name: str, environment: Mapping[str, str], kinds: tuple[Kind, ...]) -> None:
        work = self.folder / "work"
        words = [start.kind.command, f"{start.kind.name}.toml", "--quiet", "--jobs", str(start.jobs)]
        words += ["--fresh"] if start.fresh else []
        takes = self._quiet(start.kind, start.edit)[2]
        journal = work / self._output(start.kind) / "journal" / "runs.sqlite"
        with _forked(words, work, name, environment, start.disk) as pid:
            begin = time.monotonic()
            if start.lock_s and start.kind.solver:
                self._lock(journal, start.lock_s, pid)
            if start.second:
                with _forked(words, work, f"{name}_second", environment, 0) as other:
                    self._ended(f"{name}_second", _code(other, begin + _LONGEST_S), _ENDED)
                self.told.events["second start"] += 1
            if start.meanwhile is not None:
                time.sleep(0.5 * start.after * takes)
                self._write(kinds, start.meanwhile)
                self.told.events["edited meanwhile"] += 1
            code = None
            if start.asked:
                code = _code(pid, begin + start.after * takes)
                if code is None:
                    os.kill(pid, _SIGNALS[start.asked])
                    self.told.events[start.asked] += 1
            if code is None:
                code = _code(pid, begin + _LONGEST_S)
        self._ended(name, code, _ENDED)
        self.told.events["disk full"] += bool(start.disk)
        self.told.events["starts"] += 1
        if code != -signal.SIGKILL and (left := _with(f"STORY={self.number}".encode())):
            self._fault(f"{name} ended with {code} and left processes: {left}")

    def _lock(self, journal: Path, seconds: float, pid: int) -> None:
        """Hold the journal as another program would, as soon as it is there."""
        end = time.monotonic() + 30.0
        while not journal.exists() and time.monotonic() < end:
            if os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT):
                return
            time.sleep(0.005)
        try:
            database = sqlite3.connect(journal, timeout=10.0, isolation_level=None)
            database.execute("BEGIN EXCLUSIVE")
            time.sleep(seconds)
            database.execute("ROLLBACK")
            database.close()
            self.told.events["journal locked"] += 1
        except sqlite3.Error:
            return

    def _ended(self, name: str, code: int | None, allowed: tuple[int, ...]) -> None:
        text = (self.folder / "work" / f"{name}.out").read_text(errors="replace")
        if code not in allowed or "Traceback" in text:
            self._fault(f"{name} ended with {code}: {text[-2000:]}")

    def _morning(
        self, kind: Kind, variant: Variant, name: str, environment: Mapping[str, str], starts: list[Start]
    ) -> None:
        """A start that nothing disturbs has the numbers of a quiet run, and makes up for what the others lost."""
        work, state = self.folder / "work", self.folder / "state"
        words = [kind.command, f"{kind.name}.toml", "--quiet"]
        with _forked(words, work, name, environment, 0) as pid:
            code = _code(pid, time.monotonic() + _LONGEST_S)
        self._ended(name, code, (0,))
        if code != 0:
            return
        expected, needed, _ = self._quiet(kind, variant)
        found = numbers(work / self._output(kind))
        wrong = [key for key in expected if found.get(key) != expected[key]]
        if wrong:
            self._fault(f"{name}: other numbers than a quiet run: {', '.join(wrong)}: {_first(expected, found, wrong)}")
        if not kind.solver:
            return
        log = _log(state)
        counted = self._rows(work / self._output(kind))
        invented = counted - set(log.ends)
        if invented:
            self._fault(f"{name}: runs are counted that were not made: {sorted(invented)[:3]}")
        # runs of other variants, too, are made by starts that were disturbed
        plain = all(
            s.kind == kind and not (s.fresh or s.disk or s.meanwhile or s.edit != starts[0].edit) for s in starts
        )
        if plain:
            self.told.made, self.told.needed = log.count("end"), needed
            in_flight = sum(s.jobs for s in starts if s.asked)
            if log.count("end") > needed + in_flight:
                self._fault(f"{log.count('end')} runs were made of {needed}, with {in_flight} at most in flight")

    def _rows(self, folder: Path) -> set[tuple[float, ...]]:
        """Frequencies of the runs that the journal counts as done."""
        with sqlite3.connect(folder / "journal" / "runs.sqlite") as database:
            rows = database.execute("SELECT freq_hz FROM runs WHERE state = 'done'").fetchall()
        return {tuple(memoryview(row[0]).cast("d")) for row in rows}


@dataclass
class Log:
    """What the solver wrote down: the beginnings and the ends of its runs, with their frequencies."""

    lines: list[list[str]]

    def count(self, word: str) -> int:
        return sum(line[0] == word for line in self.lines)

    @property
    def ends(self) -> list[tuple[float, ...]]:
        return [tuple(map(float, line[2:])) for line in self.lines if line[0] == "end"]


def _log(state: Path) -> Log:
    path = state / "log"
    lines = [line.split() for line in path.read_text().splitlines()] if path.exists() else []
    # where files are limited, so is the log: a run whose line was cut ended with an error
    return Log([line for line in lines if len(line) == _WORDS and all(map(_is_number, line[2:]))])


def _is_number(text: str) -> bool:
    try:
        return float(text) > 0.0
    except ValueError:
        return False


def _first(expected: Any, found: Any, keys: list[str]) -> str:
    """The first difference of two trees."""

    def walk(a: Any, b: Any, place: str) -> str:
        if isinstance(a, dict) and isinstance(b, dict):
            return next((w for k in a if (w := walk(a[k], b.get(k), f"{place}.{k}"))), "")
        if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
            return next((w for i, (x, y) in enumerate(zip(a, b)) if (w := walk(x, y, f"{place}[{i}]"))), "")
        return "" if a == b else f"{place}: {str(a)[:80]} -> {str(b)[:80]}"

    return next((w for k in keys if (w := walk(expected[k], found.get(k), k))), "")


def _with(variable: bytes) -> list[int]:
    """Processes with a variable in their environment, in which a forked process has what it was started with."""
    found = []
    for name in os.listdir("/proc"):
        if name.isdecimal() and int(name) != os.getpid():
            try:
                if variable in Path("/proc", name, "environ").read_bytes().split(b"\0"):
                    found.append(int(name))
            except OSError:
                continue
    return found
