"""Offsets of bars and beams as values: matrices, exact derivatives, rigid-body modes, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.fem.tapered_parts import tapered

from femtune.errors import FemtuneError
from femtune.fem import FieldRef, Structure
from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties
from femtune.fem.contribution import joined
from femtune.fem.elements import contributions
from femtune.fem.offsets import settled, with_offsets
from femtune.model import Assignment, Configuration, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from femtune.testing import check_contribution
from structures.frames import bars, make_structure

XYZ = [[0.0, 0.0, 0.0], [1.3, 0.2, -0.1], [2.0, 1.0, 0.4]]
PAIRS = [[0, 1], [1, 2]]
SECTION = {"E": 2.1e11, "G": 8.1e10, "A": [2e-4, 3e-4], "I1": [1.5e-8, 4e-8], "I2": 6e-9, "J": 1.1e-8, "rho": 7850.0,
           "NSM": 0.3}  # fmt: skip
SHEAR = {"K1": [0.85, 0.7], "K2": [0.6, 0.9]}
ARMS = ((0.1, 0.2, 0.05), (0.02, -0.1, 0.3))
ALIKE = ((0.1, 0.2, 0.05), (0.1, 0.2, 0.05))
PARTS = {
    "bar": lambda arms: bars(PAIRS, SECTION, offsets=arms),
    "bar, shear": lambda arms: bars(PAIRS, {**SECTION, **SHEAR}, offsets=arms),
    "bar, pins": lambda arms: bars(PAIRS, SECTION, offsets=arms, pins=(5, 10)),
    "bar, shear and pins": lambda arms: bars(PAIRS, {**SECTION, **SHEAR}, offsets=arms, pins=(1, 9)),
    "beam": lambda arms: bars(PAIRS, {**SECTION, "GE": 0.02}, card="CBEAM", offsets=arms),
}
SKEW = {
    "skew": lambda arms: bars(PAIRS, {**SECTION, "I12": 2e-9}, card="CBEAM", offsets=arms),
    "tapered": lambda arms: _tapered(arms),  # noqa: PLW0108
}


def _tapered(arms):
    part = tapered(PAIRS[:1], {"E": 2.1e11, "G": 8.1e10, "rho": 7850.0}, [0.0, 1.0],
                   {"A": [2e-4, 3e-4], "I1": [1.5e-8, 4e-8], "I2": [6e-9], "J": [1e-8, 2e-8]})  # fmt: skip
    return replace(part, facts={**part.facts, "offset_a": np.array([arms[0]]), "offset_b": np.array([arms[1]])})


def _frames() -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in XYZ])


def _structure(part, consistent: bool = True) -> Structure:
    return make_structure(XYZ, [part], _frames(), consistent_mass=consistent, mass_factor=0.5)


def _at(structure: Structure, names, values) -> Structure:
    table = structure.values.values.copy()
    table[[structure.values.index(n) for n in names]] = values
    return replace(structure, values=replace(structure.values, values=table))


def _refs(card: str, element: int) -> list[FieldRef]:
    return [FieldRef(card, element, f"W{c}{end}") for end in "AB" for c in (1, 2, 3)]


@pytest.mark.slow
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("arms", [ARMS, ALIKE])
@pytest.mark.parametrize("name", [*PARTS, *SKEW])
def test_the_values_of_the_deck_give_the_same_matrices(name: str, arms, consistent: bool):
    plain = _structure({**PARTS, **SKEW}[name](arms), consistent)
    movable = with_offsets(plain, plain.batches[0].ids.tolist())
    assert len(movable.values.refs) == len(plain.values.refs) + 6 * len(plain.batches[0])
    for one in (movable, settled(movable, plain_samples(movable))):
        for kind in ("stiffness", "mass"):
            expected = assemble(plain, kind).toarray()
            np.testing.assert_allclose(assemble(one, kind).toarray(), expected, atol=1e-12 * np.abs(expected).max())


def plain_samples(structure: Structure) -> np.ndarray:
    return structure.values.values[None]


@pytest.mark.quick(0)
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("name", PARTS)
def test_other_offsets_give_the_matrices_of_a_deck_with_these(name: str, consistent: bool):
    """Length and direction change with them: the rational form against the plain element."""
    movable = with_offsets(_structure(PARTS[name](ARMS), consistent), [1, 2])
    other = ((-0.3, 0.15, 0.25), (0.2, 0.02, -0.1))
    plain, card = _structure(PARTS[name](other), consistent), movable.batches[0].card
    frames = _frames()
    moved = movable
    for element, nodes in ((1, PAIRS[0]), (2, PAIRS[1])):
        w = [frames[n].T @ arm for n, arm in zip(nodes, other)]
        moved = _at(moved, _refs(card, element), np.concatenate(w))
    for kind in ("stiffness", "mass"):
        expected = assemble(plain, kind).toarray()
        np.testing.assert_allclose(assemble(moved, kind).toarray(), expected, atol=2e-12 * np.abs(expected).max())


@pytest.mark.quick(2)
@pytest.mark.parametrize("name", [*PARTS, *SKEW])
def test_offsets_that_move_both_ends_alike_are_polynomials(name: str):
    """Contributions of the axis that stays, at other offsets, against a plain element with these."""
    part = {**PARTS, **SKEW}[name]
    movable = with_offsets(make_structure(XYZ, [part(ALIKE)], consistent_mass=True), [1, 2])
    movable = settled(movable, plain_samples(movable))
    shift = np.array([-0.3, 0.4, 0.15])
    plain = make_structure(XYZ, [part((shift, shift))], consistent_mass=True)
    moved, card = movable, movable.batches[0].card
    for element in movable.batches[0].ids:
        moved = _at(moved, _refs(card, int(element)), np.tile(shift, 2))
    for kind in ("stiffness", "mass"):
        expected = assemble(plain, kind).toarray()
        np.testing.assert_allclose(assemble(moved, kind).toarray(), expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.quick(0, gate=3)
@pytest.mark.parametrize(
    ("name", "still"),
    [*((name, True) for name in (*PARTS, *SKEW)), ("bar, shear and pins", False), ("beam", False)],
)
def test_derivatives(name: str, still: bool):
    structure = with_offsets(_structure({**PARTS, **SKEW}[name](ARMS)), [1, 2])
    if still:
        structure = settled(structure, plain_samples(structure))
    batch, values = structure.batches[0], structure.values.values
    parts = contributions(batch, structure)
    assert any("W2A" in p.roles for p in parts)
    # all entries of one matrix at once; the stiffness of a beam is that of a bar
    entries = joined([[replace(p, label="moving") if p.label.startswith("moving") else p for p in parts]])
    kinds = {"mass"} if name == "beam" and not still else {"stiffness", "mass"}
    for part in [e for e in entries if e.matrix in kinds] + [e for e in entries if e.matrix == "hysteretic"][:1]:
        check_contribution(part, {r: values[batch.roles[r][part.at]] for r in part.roles})


@pytest.mark.slow
def test_derivatives_of_many_parameters_are_those_of_few():
    """Beyond as many variables as values the chain rule takes over."""
    structure = with_offsets(_structure(PARTS["bar, shear"](ARMS)), [1])
    few = [Assignment("a", FieldRef("CBAR", 1, "W2A")), Assignment("b", FieldRef("CBAR", 1, "I1"))]
    names = [f"c{i}" for i in range(20)]
    tied = [Parameter(n, 1.0, 0.5, 2.0) for n in ("a", "b")]
    idle = [Parameter(n, 1.0, 0.5, 2.0) for n in names]
    table = structure.values
    own = [r for r, v in zip(table.refs, table.values) if v and r not in (few[0].ref, few[1].ref)]
    more = [Assignment(n, ref) for n, ref in zip(names, own)]
    one = configure(parametric_model(structure, ParameterSet(tuple(tied)), few), Configuration())
    many = configure(
        parametric_model(structure, ParameterSet((*tied, *idle[: len(more)])), [*few, *more]), Configuration()
    )
    x = np.array([0.1, -0.2])
    point = many.at(np.concatenate([x, np.zeros(len(more))]))
    assert len(more) > 16
    for p in range(2):
        expected, found = (m.stiffness_derivatives[p].toarray() for m in (one.at(x), point))
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    for i, j in ((0, 0), (0, 1)):
        expected, found = (m.stiffness_second_derivative(i, j).toarray() for m in (one.at(x), point))
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.slow
@pytest.mark.parametrize("consistent", [False, True])
def test_the_moment_of_inertia_of_a_moved_beam_about_its_axis(consistent: bool):
    """ρ (I1 + I2) L, with the length between the moved ends; a CBAR has none."""
    ends = ((0.2, 0.0, 0.0), (-0.3, 0.0, 0.0))
    for card, expected in (("CBEAM", 0.25 * 7850.0 * (1.5e-8 + 6e-9) * 1.5), ("CBAR", 0.0)):
        part = bars([[0, 1]], SECTION_ONE, card=card)
        movable = with_offsets(
            make_structure([[0, 0, 0], [2, 0, 0]], [part], consistent_mass=consistent, mass_factor=0.25), [1]
        )
        moved = _at(movable, _refs(card, 1), np.concatenate(ends))
        found = mass_properties(moved.nodes, assemble(moved, "mass")).central_inertia[0, 0]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_one_offset_normal_to_a_beam_is_three_terms():
    structure = with_offsets(make_structure([[0, 0, 0], [1, 0, 0]], [bars([[0, 1]], SECTION_ONE, offsets=UP)]), [1])
    parameters = ParameterSet((Parameter("a", 0.1, 0.0, 0.3),))
    refs = [FieldRef("CBAR", 1, n) for n in ("W2A", "W2B")]
    model = parametric_model(structure, parameters, [Assignment("a", r, False) for r in refs])
    moving = [t for t in model.terms if t.matrix == "stiffness" and t.coefficient is not None]
    assert sum(t.n_columns for t in moving) == 2
    table = model.table(np.array([1.0]))
    found = np.sort(np.concatenate([t.coefficient(table).value for t in moving]))
    np.testing.assert_allclose(found, [2.0, 4.0], rtol=1e-13)


SECTION_ONE = {"E": 2.1e11, "G": 8.1e10, "A": 2e-4, "I1": 1.5e-8, "I2": 6e-9, "J": 1.1e-8, "rho": 7850.0}
UP = ((0.0, 0.1, 0.0), (0.0, 0.1, 0.0))


@pytest.mark.slow
@pytest.mark.parametrize("name", PARTS)
def test_rigid_body_motion_is_strain_free_whatever_the_offsets(name: str):
    movable = with_offsets(make_structure(XYZ, [PARTS[name](ARMS)]), [1, 2])
    card = movable.batches[0].card
    moved = _at(movable, [*_refs(card, 1), *_refs(card, 2)], np.random.default_rng(4).uniform(-0.3, 0.3, 12))
    K = assemble(moved, "stiffness").toarray()
    xyz = np.array(XYZ)
    rigid = np.zeros((18, 6))
    for n in range(3):
        x, y, z = xyz[n]
        rigid[6 * n : 6 * n + 6, :] = np.eye(6)
        rigid[6 * n : 6 * n + 3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    assert np.abs(K @ rigid).max() <= 1e-10 * np.abs(K).max()


@pytest.mark.parametrize("name", SKEW)
def test_a_beam_that_cannot_turn_is_refused(name: str):
    structure = with_offsets(_structure(SKEW[name](ARMS)), [1])
    card = structure.batches[0].card
    with pytest.raises(FemtuneError, match="rotate the beam") as caught:
        parametric_model(
            structure,
            ParameterSet((Parameter("a", 1.0, 0.5, 2.0),)),
            [Assignment("a", FieldRef(card, 1, "W2A"))],
        )
    assert caught.value.code == "parameter.offset-axis"


def test_offsets_along_the_line():
    """OFFT with O: components along an axis system of the line from node to node."""
    part = bars([[0, 1]], SECTION_ONE, offsets=((0.0, 0.0, 0.1), (0.0, 0.0, 0.1)))
    part = replace(part, facts={**part.facts, "offset_of_line": np.array([[True, False]])})
    structure = with_offsets(make_structure([[0, 0, 0], [0, 0, 1]], [part]), [1])
    found = structure.values.values[[structure.values.index(r) for r in _refs("CBAR", 1)]]
    np.testing.assert_allclose(found, [0.1, 0.0, 0.0, 0.0, 0.0, 0.1], atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize(("upper", "refused"), [(0.9, False), (1.0, True), (1.5, True)])
def test_bounds_leave_a_length(upper: float, refused: bool):
    """A rigid end of a beam of one metre; the error names the beam."""
    structure = with_offsets(make_structure([[0, 0, 0], [1, 0, 0]], [bars([[0, 1]], SECTION_ONE)]), [1])
    parameters = ParameterSet((Parameter("a", 0.1, 0.0, upper), Parameter("b", 0.0, -0.2, 0.2)))
    chosen = [Assignment("a", FieldRef("CBAR", 1, "W1A"), False), Assignment("b", FieldRef("CBAR", 1, "W3B"), False)]
    if not refused:
        parametric_model(structure, parameters, chosen)
        return
    with pytest.raises(FemtuneError, match="CBAR 1") as caught:
        parametric_model(structure, parameters, chosen)
    assert caught.value.code == "parameter.offset-range"
