"""Catalogue of identified damping values: a TOML file that one study writes and later ones use as priors."""

from __future__ import annotations

import datetime
import math
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from femtune.errors import ErrorCollector, FemtuneError, Where, did_you_mean
from femtune.files.whole_file import write_whole

KINDS = ("material", "joint", "structure", "mode")
_LARGEST_BYTES = 1_000_000
"""Size of a catalogue; an entry takes some 300 bytes."""
_LONGEST_TEXT = 500
"""Characters of a text in an entry."""
_HEAD = """\
# Damping that was identified: value and standard deviation of a field of a deck, with where it comes from.
# A study uses an entry as prior of a parameter:  prior = "damping.toml"  in a [[parameter]] of the same name.
"""


@dataclass(frozen=True)
class DampingEntry:
    """One value.

    Parameters
    ----------
    name : identifier, once in a catalogue
    of : one of KINDS
    fields : of the deck that it was identified for: "MAT1 1 GE"
    value, sd : of the field, in `unit`; "" for a loss factor
    source : deck and configurations
    date : ISO
    study : title
    """

    name: str
    of: str
    fields: tuple[str, ...]
    value: float
    sd: float
    unit: str
    source: str
    date: str
    study: str


def write_catalogue(path: Path, entries: Iterable[DampingEntry]) -> Path:
    """Write a catalogue; what is read back is the same."""
    blocks = [_HEAD, *(_block(entry) for entry in entries)]
    write_whole(path, "\n".join(blocks).encode())
    return path


def _block(entry: DampingEntry) -> str:
    return "\n".join(["[[damping]]", *(f"{key} = {_toml(value)}" for key, value in asdict(entry).items()), ""])


def _toml(value: Any) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value) if isinstance(value, float) else _quoted(value)


def _quoted(text: str) -> str:
    """A basic string of TOML."""
    plain = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04X}" for c in plain) + '"'


def read_catalogue(path: Path) -> Mapping[str, DampingEntry]:
    """Entries by name.

    Raises
    ------
    FemtuneError : ``catalogue.file`` for a file that is not TOML, ``catalogue.entry`` for entries with errors;
        several of these are shown together
    """
    data = _parsed(path)
    errors, entries = ErrorCollector(), dict[str, DampingEntry]()
    for i, table in enumerate(_tables(data, path), start=1):
        with errors.catch():
            entry = _entry(table, i, path)
            if entry.name in entries:
                raise _bad(path, i, "catalogue.entry/repeated-name", entry_name=entry.name)
            entries[entry.name] = entry
    errors.raise_if_any()
    return entries


def look_up(path: Path, name: str) -> DampingEntry:
    """One entry (error ``catalogue.unknown``, and as `read_catalogue`)."""
    known = read_catalogue(path)
    if name not in known:
        raise FemtuneError(
            "catalogue.unknown",
            where=Where(str(path)),
            values={"it has": ", ".join(known) or "nothing"},
            hint=did_you_mean(name, known) or 'name the entry with prior_name = "…"',
            name=name,
        )
    return known[name]


def _parsed(path: Path) -> dict[str, Any]:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise _no_catalogue(path, f"it cannot be read: {error.strerror}") from error
    if len(content) > _LARGEST_BYTES:
        raise _no_catalogue(path, f"{len(content) / 1e6:.3g} MB are too large for a catalogue")
    try:
        return tomllib.loads(content.decode("utf-8").removeprefix("\ufeff"))
    except UnicodeDecodeError as error:
        raise _no_catalogue(path, "it is not UTF-8 text") from error
    except RecursionError as error:
        raise _no_catalogue(path, "brackets are nested too deeply") from error
    except ValueError as error:
        raise _no_catalogue(path, str(error)) from error


def _no_catalogue(path: Path, why: str) -> FemtuneError:
    return FemtuneError("catalogue.file", where=Where(str(path)), reason=why)


def _tables(data: dict[str, Any], path: Path) -> list[Any]:
    unknown = [key for key in data if key != "damping"]
    if unknown or not isinstance(data.get("damping", []), list):
        raise _no_catalogue(path, f"it has '{unknown[0]}'" if unknown else "damping is no list of tables")
    return list(data.get("damping", []))


def _entry(table: Any, i: int, path: Path) -> DampingEntry:
    known = [f.name for f in fields(DampingEntry)]
    if not isinstance(table, dict):
        raise _bad(path, i, "catalogue.entry/not-a-table")
    for key in table:
        if key not in known:
            raise _bad(path, i, "catalogue.entry/unknown-key", hint=did_you_mean(key, known), key=key)
    for key in known:
        if key not in table:
            raise _bad(path, i, "catalogue.entry/missing-key", key=key)
    for key in ("name", "of", "unit", "source", "date", "study"):
        _check_text(table[key], key, i, path)
    names = table["fields"]
    if (
        not isinstance(names, list)
        or not names
        or not all(isinstance(t, str) and len(t) <= _LONGEST_TEXT for t in names)
    ):
        raise _bad(path, i, "catalogue.entry/fields")
    value, sd = (_number(table[key], key, i, path) for key in ("value", "sd"))
    _check_meaning(table, sd, i, path)
    texts = {key: table[key] for key in ("name", "of", "unit", "source", "date", "study")}
    return DampingEntry(fields=tuple(names), value=value, sd=sd, **texts)


def _check_text(value: object, key: str, i: int, path: Path) -> None:
    if not isinstance(value, str) or len(value) > _LONGEST_TEXT:
        raise _bad(path, i, "catalogue.entry/text", key=key, longest=_LONGEST_TEXT)


def _number(value: object, key: str, i: int, path: Path) -> float:
    whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < 10**300
    if not (whole or (isinstance(value, float) and math.isfinite(value))):
        raise _bad(path, i, "catalogue.entry/number", key=key)
    return float(value)  # type: ignore[arg-type]


def _check_meaning(table: dict[str, Any], sd: float, i: int, path: Path) -> None:
    if not sd > 0.0:
        raise _bad(path, i, "catalogue.entry/standard-deviation")
    if table["of"] not in KINDS:
        raise _bad(path, i, "catalogue.entry/kind", kind=table["of"], kinds=", ".join(KINDS))
    if not table["name"].isidentifier():
        raise _bad(path, i, "catalogue.entry/name", name=table["name"][:40])
    try:
        datetime.date.fromisoformat(table["date"])
    except ValueError as error:
        raise _bad(path, i, "catalogue.entry/date", date=table["date"][:40]) from error


def _bad(path: Path, i: int, code: str, hint: str | None = None, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(str(path)), hint=hint, entry_number=i, **facts)
