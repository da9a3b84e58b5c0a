"""Fields of UFF records: fixed columns, and numbers as Fortran writes them."""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from femtune._optional import require
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
        raise data_set.error("uff.value", i, text=text.strip()[:30])
    return value


def free_numbers(line: str) -> list[float] | None:
    """The numbers of a line that is not in the columns of the format, separated by blanks; None where one is none."""
    texts = with_e_exponents(line).split()
    if not texts or not all(_FLOAT.fullmatch(text) for text in texts):
        return None
    numbers = [float(text) for text in texts]
    return numbers if all(map(math.isfinite, numbers)) else None


def as_int(text: str, data_set: DataSet, i: int, *, blank: int | None = None) -> int:
    """An integer below 2³¹; an empty field is `blank` where that is given (error ``uff.value``)."""
    stripped = text.strip()
    if not stripped and blank is not None:
        return blank
    if not re.fullmatch(r"[+-]?\d{1,10}", stripped, re.ASCII) or abs(int(stripped)) >= 2**31:
        raise data_set.error("uff.value/integer", i, text=stripped[:30])
    return int(stripped)


def node_number(value: float, data_set: DataSet) -> int:
    """A node or system number that pyuff gives as a float (error ``uff.value``)."""
    if not (math.isfinite(value) and value == int(value) and 0 <= value < 2**31):
        raise data_set.error("uff.value/node-number", value=value)
    return int(value)


def line_at(data_set: DataSet, i: int) -> str:
    """Text line `i`, which must be there (error ``uff.truncated``)."""
    if i >= len(data_set.lines):
        raise data_set.error(
            "uff.truncated/too-few-lines",
            max(len(data_set.lines) - 1, 0),
            values={"lines expected": f"at least {i + 1}", "lines found": len(data_set.lines)},
            data_set_number=data_set.number,
        )
    return data_set.lines[i]


def check_count(data_set: DataSet, what: str, expected: int, found: int, i: int | None = None) -> None:
    """Too few is ``uff.truncated``, too many ``uff.count``."""
    if expected != found:
        code = "uff.truncated/count" if found < expected else "uff.count"
        values = {"expected": expected, "found": found}
        raise data_set.error(code, i, values=values, data_set=data_set.number, counted=what)


# ----------------------------------------------------------------------------------------------------
# One data set at a time through pyuff, whose errors become ours.
#
# pyuff is used for 15, 18, 82, 164, 2411 and 2420, where its values are right once the frame of the data set
# is known to be whole. It is given a clean copy (line ends, trailing blanks, D exponents), and what comes back is
# counted by the callers. It is not used for 55 (it cannot hold complex rotations, shifts where a record takes two
# lines, and refuses D exponents), for 58 (numbers of other columns, orders of bytes), for 2412 (elements of more than
# eight nodes go wrong), nor for 151.


_VERBATIM = {18: lambda i: i % 4 == 1, 82: lambda i: i == 1}
"""Lines that hold names, not numbers, by data set."""


def through_pyuff(data_set: DataSet) -> dict[str, Any]:
    """What pyuff reads from one data set.

    Raises
    ------
    FemtuneError : ``uff.unreadable`` when pyuff fails, sees another data set, or leaves keys out
    """
    pyuff = require("pyuff")
    with tempfile.TemporaryDirectory(prefix="femtune-uff-") as folder:
        path = Path(folder) / "one.uff"
        path.write_bytes(_clean_copy(data_set))
        try:
            file = pyuff.UFF(str(path))
            types = [int(number) for number in file.get_set_types()]
            values = file.read_sets(0) if types == [data_set.number] else None
        # pyuff raises bare Exception for whatever it stumbles on.
        except Exception as problem:
            raise _unreadable(data_set, str(problem)) from problem
    if not isinstance(values, dict):
        raise _unreadable(data_set, f"pyuff finds the data sets {types} in it")
    return values


def _clean_copy(data_set: DataSet) -> bytes:
    verbatim = _VERBATIM.get(data_set.number, lambda i: False)
    lines = [text if verbatim(i) else with_e_exponents(text) for i, text in enumerate(data_set.lines)]
    text = "\n".join(["    -1", data_set.head, *lines, ""])
    return text.encode() + data_set.payload + b"    -1\n"


def _unreadable(data_set: DataSet, reason: str) -> Any:
    return data_set.error("uff.unreadable", data_set_number=data_set.number, reason=reason)
