"""Which program a text is the input of, by its content: Nastran, or Abaqus, CalculiX and Ansys."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from femtune.files.nastran.source import ENCODING, SourceLine

_FIRST_BYTES = 200_000
"""Beginning of a file that is looked at: comments at the head of generated decks take some thousand characters."""
_MOST_LINES = 500
"""Lines with text that are looked at."""
# statements of the sections, and cards that nearly every deck has; names in columns, with commas, and in large field
_STATEMENT = re.compile(r" {0,3}(?:SOL[ ,=]+\w+|CEND|BEGIN[ ,]*(?:BULK|SUPER)?|ENDDATA)\s*(?:=.*|\$.*)?", re.IGNORECASE)
_CARD = re.compile(
    r"(?:GRID|CORD2[RCS]|CQUAD4|CTRIA3|CBAR|CBEAM|CHEXA|CTETRA|CPENTA|CONM2|RBE[23]|PSHELL|PSOLID|PBARL?|PBEAML?|MAT1|"
    r"SPC1|EIGRL|INCLUDE)(?:\*| |,|\t).*",
    re.IGNORECASE,
)
# keywords of Abaqus and CalculiX; commands of Ansys at the beginning of a line
_KEYWORD = re.compile(
    r"\*(?:HEADING|NODE|ELEMENT|PART|MATERIAL|INCLUDE|PREPRINT|STEP|NSET|ELSET|SOLID SECTION|SHELL SECTION)\b"
    r"(?!\s*\d).*",
    re.IGNORECASE,
)
_COMMAND = re.compile(
    r"(?:/(?:BATCH|PREP7|SOLU|COM|TITLE|FILNAM|UNITS|NOPR)\b.*|"
    r"(?:NBLOCK|EBLOCK|CMBLOCK|ETBLOCK|ET|KEYOPT|ANTYPE|MPDATA|MPTEMP)\s*,.*)",
    re.IGNORECASE,
)
_CONTINUATIONS = ("+", "*", " ", ",", "\t")
_COMMENTS = ("$", "**", "!", "#", "//")


def is_input(path: str | Path) -> bool:
    """Whether a file is the input of one of these programs; False for one that cannot be read."""
    try:
        with open(path, "rb") as file:
            text = file.read(_FIRST_BYTES).decode(ENCODING)
    except (OSError, ValueError):
        return False
    if "\x00" in text:
        return False
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith(_COMMENTS)]
    lines = lines[:_MOST_LINES]
    if any(_STATEMENT.fullmatch(line) for line in lines):
        return True
    firsts = [line for line in lines if not line.startswith(_CONTINUATIONS)]
    if 2 * sum(_CARD.fullmatch(line) is not None for line in firsts) > len(firsts):
        return True
    return bool(lines) and _is_foreign(lines[0])


def foreign_line(lines: Iterable[SourceLine]) -> SourceLine | None:
    """The first line with text, if it begins an input of Abaqus, CalculiX or Ansys."""
    first = next((line for line in lines if not line.text.lstrip().startswith(_COMMENTS)), None)
    return first if first is not None and _is_foreign(first.text.rstrip()) else None


def _is_foreign(line: str) -> bool:
    return (_KEYWORD.fullmatch(line) or _COMMAND.fullmatch(line)) is not None
