"""Elements that commercial programs accept: solids in either order, two scalar elements on a card, directions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.files.nastran import Deck, build_structure
from femtune.files.nastran.solids import right_handed

from .solving import frequencies

DeckOf = Callable[..., Deck]
HEAD = "SOL 103\nCEND\nSPC = 1\nBEGIN BULK\nMAT1,1,2.+11,,.3,7800.\nPSOLID,1,1\n"
CORNERS = {
    "CHEXA": [(0, 0, 0), (1, 0, 0), (1.2, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1.1), (1, 1, 1), (0, 1, 1)],
    "CPENTA": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1.2), (0, 1, 1)],
    "CTETRA": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "CPYRAM": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.4, 1)],
}
SIDES = {
    "CHEXA": [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)],
    "CPENTA": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3)],
    "CTETRA": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "CPYRAM": [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
}


def _solid(card: str, curved: bool, mirrored: bool) -> str:
    """One element held at three corners; mirrored it is the same body, listed as a left-handed one would be."""
    xyz = np.array(CORNERS[card], float)
    if curved:
        xyz = np.vstack([xyz, [(xyz[a] + xyz[b]) / 2 for a, b in SIDES[card]]])
    if mirrored:
        xyz[:, 0] *= -1.0
    grids = "".join(f"GRID,{i},,{x:.4f},{y:.4f},{z:.4f}\n" for i, (x, y, z) in enumerate(xyz.tolist(), 1))
    numbers = ["1", "1", *map(str, range(1, len(xyz) + 1))]
    lines = [",".join(numbers[i : i + 8]) for i in range(0, len(numbers), 8)]
    return HEAD + f"SPC1,1,123,1,2,3\n{grids}{card}," + "\n,".join(lines) + "\n"


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("card", CORNERS)
def test_a_mirrored_solid_has_the_frequencies_of_the_solid(deck_of: DeckOf, card: str, curved: bool) -> None:
    one, other = (build_structure(deck_of(_solid(card, curved, mirrored))) for mirrored in (False, True))
    np.testing.assert_allclose(frequencies(other.structure), frequencies(one.structure), rtol=1e-8)
    assert [n.code for n in other.notices if n.code == "deck.turned-solids"] == ["deck.turned-solids"]
    assert "deck.turned-solids" not in [n.code for n in one.notices]


@pytest.mark.parametrize("card", CORNERS)
def test_turning_keeps_sides_and_their_middles(card: str) -> None:
    """Middles of sides stay between the same corners, and turning twice gives the first order."""
    xyz = np.array(CORNERS[card], float) * [-1.0, 1.0, 1.0]
    xyz = np.vstack([xyz, [(xyz[a] + xyz[b]) / 2 for a, b in SIDES[card]]])
    nodes, turned = right_handed(card, np.arange(len(xyz))[None], xyz)
    assert turned.all()
    moved, n = xyz[nodes[0]], len(CORNERS[card])
    np.testing.assert_allclose(moved[n:], [(moved[a] + moved[b]) / 2 for a, b in SIDES[card]])
    assert not right_handed(card, nodes, xyz)[1].any()


def test_many_mirrored_solids_are_read_by_columns(deck_of: DeckOf) -> None:
    """A bar of 120 hexahedra whose faces are exchanged, of which the middle one is as usual."""
    n = 120
    grids = "".join(
        f"GRID,{4 * i + k + 1},,{i}.,{y}.,{z}.\n"
        for i in range(n + 1)
        for k, (y, z) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)])
    )
    rows = []
    for i in range(n):
        low, high = ([4 * j + k for k in (1, 2, 3, 4)] for j in (i, i + 1))
        first = low + high if i == n // 2 else high + low
        rows.append("CHEXA   " + "".join(f"{x:8d}" for x in [i + 1, 1, *first[:6]]) + "\n        "
                    + "".join(f"{x:8d}" for x in first[6:]) + "\n")  # fmt: skip
    model = build_structure(deck_of(HEAD + "SPC1,1,123,1,2,3,4\n" + grids + "".join(rows)))
    (notice,) = [n for n in model.notices if n.code == "deck.turned-solids"]
    assert f"{n - 1} CHEXA cards" in notice.what
    assert "element 1 " in notice.what


SCALARS = "SPOINT,1,2,3\nPELAS,5,100.\nPMASS,6,1.\n"


@pytest.mark.parametrize(
    ("springs", "masses"),
    [
        ("CELAS4,11,100.,1,,12,100.,2\nCELAS4,13,300.,2", "CMASS4,21,1.,1,,22,1.,2"),
        ("CELAS3,11,5,1,,12,5,2\nCELAS4,13,300.,2", "CMASS3,21,6,1,,22,6,2"),
    ],
)
def test_two_elements_on_a_card(deck_of: DeckOf, springs: str, masses: str) -> None:
    separate = "CELAS4,11,100.,1\nCELAS4,12,100.,2\nCELAS4,13,300.,2\nCMASS4,21,1.,1\nCMASS4,22,1.,2\n"
    one = build_structure(deck_of(f"{SCALARS}{springs}\n{masses}\n"))
    other = build_structure(deck_of(SCALARS + separate))
    np.testing.assert_allclose(frequencies(one.structure), np.sqrt([100.0, 400.0]) / (2 * np.pi))
    np.testing.assert_allclose(frequencies(one.structure), frequencies(other.structure))
    assert set(one.element_cards) == {11, 12, 13, 21, 22}
    if "CELAS3" in springs:
        assert one.property_of_elements == {11: 5, 12: 5, 21: 6, 22: 6}


def test_two_dashpots_on_a_card(deck_of: DeckOf) -> None:
    model = build_structure(deck_of(SCALARS + "PDAMP,7,3.\nCDAMP3,31,7,1,,32,7,2,3\nCDAMP4,33,2.,1,,34,4.,2\n"))
    ids = sorted(int(n) for b in model.structure.batches if b.card.startswith("CDAMP") for n in b.ids)
    assert ids == [31, 32, 33, 34]


def test_a_material_direction_along_the_normal(deck_of: DeckOf) -> None:
    """An isotropic shell needs none, whatever its angle would be; an orthotropic one does."""
    plate = HEAD + "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nSPC1,1,123456,1\nPSHELL,4,1,.01,1,,1\n"
    plate += "CORD2R,9,,0.,0.,0.,0.,1.,0.\n,0.,0.,1.\n"
    one, other = (build_structure(deck_of(plate + f"CTRIA3,7,4,1,2,3{axis}\n")) for axis in ("", ",9"))
    np.testing.assert_array_equal(frequencies(one.structure), frequencies(other.structure))


def test_a_direction_along_the_normal_of_a_laminate_of_isotropic_plies(deck_of: DeckOf) -> None:
    plate = HEAD + "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nSPC1,1,123456,1\n"
    plate += "PCOMP,4\n,1,.004,0.,,1,.006,45.\nCORD2R,9,,0.,0.,0.,0.,1.,0.\n,0.,0.,1.\n"
    one, other = (build_structure(deck_of(plate + f"CTRIA3,7,4,1,2,3{axis}\n")) for axis in ("", ",9"))
    np.testing.assert_array_equal(frequencies(one.structure), frequencies(other.structure))
