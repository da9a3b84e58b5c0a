"""A solver that is a command: one run in a folder of its own, repeated if that may help, and checked."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from hashlib import sha256
from pathlib import Path

import numpy as np

from femtune.errors import FemtuneError, Where
from femtune.files.formats import MODES_FORMATS, ModesFormatKey
from femtune.files.modes.read import read_modes
from femtune.files.modes.solved import SolvedModes
from femtune.files.runs_table import LARGEST_HZ
from femtune.runs import folders
from femtune.runs.kinds import KeptFolders, check_result_name
from femtune.runs.outcome import Failure, FailureKind, RunOutcome
from femtune.runs.process import LOG, RunInterruptedError, begun, pause, run_process
from femtune.runs.template import InputFiles
from femtune.runs.watched import Watched, content_digest, signature, watched

Values = Mapping[str, float]

_LEAST_FREE_BYTES = 1 << 20
"""Free space below which a run that failed did so because the disk is full."""
_MOST_SEARCHED_BYTES = 1 << 26
"""Bytes at the end of a file in which error texts are searched."""
_ASCENDING = 1e-6
"""Decrease from one frequency to the next, relative to the highest, that is rounding of the listing."""
_TIME_STEP_NS = 2_000_000_000
"""Largest step of the times that file systems keep, in ns: 2 s."""
_SHOWN_CHARACTERS = 120
"""Characters of a line of the output that a message shows."""


@dataclass(frozen=True)
class ResultFile:
    """A file that the solver writes into the folder of its run, and its format (error ``external.result``)."""

    name: str
    format: ModesFormatKey

    def __post_init__(self) -> None:
        """Refuse a name outside of the folder."""
        check_result_name(self.name)


@dataclass(frozen=True)
class Checks:
    """What the modes of a run must be to be used.

    Parameters
    ----------
    count : number of modes, at least
    mass, mass_tolerance : of the whole model, and the relative difference allowed; None without a check
    """

    count: int = 1
    mass: float | None = None
    mass_tolerance: float = 0.01

    def fault(self, modes: SolvedModes) -> str:
        """What is wrong with the modes; "" if nothing is."""
        freq = modes.freq_hz
        if len(freq) < self.count:
            return f"{len(freq)} modes where {self.count} are expected"
        if not np.isfinite(freq).all():
            return f"the frequency of mode {int(np.argmin(np.isfinite(freq))) + 1} is not a number"
        if (freq < 0.0).any() or (np.diff(freq) < -_ASCENDING * np.abs(freq).max()).any():
            return f"the frequencies do not ascend from zero: {_listed(freq)}"
        if freq.max(initial=0.0) > LARGEST_HZ:
            return f"the frequency of mode {int(np.argmax(freq)) + 1} is too large: {freq.max():g} Hz"
        return self._fault_of_shapes(modes) or self._fault_of_mass(modes)

    def _fault_of_shapes(self, modes: SolvedModes) -> str:
        if not modes.has_shapes:
            return ""
        with np.errstate(over="ignore"):
            size = np.nansum(modes.shapes**2, axis=(0, 1))
        bad = ~(np.isfinite(size) & (size > 0.0))
        return f"the shape of mode {int(np.argmax(bad)) + 1} is zero or not a number" if bad.any() else ""

    def _fault_of_mass(self, modes: SolvedModes) -> str:
        if self.mass is None:
            return ""
        if modes.mass is None:
            return "the mass of the model is not in the output"
        if abs(modes.mass / self.mass - 1.0) <= self.mass_tolerance:
            return ""
        return f"the mass is {modes.mass:g} where {self.mass:g} is expected"


def _listed(freq: np.ndarray) -> str:
    return ", ".join(f"{f:.6g}" for f in freq[:8]) + (" …" if len(freq) > 8 else "") + " Hz"


@dataclass(frozen=True)
class ExternalSolver:
    """A command that is started in a new folder for every run, without a shell.

    Parameters
    ----------
    command : program and arguments; nothing in it is replaced
    inputs : writes the input files of a run
    result : the file that is read
    folder : in which the folders of the runs are made
    checks : what the modes must be
    timeout_s : after which a run is ended
    retries : how often a run that failed is tried again
    error_texts : texts in the output of a failed run, beside those of the format
    licence_texts : texts in the output where no licence was free; such a run waits and is tried again
    licence_wait_s, licence_tries : pause, and how often a licence is asked for
    environment : variables of the process, beside those of this one
    version : of the solver, in words; results of another version are not used
    keep : folders of runs that are kept
    keep_most : number of folders of failed runs that are kept, the newest; all of them with ``keep="all"``

    Examples
    --------
    >>> import sys
    >>> from pathlib import Path
    >>> from femtune.runs import ExternalSolver, ResultFile, Template, Templates
    >>> script = "k, m = (float(x) for x in open('in.txt')); f = (k/m)**0.5/6.283185307179586\\n"
    >>> script += "print(f, file=out := open('modes.txt', 'w')); print('end', file=out)"
    >>> inputs = Templates((Template.of_text("in.txt", "{{k}}\\n2.0"), Template.of_text("solve.py", script)))
    >>> solver = ExternalSolver((sys.executable, "solve.py"), inputs, ResultFile("modes.txt", "table"), Path("runs"))
    >>> solver.command[1]
    'solve.py'
    """

    command: tuple[str, ...]
    inputs: InputFiles
    result: ResultFile
    folder: Path
    checks: Checks = field(default_factory=Checks)
    timeout_s: float = 3600.0
    retries: int = 1
    error_texts: tuple[str, ...] = ()
    licence_texts: tuple[str, ...] = ()
    licence_wait_s: float = 60.0
    licence_tries: int = 60
    environment: tuple[tuple[str, str], ...] = ()
    version: str = ""
    keep: KeptFolders = "failed"
    keep_most: int = 20

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values of a run."""
        return self.inputs.names

    def check(self) -> None:
        """Refuse a program that is not there (error ``external.no-program``)."""
        self._program  # noqa: B018  found, or refused

    def clean(self) -> None:
        """Remove folders of interrupted runs, and of more failed ones than are kept."""
        if self.keep != "all":
            folders.clean(self.folder, self.keep_most, self.timeout_s)

    @cached_property
    def _program(self) -> str:
        program = shutil.which(self.command[0])
        if program is None:
            raise FemtuneError("external.no-program", program=self.command[0])
        return os.path.abspath(program)

    @cached_property
    def watched(self) -> Watched:
        """Files outside the folder of a run on which its result depends, as they were at the first call."""
        words, environment = self.command[1:], dict(self.environment)
        return watched(words, environment, self.inputs.texts(), self.folder / "run", self._program)

    def key(self, values: Values) -> str:
        """Digest of all that the result depends on: input files, command, program, version, and what is read.

        Of files elsewhere, such as the script that an interpreter runs or the mesh that an input file includes, the
        content counts (`watched`).
        """
        return self._key(self.inputs.files(values))

    def _key(self, files: Mapping[str, bytes]) -> str:
        digest = sha256(b"femtune run 1")
        read = (self.watched.digest,) if self.watched.files else ()
        program = content_digest(self._program, signature(self._program))
        settings = (*self.command, *read, self.version, program, self.result.name, self.result.format)
        environment = tuple(f"{name}={value}" for name, value in self.environment)
        for text in (*settings, *environment, self.inputs.version):
            digest.update(sha256(text.encode(errors="surrogateescape")).digest())
        for name, content in sorted(files.items()):
            digest.update(sha256(name.encode(errors="surrogateescape")).digest() + sha256(content).digest())
        return digest.hexdigest()

    def run(self, values: Values) -> RunOutcome:
        """Run until an attempt gives modes that pass the checks, or all have failed.

        Raises
        ------
        FemtuneError : ``external.folder`` (the disk is full), ``external.not-started``, ``external.placeholder``,
            ``external.same-name``
        """
        files = self.inputs.files(values)
        key, stop = self._key(files), begun()
        failures: list[Failure] = []
        licence, others = self.licence_tries, self.retries + 1
        while licence > 0 and others > 0:
            result = self._attempt(key, values, files, stop)
            if isinstance(result, SolvedModes):
                return RunOutcome(key, result, tuple(failures), not self.watched.changed)
            failures.append(result)
            if result.kind is FailureKind.LICENCE:
                licence -= 1
                if licence:
                    pause(self.licence_wait_s, stop)
            else:
                others -= 1
        return RunOutcome(key, None, tuple(failures), not self.watched.changed)

    def _attempt(
        self, key: str, values: Values, files: Mapping[str, bytes], stop: threading.Event
    ) -> SolvedModes | Failure:
        folder = self._new_folder(key, values, files)
        command, begin = (self._program, *self.command[1:]), os.lstat(folder)
        try:
            code = run_process(
                command, folder, self.timeout_s, dict(self.environment), stop, partial(folders.begun, folder)
            )
        except RunInterruptedError:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        result = self._judged(folder, code) if _is_still(folder, begin) else _removed(folder)
        failed = isinstance(result, Failure)
        if failed and _is_full(self.folder):
            raise FemtuneError("external.folder/full", where=Where(str(folder)))
        if self.keep == "none" or (self.keep == "failed" and not failed):
            shutil.rmtree(folder, ignore_errors=True)
        else:
            folders.end(folder, str(result) if isinstance(result, Failure) else "")
        return result

    def _new_folder(self, key: str, values: Values, files: Mapping[str, bytes]) -> Path:
        """A folder with the input files; another attempt of a run that was killed may still write into its own."""
        folder = None
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            folder = Path(tempfile.mkdtemp(prefix=f"{key[:16]}-", dir=self.folder))
            for name, content in files.items():
                # on a file system that does not tell capitals from small letters, two names may be one file
                if os.path.lexists(folder / name) or name in (LOG, folders.FACTS_FILE):
                    raise FemtuneError("external.same-name/taken", name=name)
                (folder / name).write_bytes(content)
            if os.path.lexists(folder / self.result.name) or self.result.name in (LOG, folders.FACTS_FILE):
                raise FemtuneError("external.result/input", name=self.result.name)
            folders.begin(folder, key, values)
        except FemtuneError:
            shutil.rmtree(folder or "", ignore_errors=True)
            raise
        except OSError as error:
            if folder is not None:
                shutil.rmtree(folder, ignore_errors=True)
            raise FemtuneError("external.folder", where=Where(str(self.folder)), reason=error.strerror) from error
        return folder

    def _judged(self, folder: Path, code: int | None) -> SolvedModes | Failure:
        """The modes of an attempt, or why it has none."""
        place = str(folder)
        texts = [_end_of(folder / name) for name in dict.fromkeys((LOG, self.result.name))]
        refused = _line_with(texts, self.licence_texts)
        if refused:
            return Failure(FailureKind.LICENCE, refused, place)
        if code is None:
            return Failure(FailureKind.TIME_OUT, f"ended after {self.timeout_s:g} s", place)
        error = _line_with(texts, (*self.error_texts, *MODES_FORMATS[self.result.format].error_texts))
        if error:
            return Failure(FailureKind.ERROR_TEXT, error, place)
        if code != 0:
            sentence = f"the solver ended with exit code {code}{_last_said(texts[0])}"
            return Failure(FailureKind.EXIT_CODE, sentence, place)
        path = folder / self.result.name
        strange = f": {_strange(path, folder)}" if os.path.lexists(path) else ""
        if strange != ": ":
            sentence = f"the solver wrote no file {self.result.name}{strange}{_last_said(texts[0])}"
            return Failure(FailureKind.NO_OUTPUT, sentence, place)
        try:
            modes = read_modes(path, self.result.format)
        except FemtuneError as problem:
            if problem.code.startswith("install."):
                raise
            return Failure(FailureKind.BAD_OUTPUT, f"{self.result.name}: {problem.what}", place)
        fault = self.checks.fault(modes)
        return Failure(FailureKind.NOT_SANE, fault, place) if fault else modes


def _is_still(folder: Path, begin: os.stat_result) -> bool:
    """Whether the folder of a run is the one that was made for it."""
    try:
        return os.path.samestat(os.lstat(folder), begin)
    except OSError:
        return False


def _removed(folder: Path) -> Failure:
    return Failure(FailureKind.NO_OUTPUT, "the solver removed the folder of its run", str(folder))


def _is_full(folder: Path) -> bool:
    try:
        return shutil.disk_usage(folder).free < _LEAST_FREE_BYTES
    except OSError:
        return False


def _strange(path: Path, folder: Path) -> str:
    """Why a file is none that the solver has written into the folder of its run; "" if it is one."""
    try:
        if Path(os.path.realpath(path.parent)) != Path(
            os.path.realpath(folder), *path.parent.relative_to(folder).parts
        ):
            return "its folder is a link"
        status, begin = os.lstat(path), os.lstat(folder / folders.FACTS_FILE)
    except OSError as error:
        return error.strerror or str(error)
    if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
        return "it is a link, a folder, a pipe or a device"
    # the input files were written when the run began, and by the clock of the same file system
    if status.st_mtime_ns < begin.st_mtime_ns - _TIME_STEP_NS:
        return "the file of this name is older than the run"
    return ""


def _end_of(path: Path) -> str:
    """The end of a file; "" for a link, a pipe or a device, which the solver may have put there."""
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        with os.fdopen(os.open(path, flags), "rb") as stream:
            known = os.fstat(stream.fileno())
            if not stat.S_ISREG(known.st_mode):
                return ""
            stream.seek(max(known.st_size - _MOST_SEARCHED_BYTES, 0))
            return stream.read().decode("latin-1")
    except OSError:
        return ""


def _last_said(log: str) -> str:
    """The last line that a solver printed, to be added to a sentence; "" where it printed nothing."""
    lines = [line for line in map(str.strip, log.splitlines()) if line]
    return f"; its last line was: {lines[-1][:_SHOWN_CHARACTERS]}" if lines else ""


def _line_with(texts: list[str], patterns: tuple[str, ...]) -> str:
    """The first line in which one of some texts stands."""
    for text in texts:
        for pattern in patterns:
            at = text.find(pattern)
            if pattern and at >= 0:
                begin, end = text.rfind("\n", 0, at) + 1, text.find("\n", at)
                return text[begin : end if end >= 0 else None].strip()[:_SHOWN_CHARACTERS]
    return ""


@dataclass(frozen=True)
class FunctionSolver:
    """A Python function in place of a solver: values by name -> frequencies (m,) in Hz, or `SolvedModes`.

    Parameters
    ----------
    function : is called with a dictionary of the values
    names : of the values
    version : changes where the function does, so that earlier results are not used
    checks : what the modes must be

    Examples
    --------
    >>> from femtune.runs import FunctionSolver
    >>> solver = FunctionSolver(lambda v: [v["k"] ** 0.5, 2.0], ("k",), "1")
    >>> solver.run({"k": 1.44}).modes.freq_hz
    array([1.2, 2. ])
    """

    function: Callable[[dict[str, float]], object]
    names: tuple[str, ...]
    version: str
    checks: Checks = field(default_factory=Checks)

    def check(self) -> None:
        """Nothing that could be missing."""

    def clean(self) -> None:
        """No folders."""

    def key(self, values: Values) -> str:
        """Digest of the values and the version."""
        text = repr((self.version, [(name, float(values[name])) for name in self.names]))
        return sha256(b"femtune function 1" + text.encode()).hexdigest()

    def run(self, values: Values) -> RunOutcome:
        """Call the function once; what it raises is a failure."""
        key = self.key(values)
        try:
            returned = self.function({name: float(values[name]) for name in self.names})
            modes = (
                returned
                if isinstance(returned, SolvedModes)
                else SolvedModes.of_frequencies(np.asarray(returned, float))
            )
            fault = self.checks.fault(modes)
        except FemtuneError:
            # what it returned has a wrong form, at every point
            raise
        except Exception as error:
            return RunOutcome(key, None, (Failure(FailureKind.EXIT_CODE, f"{type(error).__name__}: {error}"),))
        if fault:
            return RunOutcome(key, None, (Failure(FailureKind.NOT_SANE, fault),))
        return RunOutcome(key, modes)


Solver = ExternalSolver | FunctionSolver
