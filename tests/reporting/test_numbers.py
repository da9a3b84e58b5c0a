"""Numbers as texts."""

from __future__ import annotations

import pytest

from femtune.document.numbers import freq


@pytest.mark.parametrize(
    ("hz", "text"),
    [(0.0, "0.000"), (3e-7, "0.000"), (1.6265e-4, "0.00016"), (0.02714, "0.02714"), (0.4621, "0.462"), (99.5, "99.500"),
     (112.716, "112.72"), (2828.64, "2828.6")],
)  # fmt: skip
def test_low_frequencies_keep_their_digits(hz: float, text: str) -> None:
    assert freq(hz) == text
