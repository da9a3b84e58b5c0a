"""Generic elements: eigenvalues and rotations of a group's stiffness, rigid-body modes, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem import FieldRef, Structure
from femtune.fem.assemble import assemble
from femtune.fem.elements import contributions
from femtune.fem.fields import generic_ref
from femtune.fem.generic import GenericGroup, generic_modes, with_generic
from femtune.model import Assignment, Configuration, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from femtune.testing import check_contribution
from structures.frames import bars, make_structure

SECTION = {"E": 1.0, "G": 0.4, "A": 3.0, "I1": 1.0, "I2": 0.7, "J": 0.5, "rho": 1.0}
LINE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]


def _beams(n: int = 3) -> Structure:
    return make_structure(LINE[: n + 1], [bars([[i, i + 1] for i in range(n)], SECTION)], consistent_mass=True)


def _at(structure: Structure, **values: float) -> Structure:
    table = structure.values.values.copy()
    for name, value in values.items():
        table[structure.values.index(generic_ref("JOINT", name.replace("_", "-")))] = value
    return replace(structure, values=replace(structure.values, values=table))


def _stiffness(structure: Structure) -> np.ndarray:
    return assemble(structure, "stiffness").toarray()


@pytest.mark.parametrize(("EI", "length"), [(1.0, 1.0), (7.0, 0.3)])
def test_eigenvalues_of_a_beam_in_its_plane(EI: float, length: float):
    """0, 0, 2EI/l and EI(24/l³ + 6/l): 2 and 30 where EI = l = 1."""
    part = bars([[0, 1]], {**SECTION, "E": EI})
    structure = make_structure([[0, 0, 0], [length, 0, 0]], [part])
    modes = generic_modes(structure, GenericGroup("JOINT", frozenset([1]), components="26"))
    np.testing.assert_allclose(modes.kappa, [2 * EI / length, EI * (24 / length**3 + 6 / length)], rtol=1e-13)
    assert modes.rigid == 2
    K = np.array([[12, 6 * length, -12, 6 * length], [0, 4 * length**2, -6 * length, 2 * length**2],
                  [0, 0, 12, -6 * length], [0, 0, 0, 4 * length**2]]) * EI / length**3  # fmt: skip
    K = np.triu(K) + np.triu(K, 1).T
    np.testing.assert_allclose(modes.shapes * modes.kappa @ modes.shapes.T, K, atol=1e-12 * np.abs(K).max())


def test_the_deck_stays_as_it_is():
    structure = _beams()
    generic = with_generic(structure, GenericGroup("JOINT", frozenset([1, 2])), ["K1", "K3", "S1-2"])
    np.testing.assert_array_equal(_stiffness(generic), _stiffness(structure))


def test_the_group_has_the_eigenvalues_and_turned_shapes_that_are_asked_for():
    group = GenericGroup("JOINT", frozenset([1, 2]), components="26")
    structure = with_generic(_beams(), group, ["K1", "K2", "S1-3", "S1-2"])
    before = generic_modes(structure, group)
    moved = _at(structure, K1=0.3 * before.kappa[0], K2=1.7 * before.kappa[1], S1_3=0.4, S1_2=-0.2)
    dofs = before.dofs
    # element 3 stands beside the group
    change = (_stiffness(moved) - _stiffness(structure))[np.ix_(dofs, dofs)]
    K = before.shapes * before.kappa @ before.shapes.T + change
    wanted = before.kappa * np.array([0.3, 1.7, *np.ones(len(before.kappa) - 2)])
    np.testing.assert_allclose(np.linalg.eigvalsh(K)[before.rigid :], np.sort(wanted), rtol=1e-12)
    c, s = np.cos, np.sin
    G13 = np.array([[c(0.4), 0, -s(0.4)], [0, 1, 0], [s(0.4), 0, c(0.4)]])
    G12 = np.array([[c(-0.2), -s(-0.2), 0], [s(-0.2), c(-0.2), 0], [0, 0, 1]])
    turned = before.shapes[:, :3] @ (G13 @ G12)
    np.testing.assert_allclose(K @ turned, turned * wanted[:3], atol=1e-12 * wanted.max())


def test_rigid_body_modes_stay():
    structure = with_generic(_beams(), GenericGroup("JOINT", frozenset([1, 2, 3])), ["K1", "S1-2", "S2-5", "K7"])
    moved = _stiffness(_at(structure, K1=5.0, S1_2=0.5, S2_5=-0.3, K7=0.01))
    rigid = np.zeros((24, 6))
    for n, (x, y, z) in enumerate(LINE):
        rigid[6 * n : 6 * n + 6] = np.eye(6)
        rigid[6 * n : 6 * n + 3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    assert np.abs(moved - _stiffness(structure)).max() > 0.1
    assert np.abs(moved @ rigid).max() <= 1e-12 * np.abs(moved).max()


def test_a_group_condensed_onto_its_ends_has_the_asked_eigenvalues():
    structure, ends = _beams(), (1, 4)
    group = GenericGroup("JOINT", frozenset([1, 2, 3]), ends)
    generic = with_generic(structure, group, ["K1", "K4"])
    before = generic_modes(structure, group)
    assert (len(before.dofs), before.rigid) == (12, 6)
    moved = _stiffness(_at(generic, K1=0.5 * before.kappa[0], K4=3.0 * before.kappa[3]))
    inner = np.setdiff1d(np.arange(24), before.dofs)
    b = before.dofs
    condensed = moved[np.ix_(b, b)] - moved[np.ix_(b, inner)] @ np.linalg.solve(
        moved[np.ix_(inner, inner)], moved[np.ix_(inner, b)]
    )
    wanted = np.repeat(before.kappa, before.multiplicity)
    wanted[before.owner == 0] *= 0.5
    wanted[before.owner == 3] *= 3.0
    np.testing.assert_allclose(np.linalg.eigvalsh(condensed)[6:], np.sort(wanted), rtol=1e-11)


def test_copies_of_a_joint_share_their_eigenvalues():
    structure = _beams()
    one = generic_modes(structure, GenericGroup("JOINT", frozenset([1]), components="26"))
    two = generic_modes(structure, GenericGroup("JOINT", frozenset([1, 3]), components="26"))
    np.testing.assert_allclose(two.kappa, one.kappa, rtol=1e-12)
    assert (two.multiplicity == 2).all()
    assert two.rigid == 2 * one.rigid


@pytest.mark.slow
@pytest.mark.parametrize("names", [["K1", "K2"], ["K1", "S1-3"], ["S1-2", "S2-3", "K4"]])
def test_derivatives(names: list[str]):
    structure = with_generic(_beams(), GenericGroup("JOINT", frozenset([1, 2]), components="26"), names)
    batch = structure.batches[-1]
    values = _at(structure, **{n.replace("-", "_"): 0.3 for n in names}).values.values
    parts = contributions(batch, structure)
    assert parts
    for part in parts:
        check_contribution(part, {r: values[batch.roles[r][part.at]] for r in part.roles})


def test_linear_in_kappa_and_one_term():
    structure = with_generic(_beams(), GenericGroup("JOINT", frozenset([1, 2])), ["K1"])
    model = parametric_model(
        structure, ParameterSet((Parameter("k", 1.0, 0.2, 3.0),)), [Assignment("k", generic_ref("JOINT", "K1"))]
    )
    point = configure(model, Configuration(supports_added=((1, "123456"),))).at(np.array([0.7]))
    assert np.abs(point.stiffness_derivatives[0].toarray()).max() > 0.0
    assert np.abs(point.stiffness_second_derivative(0, 0).toarray()).max(initial=0.0) == 0.0
    assert [t.n_columns for t in model.terms if t.label.startswith("generic")] == [1]


@pytest.mark.parametrize(
    ("elements", "names", "code"),
    [
        ([1], ["K0"], "generic.rigid-body"),
        ([1], ["K7"], "generic.name"),
        ([1], ["S1-1"], "generic.name"),
        ([1], ["E"], "generic.name"),
        ([1, 3], ["S1-2"], "generic.repeated"),
        ([9], ["K1"], "generic.empty"),
    ],
)
def test_what_is_refused(elements: list[int], names: list[str], code: str):
    with pytest.raises(FemtuneError) as caught:
        with_generic(_beams(), GenericGroup("JOINT", frozenset(elements)), names)
    assert caught.value.code == code
    assert "JOINT" in str(caught.value)


def test_groups_that_overlap_are_refused():
    structure = with_generic(_beams(), GenericGroup("JOINT", frozenset([1, 2])), ["K1"])
    with pytest.raises(FemtuneError, match=r"element 2 .*JOINT") as caught:
        with_generic(structure, GenericGroup("OTHER", frozenset([2, 3])), ["K1"])
    assert caught.value.code == "generic.overlap"


def test_another_parameter_on_the_elements_of_a_group_is_refused():
    structure = with_generic(_beams(), GenericGroup("JOINT", frozenset([1, 2])), ["K1"])
    parameters = ParameterSet(tuple(Parameter(n, 1.0, 0.2, 3.0) for n in "ab"))
    kappa = Assignment("a", generic_ref("JOINT", "K1"))
    parametric_model(structure, parameters, [kappa, Assignment("b", FieldRef("CBAR", 2, "rho"))])
    with pytest.raises(FemtuneError, match="stiffness of element 2") as caught:
        parametric_model(structure, parameters, [kappa, Assignment("b", FieldRef("CBAR", 2, "E"))])
    assert caught.value.code == "generic.moved-elsewhere"


def test_a_configuration_keeps_the_elements_of_a_group():
    structure = with_generic(replace(_beams(), element_kinds={1: "CBAR", 2: "CBAR", 3: "CBAR"}),
                             GenericGroup("JOINT", frozenset([1, 2])), ["K1"])  # fmt: skip
    model = parametric_model(structure, ParameterSet(()), [])
    configure(model, Configuration(elements_off=frozenset([3])))
    with pytest.raises(FemtuneError) as caught:
        configure(model, Configuration(elements_off=frozenset([2])))
    assert caught.value.code == "generic.switched-off"
