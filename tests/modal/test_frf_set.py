"""FrfSet: sizes, kinds and frequency lines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import FrfSet


def _frfs(**facts: Any) -> FrfSet:
    given = {
        "freq_hz": [0.0, 1.0, 2.0],
        "values": np.ones((2, 1, 3)),
        "responses": DofSet.parse(["1X+", "2X+"]),
        "references": DofSet.parse(["1X+"]),
        "kind": "accelerance",
    }
    return FrfSet(**(given | facts))  # type: ignore[arg-type]


def test_values_are_complex() -> None:
    assert _frfs().values.dtype == complex


@pytest.mark.parametrize(
    ("facts", "code"),
    [
        ({"values": np.ones((2, 3))}, "frf.shape"),
        ({"coherence": np.ones((2, 1, 2))}, "frf.shape"),
        ({"kind": "inertance"}, "frf.kind"),
        ({"freq_hz": [0.0, 2.0, 1.0]}, "frf.values"),
        ({"freq_hz": [0.0, 1.0, 1.0]}, "frf.values"),
        ({"freq_hz": [-1.0, 1.0, 2.0]}, "frf.values"),
        ({"freq_hz": [0.0, 1.0, np.nan]}, "frf.values"),
        ({"values": np.full((2, 1, 3), np.inf)}, "frf.values"),
    ],
)
def test_what_does_not_fit_is_refused(facts: dict[str, Any], code: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        _frfs(**facts)
    assert caught.value.code == code


def test_names_of_combinations_are_one_a_row() -> None:
    assert _frfs(response_names=("a",) * len(_frfs().responses)).response_names[0] == "a"
    with pytest.raises(FemtuneError) as caught:
        _frfs(reference_names=("a",) * 7)
    assert caught.value.code == "frf.shape"
