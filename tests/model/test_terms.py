"""K(p) and M(p) are those of a deck with the value typed in."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.fem import FieldRef, Structure
from femtune.model import Assignment, Configuration, ModelPoint, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet, parse_expression, tied

from .decks import card, deck, structure_of

VALUES: dict[str, float] = {
    "MAT1 1 E": 2.1e11, "MAT1 1 NU": 0.3, "MAT1 1 RHO": 7850.0, "MAT1 2 E": 7e10, "MAT1 2 G": 2.7e10,
    "MAT1 2 RHO": 2700.0, "PBAR 1 A": 2e-4, "PBAR 1 I1": 1.5e-8, "PBAR 1 I2": 6e-9, "PBAR 1 J": 1.1e-8,
    "PBAR 1 NSM": 0.2, "PBAR 2 A": 3e-4, "PBAR 2 I1": 4e-8, "PBAR 2 I2": 7e-9, "PBAR 2 J": 1e-8, "PBAR 2 K1": 0.8,
    "PBAR 2 K2": 0.6, "PROD 3 A": 1e-4, "PROD 3 J": 1e-9, "PELAS 4 K": 3e4, "CELAS2 61 K": 2e5,
    "PBUSH 5 K1": 1e5, "PBUSH 5 K4": 2e3, "CMASS2 71 M": 0.3, "CONM2 72 M": 1.2, "CONM2 72 I11": 0.01,
    "CONM2 72 I22": 0.02, "CONM2 72 I33": 0.015,
}  # fmt: skip


def cards(v: Mapping[str, float]) -> list[str]:
    """Seven grid points; bars 1 to 3 shear-rigid, 11 to 13 shear-flexible, a rod, springs, a bush and masses."""
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.1, 0.0, 1.2), (2.0, 0.4, 0.0), (1.0, 0.8, 1.4), (2.2, 1.0, 1.0)]
    lines = [card("GRID", i + 1, None, *xyz) for i, xyz in enumerate(points)]
    for i, (a, b) in enumerate([(1, 2), (2, 3), (3, 4)]):
        lines.append(card("CBAR", 1 + i, 1, a, b, 0.3, 1.0, 0.1))
    for i, (a, b) in enumerate([(2, 5), (5, 6), (6, 4)]):
        lines.append(card("CBAR", 11 + i, 2, a, b, 0.3, 1.0, 0.1))
    lines += [
        card("MAT1", 1, v["MAT1 1 E"], None, v["MAT1 1 NU"], v["MAT1 1 RHO"]),
        card("MAT1", 2, v["MAT1 2 E"], v["MAT1 2 G"], None, v["MAT1 2 RHO"]),
        card("PBAR", 1, 1, *(v[f"PBAR 1 {n}"] for n in ("A", "I1", "I2", "J", "NSM"))),
        card("PBAR", 2, 2, *(v[f"PBAR 2 {n}"] for n in ("A", "I1", "I2", "J")), *[None] * 10, v["PBAR 2 K1"],
             v["PBAR 2 K2"]),
        card("CROD", 31, 3, 1, 6), card("PROD", 3, 1, v["PROD 3 A"], v["PROD 3 J"]),
        card("CELAS1", 41, 4, 3, 1, 5, 1), card("PELAS", 4, v["PELAS 4 K"]),
        card("CELAS2", 61, v["CELAS2 61 K"], 3, 3),
        card("CBUSH", 51, 5, 6, None, None, None, None, 0),
        card("PBUSH", 5, "K", v["PBUSH 5 K1"], None, None, v["PBUSH 5 K4"]),
        card("CMASS2", 71, v["CMASS2 71 M"], 5, 2),
        card("CONM2", 72, 3, 0, v["CONM2 72 M"], 0.1, 0.0, 0.2, None, v["CONM2 72 I11"], None, v["CONM2 72 I22"],
             None, None, v["CONM2 72 I33"]),
        card("SPC1", 1, 123456, 1), card("SPC1", 1, 123, 4),
        card("PARAM", "COUPMASS", 1),
    ]  # fmt: skip
    return lines


def structure(**changed: float) -> Structure:
    values = {**VALUES, **{name.replace("_", " "): value for name, value in changed.items()}}
    return structure_of(deck(cards(values), "SPC = 1"))


NOMINAL = structure()


def ref(name: str) -> FieldRef:
    kind, number, field = name.split()
    return FieldRef(kind, int(number), field)


def point_of(structure: Structure, names: list[Parameter], assignments: list[Assignment], x: list[float]) -> ModelPoint:
    model = parametric_model(structure, ParameterSet(tuple(names)), assignments)
    return configure(model, Configuration()).at(np.array(x))


def assert_same(found: ModelPoint, typed: Structure) -> None:
    wanted = point_of(typed, [], [], [])
    for kind in ("stiffness", "mass"):
        a, b = getattr(found, kind), getattr(wanted, kind)
        assert abs(a - b).max() <= 1e-12 * abs(b).max(), kind


@pytest.mark.quick(0)
@pytest.mark.parametrize("name", VALUES)
def test_a_factor_of_a_field(name: str):
    found = point_of(NOMINAL, [Parameter("p")], [Assignment("p", ref(name))], [0.3])
    assert_same(found, structure(**{name.replace(" ", "_"): 1.3 * VALUES[name]}))


@pytest.mark.quick(0)
@pytest.mark.parametrize("name", ["MAT1 1 E", "MAT1 1 NU", "PBAR 2 K1", "PELAS 4 K", "CONM2 72 M"])
def test_an_absolute_value(name: str):
    value = 1.1 * VALUES[name]
    parameter = Parameter("p", VALUES[name], 0.5 * VALUES[name], 2 * VALUES[name])
    found = point_of(NOMINAL, [parameter], [Assignment("p", ref(name), relative=False)], [0.1])
    assert_same(found, structure(**{name.replace(" ", "_"): value}))
    assert found.configured.model.field_values(np.array([0.1])) == pytest.approx({ref(name): value})


def test_what_the_elements_have_in_common_is_one_scalar():
    """A modulus of many shear-rigid bars is one column a term, whatever their lengths."""
    model = parametric_model(NOMINAL, ParameterSet((Parameter("p"),)), [Assignment("p", ref("MAT1 1 E"))])
    moving = [t for t in model.terms if t.coefficient is not None]
    assert {t.n_columns for t in moving if t.label.startswith("bar")} == {1}
    assert all(t.matrix == "stiffness" for t in moving)
    flexible = parametric_model(NOMINAL, ParameterSet((Parameter("p"),)), [Assignment("p", ref("PBAR 2 I1"))])
    assert max(t.n_columns for t in flexible.terms if t.coefficient) == 3


@pytest.mark.slow
@settings(max_examples=15)
@given(st.lists(st.floats(-0.6, 1.5), min_size=4, max_size=4))
def test_several_parameters_at_once(x: list[float]):
    names = ["MAT1 1 E", "PBAR 2 A", "PBAR 2 I1", "CONM2 72 M"]
    parameters = [Parameter(f"p{i}", 1.0, 0.1, 4.0) for i in range(4)]
    found = point_of(NOMINAL, parameters, [Assignment(f"p{i}", ref(n)) for i, n in enumerate(names)], x)
    assert_same(found, structure(**{n.replace(" ", "_"): (1 + y) * VALUES[n] for n, y in zip(names, x)}))


def test_ties():
    """I2 follows I1 by an expression, and the modulus of the second material the first one's inverse."""
    parameters = [Parameter("i1"), tied("i2", "i1**2"), tied("e", "1 / i1")]
    assignments = [Assignment("i1", ref("PBAR 1 I1")), Assignment("i2", ref("PBAR 1 I2"))]
    assignments.append(Assignment("e", ref("MAT1 2 E")))
    found = point_of(NOMINAL, parameters, assignments, [0.2])
    typed = {"PBAR_1_I1": 1.2 * 1.5e-8, "PBAR_1_I2": 1.44 * 6e-9, "MAT1_2_E": 7e10 / 1.2}
    assert_same(found, structure(**typed))
    assert found.n_parameters == 1


def test_one_parameter_on_several_fields():
    assignments = [Assignment("p", ref("PBAR 1 I1")), Assignment("p", ref("PBAR 2 I1"))]
    found = point_of(NOMINAL, [Parameter("p")], assignments, [-0.25])
    assert_same(found, structure(PBAR_1_I1=0.75 * 1.5e-8, PBAR_2_I1=0.75 * 4e-8))


def split_deck(second: float, third: float) -> Structure:
    """Bars 2 and 3 with materials of their own."""
    lines = cards(VALUES)
    lines = [line for line in lines if not line.startswith("CBAR")]
    for i, (a, b, pid) in enumerate([(1, 2, 1), (2, 3, 8), (3, 4, 9)]):
        lines.append(card("CBAR", 1 + i, pid, a, b, 0.3, 1.0, 0.1))
    for i, (a, b) in enumerate([(2, 5), (5, 6), (6, 4)]):
        lines.append(card("CBAR", 11 + i, 2, a, b, 0.3, 1.0, 0.1))
    for pid, e in ((8, second), (9, third)):
        lines.append(card("MAT1", pid, e, None, 0.3, 7850.0))
        lines.append(card("PBAR", pid, pid, *(VALUES[f"PBAR 1 {n}"] for n in ("A", "I1", "I2", "J", "NSM"))))
    return structure_of(deck(lines, "SPC = 1"))


def test_regions_split_a_field_and_what_follows_from_it():
    """E of bar 2 and of bar 3 move apart; their G follows each from its own E and the common ν."""
    assignments = [Assignment(f"e{i}", ref("MAT1 1 E"), elements=frozenset({i})) for i in (2, 3)]
    found = point_of(NOMINAL, [Parameter("e2"), Parameter("e3")], assignments, [0.4, -0.3])
    assert_same(found, split_deck(1.4 * 2.1e11, 0.7 * 2.1e11))


def test_the_rest_of_a_field_in_either_order():
    """Without elements a parameter has those that no region took."""
    region, rest = Assignment("e2", ref("MAT1 1 E"), elements=frozenset({2})), Assignment("e", ref("PBAR 1 I1"))
    whole = Assignment("e", ref("MAT1 1 E"))
    assert rest.elements is None
    for order in ([region, whole], [whole, region]):
        found = point_of(NOMINAL, [Parameter("e"), Parameter("e2")], order, [0.2, 0.4])
        model = found.configured.model
        assert len(model.field_values(found.x)) == 2
        e_of_bar_2 = [v for r, v in model.field_values(found.x).items() if r.region]
        assert e_of_bar_2 == pytest.approx([1.4 * 2.1e11])


def model_of(names: list[Parameter], assignments: list[Assignment]) -> object:
    return parametric_model(NOMINAL, ParameterSet(tuple(names)), assignments)


P = Parameter("p")
BAD: dict[str, tuple[list[Parameter], list[Assignment]]] = {
    "parameter.unknown-field": ([P], [Assignment("p", FieldRef("PBAR", 77, "I1"))]),
    "parameter.touches-nothing": ([P], [Assignment("p", ref("PBAR 1 I1"), elements=frozenset({11, 12}))]),
    "parameter.zero-nominal": ([P], [Assignment("p", FieldRef("PBAR", 2, "NSM"))]),
    "parameter.without-effect": ([P], [Assignment("p", ref("PBAR 1 I12"), False)]),
    "parameter.field-twice": (
        [P, Parameter("q")], [Assignment("p", ref("PBAR 1 I1")), Assignment("q", ref("PBAR 1 I1"))],
    ),
}  # fmt: skip


@pytest.mark.parametrize("code", BAD)
def test_refused(code: str):
    with pytest.raises(FemtuneError) as caught:
        model_of(*BAD[code])
    assert caught.value.code == code
    assert "p" in caught.value.what or "q" in caught.value.what


def test_a_parameter_without_field_is_refused_and_one_that_only_a_tie_uses_is_not():
    with pytest.raises(FemtuneError, match="q does not set any field"):
        model_of([P, Parameter("q")], [Assignment("p", ref("PBAR 1 I1"))])
    factor = Parameter("half", tie=parse_expression("p / 2"))
    model_of([P, factor], [Assignment("half", ref("PBAR 1 I1"))])


def test_overlapping_regions_are_refused():
    regions = [frozenset({1, 2}), frozenset({2, 3})]
    both = [Assignment(n, ref("MAT1 1 E"), elements=r) for n, r in zip(("p", "q"), regions)]
    with pytest.raises(FemtuneError) as caught:
        model_of([P, Parameter("q")], both)
    assert caught.value.code == "parameter.field-twice"


def test_problems_are_shown_together():
    with pytest.raises(FemtuneErrors) as caught:
        model_of(
            [P, Parameter("q"), Parameter("r")],
            [Assignment("p", FieldRef("PBAR", 77, "I1")), *BAD["parameter.touches-nothing"][1]],
        )
    assert len(caught.value.errors) >= 2
