"""Messages of the generators of test beds."""

from __future__ import annotations

import pytest

from femtune.errors import FemtuneError
from structures.subframe import subframe


@pytest.mark.slow
def test_too_few_degrees_of_freedom_say_how_many_there_could_be() -> None:
    with pytest.raises(FemtuneError) as caught:
        subframe(1000)
    assert caught.value.code == "testing.mesh-size"
    text = str(caught.value)
    assert "wanted = 1000" in text
    assert "closest = 5" in text
    assert "hint: request a number within 10 %" in text
