"""Citations are complete enough to be found."""

from __future__ import annotations

import re

import pytest

from femtune import citations


@pytest.mark.parametrize("key", sorted(citations.PUBLICATIONS))
def test_bibtex_has_author_title_and_year(key: str) -> None:
    found = citations.citation(key)
    assert found.bibtex.startswith("@")
    assert found.bibtex.count("{") == found.bibtex.count("}")
    for field in ("author", "title", "year"):
        assert re.search(rf"^  {field} = \{{.+\}}", found.bibtex, re.M)
    year = re.search(r"year = \{(\d{4})\}", found.bibtex)
    assert year
    assert key.endswith(year[1])
    assert year[1] in found.text
