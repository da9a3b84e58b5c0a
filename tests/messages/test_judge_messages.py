"""Messages of the verdict: each is the example that its page shows."""

from __future__ import annotations

import pytest
from tests.messages.shown import check_shown

from femtune.errors import Notice

_CASES: dict[str, Notice] = {
    "judge.missing": Notice(
        "judge.missing",
        field="PSHELL 2 T (or what looks like it: MAT1 1 E)",
        change="an increase by 11.6 %",
        before="1025",
        after="181",
    ),
    "judge.missing, limit": Notice(
        "judge.missing/at-limit", field="PSHELL 2 T", change="an increase by 25 %", before="1025", after="181"
    ),
    "judge.missing, suspected": Notice(
        "judge.missing/suspected", field="CELAS2 903 K", chance="p = 0.03", tested="105 fields"
    ),
    "judge.missing, implausible": Notice("judge.missing/implausible", chance="p < 0.002", tested="105 fields"),
    "judge.deck-differs": Notice(
        "judge.deck-differs", difference="MAT1 1 E is 2.1e+11 instead of 1.7e+11 for 4 elements"
    ),
    "judge.no-optimum": Notice("judge.no-optimum", ending="the largest number of iterations was reached"),
}


@pytest.mark.parametrize("code", sorted(_CASES))
def test_the_page_shows_the_message(code: str) -> None:
    check_shown(code, _CASES[code])
