"""Nastran's numbers: reading, and the closest number that a field holds."""

from __future__ import annotations

import math
from decimal import Decimal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from femtune.errors import FemtuneError
from femtune.files.nastran.lines import format_real, parse_integer, parse_real, rounded

FINITE = st.floats(allow_nan=False, allow_infinity=False)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("7.0", 7.0),
        (".7E1", 7.0),
        ("0.7+1", 7.0),
        (".70+1", 7.0),
        ("7.E+0", 7.0),
        ("70.-1", 7.0),
        ("1.5-3", 1.5e-3),
        ("1.+4", 1e4),
        ("2.D5", 2e5),
        ("2.d-5", 2e-5),
        (".1", 0.1),
        ("1.e7", 1e7),
        ("5.", 5.0),
        ("-.25", -0.25),
        ("+3.", 3.0),
    ],
)
def test_real_syntax(text: str, value: float) -> None:
    assert parse_real(text) == value


@pytest.mark.parametrize(
    "text", ["", "1", "1E7", ".", "1.5 -3", "1.5-", "nan", "inf", "0x1.", "1.5-3.", "1,5", "1.+999"]
)
def test_not_a_real(text: str) -> None:
    assert parse_real(text) is None


@pytest.mark.parametrize(
    ("text", "value"), [("12", 12), ("-3", -3), ("+4", 4), ("1.", None), ("1 2", None), ("", None)]
)
def test_integer_syntax(text: str, value: int | None) -> None:
    assert parse_integer(text) == value


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0.0"),
        (1.0, "1.0"),
        (0.5, "0.5"),
        (1.2345e-5, "1.2345-5"),
        (0.123456, "0.123456"),
        (0.12345678, ".1234568"),
        (123456.78, "123456.8"),
        (1.23456e12, "12346.+8"),
        (2.06e11, "2.06+11"),
        (1.23456e-10, ".12346-9"),
        (-1.23456e-10, "-.1235-9"),
        (9999999.9, "1.+7"),
        (1.7976931348623157e308, "1.79+308"),
        (5e-324, "5.-324"),
    ],
)
def test_eight_columns(value: float, text: str) -> None:
    assert len(format_real(value, 8)) <= 8
    assert rounded(value, 8) == parse_real(text)


@pytest.mark.parametrize("width", [8, 16])
@given(value=FINITE)
@example(value=99999999.5)
@example(value=-9.9999999999e-5)
@example(value=1e22)
def test_fits_and_no_other_text_is_closer(value: float, width: int) -> None:
    text = format_real(value, width)
    read_back = parse_real(text)
    assert len(text) <= width
    assert "." in text
    assert read_back is not None
    error = abs(Decimal(read_back) - Decimal(value))
    # a candidate's own reading is rounded to double: allow that much
    slack = Decimal(math.ulp(value))
    errors = [abs(Decimal(number) - Decimal(value)) for number in _candidates(value, width)]
    assert error <= min(errors, default=error) + slack


def _candidates(value: float, width: int) -> list[float]:
    """Numbers of all usual spellings of `value` that fit: fixed, and with every place of the point."""
    texts = [f"{value:.{digits}f}" for digits in range(width + 1)] if abs(value) < 1e17 else []
    texts = [text if "." in text else text + "." for text in texts]
    texts += [text.replace("0.", ".", 1) for text in texts if text.lstrip("-").startswith("0.")]
    texts += [_scientific(value, digits, shift) for digits in range(width) for shift in range(-3, width)]
    numbers = [parse_real(text) for text in texts if len(text) <= width]
    return [number for number in numbers if number is not None]


def _scientific(value: float, digits: int, shift: int) -> str:
    mantissa, exponent = f"{value:.{digits}e}".split("e")
    sign, ones = ("-", mantissa[1:]) if mantissa[0] == "-" else ("", mantissa)
    whole = ones.replace(".", "")
    power = int(exponent) - shift
    if shift < 0:
        placed = "." + "0" * (-shift - 1) + whole
    else:
        placed = whole[: shift + 1].ljust(shift + 1, "0") + "." + whole[shift + 1 :]
    return f"{sign}{placed}{power:+d}"


@given(value=FINITE)
def test_writing_twice_changes_nothing(value: float) -> None:
    once = rounded(value, 8)
    assert rounded(once, 8) == once


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_not_finite(value: float) -> None:
    with pytest.raises(FemtuneError) as caught:
        format_real(value)
    assert caught.value.code == "write.not-finite"
