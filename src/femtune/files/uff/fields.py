"""Fields of UFF records: fixed columns, and numbers as Fortran writes them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from femtune.files.uff.scan import DataSet

_SHORT_EXPONENT = re.compile(r"(\d\.?)([+-]\d{3})$")
_D_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")
_FLOAT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def with_e_exponents(line: str) -> str:
    """The line with Fortran's D exponents written as E; columns stay where they are."""
    return _D_EXPONENT.sub("E", line) if "D" in line or "d" in line else line


def fixed(line: str, widths: Iterable[int]) -> list[str]:
    """The fields of a line by their widths, without blanks around them."""
    fields, start = [], 0
    for width in widths:
        fields.append(line[start : start + width].strip())
        start += width
    return fields


def as_float(text: str, data_set: DataSet, i: int) -> float:
    """A finite number written with E, D or (three-digit exponents) neither (error ``uff.value``)."""
    plain = _SHORT_EXPONENT.sub(r"\1E\2", with_e_exponents(text.strip()))
    value = float(plain) if _FLOAT.fullmatch(plain) else math.nan
    if not math.isfinite(value):
        what = f"'{text.strip()[:30]}' is not a finite number"
        raise data_set.error("uff.value", what, i, hint="a measured value must be a number; export it again")
    return value


def as_int(text: str, data_set: DataSet, i: int, *, blank: int | None = None) -> int:
    """An integer below 2³¹; an empty field is `blank` where that is given (error ``uff.value``)."""
    stripped = text.strip()
    if not stripped and blank is not None:
        return blank
    if not re.fullmatch(r"[+-]?\d{1,10}", stripped, re.ASCII) or abs(int(stripped)) >= 2**31:
        what = f"'{stripped[:30]}' is not an integer"
        raise data_set.error("uff.value", what, i, hint="the columns of this record may be shifted")
    return int(stripped)


def node_number(value: float, data_set: DataSet) -> int:
    """A node or system number that pyuff gives as a float (error ``uff.value``)."""
    if not (math.isfinite(value) and value == int(value) and 0 <= value < 2**31):
        raise data_set.error("uff.value", f"{value} is not a node or system number")
    return int(value)


def line_at(data_set: DataSet, i: int) -> str:
    """Text line `i`, which must be there (error ``uff.truncated``)."""
    if i >= len(data_set.lines):
        raise data_set.error(
            "uff.truncated",
            f"data set {data_set.number} ends too early",
            max(len(data_set.lines) - 1, 0),
            values={"lines expected": f"at least {i + 1}", "lines found": len(data_set.lines)},
            hint="the data set was cut: export or copy the file again",
        )
    return data_set.lines[i]


def check_count(data_set: DataSet, what: str, expected: int, found: int, i: int | None = None) -> None:
    """Too few is ``uff.truncated``, too many ``uff.count``."""
    if expected != found:
        code = "uff.truncated" if found < expected else "uff.count"
        raise data_set.error(
            code,
            f"data set {data_set.number} does not hold the {what} that it declares",
            i,
            values={"expected": expected, "found": found},
            hint="the file was cut or edited: export or copy it again",
        )
