"""The text of single lines: one field replaced in place, and new lines in small, large or free field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral

from femtune.errors import FemtuneError
from femtune.files.nastran.fields import Format, split_line
from femtune.files.nastran.reals import format_real
from femtune.files.nastran.source import SourceLine

Value = float | int | str | None


@dataclass(frozen=True)
class Layout:
    """How a line is written: its format, and whether its fields are 16 columns wide."""

    format: Format
    large: bool

    @property
    def width(self) -> int:
        """Characters of one field."""
        return 16 if self.large else 8

    @property
    def count(self) -> int:
        """Data fields of one line."""
        return 4 if self.large else 8


def layout_of(line: SourceLine) -> Layout:
    """Format of a line of bulk data."""
    cut = split_line(line, line.body)
    return Layout(cut.format, cut.large)


def value_text(value: Value, width: int) -> str:
    """A real, integer, word or blank as a field of `width` characters holds it.

    Raises
    ------
    FemtuneError : ``write.too-wide``, ``write.not-finite``
    """
    if isinstance(value, str) or value is None or isinstance(value, Integral):
        text = "" if value is None else str(value).strip()
    else:
        text = format_real(float(value), width)
    if len(text) > width:
        raise FemtuneError(
            "write.too-wide",
            f"'{text}' does not fit in a field of {width} characters",
            hint="give it a shorter name or number, or write the card in large field",
        )
    return text


def field_width(line: SourceLine, slot: int) -> int:
    """Characters that data field `slot` of a line may take: more than 8 in free field if it had more."""
    layout = layout_of(line)
    if layout.format != "free" or layout.large:
        return layout.width
    before = split_line(line, line.body).data[slot]
    return min(max(8, len(before)), 16)


def with_field(line: SourceLine, slot: int, text: str) -> SourceLine:
    """The line with data field `slot` replaced; every other character stays where it was if there is room."""
    content = line.text.rstrip("\r\n")
    dollar = content.find("$")
    body, comment = (content, "") if dollar < 0 else (content[:dollar], content[dollar:])
    layout = layout_of(line)
    if layout.format == "free":
        body = _replaced_piece(body, slot + 1, text)
    else:
        body = _replaced_columns(body, 8 + slot * layout.width, layout.width, text)
    return line._replace(text=body + comment + line.ending)


def _replaced_piece(body: str, at: int, text: str) -> str:
    pieces = body.split(",")
    if at >= len(pieces):
        kept = body.rstrip()
        return kept + "," * (at - len(pieces) + 1) + text + body[len(kept) :]
    old = pieces[at].strip()
    pieces[at] = pieces[at].replace(old, text, 1) if old else text.ljust(len(pieces[at]))
    return ",".join(pieces)


def _replaced_columns(body: str, start: int, width: int, text: str) -> str:
    body += " " * (start - len(body.expandtabs(8)))
    first, last = _raw_index(body, start), _raw_index(body, start + width)
    old = body[first:last]
    new = _placed(old.expandtabs(8), width, text)
    if last == len(body):
        new = new.rstrip().ljust(len(old.expandtabs(8)))
    return body[:first] + new + body[last:]


def _raw_index(body: str, column: int) -> int:
    """Index of the first character at or after a column, tabs expanded."""
    if "\t" not in body:
        return min(column, len(body))
    return next((i for i in range(len(body)) if len(body[:i].expandtabs(8)) >= column), len(body))


def _placed(old: str, width: int, text: str) -> str:
    """`text` in a field, on the side where the old text stood."""
    lead = len(old) - len(old.lstrip())
    left = bool(old.strip()) and len(old.rstrip()) < width
    return (" " * min(lead, width - len(text)) + text).ljust(width) if left else text.rjust(width)


def new_line(layout: Layout, head: str, texts: Sequence[str], tail: str = "") -> str:
    """One line of bulk data without its ending."""
    if layout.format == "free":
        return ",".join([head, *texts]).rstrip(",") + ("," * (layout.count - len(texts) + 1) + tail if tail else "")
    fields = "".join(text.rjust(layout.width) for text in texts)
    return (head.ljust(8) + fields).ljust(72 if tail else 0).rstrip(" " if not tail else "") + tail


def new_card_lines(layout: Layout, name: str, texts: Sequence[str]) -> list[str]:
    """Lines of a whole card without their endings; large field always in pairs of lines."""
    star = "*" if layout.large else ""
    per_card_line = layout.count
    rows = max(1, -(-len(texts) // per_card_line))
    rows += rows % 2 if layout.large else 0
    lines = []
    for row in range(rows):
        head = name + star if row == 0 else star or "+"
        lines.append(new_line(layout, head, texts[row * per_card_line : (row + 1) * per_card_line]))
    return lines
