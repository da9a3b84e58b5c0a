"""What mutated decks brought to light, one small deck each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck, build_structure

DeckOf = Callable[..., Deck]
BAR = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,0.,0.,9.
MAT1,1,2.+11,,.3,7800.
"""


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("SPOINT,1,0\nCELAS4,1,2.,1\n", 1, "numbers of scalar points must be positive"),
        (BAR + "PBAR,1,1,1.-2,1.-60,1.-5,1.-5\nCBAR,1,1,1,2,0.,1.,0.\n", 5, "too large"),
        (BAR + "PBARL,1,1,,ROD\n,1.-30\nCBAR,1,1,1,2,0.,1.,0.\n", 6, "too large"),
        (BAR + "MPC,1,1,1,1.-20,2,1,1.+20\n", 5, "a coefficient of this MPC is too large"),
        (BAR + "MAT1,2,2.+11,0.\nPBEAM,1,2,1.-2,1.-5,1.-5,,1.-5\n,,,,,,,,\n,YES,1.,2.-2,1.-5,1.-5,,1.-5\nCBEAM,1,1,1,2,"
         "0.,1.,0.\n", 6, "needs a material with a shear modulus"),
        (BAR + "PCOMP,1\n,1,.1,,,1,1.+59\nCTRIA3,1,1,1,2,3\n", 6, "thickness of a ply must be between"),
        (BAR + "PCOMP,1\n,1,.1,,,1,1.-59\nCTRIA3,1,1,1,2,3\n", 6, "thickness of a ply must be between"),
    ],
)  # fmt: skip
def test_refused_with_their_line(deck_of: DeckOf, text: str, line: int, message: str) -> None:
    with pytest.raises(FemtuneError, match=message) as caught:
        build_structure(deck_of(text))
    assert caught.value.where is not None
    assert caught.value.where.line == line


def test_an_orientation_point_counts_beside_the_vector_of_baror(deck_of: DeckOf) -> None:
    """G0 stands in the place of X1; X2 and X3 of the BAROR card are no part of it."""
    bar = "PBAR,1,1,1.-2,1.-5,2.-5,1.-5\nCBAR,1,1,1,2,3\n"
    alone, beside = (build_structure(deck_of(BAR + bar + more)) for more in ("", "BAROR,,,,,0.,1.,.5\n"))
    for name, fact in alone.structure.batches[0].facts.items():
        np.testing.assert_array_equal(fact, beside.structure.batches[0].facts[name], err_msg=name)
    names_point = build_structure(deck_of(BAR + bar.replace(",2,3\n", ",2\n") + "BAROR,,,,,3\n"))
    for name, fact in alone.structure.batches[0].facts.items():
        np.testing.assert_array_equal(fact, names_point.structure.batches[0].facts[name], err_msg=name)


def test_a_stiff_laminate_keeps_its_transverse_shear(deck_of: DeckOf) -> None:
    """Of its flexibility even the determinant's powers are numbers: κ G t with κ = 5/6 of one ply."""
    stiff = "1.+58"
    deck = deck_of(BAR + f"MAT8,2,{stiff},{stiff},.3,{stiff},{stiff},{stiff}\nPCOMP,1\n,2,.1,0.\nCTRIA3,1,1,1,2,3\n")
    structure = build_structure(deck).structure
    found = structure.values.values[structure.batches[0].roles["S11"]]
    np.testing.assert_allclose(found, 5.0 / 6.0 * 1e58 * 0.1)
