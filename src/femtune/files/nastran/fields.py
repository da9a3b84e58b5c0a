"""One line of bulk data cut into fields: small (8 columns), large (16 columns) or free (commas).

A line has ten fields: the name, data (8, or 4 in large field), and a tenth for the name of the continuation.
Tabs move to the next multiple of eight columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.source import SourceLine

Format = Literal["small", "large", "free"]
LINE_COLUMNS = 80


@dataclass(frozen=True, slots=True)
class FieldLine:
    """One line cut up: `head` is field 1 in upper case, `data` 8 or 4 stripped texts, `tail` field 10.

    `large` tells a line of four 16-column fields, in columns or with commas (``GRID*,...``).
    """

    source: SourceLine
    format: Format
    head: str
    data: tuple[str, ...]
    tail: str
    large: bool

    @property
    def continues(self) -> bool:
        """Whether the line goes on with the card above."""
        return not self.head or self.head[0] in "+*"


def split_line(line: SourceLine, body: str) -> FieldLine:
    """Cut a line without its comment (`body`) into fields.

    Raises
    ------
    FemtuneError : ``deck.too-many-fields``
    """
    if "," in body:
        return _split_free(line, body)
    columns = body.expandtabs(8)
    head = columns[:8].strip().upper()
    large = head.endswith("*") or head.startswith("*")
    width = 16 if large else 8
    data = tuple([columns[start : start + width].strip() for start in range(8, 72, width)])
    return FieldLine(line, "large" if large else "small", head, data, columns[72:80].strip(), large)


def _split_free(line: SourceLine, body: str) -> FieldLine:
    texts = [text.strip() for text in body.split(",")]
    head = texts[0].upper()
    large = head.endswith("*") or head.startswith("*")
    count = 4 if large else 8
    if any(texts[count + 2 :]):
        raise _too_many(line, head, len(texts), count + 2)
    data = texts[1 : count + 1]
    data += [""] * (count - len(data))
    tail = texts[count + 1] if len(texts) > count + 1 else ""
    return FieldLine(line, "free", head, tuple(data), tail, large)


def _too_many(line: SourceLine, head: str, found: int, allowed: int) -> FemtuneError:
    return FemtuneError(
        "deck.too-many-fields",
        f"a free-field line has {found} fields, but {allowed} is the most that one line holds",
        where=Where(line.file, line.number, head),
        hint=f"go on in a new line that starts with a comma after {allowed - 1} fields",
    )


def beyond_last_column(line: FieldLine, body: str) -> bool:
    """Whether a line in columns has text after column 80, which no field takes."""
    return line.format != "free" and len(body) > LINE_COLUMNS and len(body.expandtabs(8)) > LINE_COLUMNS
