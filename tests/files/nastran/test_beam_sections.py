"""PBEAM, PBEAML, PBARL and PBCOMP: stations, offsets, lumps, what may be updated, and write-back."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran import Deck, read_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.files.nastran.write import plan_edits, write_deck

from .solving import frequencies

DeckOf = Callable[..., Deck]
HEAD = """SOL 103
CEND
SPC = 1
BEGIN BULK
MAT1,1,2.+11,8.+10,,7800.
MAT1,2,7.+10,2.6+10,,2700.
SPC1,1,123456,1
"""
GRIDS = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,2.,0.,0.\n"
BEAMS = "CBEAM,7,3,1,2,0.,1.,0.\nCBEAM,8,3,2,3,0.,1.,0.\n"
BASE = HEAD + GRIDS + BEAMS
TAPER = (
    "PBEAM,3,1,1.-3,2.-6,3.-6,1.-7,4.-6,.5\n,NO,.25,9.-4\n,YES,1.,5.-4,1.-6,,,2.-6,.5\n,0.,0.,0.,0.,0.,0.,0.,0.\n"
    ",.8,.7,,,1.-3,,,\n,.01,.02,,,.03,,.04\n"
)


def built(deck: Deck) -> tuple[BuiltDeck, ElementBatch]:
    model = build_structure(deck)
    return model, model.structure.batches[0]


def value(model: BuiltDeck, batch: ElementBatch, role: str) -> float:
    return float(model.structure.values.values[batch.roles[role][0]])


def test_tapered_beam(deck_of: DeckOf):
    model, batch = built(deck_of(BASE + TAPER + "ENDDATA\n"))
    assert (batch.kind, batch.card, batch.facts["stations"][0].tolist()) == ("tapered-beam", "CBEAM", [0, 0.25, 1])
    expected = {
        "A": (1e-3, 9e-4, 5e-4), "I1": (2e-6, 1.75e-6, 1e-6), "I2": (3e-6,) * 3, "I12": (1e-7,) * 3,
        "J": (4e-6, 3.5e-6, 2e-6), "NSM": (0.5,) * 3, "K1": (0.8,) * 3, "K2": (0.7,) * 3, "NSI": (1e-3,) * 3,
        "M1": (0.01,) * 3, "M2": (0.02,) * 3, "N1": (0.03, 0.0325, 0.04), "N2": (0.0,) * 3,
    }  # fmt: skip
    for name, values in expected.items():
        assert [value(model, batch, f"{name}@{k}") for k in range(3)] == pytest.approx(values), name
    places = {
        name: model.fields[FieldRef("PBEAM", 3, name)].fields for name in ("A", "AB", "I1B", "NSM", "N1B", "NSIA")
    }
    assert places == {"A": (2,), "AB": (18,), "I1B": (19,), "NSM": (7, 23), "N1B": (46,), "NSIA": (36,)}


def test_order_of_stations_does_not_matter(deck_of: DeckOf):
    one = "PBEAM,3,1,1.-3,2.-6,3.-6,,4.-6\n,NO,1.,5.-4\n,NO,.25,9.-4\n"
    two = "PBEAM,3,1,1.-3,2.-6,3.-6,,4.-6\n,NO,.25,9.-4\n,NO,1.,5.-4\n"
    found = [frequencies(build_structure(deck_of(BASE + text + "ENDDATA\n")).structure) for text in (one, two)]
    np.testing.assert_array_equal(*found)


def test_warping_without_scalar_points_is_a_notice(deck_of: DeckOf):
    model, batch = built(deck_of(BASE + "PBEAM,3,1,1.-3,2.-6,3.-6,,4.-6\n,,,,,,,,\n,,,,,,,1.-9\nENDDATA\n"))
    assert batch.kind == "bar"
    assert "deck.no-warping" in [notice.code for notice in model.notices]


@pytest.mark.parametrize(("tail", "allowed"), [("", True), ("\n,,,,,,,,\n,,,,,,,1.-9", False)])
def test_scalar_points_of_a_section_that_does_not_warp(deck_of: DeckOf, tail: str, allowed: bool):
    text = BASE + "PBEAM,3,1,1.-3,2.-6,3.-6,,4.-6\n"
    text += f"SPOINT,50,51\nPBEAM,4,1,1.-3,2.-6,3.-6,,4.-6{tail}\nCBEAM,9,4,1,2,0.,1.,0.\n,,,,,,,,\n,50,51\nENDDATA\n"
    if allowed:
        assert build_structure(deck_of(text)).structure is not None
    else:
        with pytest.raises(FemtuneError) as caught:
            build_structure(deck_of(text))
        assert caught.value.code == "deck.section"


@pytest.mark.parametrize("shape", ["T", "CHAN", "L"])
def test_shaped_bars_and_beams_differ_by_the_shear_centre(deck_of: DeckOf, shape: str):
    text = f"CBAR,9,4,1,2,0.,1.,0.\nPBARL,4,1,,{shape}\n,.1,.12,.01,.008,.3\nPBEAML,3,1,,{shape}\n,.1,.12,.01,.008,.3\n"
    model = build_structure(deck_of(BASE + text + "ENDDATA\n"))
    bar, beam = (next(b for b in model.structure.batches if b.card == card) for card in ("CBAR", "CBEAM"))
    assert (bar.kind, beam.kind) == ("bar", "tapered-beam")
    for role in ("A", "I1", "I2", "I12", "J", "NSM"):
        assert value(model, bar, role) == value(model, beam, f"{role}@0")
    assert max(abs(value(model, beam, "N1@0")), abs(value(model, beam, "N2@0"))) > 0.01


def test_symmetric_sections_have_no_product_of_inertia(deck_of: DeckOf):
    text = "PBEAML,3,1,,BOX1\n,.1,.2,.011,.011,.007,.007\nENDDATA\n"
    model, batch = built(deck_of(BASE + text))
    assert (batch.kind, value(model, batch, "I12")) == ("bar", 0.0)


def test_dimensions_at_both_ends(deck_of: DeckOf):
    text = "PBEAML,3,1,,TUBE\n,.1,.09,.5,NO,.5,,,.6\n,,1.,.06,.05,.5\nENDDATA\n"
    model, batch = built(deck_of(BASE + text))
    assert batch.facts["stations"][0].tolist() == [0.0, 0.5, 1.0]
    area = [np.pi * (a**2 - b**2) for a, b in ((0.1, 0.09), (0.08, 0.07), (0.06, 0.05))]
    assert [value(model, batch, f"A@{k}") for k in range(3)] == pytest.approx(area)
    assert [value(model, batch, f"NSM@{k}") for k in range(3)] == [0.5, 0.6, 0.5]
    index = resolve(model, parse_field_ref("PBEAML 3 DIM1B"))
    touched = model.structure.values.dependents([index])
    assert {int(batch.roles["A@1"][0]), int(batch.roles["I1@2"][0])} <= touched
    assert int(batch.roles["A@0"][0]) not in touched


def test_a_tapered_beam_meets_its_division(deck_of: DeckOf):
    """One property with four stations and four properties without taper, on the same sixteen elements."""
    n = 16
    grids = "".join(f"GRID,{i + 1},,{2.0 * i / n:.4f},0.,0.\n" for i in range(n + 1))
    beams = "".join(f"CBEAM,{i + 1},{i + 1},{i + 1},{i + 2},0.,1.,0.\n" for i in range(n))

    def sizes(i: float) -> tuple[float, float]:
        return 0.1 - 0.05 * i / n, 0.2 - 0.1 * i / n

    tapered = "".join(
        "PBEAML,{},1,,BAR\n,{:.6f},{:.6f},0.,NO,1.,{:.6f},{:.6f}\n".format(i + 1, *sizes(i), *sizes(i + 1))
        for i in range(n)
    )
    stepped = "".join("PBEAML,{},1,,BAR\n,{:.6f},{:.6f}\n".format(i + 1, *sizes(i + 0.5)) for i in range(n))
    found = [
        frequencies(build_structure(deck_of(HEAD + grids + beams + text + "ENDDATA\n")).structure)[:6]
        for text in (tapered, stepped)
    ]
    np.testing.assert_allclose(found[0], found[1], rtol=5e-3)


def test_composite_of_one_material_is_the_sum_of_its_lumps(deck_of: DeckOf):
    """Four lumps of a quarter of the area at (±0.1, ±0.05)."""
    text = "PBCOMP,3,1,1.-3,,,,4.-6,.5\n,,,,,,,1\n,.1,.05,.25\nENDDATA\n"
    model, batch = built(deck_of(BASE + text))
    expected = {"A": 1e-3, "I1": 1e-5, "I2": 2.5e-6, "I12": 0.0, "J": 4e-6, "NSM": 0.5, "rho": 7800.0, "K1": 1.0}
    assert batch.kind == "bar"
    assert {n: value(model, batch, n) for n in expected} == pytest.approx(expected, abs=1e-20)


def test_composite_of_two_materials(deck_of: DeckOf):
    """Steel above, aluminium below: neutral axis, stiffness and mass from the parts."""
    text = "PBCOMP,3,1,1.-3,,,,4.-6\n,,,,,,,2\n,.1,.05,.3\n,-.1,.02,.2,2\nENDDATA\n"
    model, batch = built(deck_of(BASE + text))
    steel, alu = 2e11 * 0.6, 7e10 * 0.4
    y = (steel * 0.1 - alu * 0.1) / (steel + alu)
    bending = 1e-3 * (steel * (0.1 - y) ** 2 + alu * (0.1 + y) ** 2)
    found = {n: value(model, batch, f"{n}@0") for n in ("A", "I1", "I2", "N1", "N2", "J")}
    assert found["N1"] == pytest.approx(y)
    assert found["N2"] == pytest.approx(0.0, abs=1e-15)
    assert found["A"] * 2e11 == pytest.approx(1e-3 * (steel + alu))
    assert found["I1"] * 2e11 == pytest.approx(bending)
    assert found["I2"] * 2e11 == pytest.approx(1e-3 * (steel * 0.05**2 + alu * 0.02**2))
    assert found["J"] * 8e10 == pytest.approx(4e-6 * (8e10 * 0.6 + 2.6e10 * 0.4))
    assert value(model, batch, "rho") * found["A"] == pytest.approx(1e-3 * (7800 * 0.6 + 2700 * 0.4))
    # the lumps' own material may be updated
    touched = model.structure.values.dependents([resolve(model, parse_field_ref("MAT1 2 E"))])
    assert {int(batch.roles[name][0]) for name in ("A@0", "I1@0", "N1@0")} <= touched


@pytest.mark.parametrize(
    ("option", "signs"),
    [(0, [(1, 1)]), (1, [(1, 1), (-1, 1), (1, -1), (-1, -1)]), (2, [(1, 1), (1, -1)]), (3, [(1, 1), (-1, 1)]),
     (4, [(1, 1), (-1, -1)]), (5, [(1, 1)])],
)  # fmt: skip
def test_symmetry_of_lumps(deck_of: DeckOf, option: int, signs: list[tuple[int, int]]):
    lumps = [(0.1, 0.05, 0.1), (-0.02, 0.04, 0.05), (0.03, -0.07, 0.08)]
    lines = "".join(f",{y},{z},{c}\n" for y, z, c in lumps)
    model, batch = built(deck_of(BASE + f"PBCOMP,3,1,1.-3,,,,4.-6\n,,,,,,,{option}\n{lines}ENDDATA\n"))
    y, z, c = np.array([(s * y, t * z, c) for y, z, c in lumps for s, t in signs]).T
    y, z = y - y @ c / c.sum(), z - z @ c / c.sum()
    suffix = "" if batch.kind == "bar" else "@0"
    assert value(model, batch, "A" + suffix) == pytest.approx(1e-3 * c.sum())
    for name, moment in (("I1", y * y), ("I2", z * z), ("I12", y * z)):
        assert value(model, batch, name + suffix) == pytest.approx(1e-3 * moment @ c, abs=1e-18)


CARDS = {
    "tapered": (TAPER, "PBEAM 3", "A AB I1 I1B I2 I12 J JB NSM K1 K2 NSIA M1A M2A N1A N1B"),
    "constant": ("PBEAM,3,1,1.-3,2.-6,3.-6,1.-7,4.-6,.5\n,NO,1.,1.-3,2.-6,3.-6,1.-7,4.-6,.5\n,.8,.7\n", "PBEAM 3",
                 "A I1 I2 I12 J NSM K1 K2"),
    "shaped": ("PBEAML,3,1,,I\n,.2,.1,.14,.008,.012,.01,.5,YES\n,1.,.2,.1,.12,.007,.012,.01,.5\n", "PBEAML 3",
               "DIM1 DIM2 DIM3 DIM3B DIM4 DIM4B DIM5 DIM6 NSM"),
    "composite": ("PBCOMP,3,1,1.-3,,,,4.-6,.5\n,1.,1.,.01,.02,,,3\n,.1,.05,.2\n,.1,-.04,.2\n,.05,-.04,.2\n",
                  "PBCOMP 3", "A J NSM K1 K2 M1 M2"),
    "whole composite": ("PBCOMP,3,1,1.-3,2.-6,3.-6,1.-7,4.-6,.5\n,1.,1.,,,.01,.02\n", "PBCOMP 3",
                        "A I1 I2 I12 J NSM K1 K2 N1 N2"),
}  # fmt: skip


@pytest.mark.quick(1)
@pytest.mark.parametrize("name", CARDS)
def test_every_value_is_written_back_into_its_fields(deck_of: DeckOf, tmp_path: Path, name: str):
    text, card, fields = CARDS[name]
    model = build_structure(deck_of(BASE + text + "ENDDATA\n"))
    for field in fields.split():
        ref = parse_field_ref(f"{card} {field}")
        index = resolve(model, ref)
        new = model.structure.values.values[index] * 1.25
        plan = plan_edits(model, {ref: new})
        written = write_deck(plan.edited, tmp_path / "out")
        before, after = (tmp_path / "deck.bdf").read_bytes(), written.main.read_bytes()
        again = build_structure(read_deck(written.main))
        values = again.structure.values
        assert values.values[values.index(ref)] == pytest.approx(new, rel=1e-3), field
        # nothing but the lines of the fields' cards differ, and no other value
        own = {ref, *(values.refs[i] for i in values.dependents([index]))}
        moved = {r for r, x, y in zip(values.refs, values.values, model.structure.values.values) if x != y}
        assert moved <= own, field
        places = model.fields[ref].fields
        pairs = list(zip(before.splitlines(), after.splitlines(), strict=True))
        changed = [(a, b) for a, b in pairs if a != b]
        assert 1 <= len(changed) <= len(places), field
        cells = sum(x != y for a, b in changed for x, y in zip(a.split(b","), b.split(b",")))
        assert cells == len(places), field


def test_a_region_of_a_tapered_beam_gets_a_card_of_its_own(deck_of: DeckOf, tmp_path: Path):
    model = build_structure(deck_of(BASE + TAPER + "ENDDATA\n"))
    ref = FieldRef("PBEAM", 3, "AB", "far")
    plan = plan_edits(model, {ref: 7e-4}, {"far": [8]})
    again = build_structure(read_deck(write_deck(plan.edited, tmp_path / "out").main))
    batch, values = again.structure.batches[0], again.structure.values.values
    assert values[batch.roles["A@2"]].tolist() == pytest.approx([5e-4, 7e-4])
    assert values[batch.roles["N1@2"]].tolist() == [0.04, 0.04]


@pytest.mark.parametrize("name", ["cbarao_cbeam.blk", "cbar_cbeam.blk"])
def test_round_bars_and_beams_of_another_program(nastran_decks: Path, name: str):
    """Nine CBAR with PBARL and one CBEAM with PBEAML, all round of radius 1: the same section, without stations."""
    model = build_structure(read_deck(nastran_decks / name))
    bar, beam = (next(b for b in model.structure.batches if b.card == card) for card in ("CBAR", "CBEAM"))
    assert (len(bar), len(beam), bar.kind, beam.kind) == (9, 1, "bar", "bar")
    for role in ("A", "I1", "I2", "J", "K1", "K2"):
        assert value(model, bar, role) == value(model, beam, role)
    assert value(model, bar, "A") == pytest.approx(np.pi)
