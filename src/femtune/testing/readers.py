"""Check of a file reader: its behaviour for valid, damaged and missing files."""

from __future__ import annotations

import math
import re
import signal
import tempfile
import threading
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp
from pydantic import BaseModel

from femtune.errors import FemtuneError, Notice

T = TypeVar("T")

HUGE = (b"1e400", b"-1e308", b"99999999999999999999", b"9.9e37", b"nan", b"inf", b"-1", b"0", b"1e-400", b"2147483648")
"""What replaces a number in a damaged file."""
_NUMBER = re.compile(rb"(?<![A-Za-z0-9_.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?")
_MOST_NUMBERS = 1_000
"""Numbers at the beginning of a file among which those to be replaced are drawn."""


@dataclass(frozen=True)
class ReaderChecks:
    """Result of `check_reader`: files read and refused, and the largest time and memory."""

    read: int
    refused: int
    slowest_s: float
    largest_mb: float


def check_reader(
    read: Callable[[Path], T],
    path: Path | str,
    *,
    complete: Callable[[T], None] | None = None,
    unknown: str | None = None,
    notices: Callable[[T], Iterable[Notice]] = lambda data: getattr(data, "notices", ()),
    mutants: int = 100,
    seed: int = 1,
    seconds: float = 5.0,
    megabytes: float = 256.0,
) -> ReaderChecks:
    """Raise AssertionError if a reader breaks the rules of the package.

    - The good file is read, twice with the same result, and is not changed.
    - Nothing is dropped silently: `complete` asserts what the data must hold, and a record that the reader does not
      know (`unknown`) is named by a notice with its line, or by an error.
    - A damaged file gives data or a `FemtuneError`, never another exception or a warning, within the limits of time and
      memory: cut short, garbled, with lines lost, doubled or exchanged, with huge numbers, empty, binary.
    - A file that does not exist and a folder give a `FemtuneError` that names it.

    The file that broke a rule is kept; the message says where.

    Parameters
    ----------
    read : reads a file
    path : a good file, small: it is read some hundred times
    complete : raises AssertionError where something of the file is missing in the data
    unknown : lines with a record that the reader does not know, set in before the last line
    notices : of the data, its diagnostics
    mutants : number of damaged files of each kind that is drawn at random
    seed : the same seed gives the same files
    seconds, megabytes : that reading a file may take

    Returns
    -------
    ReaderChecks

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import check_reader, example_test
    >>> def all_there(test):
    ...     assert len(test.modes) == 4
    >>> check_reader(ft.read_test, example_test(), complete=all_there, mutants=5).refused > 0
    True
    """
    path = Path(path)
    limits = _Limits(seconds, megabytes)
    good = path.read_bytes()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _check_good(read, path, good, complete, limits)
        if unknown is not None:
            _check_unknown(read, notices, _beside(folder, path, _with_unknown(good, unknown)), unknown, limits)
        _check_absent(read, folder / f"absent{path.suffix}", limits)
        _check_absent(read, folder, limits)
        outcomes = [
            _check_damaged(read, _beside(folder, path, content), words, limits)
            for words, content in damaged(good, mutants, seed)
        ]
    return ReaderChecks(outcomes.count(True), outcomes.count(False), limits.slowest_s, limits.largest_mb)


@dataclass
class _Limits:
    """What reading may take, and the most that it took."""

    seconds: float
    megabytes: float
    slowest_s: float = 0.0
    largest_mb: float = 0.0

    @contextmanager
    def watched(self, words: str) -> Iterator[None]:
        """Time and memory of a block; warnings are errors in it."""
        tracemalloc.start()
        begin = time.perf_counter()
        try:
            with warnings.catch_warnings(), _alarm(2.0 * self.seconds):
                warnings.simplefilter("error")
                yield
        finally:
            took, (_, peak) = time.perf_counter() - begin, tracemalloc.get_traced_memory()
            tracemalloc.stop()
        self.slowest_s, self.largest_mb = max(self.slowest_s, took), max(self.largest_mb, peak / 1e6)
        assert took <= self.seconds, f"{words}: reading took {took:.2g} s, more than {self.seconds:g} s"
        taken = f"{words}: reading took {peak / 1e6:.0f} MB"
        assert peak <= 1e6 * self.megabytes, f"{taken}, more than {self.megabytes:g} MB"


class _TooSlow(BaseException):
    """The clock has run out; no `except Exception` of a reader may catch it."""


@contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    """End a reader that does not end by itself, where the system has alarms."""
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def ring(number: int, frame: FrameType | None) -> None:
        raise _TooSlow

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    except _TooSlow:
        raise AssertionError(f"reading did not end within {seconds:g} s") from None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _check_good(
    read: Callable[[Path], T], path: Path, good: bytes, complete: Callable[[T], None] | None, limits: _Limits
) -> None:
    with limits.watched("the good file"):
        data = read(path)
    if complete is not None:
        complete(data)
    assert alike(data, read(path)), "the same file, read twice, gives different data"
    assert path.read_bytes() == good, "reading has changed the file"


def _check_unknown(
    read: Callable[[Path], T], notices: Callable[[T], Iterable[Notice]], path: Path, unknown: str, limits: _Limits
) -> None:
    """A record that is not understood is named, with its line."""
    last = path.read_bytes().rstrip().count(b"\n") + 1
    lines = range(last - unknown.rstrip("\n").count("\n") - 2, last + 1)
    try:
        with limits.watched("a file with an unknown record"):
            places = [n.where for n in notices(read(path))]
    except FemtuneError as error:
        places = [error.where]
    except Exception as error:
        what = f"a file with an unknown record gives {type(error).__name__} and no FemtuneError: {error}"
        raise AssertionError(f"{what}; kept in {_keep(path)}") from error
    if not any(where is not None and where.line in lines for where in places):
        what = f"a record that the reader does not know (lines {lines[0]} to {lines[-1]})"
        raise AssertionError(f"{what} is dropped without a notice that has its line; kept in {_keep(path)}")


def _check_absent(read: Callable[[Path], object], path: Path, limits: _Limits) -> None:
    """No file, and a folder."""
    what = "a folder" if path.is_dir() else "a file that does not exist"
    try:
        with limits.watched(what):
            read(path)
    except FemtuneError as error:
        if path.name not in str(error):
            raise AssertionError(f"the error of {what} does not name it: {error}") from error
    except Exception as error:
        raise AssertionError(f"{what} gives {type(error).__name__} and no FemtuneError: {error}") from error
    else:
        raise AssertionError(f"{what} was read")


def _check_damaged(read: Callable[[Path], object], path: Path, words: str, limits: _Limits) -> bool:
    """True where it was read, False where it was refused."""
    try:
        with limits.watched(f"a file {words}"):
            read(path)
    except FemtuneError:
        return False
    except AssertionError as error:
        raise AssertionError(f"{error}; kept in {_keep(path)}") from error
    except Exception as error:
        what = f"a file {words} gives {type(error).__name__} and no FemtuneError: {error}"
        raise AssertionError(f"{what}; kept in {_keep(path)}") from error
    return True


def _beside(folder: Path, path: Path, content: bytes) -> Path:
    """A file of the same name with other content."""
    made = folder / path.name
    made.write_bytes(content)
    return made


def _keep(path: Path) -> Path:
    kept = Path(tempfile.mkdtemp(prefix="femtune-reader-")) / path.name
    kept.write_bytes(path.read_bytes())
    return kept


def _with_unknown(good: bytes, unknown: str) -> bytes:
    lines = good.rstrip().split(b"\n")
    return b"\n".join([*lines[:-1], unknown.rstrip("\n").encode(), lines[-1], b""])


def damaged(good: bytes, count: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Files made of a good one, each with words that say what was done to it; the same for the same seed."""
    chance = np.random.default_rng(seed)
    yield "without content", b""
    yield "of blanks", b" \n" * 10
    yield "of zeros", bytes(1000)
    yield "of noise", chance.bytes(4000)
    yield "twice in a row", good + good
    yield "with a line of a million letters", good + b"x" * 1_000_000 + b"\n"
    for at in sorted({int(p) for p in np.linspace(1, max(len(good) - 1, 1), count)}):
        yield f"cut after {at} bytes", good[:at]
    for _ in range(count):
        yield _garbled(good, chance)
    lines = good.splitlines(keepends=True)
    if b"\0" not in good and len(lines) > 1:
        for _ in range(count):
            yield _of_lines(lines, chance)
            yield _of_numbers(good, chance)


def _garbled(good: bytes, chance: np.random.Generator) -> tuple[str, bytes]:
    """A few bytes are others."""
    content = bytearray(good)
    places = chance.integers(0, len(good), size=int(chance.integers(1, 9))).tolist() if good else []
    for at in places:
        content[at] = int(chance.integers(0, 256))
    return f"garbled at bytes {', '.join(map(str, places))}", bytes(content)


def _of_lines(lines: Sequence[bytes], chance: np.random.Generator) -> tuple[str, bytes]:
    """A line is lost, doubled, or exchanged with another one."""
    i, j = (int(k) for k in chance.integers(0, len(lines), 2))
    changed = list(lines)
    word = ("lost", "doubled", "exchanged")[int(chance.integers(3))]
    if word == "lost":
        del changed[i]
    elif word == "doubled":
        changed.insert(i, lines[i])
    else:
        changed[i], changed[j] = lines[j], lines[i]
    other = f" with {j + 1}" if word == "exchanged" else ""
    return f"with line {i + 1} {word}{other}", b"".join(changed)


def _of_numbers(good: bytes, chance: np.random.Generator) -> tuple[str, bytes]:
    """A number is another one, in the same columns where it fits into them."""
    numbers = list(_NUMBER.finditer(good))
    if not numbers:
        return "unchanged", good
    match = numbers[int(chance.integers(min(len(numbers), _MOST_NUMBERS)))]
    other = HUGE[int(chance.integers(len(HUGE)))]
    width = match.end() - match.start()
    text = other.rjust(width) if len(other) <= width else other
    line = good.count(b"\n", 0, match.start()) + 1
    words = f"with {other.decode()} in place of {match[0].decode(errors='replace')} on line {line}"
    return words, good[: match.start()] + text + good[match.end() :]


def alike(a: object, b: object) -> bool:
    """True for data that are equal throughout: arrays by their entries (NaN equals NaN), dataclasses by fields."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return _same_arrays(a, b)
    if sp.issparse(a):
        return _same_arrays(a.toarray(), b.toarray())  # type: ignore[attr-defined]
    if isinstance(a, BaseModel):
        return alike(a.__dict__, b.__dict__)
    if is_dataclass(a):
        return all(alike(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.init)
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return list(a) == list(b) and all(alike(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(alike(x, y) for x, y in zip(a, b))
    return _same_objects(a, b)


def _same_arrays(a: Any, b: Any) -> bool:
    floats = a.dtype.kind in "fc"
    return a.shape == b.shape and a.dtype == b.dtype and bool(np.array_equal(a, b, equal_nan=floats))


def _same_objects(a: Any, b: Any) -> bool:
    """NaN equals NaN; objects that define equality by it, others by their attributes."""
    if isinstance(a, float) and math.isnan(a):
        return math.isnan(b)
    if type(a).__eq__ is not object.__eq__:
        return bool(a == b) or (isinstance(a, float) and math.isnan(a) and math.isnan(b))
    attributes = getattr(a, "__dict__", None)
    return a is b or (attributes is not None and alike(attributes, b.__dict__)) or callable(a)
