"""Messages of the verdict: each is the example that its page shows."""

from __future__ import annotations

import pytest
from tests.messages.shown import check_shown

from femtune.errors import Notice

_CASES: dict[str, Notice] = {
    "judge.no-optimum": Notice("judge.no-optimum", ending="the largest number of iterations was reached"),
}


@pytest.mark.parametrize("code", sorted(_CASES))
def test_the_page_shows_the_message(code: str) -> None:
    check_shown(code, _CASES[code])
