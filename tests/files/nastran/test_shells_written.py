"""Values of shell decks written back: bytes of the fields only, and copies for a part of the elements."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.nastran import Deck, read_deck, write_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.files.nastran.write import WritePlan, plan_edits
from femtune.parameters import jet

DeckOf = Callable[..., Deck]
# every card once in small field, once in large field and once with commas
MESH = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,1.,1.,0.
GRID,4,,0.,1.,0.
"""
SMALL = (
    MESH
    + """MAT1    1       2.+11           .25     7800.                   .01     $ steel
MAT2    2       2.      .5              3.              1.      7.
                                        .02
MAT8    3       140.    10.     .3      5.      4.      3.      2.
+                                                               $ no strengths
        .03
PSHELL  11      1       .1      2       1.1     3       .8      .5      $ skin
CQUAD4  21      11      1       2       3       4               .01     $
                        .1      .11     .12     .13
CTRIA3  22      11      1       2       3               .02
                        .1      .11     .12
"""
)
LARGE = (
    MESH
    + """MAT1*                  1           2.+11                             .25
*                  7800.                                             .01
MAT2*                  2              2.              .5
*                     3.                              1.              7.
*
*                    .02
*
MAT8*                  3            140.             10.              .3
*                     5.              4.              3.              2.
*
*
*                    .03
*
PSHELL*               11               1              .1               2
*                    1.1               3              .8              .5
CQUAD4*               21              11               1               2
*                      3               4                             .01
*                                                     .1             .11
*                    .12             .13
CTRIA3*               22              11               1               2
*                      3                             .02
*                                                     .1             .11
*                    .12
"""
)
FREE = (
    MESH
    + """MAT1,1,2.+11,,.25,7800.,,,.01 $ steel
MAT2,2,2.,.5,,3.,,1.,7.
,,,,,.02
MAT8,3,140.,10.,.3,5.,4.,3.,2.
,
,.03
PSHELL,11,1,.1,2,1.1,3,.8,.5
CQUAD4,21,11,1,2,3,4,,.01,+
+,,,.1,.11,.12,.13
CTRIA3,22,11,1,2,3,,.02
,,,.1,.11,.12
"""
)
FORMATS = {"small": SMALL, "large": LARGE, "free": FREE}
UPDATABLE = {
    "PSHELL 11 RI": 1.1, "PSHELL 11 TS": 0.8, "PSHELL 11 NSM": 0.5,
    "MAT1 1 GE": 0.01, "MAT1 1 E": 2e11, "MAT1 1 NU": 0.25, "MAT1 1 RHO": 7800.0,
    "MAT2 2 G11": 2.0, "MAT2 2 G12": 0.5, "MAT2 2 G13": 0.0, "MAT2 2 G22": 3.0, "MAT2 2 G23": 0.0, "MAT2 2 G33": 1.0,
    "MAT2 2 GE": 0.02, "MAT8 3 G1Z": 4.0, "MAT8 3 G2Z": 3.0, "MAT8 3 GE": 0.03,
    "CQUAD4 21 ZOFFS": 0.01, "CQUAD4 21 T1": 0.1, "CQUAD4 21 T2": 0.11, "CQUAD4 21 T3": 0.12, "CQUAD4 21 T4": 0.13,
    "CTRIA3 22 ZOFFS": 0.02, "CTRIA3 22 T1": 0.1, "CTRIA3 22 T3": 0.12,
}  # fmt: skip


def again(plan: WritePlan, folder: Path) -> BuiltDeck:
    return build_structure(read_deck(write_deck(plan.edited, folder).main))


def value_of(model: BuiltDeck, element: int, role: str) -> float:
    batch = next(b for b in model.structure.batches if element in b.ids)
    return float(model.structure.values.values[batch.roles[role][batch.ids.tolist().index(element)]])


@pytest.mark.parametrize("form", FORMATS)
def test_formats_say_the_same(deck_of: DeckOf, form: str) -> None:
    model = build_structure(deck_of(FORMATS[form]))
    found = {text: model.structure.values.values[resolve(model, parse_field_ref(text))] for text in UPDATABLE}
    assert found == pytest.approx(UPDATABLE)


@pytest.mark.quick(15)
@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("text", UPDATABLE)
def test_only_the_field_changes(deck_of: DeckOf, form: str, text: str, tmp_path: Path) -> None:
    model = build_structure(deck_of(FORMATS[form]))
    ref = parse_field_ref(text)
    index = resolve(model, ref)
    old = UPDATABLE[text]
    new = old * 1.25 if old else 0.125
    written = again(plan_edits(model, {ref: new}), tmp_path / "run")
    before, after = FORMATS[form].splitlines(), (tmp_path / "run" / "updated.bdf").read_text().splitlines()
    assert len(before) == len(after)
    (changed,) = [(a, b) for a, b in zip(before, after) if a != b]
    assert _differing_fields(*changed) == 1
    expected = model.structure.values.evaluate({index: jet.constant(new, 0)}, 0).value
    assert written.structure.values.refs == model.structure.values.refs
    np.testing.assert_allclose(written.structure.values.values, expected, rtol=1e-12)


def _differing_fields(before: str, after: str) -> int:
    """How many fields of a line differ; the comment and the field of the name included."""
    if "," in before:
        pieces = before.partition("$")[0].split(","), after.partition("$")[0].split(",")
        pieces[0].extend([""] * (len(pieces[1]) - len(pieces[0])))
        return sum(a.strip() != b.strip() for a, b in zip(*pieces)) + (
            before.partition("$")[2] != after.partition("$")[2]
        )
    width = 16 if "*" in before[:8] else 8
    a, b = before.ljust(80), after.ljust(80)
    cuts = [(0, 8), *((i, i + width) for i in range(8, 72, width)), (72, 200)]
    return sum(a[i:j] != b[i:j] for i, j in cuts)


@pytest.fixture
def panels(deck_of: DeckOf) -> BuiltDeck:
    """Two shells of one property whose membrane and bending are of one material, and a bar of that material."""
    text = MESH + (
        "MAT1,1,2.+11,,.25,7800.\nMAT1,2,7.+10,,.33,2700.\nMAT8,3,140.,10.,.3,5.,4.,3.,2.\n"
        "PSHELL,11,1,.1,1,,2\nPSHELL,12,3,.2,3\n"
        "CQUAD4,21,11,1,2,3,4\nCTRIA3,22,11,1,2,3\nCTRIA3,23,11,2,3,4\nCQUAD4,24,12,1,2,3,4\nCONROD,25,1,2,1,.5\n"
    )
    return build_structure(deck_of(text))


def test_property_split(panels: BuiltDeck, tmp_path: Path) -> None:
    plan = plan_edits(panels, {FieldRef("PSHELL", 11, "T", "half"): 0.15}, {"half": [22]})
    assert [(s.source, s.copy, s.elements) for s in plan.splits] == [("PSHELL 11", "PSHELL 13", (22,))]
    new = again(plan, tmp_path / "run")
    assert [value_of(new, e, "t") for e in (21, 22, 23, 24)] == [0.1, 0.15, 0.1, 0.2]


def test_material_split_repoints_every_field_that_names_it(panels: BuiltDeck, tmp_path: Path) -> None:
    plan = plan_edits(panels, {FieldRef("MAT1", 1, "E", "r"): 1.9e11}, {"r": [21, 23, 25]})
    assert {(s.source, s.copy, s.elements) for s in plan.splits} == {
        ("MAT1 1", "MAT1 4", (21, 23, 25)), ("PSHELL 11", "PSHELL 13", (21, 23)),
    }  # fmt: skip
    new = again(plan, tmp_path / "run")
    (card,) = [c for c in new.deck.by_name("PSHELL") if c.integer(0) == 13]
    assert [card.text(i) for i in (1, 3, 5)] == ["4", "4", "2"]
    for role in ("M11", "B11"):
        stiff = [value_of(new, e, role) for e in (21, 22, 23)]
        np.testing.assert_allclose(stiff, np.array([1.9e11, 2e11, 1.9e11]) / (1 - 0.25**2), rtol=1e-14)
    assert value_of(new, 25, "E") == 1.9e11
    assert value_of(new, 21, "S11") == value_of(panels, 21, "S11")


def test_two_materials_of_a_shell_split_at_once(panels: BuiltDeck, tmp_path: Path) -> None:
    refs = {FieldRef("MAT1", 1, "RHO", "a"): 8000.0, FieldRef("MAT1", 2, "E", "b"): 7.5e10}
    new = again(plan_edits(panels, refs, {"a": [21, 22], "b": [22, 23]}), tmp_path / "run")
    assert [value_of(new, e, "rho") for e in (21, 22, 23)] == [8000.0, 8000.0, 7800.0]
    shear = [value_of(new, e, "S11") * 2.66 for e in (21, 22, 23)]
    np.testing.assert_allclose(shear, [7e10, 7.5e10, 7.5e10], rtol=1e-14)


def test_orthotropic_material_split(panels: BuiltDeck, tmp_path: Path) -> None:
    plan = plan_edits(panels, {FieldRef("MAT8", 3, "E2", "r"): 12.0}, {"r": [24]})
    new = again(plan, tmp_path / "run")
    ratio = 1.0 - 0.09 * 12.0 / 140.0
    np.testing.assert_allclose([value_of(new, 24, n) for n in ("M22", "B22")], [12.0 / ratio] * 2, rtol=1e-14)


def test_split_deck_is_the_split_structure(panels: BuiltDeck, tmp_path: Path) -> None:
    table = panels.structure.values
    index = table.index(FieldRef("MAT1", 1, "NU"))
    assert index is not None
    split = panels.structure.split(index, [21, 23], "r")
    at = split.values.index(FieldRef("MAT1", 1, "NU", "r"))
    assert at is not None
    values = split.values.evaluate({at: jet.constant(0.3, 0)}, 0).value
    new = again(plan_edits(panels, {FieldRef("MAT1", 1, "NU", "r"): 0.3}, {"r": [21, 23]}), tmp_path / "run")
    for one, other in zip(split.batches, new.structure.batches):
        for role in one.roles:
            written = new.structure.values.values[other.roles[role]]
            np.testing.assert_allclose(written, values[one.roles[role]], rtol=1e-14, err_msg=role)


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("PSHELL 11 TS/T", "", ""),
        ("PSHELL 11 12I/T**3", "", ""),
        ("CQUAD4 21 T", "parameter.derived-field", "mean of its corner thicknesses"),
        ("CQUAD4 21 ZOFFS", "parameter.touches-nothing", "write 0. into the field"),
        ("CQUAD4 21 T1", "parameter.touches-nothing", "CQUAD4 21 T1 is blank"),
        ("PSHELL 12 TS", "parameter.touches-nothing", "depends on PSHELL 12 TS"),
        ("MAT8 3 G1Z", "parameter.touches-nothing", "depends on MAT8 3 G1Z"),
        ("PSHELL 11 Z1", "study.unknown-field", "known: NSM, RI, T, TS"),
    ],
)
def test_names_of_fields(panels: BuiltDeck, text: str, code: str, message: str) -> None:
    if not code:
        assert resolve(panels, parse_field_ref(text)) >= 0
        return
    with pytest.raises(FemtuneError) as error:
        resolve(panels, parse_field_ref(text))
    assert error.value.code == code
    assert message in str(error.value)
