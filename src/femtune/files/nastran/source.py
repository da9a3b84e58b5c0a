"""Text files of a deck with their INCLUDEs: every physical line is kept byte-true.

Files are decoded as Latin-1, so that every byte is preserved; line endings, tabs, trailing blanks and comments are kept
in `SourceLine.text`.
"""

from __future__ import annotations

import difflib
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from femtune.errors import FemtuneError, Notice, Where

ENCODING = "latin-1"
_BYTE_ORDER_MARK = "\u00ef\u00bb\u00bf"  # the UTF-8 mark as Latin-1 shows it
_PHYSICAL_LINE = re.compile(r"[^\r\n]*(?:\r\n|\n|\r)|[^\r\n]+")
_INCLUDE = re.compile(r"\s*INCLUDE(?=[\s'\"=])\s*=?\s*(.*)", re.IGNORECASE)
_FIRST_LETTERS = frozenset("iIeE")
_ENDDATA = re.compile(r"\s*ENDDATA\b", re.IGNORECASE)
_CEND = re.compile(r"\s*CEND\s*(\$.*)?", re.IGNORECASE)
_BEGIN = re.compile(r"\s*BEGIN\b", re.IGNORECASE)
# Limits of INCLUDEs. Those of real decks are nested a few levels; files that include others twice grow exponentially.
_MOST_LEVELS = 100
_MOST_INCLUDES = 5_000
_MOST_LINES = 100_000_000
"""Lines of an expanded deck: some ten GB of memory, and more than any deck of real structures."""
_CONTROL = re.compile(r"[\x01-\x08\x0b\x0e-\x19\x1b-\x1f]")


class SourceLine(NamedTuple):
    """One physical line: `number` starts at 1, `text` includes the line ending."""

    file: str
    number: int
    text: str

    @property
    def body(self) -> str:
        """The text before a comment and the line ending, trailing blanks removed."""
        return self.text.partition("$")[0].rstrip()

    @property
    def ending(self) -> str:
        """Line ending as in the file: LF, CR LF, CR, or nothing at the end of a file."""
        return self.text[len(self.text.rstrip("\r\n")) :]


@dataclass(frozen=True)
class SourceFile:
    """One file: `prefix` is a byte order mark or empty; prefix and lines joined are the file's bytes."""

    file: str
    prefix: str
    lines: tuple[SourceLine, ...]

    @property
    def text(self) -> str:
        """The whole file as Latin-1 text."""
        return self.prefix + "".join(line.text for line in self.lines)


@dataclass(frozen=True)
class IncludeStatement:
    """An INCLUDE on lines `first` to `last` of `file`; `written` is the path as written in the deck."""

    file: str
    first: int
    last: int
    written: str
    target: str


@dataclass(frozen=True)
class DeckSource:
    """A deck's files (the main file first) and its active lines in reading order, INCLUDEs expanded.

    `lines` ends with ENDDATA if there is one (`ended`); lines after it are in `files` only, and those with text in
    `unread`. `notices` are about files that executive control includes and that do not exist.
    """

    files: tuple[SourceFile, ...]
    includes: tuple[IncludeStatement, ...]
    lines: tuple[SourceLine, ...]
    ended: bool
    notices: tuple[Notice, ...] = ()
    unread: tuple[SourceLine, ...] = ()


def read_source(path: str | Path) -> DeckSource:
    """Read a deck and all files that it includes.

    Raises
    ------
    FemtuneError : ``deck.not-found``, ``deck.unreadable``, ``deck.not-text``, ``deck.missing-include``,
        ``deck.circular-include``, ``deck.too-many-includes``, ``deck.truncated`` (an INCLUDE without its closing quote)
    """
    main = read_file(str(path))
    expansion = _Expansion(_ends_executive(main))
    expansion.read(main, ())
    return DeckSource(
        tuple(expansion.files.values()),
        tuple(expansion.includes),
        tuple(expansion.lines),
        expansion.ended,
        tuple(expansion.notices),
        tuple(expansion.unread),
    )


def _ends_executive(main: SourceFile) -> SourceLine | None:
    """CEND of the main file; None if it does not begin with executive control."""
    for line in main.lines:
        if _CEND.fullmatch(line.body):
            return line
        if _BEGIN.match(line.text):
            return None
    return None


def read_file(file: str) -> SourceFile:
    """Read one text file into its physical lines."""
    text = _decoded(file)
    prefix = _BYTE_ORDER_MARK if text.startswith(_BYTE_ORDER_MARK) else ""
    pieces = _PHYSICAL_LINE.findall(text[len(prefix) :])
    return SourceFile(file, prefix, tuple(SourceLine(file, i, piece) for i, piece in enumerate(pieces, 1)))


def _decoded(file: str) -> str:
    try:
        raw = Path(file).read_bytes()
    except FileNotFoundError as missing:
        raise FemtuneError("deck.not-found", where=Where(file)) from missing
    except OSError as broken:
        raise FemtuneError("deck.unreadable", where=Where(file), strerror=broken.strerror) from broken
    text = raw.decode(ENCODING)
    _check_text(file, text)
    return text


def _check_text(file: str, text: str) -> None:
    controls = text.count("\x00") or len(_CONTROL.findall(text))
    if "\x00" in text or controls > 0.01 * len(text):
        raise FemtuneError("deck.not-text", where=Where(file), values={"control characters": controls})


class _Expansion:
    """Collects the active lines while INCLUDEs are followed."""

    def __init__(self, cend: SourceLine | None) -> None:
        self.files: dict[str, SourceFile] = {}
        self.includes: dict[IncludeStatement, None] = {}
        self.lines: list[SourceLine] = []
        self.notices: list[Notice] = []
        self.ended = False
        self.unread: list[SourceLine] = []
        self.followed = 0
        # its INCLUDEs change the solution sequence (DMAP), not the model
        self.cend, self.executive = cend, cend is not None

    def read(self, source: SourceFile, parents: tuple[str, ...]) -> None:
        self.files.setdefault(source.file, source)
        parents = (*parents, source.file)
        number = 0
        while number < len(source.lines) and not self.ended:
            line = source.lines[number]
            if line is self.cend:
                self.executive = False
            if line.text.lstrip()[:1] not in _FIRST_LETTERS:
                self.lines.append(line)
                number += 1
                continue
            match = _INCLUDE.match(line.text)
            if match is None:
                self.lines.append(line)
                self.ended = _ENDDATA.match(line.text) is not None
                number += 1
            else:
                number = self._follow(source, number, match[1], parents)
        after = source.lines[number:]
        self.unread += [line for line in after if line.body.strip() and not _ENDDATA.match(line.text)]

    def _follow(self, source: SourceFile, number: int, rest: str, parents: tuple[str, ...]) -> int:
        written, after = _include_path(source, number, rest)
        target = _target(source.file, written)
        statement = IncludeStatement(source.file, number + 1, after, written, target)
        if self.executive and not os.path.isfile(target):
            where = Where(statement.file, statement.first, "INCLUDE")
            self.notices.append(Notice("deck.missing-include/executive", where=where, written=written))
            return after
        if statement not in self.includes:
            # a file that was expanded before does not include any of the files above it
            _check_include(statement, parents)
            self.includes[statement] = None
        self._check_size(statement, parents)
        self.read(self.files.get(target) or read_file(target), parents)
        return after

    def _check_size(self, statement: IncludeStatement, parents: tuple[str, ...]) -> None:
        """Errors for INCLUDEs that are nested too deep, or that repeat files until the deck is too long."""
        self.followed += 1
        where = Where(statement.file, statement.first, "INCLUDE")
        if len(parents) > _MOST_LEVELS:
            raise FemtuneError("deck.too-many-includes/depth", where=where, most=_MOST_LEVELS)
        if self.followed > _MOST_INCLUDES or len(self.lines) > _MOST_LINES:
            count = f"{self.followed - 1} INCLUDEs, {len(self.lines)} lines"
            raise FemtuneError("deck.too-many-includes", where=where, values={"so far": count})


def _include_path(source: SourceFile, number: int, rest: str) -> tuple[str, int]:
    """Path of the INCLUDE at index `number` and the index of the line after the statement."""
    quote = rest[:1] if rest[:1] in ("'", '"') else ""
    return _quoted(source, number, rest[1:], quote) if quote else _unquoted(source, number, rest)


def _quoted(source: SourceFile, number: int, rest: str, quote: str) -> tuple[str, int]:
    pieces = []
    for index in range(number, len(source.lines)):
        text = rest if index == number else source.lines[index].text
        piece, closed, _ = text.partition(quote)
        pieces.append(piece.strip())
        if closed:
            return "".join(pieces), index + 1
    raise _unfinished(source, number, "deck.truncated/no-closing-quote")


def _unquoted(source: SourceFile, number: int, rest: str) -> tuple[str, int]:
    """Read an unquoted path, which continues in the next line if it ends with a comma."""
    pieces = []
    for index in range(number, len(source.lines)):
        text = rest if index == number else source.lines[index].text
        piece = text.partition("$")[0].strip()
        pieces.append(piece.rstrip(","))
        if not piece.endswith(","):
            break
    else:
        raise _unfinished(source, number, "deck.truncated/include-continued")
    if not "".join(pieces):
        raise _unfinished(source, number, "deck.truncated/include-without-file")
    return "".join(pieces), index + 1


def _unfinished(source: SourceFile, number: int, code: str) -> FemtuneError:
    return FemtuneError(code, where=Where(source.file, number + 1, "INCLUDE"))


def plain_path(written: str) -> str:
    """A path as written in the deck, with forward slashes, and in UTF-8 if its bytes are UTF-8."""
    try:
        text = written.encode(ENCODING).decode("utf-8")
    except UnicodeDecodeError:
        text = written
    return text.replace("\\", "/")


def _target(file: str, written: str) -> str:
    """Path of an included file, relative to the folder of the file that includes it."""
    joined = os.path.join(os.path.dirname(file), plain_path(written))
    normal = os.path.normpath(joined)
    # "folder/../x" is not "x" if the folder is a symbolic link
    return normal if os.path.realpath(normal) == os.path.realpath(joined) else joined


def _check_include(statement: IncludeStatement, parents: tuple[str, ...]) -> None:
    where = Where(statement.file, statement.first, "INCLUDE")
    target = Path(statement.target)
    if not os.path.isfile(target):  # also False for a name that no file can have
        raise FemtuneError(
            "deck.missing-include",
            where=where,
            values={"looked for": str(target.absolute())},
            hint=_missing_hint(target),
            written=statement.written,
        )
    if os.path.realpath(target) in map(os.path.realpath, parents):
        raise FemtuneError(
            "deck.circular-include",
            where=where,
            values={"chain": " -> ".join([*parents, statement.target])},
            written=statement.written,
        )


def _missing_hint(target: Path) -> str:
    general = "put the file there, or correct the path (it is relative to the file that includes it)"
    folder = target.parent
    names = os.listdir(folder) if os.path.isdir(folder) and os.access(folder, os.R_OK) else []
    lowered = {name.lower(): name for name in names}
    close = difflib.get_close_matches(target.name.lower(), lowered, n=1, cutoff=0.8)
    return f"did you mean '{lowered[close[0]]}'? Else {general}" if close else general
