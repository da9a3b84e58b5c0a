"""Messages of solids: the page's example, and what each kind of bad shape is called."""

from __future__ import annotations

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.fem.elements import contributions
from structures.shells import Isotropic
from structures.solids import SolidPart, solid_structure

_MATERIAL = Isotropic(200.0, 0.3)
_CUBE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
_WEDGE, _TETRA = _CUBE[[0, 1, 3, 4, 5, 7]], _CUBE[[0, 1, 3, 4]]
_PYRAMID = np.array([*_CUBE[:4], [0.5, 0.5, 1.0]])
_SOUND = {"hexa8": _CUBE, "penta6": _WEDGE, "tetra4": _TETRA, "pyram5": _PYRAMID}


def refusal(kind: str, xyz) -> FemtuneError:
    """What a batch of eleven sound elements and a bad one, element 12, is refused with."""
    n = len(xyz)
    sound = SolidPart(kind, [list(range(n))] * 11 + [list(range(n, 2 * n))], _MATERIAL)
    structure = solid_structure([*_SOUND[kind], *xyz], [sound])
    with pytest.raises(FemtuneError) as caught:
        contributions(structure.batches[0], structure)
    assert caught.value.code == "element.solid-shape"
    return caught.value


def moved(xyz, corner: int, place) -> np.ndarray:
    out = xyz.copy()
    out[corner] = place
    return out


def test_the_page_shows_the_message():
    xyz = moved(_CUBE, 6, (0.3, 0.3, 0.3))
    structure = solid_structure([*xyz], [SolidPart("hexa8", [list(range(8))], _MATERIAL)])
    with pytest.raises(FemtuneError) as caught:
        contributions(structure.batches[0], structure)
    check_shown("element.solid-shape", str(caught.value).replace("CHEXA 1\n", "CHEXA 12\n"))


@pytest.mark.parametrize("kind", _SOUND)
def test_two_grid_points_in_one_place(kind: str):
    n = len(_SOUND[kind])
    text = str(refusal(kind, moved(_SOUND[kind], 1, _SOUND[kind][0])))
    assert f"grid points {n + 1} and {n + 2} (positions 1 and 2 on the card) are at the same place" in text
    assert "CHEXA 12" in text or kind != "hexa8"


_MIRRORED = {
    "hexa8": [4, 5, 6, 7, 0, 1, 2, 3],
    "penta6": [3, 4, 5, 0, 1, 2],
    "tetra4": [1, 0, 2, 3],
    "pyram5": [3, 2, 1, 0, 4],
}


@pytest.mark.parametrize("kind", _MIRRORED)
def test_corners_listed_the_other_way_around(kind: str):
    text = str(refusal(kind, _SOUND[kind][_MIRRORED[kind]]))
    assert "the corners of the solid are listed in the opposite order" in text
    assert "hint: list" in text


@pytest.mark.parametrize("kind", _SOUND)
def test_a_flat_solid(kind: str):
    xyz = _SOUND[kind] * [1.0, 1.0, 0.0] + [[0.1 * i * i, 0.0, 0.0] for i in range(len(_SOUND[kind]))]
    assert "the solid is flat: it has no volume" in str(refusal(kind, xyz))


@pytest.mark.parametrize(
    ("kind", "corner", "place"),
    [("hexa8", 6, (0.3, 0.3, 0.3)), ("pyram5", 2, (0.3, 0.3, 0.0))],
)
def test_a_corner_turned_inside_out_is_named(kind: str, corner: int, place):
    text = str(refusal(kind, moved(_SOUND[kind], corner, place)))
    n = len(_SOUND[kind])
    assert f"inverted at its corner {corner + 1} (grid point {n + corner + 1})" in text


@pytest.mark.parametrize(("kind", "order"), [("hexa8", [0, 1, 3, 2, 4, 5, 7, 6]), ("penta6", [0, 1, 2, 3, 5, 4])])
def test_faces_listed_crosswise(kind: str, order: list[int]):
    text = str(refusal(kind, _SOUND[kind][order]))
    assert "the solid is" in text
    assert "at its corner" in text
    assert "if the order is right, move the grid point" in text


def test_a_collapsed_hexahedron_is_sent_to_the_card_it_has_become():
    text = str(refusal("hexa8", _CUBE[[0, 1, 2, 2, 4, 5, 6, 6]]))
    assert "at the same place" in text
    assert "the card with fewer corners" in text


def test_several_are_shown_together_and_ten_at_most():
    xyz = [*_CUBE, *moved(_CUBE, 6, (0.3, 0.3, 0.3))]
    for count in (3, 30):
        part = SolidPart("hexa8", [list(range(8))] + [list(range(8, 16))] * count, _MATERIAL)
        structure = solid_structure(xyz, [part])
        with pytest.raises(FemtuneErrors) as caught:
            contributions(structure.batches[0], structure)
        assert len(caught.value.errors) == min(count, 10)


def test_thin_and_long_solids_are_not_refused():
    for sizes in ((1.0, 1.0, 1e-5), (1e4, 1.0, 1.0), (1e-4, 1e-4, 1e-4)):
        structure = solid_structure(_CUBE * sizes, [SolidPart("hexa8", [list(range(8))], _MATERIAL)])
        assert contributions(structure.batches[0], structure)
