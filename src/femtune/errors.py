"""Errors and notices: problem, place, values and fix, each with a stable code.

A code is ``area.problem`` (``deck.missing-include``). The texts of all codes are in the registry
``messages/``, from which the pages of ``docs/errors/`` are made.
"""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from copy import copy
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

Mark = Callable[[str], str]
"""How a code is shown: in colour on a terminal, as it is elsewhere."""
Item = TypeVar("Item")
Made = TypeVar("Made")


@dataclass(frozen=True)
class Where:
    """A place in a file: line numbers start at 1; `record` names a card, data set or key."""

    file: str = ""
    line: int | None = None
    record: str = ""

    def __str__(self) -> str:
        place = ":".join(part for part in (self.file, str(self.line or "")) if part)
        return f"{place} ({self.record})" if place and self.record else place or self.record


@dataclass(frozen=True)
class Wording:
    """Wording of a code in the registry: sentence and hint, with the ``{names}`` of the facts that are filled in."""

    what: str
    hint: str = ""


def wording(code: str) -> tuple[str, Wording]:
    """The code without its variant, and its wording.

    The wording is in ``messages/<area>.toml``, once for each ``area.problem``; a code with several wordings selects one
    as ``area.problem/variant``.

    Raises
    ------
    KeyError : the registry does not have the code or the variant
    """
    plain, _, variant = code.partition("/")
    area, _, problem = plain.partition(".")
    entry = _registry(area)[problem]
    entry = entry[variant] if variant else entry
    return plain, Wording(entry["what"], entry.get("hint", ""))


@lru_cache
def _registry(area: str) -> dict[str, Any]:
    """The messages of an area, empty if there is no such area; read when the first of them is needed."""
    import tomllib  # noqa: PLC0415 only a message needs it

    path = Path(__file__).with_name("messages") / f"{area}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def codes() -> list[str]:
    """All codes of the registry, ``area.problem``, sorted."""
    areas = sorted(path.stem for path in Path(__file__).with_name("messages").glob("*.toml"))
    return [f"{area}.{problem}" for area in areas for problem in sorted(_registry(area))]


def explanation(code: str) -> str:
    """Meaning of a code and its fix, as on the page of its area in docs/errors.

    Raises
    ------
    KeyError : the registry does not have the code

    Examples
    --------
    >>> from femtune.errors import explanation
    >>> explanation("units.unknown").startswith("A deck has no units")
    True
    """
    said = meaning(code)
    return f"{said['meaning']}\n\nTo fix it: {said['fix']}"


def meaning(code: str) -> dict[str, str]:
    """The texts ``meaning`` and ``fix`` of a code.

    Raises
    ------
    KeyError : the registry does not have the code
    """
    area, _, problem = code.partition(".")
    entry = _registry(area)[problem]
    return {"meaning": entry["page"].strip(), "fix": entry["fix"].strip()}


class FemtuneError(Exception):
    """A problem that the user can fix.

    Parameters
    ----------
    code : stable code, ``area.problem``; ``area.problem/variant`` if the registry has several wordings
    what : one sentence that describes the problem, for codes that are not in the registry
    where : file, line and record
    values : the values at fault, by name
    hint : the smallest fix; by default that of the registry
    facts : values for the wording of the registry, by name; they are kept as data of the error

    Attributes
    ----------
    notices : notices about the same data, often the cause; added by `with_notices`

    Examples
    --------
    >>> import femtune as ft
    >>> try:
    ...     ft.Dof(0, "Z")
    ... except ft.FemtuneError as error:
    ...     print(error.code)
    dof.syntax
    """

    def __init__(
        self,
        code: str,
        what: str | None = None,
        *,
        where: Where | None = None,
        values: Mapping[str, Any] | None = None,
        hint: str | None = None,
        **facts: Any,
    ) -> None:
        self.code, said = (code, Wording(what)) if what is not None else wording(code)
        self.what = said.what if what is not None else said.what.format_map(facts)
        self.where, self.values, self.facts = where, dict(values or {}), facts
        self.hint = said.hint.format_map(facts) if hint is None else hint
        self.notices: tuple[Notice, ...] = ()
        super().__init__(self.what)

    def at(self, where: Where | None) -> FemtuneError:
        """The same error at another place."""
        other = copy(self)
        other.where = where
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies, also those that go to another process, are not worded again."""
        return _copied, (type(self), self.args, self.__dict__)

    def __str__(self) -> str:
        return self.text()

    def text(self, mark: Mark = str) -> str:
        """All that is said of it; `mark` shows the code."""
        lines = [self.what]
        if str(self.where or ""):
            lines.append(f"  at {self.where}")
        lines += [f"  {name} = {value}" for name, value in self.values.items()]
        lines += ["", "found before this error, perhaps its cause:"] * bool(self.notices)
        lines += [f"  {notice}" for notice in self.notices]
        if self.hint:
            lines += ["", f"hint: {self.hint}"]
        rest = printable("\n".join(lines))
        return f"{mark(f'[{self.code}]')} {rest}"


def _copied(kind: type[FemtuneError], args: tuple[Any, ...], state: dict[str, Any]) -> FemtuneError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class FemtuneErrors(FemtuneError):  # noqa: N818
    """Several errors, reported together."""

    def __init__(self, errors: Iterable[FemtuneError]) -> None:
        self.errors = tuple(errors)
        super().__init__(self.errors[0].code, f"{len(self.errors)} problems found")

    def text(self, mark: Mark = str) -> str:
        """That of each error."""
        return "\n\n".join([f"{len(self.errors)} problems:", *(error.text(mark) for error in self.errors)])


class _Catching(AbstractContextManager[None]):
    """The block of `ErrorCollector.catch`; plain methods, since a deck enters it once for each card."""

    __slots__ = ("errors",)

    def __init__(self, errors: list[FemtuneError]) -> None:
        self.errors = errors

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type | None, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, FemtuneError):
            self.errors.extend(error.errors if isinstance(error, FemtuneErrors) else [error])
            return True
        return False


@dataclass
class ErrorCollector:
    """Collects errors so that all of them are reported together."""

    errors: list[FemtuneError] = field(default_factory=list)

    def catch(self) -> AbstractContextManager[None]:
        """Keep a FemtuneError raised inside the block and go on."""
        return _Catching(self.errors)

    def raise_if_any(self) -> None:
        """Raise what was gathered: the error itself if it is alone, else all of them."""
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            raise FemtuneErrors(self.errors)


_MOST_TOGETHER = 20
"""Number of errors that are reported together; more fill the screen and often have one cause."""


def raise_together(errors: Iterable[FemtuneError]) -> None:
    """Raise the errors of a file, if any: the first twenty, the last of which mentions that there are more.

    Raises
    ------
    FemtuneError : the error if it is alone
    FemtuneErrors : of several
    """
    first = list(islice(errors, _MOST_TOGETHER + 1))
    if len(first) > _MOST_TOGETHER:
        last = copy(first[_MOST_TOGETHER - 1])
        more = f"reading stopped after {_MOST_TOGETHER} errors, and more lines may be wrong"
        last.hint = f"{last.hint}; {more}" if last.hint else more
        first[_MOST_TOGETHER - 1 :] = [last]
    ErrorCollector(first).raise_if_any()


def each(make: Callable[[Item], Made], items: Iterable[Item]) -> list[Made]:
    """`make` of each item; errors of several items are reported together.

    Raises
    ------
    FemtuneError : that of `make`, if one item is wrong
    FemtuneErrors : of several items, as `raise_together` does
    """
    errors, results = ErrorCollector(), list[Made]()
    for item in items:
        with errors.catch():
            results.append(make(item))
        if len(errors.errors) > _MOST_TOGETHER:
            break
    raise_together(errors.errors)
    return results


@dataclass(frozen=True, init=False)
class Notice:
    """A remark that does not stop the analysis.

    `level` is "info", "warning" or "problem"; the wording is that of the registry, filled with `facts`, or the given
    `what`. A fact that needs no explanation has the code "". `repeated` is the number of further notices of the same
    kind for which this one stands.
    """

    code: str
    what: str
    where: Where | None = None
    level: str = "warning"
    facts: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)
    repeated: int = 0

    def __init__(
        self, code: str, what: str | None = None, where: Where | None = None, level: str = "warning", **facts: Any
    ) -> None:
        plain, said = (code, Wording(what)) if what is not None else wording(code)
        given = {
            "code": plain,
            "what": said.what if what is not None else said.what.format_map(facts),
            "where": where,
            "level": level,
            "facts": facts,
        }
        for name, value in given.items():
            object.__setattr__(self, name, value)

    def __str__(self) -> str:
        return self.text()

    def text(self, mark: Mark = str) -> str:
        """The sentence with its code, as `mark` shows it, and its place."""
        code = f"{mark(f'[{self.code}]')} " if self.code else ""
        place = f" at {self.where}" if str(self.where or "") else ""
        more = f"; and {self.repeated} more of this kind" if self.repeated else ""
        return code + printable(f"{self.what}{place}{more}")


def folded(notices: Iterable[Notice]) -> list[Notice]:
    """The first notice of each kind, with the number of the others."""
    loud = list(notices)
    first = {n.code: copy(n) for n in reversed(loud)}
    counts = Counter(n.code for n in loud)
    for code, count in counts.items():
        object.__setattr__(first[code], "repeated", count - 1)
    return [first[code] for code in counts]


@contextmanager
def with_notices(notices: Iterable[Notice]) -> Iterator[None]:
    """Add earlier notices to an error that is raised inside the block."""
    try:
        yield
    except FemtuneError as error:
        error.notices = (*notices, *error.notices)
        raise


def printable(text: str) -> str:
    """`text` with control characters escaped, so that the content of a file cannot control a terminal."""
    if text.replace("\n", "").isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A sentence with the closest known word, or with all of them if none is close; "" without known words."""
    known = sorted(set(known))
    if not known:
        return ""
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else "known: " + ", ".join(known)
