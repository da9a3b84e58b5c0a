"""Configurations: overlays equal a deck that is written that way."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem import Structure
from femtune.model import AddedMass, Configuration, ModelPoint, configure, parametric_model
from femtune.parameters import ParameterSet

from .decks import card, deck, structure_of

BASE = [
    *(card("GRID", 1 + i, None, 0.5 * i, 0.2 * (i % 2), 0.0) for i in range(5)),
    *(card("CBAR", 1 + i, 1, 1 + i, 2 + i, 0.0, 0.0, 1.0) for i in range(4)),
    card("CBAR", 9, 1, 1, 4, 0.0, 0.0, 1.0),
    card("PBAR", 1, 1, 1e-4, 2e-9, 1e-9, 3e-9),
    card("MAT1", 1, 7e10, None, 0.3, 2700.0),
]
SUPPORTS = [card("SPC1", 1, 123456, 1), card("SPC1", 2, 123456, 1, 5), card("SPC1", 3, 3, 2)]
EQUATIONS = [card("MPC", 7, 4, 2, 1.0, None, 5, 2, -1.0), card("MPC", 8, 4, 3, 1.0, None, 5, 3, -0.5)]
RIGID = [card("RBE2", 51, 3, 123456, 4)]
PLAIN = [*BASE, *SUPPORTS, *EQUATIONS]


AS_THE_DECK = Configuration()


def at(structure: Structure, configuration: Configuration = AS_THE_DECK) -> ModelPoint:
    model = parametric_model(structure, ParameterSet(()), ())
    return configure(model, configuration).at(np.zeros(0))


def assert_same(overlaid: ModelPoint, written: ModelPoint) -> None:
    assert overlaid.configured.free.tolist() == written.configured.free.tolist()
    for kind in ("stiffness", "mass"):
        a, b = getattr(overlaid, kind), getattr(written, kind)
        assert abs(a - b).max() <= 1e-12 * abs(b).max(), kind


NOTHING = structure_of(deck(PLAIN, "SPC = 1"))


def test_as_the_deck_says():
    assert at(NOTHING).configured.n_free == 24


@pytest.mark.slow
@pytest.mark.parametrize(
    ("overlay", "written"),
    [
        (Configuration(support_set=2), deck(PLAIN, "SPC = 2")),
        (Configuration(multipoint_set=7), deck(PLAIN, "SPC = 1\nMPC = 7")),
        (Configuration(multipoint_set=8), deck(PLAIN, "SPC = 1\nMPC = 8")),
        (Configuration(supports_added=((3, "13"), (5, "6"))),
         deck([*PLAIN, card("SPC1", 1, 13, 3), card("SPC1", 1, 6, 5)], "SPC = 1")),
        (Configuration(supports_removed=((1, "456"),)),
         deck([*BASE, card("SPC1", 1, 123, 1)], "SPC = 1")),
        (Configuration(elements_off=frozenset({9})),
         deck([line for line in PLAIN if not line.startswith("CBAR*   9")], "SPC = 1")),
    ],
    ids=["SPC set", "equations 7", "equations 8", "supports added", "supports removed", "element off"],
)  # fmt: skip
def test_overlays(overlay: Configuration, written: str):
    assert_same(at(NOTHING, overlay), at(structure_of(written)))


def test_a_rigid_element_can_be_switched_off():
    rigid = structure_of(deck([*PLAIN, *RIGID], "SPC = 1"))
    assert at(rigid).configured.n_free == 18
    assert_same(at(rigid, Configuration(elements_off=frozenset({51}))), at(NOTHING))


@pytest.mark.slow
@pytest.mark.parametrize("frame", [None, 4])
def test_an_added_mass_is_a_conm2(frame: int | None):
    """Offset and inertia, also at a grid point with a displacement system of its own; WTMASS leaves it alone."""
    rest = [line for line in PLAIN if not line.startswith("GRID*   3")]
    rest.append(card("GRID", 3, None, 1.0, 0.0, 0.0, frame))
    if frame:
        rest.append(card("CORD2R", 4, None, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.6, 0.8, 0.3))
    inertia = ((0.02, -0.001, 0.002), (-0.001, 0.03, 0.003), (0.002, 0.003, 0.04))
    # CONM2 gives I21, I31, I32 without the minus of the tensor; offset and inertia along the basic axes
    conm2 = card("CONM2", 90, 3, 0, 1.5, 0.1, -0.2, 0.3, None, 0.02, 0.001, 0.03, -0.002, -0.003, 0.04)
    mass = AddedMass(3, 1.5, (0.1, -0.2, 0.3), inertia)
    assert_same(at(structure_of(deck(rest, "SPC = 1")), Configuration(masses=(mass,))),
                at(structure_of(deck([*rest, conm2], "SPC = 1"))))  # fmt: skip
    scaled = structure_of(deck([*rest, card("PARAM", "WTMASS", 0.5)], "SPC = 1"))
    difference = at(scaled, Configuration(masses=(mass,))).mass - at(scaled).mass
    plain = at(structure_of(deck([*rest, conm2], "SPC = 1"))).mass - at(structure_of(deck(rest, "SPC = 1"))).mass
    assert abs(difference - plain).max() <= 1e-12 * abs(plain).max()


def test_what_was_held_is_listed():
    rods = [line.replace("CBAR", "CROD") if line.startswith("CBAR") else line for line in BASE]
    rods = [line for line in rods if not line.startswith("PBAR")]
    rods = [line if not line.startswith("CROD") else "\n".join(line.split("\n")[:1])[:72] for line in rods]
    structure = structure_of(deck([*rods, card("PROD", 1, 1, 1e-4, 1e-9)], ""))
    held = {str(d) for d in at(structure).configured.held_singular}
    # rods in a plane: no stiffness across it
    assert {"1Z+", "5Z+"} <= held
    free = structure_of(deck([*rods, card("PROD", 1, 1, 1e-4, 1e-9), card("PARAM", "AUTOSPC", "NO")], ""))
    # without AUTOSPC a translation that has mass stays free
    names = {str(d) for d in at(free).configured.held_singular}
    assert names
    assert names < held
    assert all(n[-3] == "R" for n in names)


def test_a_soft_spring_with_a_stiff_one_elsewhere_is_not_held_without_autospc() -> None:
    """Node 3 has 1 N/m along Z and mass along X only; node 2 has 1e15 N/m."""
    cards = [
        *(card("GRID", i, None, float(i), 0.0, 0.0) for i in (2, 3)),
        card("CELAS2", 1, 1e15, 2, 1), card("CELAS2", 2, 1.0, 3, 3), card("CMASS2", 3, 1.0, 3, 1),
        card("PARAM", "AUTOSPC", "NO"),
    ]  # fmt: skip
    held = {str(d) for d in at(structure_of(deck(cards, ""))).configured.held_singular}
    assert {f"{node}{axis}+" for node in (2, 3) for axis in "XYZ"} - held == {"2X+", "3X+", "3Z+"}


CODES: dict[str, Configuration] = {
    "configuration.unknown-element": Configuration("BC", elements_off=frozenset({9, 1234})),
    "configuration.unknown-set": Configuration("BC", support_set=44),
    "configuration.not-held": Configuration("BC", supports_removed=((2, "12"),)),
    "model.unknown-node": Configuration("BC", masses=(AddedMass(99, 1.0),)),
    "model.component": Configuration("BC", supports_added=((2, "7"),)),
}


@pytest.mark.parametrize("code", CODES)
def test_refused(code: str):
    with pytest.raises(FemtuneError) as caught:
        at(NOTHING, CODES[code])
    assert caught.value.code == code


def test_an_unknown_set_of_equations_is_refused():
    with pytest.raises(FemtuneError, match="MPC set") as caught:
        at(NOTHING, Configuration("BC", multipoint_set=3))
    assert caught.value.values == {"known": "7, 8"}
