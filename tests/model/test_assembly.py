"""Terms, their folding and their projection beside element matrices that are summed one by one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem import FieldRef, Structure
from femtune.fem.assemble import assemble
from femtune.fem.constraints import rigid_body_rows
from femtune.fem.elements import contributions, pieces
from femtune.model import Assignment, Configuration, ModelPoint, configure, parametric_model, solve_modes, spread
from femtune.model.linear import memory
from femtune.model.response.mass import mass_response
from femtune.model.terms import CompiledTerms, compile_terms
from femtune.parameters import Parameter, ParameterSet
from structures.frames import make_structure, masses, rods, scalars
from structures.shells import Isotropic, Section, ShellPart, cylinder, dofs_of, shell_mesh, shell_structure

EVERY = (1, 2, 3, 4, 5, 6)
STEP = 1e-30


def shells(cells: str = "quad", loss: float = 0.0, frames: bool = False, rigid: bool = True) -> Structure:
    """Two thickness regions of a curved shell, a mass, a rigid body of four grid points, turned frames."""
    mesh = shell_mesh(cylinder(0.5, 1.0, 0.2, 1.5), 8, 6, cells=cells, distort=0.2)
    halves = np.array_split(mesh.cells, 2)
    steel = Isotropic(2.1e11, 0.3, 7850.0, loss)
    parts = [ShellPart(cells, Section(steel, t)) for cells, t in zip(halves, (0.004, 0.006))]
    turned = np.linalg.qr(np.random.default_rng(1).standard_normal((len(mesh.xyz), 3, 3)))[0] if frames else None
    structure = shell_structure(
        mesh.xyz, parts, [masses([20, 30], {"M": 0.5})], turned, dofs_of(mesh.edge("u0"), "123456")
    )
    grid = mesh.rows[3:5, 2:4].ravel() + 1
    rows = rigid_body_rows(structure.nodes, [(int(grid[0]), EVERY)], [(int(g), EVERY) for g in grid[1:]], 9000)
    return replace(structure, rigid=rows) if rigid else structure


def model(structure: Structure, **fields: str) -> ModelPoint:
    """One parameter a field ("PSHELL 1 T"), each at some value of its own."""
    assignments = [
        Assignment(name, FieldRef(card, int(number), field))
        for name, text in fields.items()
        for one in text.split(",")
        for card, number, field in [one.split()]
    ]
    parameters = ParameterSet(tuple(Parameter(name) for name in fields))
    x = np.linspace(-0.2, 0.3, len(fields))
    return configure(parametric_model(structure, parameters, assignments), Configuration()).at(x)


THREE = {"t1": "PSHELL 1 T", "t2": "PSHELL 2 T", "E": "MAT1 1 E,MAT1 2 E"}


def slowly(point: ModelPoint, kind: str) -> np.ndarray:
    """TᵀKT of the g-set matrix at the point's values, dense."""
    structure, T = point.configured.model.structure, point.configured.transformation.toarray()
    values = replace(structure.values, values=point.configured.model.table(point.x).value)
    return T.T @ assemble(replace(structure, values=values), kind).toarray() @ T  # type: ignore[arg-type]


@pytest.mark.quick(0)
@pytest.mark.parametrize("cells", ["quad", "union"])
@pytest.mark.parametrize("frames", [False, True])
@pytest.mark.parametrize("kind", ["stiffness", "mass"])
def test_the_matrices_are_those_of_the_elements(cells: str, frames: bool, kind: str) -> None:
    point = model(shells(cells, frames=frames), **THREE)
    exact = slowly(point, kind)
    np.testing.assert_allclose(getattr(point, kind).toarray(), exact, atol=1e-13 * np.abs(exact).max())
    upper = getattr(point, f"symmetric_{kind}")
    np.testing.assert_allclose(upper.upper.toarray(), np.triu(exact), atol=1e-13 * np.abs(exact).max())
    assert (
        np.diff(upper.upper.indices)[np.diff(np.repeat(np.arange(len(exact)), np.diff(upper.indptr))) == 0] > 0
    ).all()


def test_the_coefficients_of_a_thickness_region() -> None:
    """E t for the membrane, E t³ for bending, between them shear with two sizes of both parts; t for the mass."""
    point = model(shells(), **THREE)
    moving = {p.term.matrix: p.term.n_columns for p in point.configured.projected if p.term.coefficient}
    assert moving == {"stiffness": 12, "mass": 2}
    values = [c for p, c in zip(point.configured.projected, point.coefficients) if p.term.matrix == "stiffness" and c]
    # logarithmic derivatives by t1, t2 and E tell which functions they are
    powers = values[0].grad * (1.0 + point.x) / values[0].value[:, None]
    for own, other in ((0, 1), (1, 0)):
        mine = powers[powers[:, other] == 0.0]
        np.testing.assert_allclose(mine[:, 2], 1.0, rtol=1e-12)
        found = np.sort(mine[:, own])
        np.testing.assert_allclose(found[[0, -1]], [1.0, 3.0], rtol=1e-12)
        assert ((found[1:-1] > 1.0) & (found[1:-1] < 3.0)).all()


def test_poissons_ratio_keeps_what_it_tells_apart() -> None:
    """E/(1 − ν²), νE/(1 − ν²), G and E itself are four functions of ν, each with t and t³; and four of shear."""
    point = model(shells(), nu="MAT1 1 NU", t="PSHELL 1 T")
    stiffness = next(p for p in point.configured.projected if p.term.matrix == "stiffness" and p.term.coefficient)
    assert stiffness.term.n_columns == 12


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["stiffness", "mass", "hysteretic"])
def test_folded_terms_have_exact_derivatives(kind: str) -> None:
    point = model(shells(loss=0.02), nu="MAT1 1 NU", **THREE)
    for i in range(point.n_parameters):
        step = np.zeros(point.n_parameters, complex)
        step[i] = 1j * STEP
        moved = point.configured.at(point.x + step)
        slope = getattr(moved, kind).toarray().imag / STEP
        exact = getattr(point, f"{kind}_derivatives")[i].toarray()
        np.testing.assert_allclose(slope, exact, atol=1e-12 * np.abs(exact).max())
        for j in range(point.n_parameters):
            curve = getattr(moved, f"{kind}_derivatives")[j].toarray().imag / STEP
            second = getattr(point, f"{kind}_second_derivative")(i, j).toarray()
            np.testing.assert_allclose(curve, second, atol=1e-12 * max(np.abs(second).max(), np.abs(exact).max()))


def test_pieces_are_the_whole_batch() -> None:
    structure = shells("union", rigid=False)
    large = shells(rigid=False).batches[0]
    for batch in (*structure.batches, large):
        whole = {
            (p.matrix, p.label): np.zeros((len(batch), *p.matrices.shape[1:])) for p in contributions(batch, structure)
        }
        for piece in pieces(batch, structure):
            for part in piece:
                whole[part.matrix, part.label][part.at] += part.matrices
        for part in contributions(batch, structure):
            np.testing.assert_array_equal(whole[part.matrix, part.label][part.at], part.matrices)


@pytest.mark.slow
def test_small_pieces_give_the_same_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regions, coefficients and slots that span pieces."""
    whole = model(shells(loss=0.02), nu="MAT1 1 NU", **THREE)
    monkeypatch.setattr("femtune.fem.elements.shells.flat.ELEMENTS_PER_CHUNK", 5)
    monkeypatch.setattr("femtune.fem.elements.kernels.ELEMENTS_PER_PIECE", 1)
    parts = model(shells(loss=0.02), nu="MAT1 1 NU", **THREE)
    for kind in ("stiffness", "mass", "hysteretic"):
        a, b = (getattr(p, kind).toarray() for p in (whole, parts))
        np.testing.assert_allclose(a, b, atol=1e-14 * np.abs(a).max())
    columns = [[p.term.n_columns for p in point.configured.projected] for point in (whole, parts)]
    assert columns[0] == columns[1]


@pytest.mark.quick(1)
@pytest.mark.parametrize("passes", [0, 10**9])
def test_both_ways_to_sum_entries(monkeypatch: pytest.MonkeyPatch, passes: int) -> None:
    monkeypatch.setattr(spread, "PASSES", passes)
    monkeypatch.setattr(spread, "AT_ONCE", 1000)
    monkeypatch.setattr("femtune.model.projection.AT_ONCE", 1000)
    monkeypatch.setattr("femtune.model.projection.SORTED_AT_ONCE", 1500)
    point = model(shells("union"), **THREE)
    exact = slowly(point, "stiffness")
    np.testing.assert_allclose(point.stiffness.toarray(), exact, atol=1e-13 * np.abs(exact).max())


def test_coefficients_are_told_apart_whatever_their_hash_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("femtune.model.terms.odd_numbers", lambda count: np.zeros(count, np.uint64))
    point = model(shells("union"), **THREE)
    exact = slowly(point, "stiffness")
    np.testing.assert_allclose(point.stiffness.toarray(), exact, atol=1e-13 * np.abs(exact).max())


@pytest.mark.slow
def test_terms_that_are_released_are_compiled_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A large model gives them back before its modes are solved; weighing it takes those of the mass alone."""
    first = model(shells("union"), **THREE)
    whole, before, weighed = first.configured.model, first.stiffness, mass_response(first)
    monkeypatch.setattr("femtune.model.eigen.solution.ONE_FACTOR_FROM", 0)
    solve_modes(first, 3)
    compiled: list[Structure] = []

    def counted(structure: Structure, *given: Any) -> CompiledTerms:
        compiled.append(structure)
        return compile_terms(structure, *given)

    monkeypatch.setattr("femtune.model.parametric.compile_terms", counted)
    np.testing.assert_array_equal(mass_response(first).mass, weighed.mass)
    assert not compiled
    again = configure(whole, Configuration()).at(first.x)
    assert len(compiled) == 1
    np.testing.assert_array_equal(again.stiffness.toarray(), before.toarray())
    assert whole.terms
    assert len(compiled) == 1


def test_a_state_without_any_element_of_a_term() -> None:
    """The only dashpot is switched off: the model has no damping, and is built all the same."""
    ends = np.array([[0, -1], [0, -1]])
    parts = [scalars("spring", ends[:1], "K", 5.0), scalars("dashpot", ends[1:], "B", 2.0)]
    structure = make_structure([[0.0, 0.0, 0.0]], parts, element_kinds={1: "CELAS2", 1001: "CDAMP2"})
    whole = configure(parametric_model(structure, ParameterSet(()), ()), Configuration())
    without = configure(whole.model, Configuration(elements_off=frozenset({1001})))
    assert whole.at(np.zeros(0)).viscous.sum() == 2.0
    assert without.at(np.zeros(0)).viscous.sum() == 0.0


def test_elements_switched_off() -> None:
    structure = shells(rigid=False)
    structure = replace(structure, element_kinds={int(i): b.card for b in structure.batches for i in b.ids})
    parameters, assignments = ParameterSet((Parameter("t"),)), [Assignment("t", FieldRef("PSHELL", 1, "T"))]
    off = frozenset({3, 4, 40})
    point = configure(parametric_model(structure, parameters, assignments), Configuration(elements_off=off)).at(
        np.zeros(1)
    )
    left = tuple(
        replace(
            b, ids=b.ids[k], nodes=b.nodes[k], dofs=b.dofs[k], roles={r: a[k] for r, a in b.roles.items()},
            facts={f: a[k] for f, a in b.facts.items()},
        )
        for b in structure.batches
        for k in [~np.isin(b.ids, list(off))]
    )  # fmt: skip
    T = point.configured.transformation.toarray()
    # shared normals look at all shells, those that are off too, so that the check is of flat parts: the mass
    exact = T.T @ assemble(replace(structure, batches=left), "mass").toarray() @ T
    np.testing.assert_allclose(point.mass.toarray(), exact, atol=1e-13 * np.abs(exact).max())


def test_a_model_that_does_not_fit_is_refused_before_it_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    structure = shells()
    ready = parametric_model(structure, ParameterSet(()), ())
    monkeypatch.setattr(memory, "free_memory", lambda: 10_000)
    monkeypatch.setattr(memory, "NEGLIGIBLE_BYTES", 0)
    with pytest.raises(FemtuneError, match="memory") as caught:
        parametric_model(structure, ParameterSet(()), ())
    assert caught.value.code == "model.memory"
    assert "matrices of 50 elements" in str(caught.value)
    with pytest.raises(FemtuneError, match="memory") as caught:
        configure(ready, Configuration())
    assert "assembling 318 DOF" in str(caught.value)


def test_values_of_their_own_for_each_element_fold_where_one_modulus_moves() -> None:
    """E moves and every bar has its own area: E A is one function of the parameter."""
    xyz = np.random.default_rng(3).uniform(0.0, 1.0, (40, 3))
    connection = np.stack([np.arange(39), np.arange(1, 40)], axis=1)
    values = {"E": 2e11, "A": np.linspace(1e-4, 2e-4, 39), "G": 8e10, "J": 1e-8, "rho": 7850.0}
    structure = make_structure(xyz, [rods(connection, values)], hold_singular=False)
    names = [Parameter("E")]
    refs = [Assignment("E", ref) for ref in structure.values.refs if ref.name == "E"]
    point = configure(parametric_model(structure, ParameterSet(tuple(names)), refs), Configuration()).at(
        np.array([0.1])
    )
    stiffness = next(p for p in point.configured.projected if p.term.matrix == "stiffness" and p.term.coefficient)
    assert stiffness.term.n_columns == 1
    exact = slowly(point, "stiffness")
    np.testing.assert_allclose(point.stiffness.toarray(), exact, atol=1e-13 * np.abs(exact).max())
