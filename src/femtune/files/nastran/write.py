"""A deck written into a folder: changed files go there, unchanged INCLUDEs are referred to where they are.

The main file is written as ``updated.bdf``; an included file is written beside it if it was changed or includes
a file that was. The path of an INCLUDE is rewritten only where it would not lead to its file any more.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.edit import EditedDeck, new_text
from femtune.files.nastran.source import ENCODING, IncludeStatement, SourceLine, plain_path
from femtune.files.whole_file import write_whole

_PATH_COLUMNS = 56
_STATEMENT = re.compile(r"\s*INCLUDE\s*=?\s*", re.IGNORECASE)


@dataclass(frozen=True)
class IncludeChange:
    """An INCLUDE whose path was rewritten: its place in the deck that was read, old and new path."""

    where: Where
    before: str
    after: str


@dataclass(frozen=True)
class WrittenDeck:
    """Files that were written (the main file first) and the INCLUDEs whose path had to change."""

    main: Path
    files: tuple[Path, ...]
    include_changes: tuple[IncludeChange, ...]


def write_deck(edited: EditedDeck, folder: str | Path, name: str = "updated.bdf") -> WrittenDeck:
    """Write an edited deck into `folder`, which is made if it is not there.

    Raises
    ------
    FemtuneError : ``run.unwritable``, ``write.overwrites-input``
    """
    folder, deck = Path(folder), edited.deck
    check_overwrites(deck, folder, name)
    names = _new_names(edited, name, folder)
    includes = _rewritten_includes(deck, names, folder)
    replacements = {**edited.replacements, **_include_lines(deck, includes)}
    texts = {names[file.file]: new_text(file, replacements) for file in deck.files if file.file in names}
    _write(folder, texts)
    changes = tuple(
        IncludeChange(Where(one.file, one.first, "INCLUDE"), one.written, path) for one, path in includes.items()
    )
    return WrittenDeck(folder / name, tuple(folder / new for new in texts), changes)


def _new_names(edited: EditedDeck, name: str, folder: Path) -> dict[str, str]:
    """Names in the run folder of all files that must be written, by their present file; none is that of an input."""
    main = edited.deck.files[0].file
    written = {main} | set(edited.texts)
    for _ in edited.deck.files:
        written |= {one.file for one in edited.deck.source.includes if one.target in written}
    read = {os.path.realpath(file.file) for file in edited.deck.files}
    names = {main: name}
    for file in edited.deck.files[1:]:
        if file.file in written:
            names[file.file] = _free_name(os.path.basename(file.file), names, folder, read)
    return names


def _free_name(name: str, names: Mapping[str, str], folder: Path, read: set[str]) -> str:
    taken = {other.lower() for other in names.values()}
    stem, ending = os.path.splitext(name)
    candidates = [name, *(f"{stem}_{number}{ending}" for number in range(2, len(names) + len(read) + 3))]
    return next(one for one in candidates if one.lower() not in taken and os.path.realpath(folder / one) not in read)


def check_overwrites(deck: Deck, folder: Path, name: str) -> None:
    """Refuse a folder in which the updated deck would overwrite the deck that was read, or one of its INCLUDEs.

    Raises
    ------
    FemtuneError : ``write.overwrites-input``
    """
    if os.path.realpath(folder / name) in {os.path.realpath(file.file) for file in deck.files}:
        raise FemtuneError(
            "write.overwrites-input",
            "the updated deck would overwrite a file of the deck that was read",
            where=Where(str(folder / name)),
            hint="choose another folder for the run",
        )


def _rewritten_includes(deck: Deck, names: Mapping[str, str], folder: Path) -> dict[IncludeStatement, str]:
    """New paths of those INCLUDEs in written files that would not lead to their file any more."""
    new_paths = {}
    for statement in deck.source.includes:
        if statement.file in names:
            path = names.get(statement.target) or _kept_path(statement, folder)
            if path != plain_path(statement.written):
                new_paths[statement] = path
    return new_paths


def _kept_path(statement: IncludeStatement, folder: Path) -> str:
    """Path from the run folder to a file that stays where it is: the old one if it still leads there."""
    target = os.path.realpath(statement.target)
    spelled = plain_path(statement.written)
    if os.path.realpath(folder / spelled) == target:
        return spelled
    try:
        return os.path.relpath(target, os.path.realpath(folder)).replace("\\", "/")
    except ValueError:  # another drive
        return target.replace("\\", "/")


def _include_lines(deck: Deck, includes: Mapping[IncludeStatement, str]) -> dict[tuple[str, int], str]:
    by_file = {file.file: file.lines for file in deck.files}
    replacements: dict[tuple[str, int], str] = {}
    for statement, path in includes.items():
        lines = by_file[statement.file][statement.first - 1 : statement.last]
        replacements.update({line[:2]: "" for line in lines})
        replacements[lines[0][:2]] = _include_text(lines, path)
    return replacements


def _include_text(lines: tuple[SourceLine, ...], path: str) -> str:
    """The statement with another path; what follows the path (a comment) is kept."""
    match = _STATEMENT.match(lines[0].text)
    assert match is not None
    joined = "".join(line.text for line in lines)[match.end() :]
    quoted = joined[0] in "'\""
    rest = joined[1:].partition(joined[0])[2] if quoted else lines[-1].text[len(lines[-1].body) :]
    path = path.encode("utf-8", "surrogateescape").decode(ENCODING)
    quote = '"' if "'" in path else "'"
    ending = lines[0].ending or "\n"
    return match[0] + quote + ending.join(_path_pieces(path)) + quote + rest


def _path_pieces(path: str) -> list[str]:
    """A long path cut behind slashes, as no line may go beyond column 72."""
    pieces, at = [], 0
    while len(path) - at > _PATH_COLUMNS:
        slash = path.rfind("/", at, at + _PATH_COLUMNS)
        slash = slash if slash >= at else path.find("/", at + _PATH_COLUMNS)
        if slash < 0:
            break
        pieces.append(path[at : slash + 1])
        at = slash + 1
    return [piece for piece in [*pieces, path[at:]] if piece]


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            write_whole(folder / name, text.encode(ENCODING))
    except OSError as broken:
        raise FemtuneError(
            "run.unwritable",
            f"the run folder cannot be written: {broken.strerror}",
            where=Where(str(folder)),
            hint="choose a folder that you may write to, with space left on its disk",
        ) from broken
