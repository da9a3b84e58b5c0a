"""What binary and text OP4 files share: headers, runs of values in a column, and how sparse strings are packed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where

_LARGEST = 50_000_000


@dataclass(frozen=True)
class Header:
    """One matrix of a file.

    Parameters
    ----------
    name : as the file spells it, without blanks
    rows, columns : its size
    big : True where sparse strings have two words for length and row
    form : 1 square, 2 rectangular, 6 symmetric …
    type : 1 real single, 2 real double, 3 complex single, 4 complex double
    where : place of the header
    """

    name: str
    rows: int
    columns: int
    big: bool
    form: int
    type: int
    where: Where

    @property
    def complex(self) -> bool:
        """True for complex values."""
        return self.type > 2

    @property
    def double(self) -> bool:
        """True for eight bytes a real number."""
        return self.type % 2 == 0


@dataclass(frozen=True, eq=False)
class Run:
    """Values of consecutive rows of a column, both from 0."""

    column: int
    row: int
    values: NDArray
    where: Where


def header_of(columns: int, rows: int, form: int, kind: int, name: str, where: Where) -> Header:
    """A header that makes sense (error ``matrices.op4``)."""
    if not (0 <= columns <= _LARGEST and abs(rows) <= _LARGEST and kind in (1, 2, 3, 4)):
        raise op4_error(
            "this is no header of a matrix", where, {"columns": columns, "rows": rows, "form": form, "type": kind}
        )
    return Header(name.strip("\0 "), abs(rows), columns, rows < 0, form, kind, where)


def op4_error(what: str, where: Where, values: dict[str, object]) -> FemtuneError:
    """The file is not as OP4 files are."""
    hint = "check that it is an OP4 file (OUTPUT4) that was copied in binary mode; else write it again"
    return FemtuneError("matrices.op4", what, where=where, values=values, hint=hint)


def cut(header: Header, column: int, where: Where) -> FemtuneError:
    """The file ends inside a matrix."""
    return FemtuneError(
        "matrices.truncated",
        f"the file ends inside matrix {header.name}",
        where=where,
        values={"column": column + 1, "columns": header.columns},
        hint="the file was cut: write or copy it again",
    )


def check_extent(header: Header, column: int, row: int, count: int, where: Where) -> None:
    """`count` reals from a row, from 0, make whole values inside the matrix (error ``matrices.op4``)."""
    parts = 2 if header.complex else 1
    if count < 0 or count % parts:
        shown: dict[str, object] = {"column": column, "row": row + 1, "real numbers": count}
        raise op4_error(f"a string of {header.name} holds no whole number of values", where, shown)
    last = row + count // parts
    if row < 0 or last > header.rows:
        shown = {"column": column, "rows": f"{row + 1} to {last}"}
        raise op4_error(f"a column of {header.name} is longer than the matrix's {header.rows} rows", where, shown)


def unpacked(word: int) -> tuple[int, int]:
    """Length in words and row from 0 of a packed string header: 65536·(length + 1) + row."""
    length = (word >> 16) - 1
    return length, (word & 0xFFFF) - 1


def paired(values: NDArray[np.float64], header: Header) -> NDArray:
    """Real values as the matrix's own kind."""
    return values[0::2] + 1j * values[1::2] if header.complex else values
