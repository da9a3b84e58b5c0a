"""Damping as matrices: closed forms of small oscillators, derivatives, ratios of modes over frequency."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.fem.assemble import assemble
from femtune.model import Assignment, Configuration, ModelPoint, configure, parametric_model
from femtune.model.damping import (
    ModalDamping,
    constant_damping,
    damping_by_mode,
    damping_table,
)
from femtune.parameters import Parameter, ParameterSet
from femtune.testing.derivatives import check_matrix_derivatives

from .decks import deck, structure_of


def point(cards: list[str], moved: dict[str, float] | None = None, x: float = 0.0, case: str = "") -> ModelPoint:
    """A model whose fields (text to start value) are absolute parameters p0, p1, …, at x for all of them."""
    moved = moved or {}
    parameters = tuple(Parameter(f"p{i}", v, v - 1.0, v + 1.0) for i, v in enumerate(moved.values()))
    refs = [FieldRef("PARAM", 0, "G") if t == "PARAM G" else FieldRef(*_split(t)) for t in moved]
    assignments = [Assignment(f"p{i}", ref, relative=False) for i, ref in enumerate(refs)]
    model = parametric_model(structure_of(deck(cards, case)), ParameterSet(parameters), assignments)
    return configure(model, Configuration()).at(np.full(len(moved), x))


def _split(text: str) -> tuple[str, int, str]:
    card, number, name = text.split()
    return card, int(number), name


OSCILLATOR = ["SPOINT,1", "CELAS2,1,100.,1,,,,.04", "CDAMP2,2,.6,1", "CMASS2,3,4.,1", "PARAM,G,.01"]


def test_one_degree_of_freedom():
    """K = 100, η = 0.04 + 0.01, c = 0.6, m = 4: poles of m s² + c s + k(1 + iη) on the upper side."""
    p = point(OSCILLATOR)
    k, h, c, m = (float(x.toarray()[0, 0]) for x in (p.stiffness, p.hysteretic, p.viscous, p.mass))
    assert (k, h, c, m) == pytest.approx((100.0, 5.0, 0.6, 4.0))
    # loss factor and viscous ratio add up in ζ = η/2 + c/(2 m ω), to first order
    s = np.roots([m, c, k + 1j * h])
    pole = s[np.argmax(s.imag)]
    assert -pole.real / abs(pole) == pytest.approx(0.05 / 2 + 0.6 / (2 * 4 * 5), rel=2e-3)


def test_two_degrees_of_freedom():
    """Ground - k1, c1 - m1 - k2 - m2, with loss factors of both springs."""
    cards = [
        "SPOINT,1,2", "PELAS,7,100.,.1", "CELAS1,1,7,1", "CELAS2,2,50.,1,,2,,.2", "PDAMP,7,3.", "CDAMP1,3,7,1",
        "CMASS2,4,2.,1", "CMASS2,5,1.,2",
    ]  # fmt: skip
    p = point(cards)
    np.testing.assert_allclose(p.stiffness.toarray(), [[150, -50], [-50, 50]])
    np.testing.assert_allclose(p.hysteretic.toarray(), [[20, -10], [-10, 10]])
    np.testing.assert_allclose(p.viscous.toarray(), [[3, 0], [0, 0]])


def test_a_rod_of_lossy_material():
    """Fixed-free rod: K(1 + iη) has the real modes, and poles with λ (1 + iη)."""
    grids = [f"GRID,{i},,{i - 1}.,0.,0.,,23456" for i in range(1, 12)]
    rods = [f"CROD,{i},1,{i},{i + 1}" for i in range(1, 11)]
    p = point([*grids, *rods, "PROD,1,1,1.", "MAT1,1,4.,,.3,1.,,,.06", "SPC1,1,1,1"], case="SPC = 1")
    K, H, M = (x.toarray() for x in (p.stiffness, p.hysteretic, p.mass))
    np.testing.assert_allclose(H, 0.06 * K, rtol=1e-12)
    complex_eigenvalues = np.sort_complex(np.linalg.eigvals(np.linalg.solve(M, K + 1j * H)))
    # lumped masses: λ_j = 4 (c/h)² sin²((2j − 1)π/(4n)), with c² = E/ρ = 4, h = 1, n = 10
    j = np.arange(1, 11)
    expected = 4 * 4.0 * np.sin((2 * j - 1) * np.pi / 40) ** 2 * (1 + 0.06j)
    np.testing.assert_allclose(complex_eigenvalues, expected, rtol=1e-10)


def test_maxwell_and_kelvin_elements():
    """A spring in series with a dashpot is k·iωc/(k + iωc), beside it k + iωc."""
    k, c, omega = 30.0, 2.0, 7.0
    maxwell = point(["SPOINT,1,2", f"CELAS2,1,{k},1,,2", f"CDAMP2,2,{c},2", "CMASS2,3,1.,1"])
    Z = maxwell.stiffness.toarray() + 1j * omega * maxwell.viscous.toarray()
    assert Z[0, 0] - Z[0, 1] * Z[1, 0] / Z[1, 1] == pytest.approx(k * 1j * omega * c / (k + 1j * omega * c))
    kelvin = point(["SPOINT,1", f"CELAS2,1,{k},1", f"CDAMP2,2,{c},1", "CMASS2,3,1.,1"])
    assert (kelvin.stiffness + 1j * omega * kelvin.viscous).toarray()[0, 0] == pytest.approx(k + 1j * omega * c)


FRAME = [
    "GRID,1,,0.,0.,0.", "GRID,2,,1.,.2,0.", "GRID,3,,1.,1.,.5", "MAT1,1,2.+3,,.3,2.,,,.02", "MAT1,2,1.+3,4.+2,,1.",
    "PBAR,1,1,.1,.01,.02,.03", ",", ",.8,.7", "CBAR,1,1,1,2,0.,0.,1.", "CBAR,2,1,2,3,0.,0.,1.",
    "CONROD,3,1,3,2,.5,.1", "PBUSH,4,K,10.,20.,30.,40.,50.,60.", ",,B,1.,2.,,,5.", ",,GE,.1,.2,.3",
    "CBUSH,4,4,3,,,,,0", "PBUSH,5,K,10.,20.", "CBUSH,5,5,1,,,,,0", "PVISC,6,2.,1.", "CVISC,6,6,1,3",
    "PBUSH1D,7,8.,.4", "CBUSH1D,7,7,2,3", "CDAMP2,8,.7,3,1", "CELAS2,9,5.,3,2,,,.05", "PARAM,G,.03",
]  # fmt: skip
MOVED = {
    "MAT1 1 GE": 0.02, "MAT1 1 E": 2000.0, "PBAR 1 I1": 0.01, "MAT1 2 GE": 0.0, "PARAM G": 0.03, "PBUSH 4 B1": 1.0,
    "PBUSH 4 GE2": 0.2, "PBUSH 4 K2": 20.0, "PBUSH 5 GE1": 0.0, "PBUSH 5 K2": 20.0, "PVISC 6 CR": 1.0,
    "PBUSH1D 7 C": 0.4, "CDAMP2 8 B": 0.7, "CELAS2 9 GE": 0.05, "CELAS2 9 K": 5.0, "PBUSH 4 B3": 0.0,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("x", [0.0, 0.03])
def test_derivatives_of_every_kind(x: float):
    """Loss factors times stiffness, in materials, springs, bushes and overall; values that start at zero too."""
    check_matrix_derivatives(point(FRAME, MOVED, x))


def test_the_matrices_are_those_of_the_elements():
    p = point(FRAME)
    structure = p.configured.model.structure
    T = p.configured.transformation
    for name in ("viscous", "hysteretic"):
        whole = assemble(structure, name)
        if name == "hysteretic":
            whole = whole + 0.03 * assemble(structure, "stiffness")
        np.testing.assert_allclose(getattr(p, name).toarray(), (T.T @ whole @ T).toarray(), atol=1e-12)


def test_what_is_not_damped_costs_nothing():
    cards = [c for c in FRAME if not c.startswith(("PARAM", "CDAMP", "CVISC", ",,B", ",,GE", "PBUSH1D", "CBUSH1D"))]
    cards = [c.removesuffix(",,,.02").removesuffix(",,,.05") for c in cards]
    p = point(cards, {"MAT1 1 E": 2000.0, "PBUSH 4 K2": 20.0})
    assert {t.term.matrix for t in p.configured.projected} == {"stiffness", "mass"}
    assert p.hysteretic.count_nonzero() == 0


def test_the_overall_loss_factor_is_not_for_a_part_of_the_model():
    structure = structure_of(deck(FRAME))
    whole = Assignment("p", FieldRef("PARAM", 0, "G"), relative=False)
    part = Assignment("p", FieldRef("PARAM", 0, "G"), relative=False, elements=frozenset({1}))
    parametric_model(structure, ParameterSet((Parameter("p", 0.03, 0.0, 0.1),)), [whole])
    with pytest.raises(FemtuneError) as error:
        parametric_model(structure, ParameterSet((Parameter("p", 0.03, 0.0, 0.1),)), [part])
    assert error.value.code == "parameter.whole-model"


def test_ratios_of_modes():
    freq = np.array([1.0, 2.0, 5.0])
    np.testing.assert_array_equal(constant_damping(0.02).ratio(freq), [0.02] * 3)
    np.testing.assert_array_equal(damping_by_mode([0.01, 0.02, 0.03, 0.04]).ratio(freq), [0.01, 0.02, 0.03])
    np.testing.assert_array_equal(damping_by_mode([0.01]).ratio(freq[:1]), [0.01])
    assert not constant_damping(0.02).slope(freq).any()
    for short in ([0.01, 0.02], [0.01]):
        with pytest.raises(FemtuneError) as error:
            damping_by_mode(short).ratio(freq)
        assert error.value.code == "damping.too-few-modes"


TABLE = ([1.0, 2.0, 4.0, 4.0, 6.0], [0.01, 0.03, 0.02, 0.06, 0.06])


@pytest.mark.parametrize(
    ("freq", "expected"),
    [(1.0, 0.01), (1.5, 0.02), (2.0, 0.03), (3.0, 0.025), (4.0, 0.04), (3.999999, 0.02), (5.0, 0.06), (6.0, 0.06),
     (0.5, 0.0), (0.0, -0.01), (9.0, 0.06)],
)  # fmt: skip
def test_a_table_over_frequency(freq: float, expected: float):
    """Straight lines, their mean at a jump, and the first and last line beyond the table."""
    found = damping_table(*TABLE).ratio([freq])
    assert found == pytest.approx([expected], abs=1e-6)
    assert damping_table(TABLE[0][::-1], TABLE[1][::-1]).ratio([freq]) == pytest.approx(found)


def test_a_table_that_is_flat_outside():
    flat = damping_table([1.0, 2.0], [0.01, 0.03], flat=True)
    np.testing.assert_allclose(flat.ratio([0.0, 1.5, 7.0]), [0.01, 0.02, 0.03])
    np.testing.assert_allclose(flat.slope([0.0, 1.5, 7.0]), [0.0, 0.02, 0.0])


@pytest.mark.parametrize("unit", ["CRIT", "G", "Q"])
def test_units_of_a_table_and_its_slope(unit: str):
    """ζ = G/2 = 1/(2Q), interpolated in the unit of the table."""
    values = np.array([0.02, 0.05, 0.03])
    given = {"CRIT": values, "G": 2 * values, "Q": 0.5 / values}[unit]
    table = damping_table([1.0, 3.0, 4.0], given, unit)  # type: ignore[arg-type]
    np.testing.assert_allclose(table.ratio([1.0, 3.0, 4.0]), values)
    middle = {"CRIT": 0.035, "G": 0.035, "Q": 0.5 / (0.25 / 0.02 + 0.25 / 0.05)}[unit]
    assert table.ratio([2.0]) == pytest.approx([middle])
    f, step = np.array([1.2, 2.5, 3.3]), 1e-6
    np.testing.assert_allclose(table.slope(f), (table.ratio(f + step) - table.ratio(f - step)) / (2 * step), rtol=1e-7)


@pytest.mark.parametrize(
    ("freq", "values", "unit"),
    [([], [], "G"), ([1.0, 2.0], [0.1], "G"), ([1.0, 3.0, 2.0], [0.1] * 3, "G"), ([1.0, 1.0, 2.0], [0.1] * 3, "G"),
     ([1.0, 2.0, 2.0], [0.1] * 3, "G"), ([1.0, 2.0, 2.0, 2.0, 3.0], [0.1] * 5, "G"), ([1.0, np.nan], [0.1, 0.1], "G"),
     ([1.0, 2.0], [5.0, 0.0], "Q")],
)  # fmt: skip
def test_tables_that_are_refused(freq: list[float], values: list[float], unit: str):
    with pytest.raises(FemtuneError) as error:
        damping_table(freq, values, unit)  # type: ignore[arg-type]
    assert error.value.code == "damping.table"


def test_a_quality_that_runs_to_zero_is_refused():
    table = damping_table([1.0, 2.0], [20.0, 10.0], "Q")
    with pytest.raises(FemtuneError) as error:
        table.ratio([3.5])
    assert error.value.code == "damping.quality"
    assert isinstance(table, ModalDamping)
