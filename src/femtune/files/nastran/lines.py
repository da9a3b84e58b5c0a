"""One line of bulk data split into fields: small (8 columns), large (16 columns) or free (commas).

A line has ten fields: the name, data (8, or 4 in large field), and a tenth for the name of the continuation.
Tabs move to the next multiple of eight columns.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_DOWN, Context, Decimal
from numbers import Integral
from typing import Literal

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.source import SourceLine

Format = Literal["small", "large", "free"]
LINE_COLUMNS = 80
"""Columns of a line of bulk data; the last eight are field 10."""


@dataclass(frozen=True, slots=True)
class FieldLine:
    """One split line: `head` is field 1 in upper case, `data` 8 or 4 stripped texts, `tail` field 10.

    `large` is True for a line of four 16-column fields, in columns or with commas (``GRID*,...``). In free field `data`
    has 8 more texts (4 in large field) for each line that continues the card after a comma.
    """

    source: SourceLine
    format: Format
    head: str
    data: tuple[str, ...]
    tail: str
    large: bool

    @property
    def size(self) -> tuple[bool, int]:
        """Whether the fields are large, and their number."""
        return self.large, len(self.data)

    @property
    def continues(self) -> bool:
        """Whether the line continues the card above."""
        return not self.head or self.head[0] in "+*"


def split_line(line: SourceLine, body: str) -> FieldLine:
    """Split a line without its comment (`body`) into fields.

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
    pieces = body.split(",")
    texts = [text.strip() for text in pieces]
    _check_commas(line, body, texts[0])
    if (mixed := _mixed(pieces[0])) is not None:
        texts[:1] = [mixed[1].strip(), mixed[2]]
    head = texts[0].upper()
    large = head.endswith("*") or head.startswith("*")
    count = 4 if large else 8
    tail = texts[count + 1] if len(texts) > count + 1 else ""
    if any(texts[count + 2 :]):
        if tail[:1] in ("+", "*") and parse_number(tail) is None:
            raise _too_many(line, head, len(texts), count + 2)
        # the fields after the last one of the line continue the card (MSC, "Format of Bulk Data Entries")
        data, tail = texts[1:], ""
    else:
        data = texts[1 : count + 1]
    data += [""] * (-len(data) % count if data else count)
    return FieldLine(line, "free", head, tuple(data), tail, large)


# name and first field of a line whose other fields are separated by commas
_MIXED = re.compile(r"(\s*[A-Z][A-Z0-9]{2,7}\*?\s+)([^\s,]+)\s*", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[ED]?[+-]?\d{1,3})?", re.IGNORECASE)


def _mixed(first: str) -> re.Match[str] | None:
    """Name and first field where a blank separates them and commas the others: ``CBUSH   10211, 10010, 201``."""
    return _MIXED.fullmatch(first)


def _check_commas(line: SourceLine, body: str, first: str) -> None:
    """Refuse a line in columns whose numbers have decimal commas (``deck.decimal-comma``)."""
    if len(first.split()) < 3 or "," in body[:10]:
        return
    columns = body.expandtabs(8)
    width = 16 if "*" in columns[:8] else 8
    fields = [columns[start : start + width].strip() for start in range(8, 72, width)]
    number = next((text for text in fields if _DECIMAL_COMMA.fullmatch(text)), None)
    if number is not None:
        where = Where(line.file, line.number, columns[:8].strip())
        raise FemtuneError("deck.decimal-comma", where=where, text=number, right=number.replace(",", "."))


def _too_many(line: SourceLine, head: str, found: int, allowed: int) -> FemtuneError:
    return FemtuneError(
        "deck.too-many-fields",
        where=Where(line.file, line.number, head),
        found=found,
        allowed=allowed,
        before_continuation=allowed - 1,
    )


def beyond_last_column(line: FieldLine, body: str) -> bool:
    """Whether a line in columns has text after column 80, which belongs to no field."""
    return line.format != "free" and len(body) > LINE_COLUMNS and len(body.expandtabs(8)) > LINE_COLUMNS


# ----------------------------------------------------------------------------------------------------
# Numbers in Nastran's notation: reading, and writing the closest number that fits in a field.


_REAL = re.compile(r"([+-]?(?:\d+\.\d*|\.\d+))(?:[ED]([+-]?\d{1,4})|([+-]\d{1,4}))?", re.IGNORECASE)
_WITHOUT_POINT = re.compile(r"([+-]?\d+)(?:[ED]([+-]?\d{1,4})|([+-]\d{1,4}))?", re.IGNORECASE)
_INTEGER = re.compile(r"[+-]?\d{1,18}")


def parse_real(text: str) -> float | None:
    """The real number in `text` (``1.5-3``, ``1.+4``, ``2.D5``, ``.1``), or None if it is not one.

    A real number has a decimal point; the letter of the exponent may be omitted. Numbers beyond the range of
    double precision are refused.
    """
    return _finite(_REAL.fullmatch(text))


def parse_number(text: str) -> float | None:
    """The number in a field that can only hold a real one: also without decimal point (``0``, ``2e+11``, ``70E6``)."""
    return _finite(_REAL.fullmatch(text) or _WITHOUT_POINT.fullmatch(text))


def _finite(match: re.Match[str] | None) -> float | None:
    if match is None:
        return None
    value = float(f"{match[1]}e{match[2] or match[3] or 0}")
    return value if math.isfinite(value) else None


def is_too_large(text: str) -> bool:
    """Whether `text` is spelt as a number, but lies beyond the range of double precision."""
    return (_REAL.fullmatch(text) or _WITHOUT_POINT.fullmatch(text)) is not None and parse_number(text) is None


def parse_integer(text: str) -> int | None:
    """The integer in `text`, or None if it is not one."""
    return int(text) if _INTEGER.fullmatch(text) else None


def format_real(value: float, width: int = 8) -> str:
    """Closest number to `value` that fits in `width` columns (8 or more); it always has a decimal point.

    The exponent has no letter, and the decimal point is where it costs the fewest columns:
    ``1.2346-5``, ``.123456``, ``12346.+8``.

    Raises
    ------
    FemtuneError : ``write.not-finite``
    """
    if not math.isfinite(value):
        raise FemtuneError("write.not-finite", values={"value": value})
    if value == 0.0:
        return "0.0"
    sign = "-" if value < 0 else ""
    room = width - len(sign)
    exact = Decimal(repr(float(value))).copy_abs()  # the shortest digits that read back as `value`
    for count in range(min(room, 17), 0, -1):
        digits, power = _rounded_digits(exact, count)
        text = _shortest_fitting(digits, power, room)
        if text:
            return sign + text
    raise ValueError(f"no real number of this size fits in {width} columns; at least 8 are needed")


def rounded(value: float, width: int = 8) -> float:
    """The value that is read back after `format_real(value, width)`."""
    read_back = parse_real(format_real(value, width))
    assert read_back is not None
    return read_back


def _rounded_digits(value: Decimal, count: int) -> tuple[str, int]:
    """`value` as 0.digits x 10**power, correctly rounded to `count` digits, trailing zeros removed."""
    near = Context(prec=count, Emin=-9999, Emax=9999).plus(value)
    if math.isinf(float(near)):
        near = Context(prec=count, rounding=ROUND_DOWN, Emin=-9999, Emax=9999).plus(value)
    digits = "".join(map(str, near.as_tuple().digits))
    return digits.rstrip("0"), near.adjusted() + 1


def _shortest_fitting(digits: str, power: int, room: int) -> str:
    """The most readable spelling of 0.digits x 10**power that fits, or nothing."""
    plain = _plain(digits, power)
    with_exponent = [_with_exponent(digits, power, before) for before in _points(digits)]
    ordered = [*plain, *with_exponent] if -4 < power <= 7 else [*with_exponent, *plain]
    return next((text for text in ordered if len(text) <= room), "")


def _points(digits: str) -> list[int]:
    """Positions of the decimal point, the usual one (after the first digit) first."""
    return [1, 0, *range(2, len(digits) + 1)]


def _plain(digits: str, power: int) -> list[str]:
    if power <= 0:
        fraction = "." + "0" * -power + digits
        return ["0" + fraction, fraction]
    if power < len(digits):
        return [f"{digits[:power]}.{digits[power:]}"]
    whole = digits + "0" * (power - len(digits)) + "."
    return [whole + "0", whole]


def _with_exponent(digits: str, power: int, before: int) -> str:
    exponent = power - before
    return f"{digits[:before]}.{digits[before:]}" + (f"{exponent:+d}" if exponent else "")


# ----------------------------------------------------------------------------------------------------
# The text of single lines: one field replaced in place, and new lines in small, large or free field.


Value = float | int | str | None


@dataclass(frozen=True)
class CardLayout:
    """Layout of a line: its format, and whether its fields are 16 columns wide."""

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


def layout_of(line: SourceLine) -> CardLayout:
    """Format of a line of bulk data."""
    cut = split_line(line, line.body)
    return CardLayout(cut.format, cut.large)


def value_text(value: Value, width: int) -> str:
    """Text of a real, integer, word or blank in a field of `width` characters.

    Raises
    ------
    FemtuneError : ``write.too-wide``, ``write.not-finite``
    """
    if isinstance(value, str) or value is None or isinstance(value, Integral):
        text = "" if value is None else str(value).strip()
    else:
        text = format_real(float(value), width)
    if len(text) > width:
        raise FemtuneError("write.too-wide", text=text, width=width)
    return text


def field_width(line: SourceLine, slot: int) -> int:
    """Characters that data field `slot` of a line may take: more than 8 in free field if it had more."""
    layout = layout_of(line)
    if layout.format != "free" or layout.large:
        return layout.width
    before = split_line(line, line.body).data[slot]
    return min(max(8, len(before)), 16)


def with_field(line: SourceLine, slot: int, text: str) -> SourceLine:
    """The line with data field `slot` replaced; every other character keeps its place if there is room."""
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
    if (mixed := _mixed(pieces[0])) is not None:
        # the blank after the name counts as a comma
        pieces[0], at = mixed[0] if at > 1 else mixed[1] + text.ljust(len(mixed[0]) - len(mixed[1])), at - 1
        if at == 0:
            return ",".join(pieces)
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
    """`text` in a field, aligned as the old text."""
    lead = len(old) - len(old.lstrip())
    left = bool(old.strip()) and len(old.rstrip()) < width
    return (" " * min(lead, width - len(text)) + text).ljust(width) if left else text.rjust(width)


def new_line(layout: CardLayout, head: str, texts: Sequence[str], tail: str = "") -> str:
    """One line of bulk data without its ending."""
    if layout.format == "free":
        return ",".join([head, *texts]).rstrip(",") + ("," * (layout.count - len(texts) + 1) + tail if tail else "")
    fields = "".join(text.rjust(layout.width) for text in texts)
    return (head.ljust(8) + fields).ljust(72 if tail else 0).rstrip(" " if not tail else "") + tail


def new_card_lines(layout: CardLayout, name: str, texts: Sequence[str]) -> list[str]:
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
