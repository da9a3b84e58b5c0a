"""Messages on decks that would not be the solution: each is the example that its page shows."""

from __future__ import annotations

import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError, Where

_AT = Where("study.toml", 16, "parameter[1].fields")
_CASES = {
    "write.no-card": FemtuneError("write.no-card", where=_AT, parameter="joint", field="GENERIC JOINT K1"),
    "write.shared": FemtuneError("write.shared", where=_AT, parameter="root", field="MAT1 1 E"),
    "write.differs": FemtuneError(
        "write.differs",
        values={"deck as written": "run/unverified.bdf"},
        difference="mode 3 (baseline) has 41.02 Hz instead of 40.87 Hz",
    ),
}


@pytest.mark.parametrize("code", sorted(_CASES))
def test_the_page_shows_the_message(code: str) -> None:
    check_shown(code, _CASES[code])
