"""Numbers as texts: a true minus sign, a suitable number of digits, and words if there is no number."""

from __future__ import annotations

import math
from collections.abc import Iterable

NOT_TESTED = "not tested"
"""What stands for the result of a comparison that was not made."""
NONE = "–"
"""What stands for any other number that is not known."""


_MOST_DIGITS = 9
"""Digits that a solution has."""


def typeset(text: str) -> str:
    """A formatted number with a true minus sign; exponents without padding: 2.1e11."""
    mantissa, e, exponent = text.partition("e")
    return (mantissa + (f"e{int(exponent)}" if e else "")).replace("-", "−")


def value(number: float | None, none: str = NONE) -> str:
    """Five significant digits."""
    return none if number is None else typeset(f"{number:.5g}")


def short(number: float | None, none: str = NONE) -> str:
    """Three significant digits."""
    return none if number is None else typeset(f"{number:.3g}")


def interval(low: float, high: float, least: int = 3) -> tuple[str, str]:
    """Both ends with as many significant digits as their distance needs, at least `least`.

    Examples
    --------
    >>> interval(0.6496, 0.6504), interval(1.2, 3.4)
    (('0.64960', '0.65040'), ('1.20', '3.40'))
    """
    size, width = max(abs(low), abs(high)), abs(high - low)
    digits = max(least, min(2 + math.ceil(math.log10(size / width)), _MOST_DIGITS)) if width > 0.0 else least
    return typeset(f"{low:#.{digits}g}".rstrip(".")), typeset(f"{high:#.{digits}g}".rstrip("."))


def freq(number: float | None, none: str = NONE) -> str:
    """A frequency in Hz: five decimals below 0.1 (three if it rounds to zero), three below 100, two below 1000."""
    if number is None:
        return none
    decimals = 5 if 1e-4 <= number < 0.1 else 3 if number < 100 else 2 if number < 1000 else 1
    return typeset(f"{number:.{decimals}f}")


def percent(number: float | None, none: str = NONE) -> str:
    """Two decimals, without a sign for what is positive by nature."""
    return none if number is None else typeset(f"{number:.2f}")


def signed_percent(number: float | None, none: str = NONE) -> str:
    """Two decimals with a sign, unless it rounds to zero."""
    if number is None:
        return none
    text = f"{number:+.2f}"
    return typeset(text) if float(text) else text[1:]


def unit_fraction(number: float | None, none: str = NOT_TESTED) -> str:
    """A number between 0 and 1, three decimals."""
    return none if number is None else typeset(f"{number:.3f}")


def sensitivity(number: float) -> str:
    """Three decimals; what they round to nothing is "0"."""
    return typeset(f"{number:.3f}") if abs(number) >= 5e-4 else "0"


def counted(count: int, noun: str, plural: str = "") -> str:
    """ "1 mode", "3 modes"."""
    return f"{count} {noun if count == 1 else plural or noun + 's'}"


def as_sentence(words: str) -> str:
    """With a capital letter and a full stop."""
    return f"{words[:1].upper()}{words[1:]}."


def listed(words: Iterable[str]) -> str:
    """ "a, b and c"."""
    listed = list(words)
    return " and ".join([", ".join(listed[:-1]), listed[-1]]) if len(listed) > 1 else "".join(listed)


def with_unit(text: str, unit: str) -> str:
    """A number and its unit."""
    return f"{text} {unit}" if unit else text
