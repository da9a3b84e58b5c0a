"""Numbers as Nastran spells them: reading, and writing the closest number that a field can hold."""

from __future__ import annotations

import math
import re
from decimal import ROUND_DOWN, Context, Decimal

from femtune.errors import FemtuneError

_REAL = re.compile(r"([+-]?(?:\d+\.\d*|\.\d+))(?:[ED]([+-]?\d{1,4})|([+-]\d{1,4}))?", re.IGNORECASE)
_INTEGER = re.compile(r"[+-]?\d{1,18}")


def parse_real(text: str) -> float | None:
    """The real number in `text` (``1.5-3``, ``1.+4``, ``2.D5``, ``.1``), or None if it is not one.

    A real number has a decimal point; an exponent may stand without its letter. Numbers beyond the range of
    double precision are not taken.
    """
    match = _REAL.fullmatch(text)
    if match is None:
        return None
    value = float(f"{match[1]}e{match[2] or match[3] or 0}")
    return value if math.isfinite(value) else None


def is_too_large(text: str) -> bool:
    """Whether `text` is spelt as a real number, but lies beyond the range of double precision."""
    return _REAL.fullmatch(text) is not None and parse_real(text) is None


def parse_integer(text: str) -> int | None:
    """The integer in `text`, or None if it is not one."""
    return int(text) if _INTEGER.fullmatch(text) else None


def format_real(value: float, width: int = 8) -> str:
    """Closest number to `value` that `width` columns (8 or more) hold; it always has a decimal point.

    The exponent stands without its letter and the decimal point where it costs the fewest columns:
    ``1.2346-5``, ``.123456``, ``12346.+8``.

    Raises
    ------
    FemtuneError : ``write.not-finite``
    """
    if not math.isfinite(value):
        raise FemtuneError(
            "write.not-finite",
            "a deck holds finite numbers only",
            values={"value": value},
            hint="find out why this value is not a number before it is written",
        )
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
    """Places of the decimal point, the usual one (after the first digit) first."""
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
