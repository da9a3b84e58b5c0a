"""Models assembled from Craig-Bampton components: closed form, full models, an independent assembly, derivatives."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigvalsh
from tests.deck_models import model_of
from tests.messages.shown import check_shown

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.model import (
    AddedMass,
    Assignment,
    Configuration,
    ConfiguredModel,
    configure,
    parametric_model,
    solve_modes,
)
from femtune.model.reduce import (
    Component,
    Components,
    ComponentTrainer,
    TrainingRules,
    TrainingStatus,
    alone,
    certified_error,
    component_model,
    couple,
    craig_bampton,
    divide,
    reduced_derivative,
    reduced_modes,
)
from femtune.parameters import Parameter, ParameterSet
from structures.beams import I1, RHO, SECTION, A, E, L, exact_frequency, held_for_bending, straight_line
from structures.frames import bars, make_structure
from structures.shells import Isotropic, Section, ShellPart, rectangle, shell_mesh, shell_structure

_STEEL = Isotropic(2.1e11, 0.3, 7850.0)
_EVERYTHING = 1e9


def _beam(n: int = 48) -> ConfiguredModel:
    """A clamped-free Euler beam of n elements, bending in one plane."""
    xyz, pairs = straight_line(n)
    kinds = dict.fromkeys(range(1, n + 1), "CBAR")
    structure = make_structure(xyz, [bars(pairs, SECTION)], consistent_mass=True, element_kinds=kinds)
    held = np.array(sorted(held_for_bending(("clamped", "free"), n, 1)))
    return configure(parametric_model(replace(structure, permanent=held), ParameterSet(()), ()), Configuration())


def _halves(n: int = 48) -> Components:
    return Components({"left": frozenset(range(1, n // 2 + 1)), "right": frozenset(range(n // 2 + 1, n + 1))})


def _plate(parts: int, moved: tuple[str, ...] = ("t1", "t2", "t3")) -> tuple[ConfiguredModel, Components]:
    """A free plate of shells in three regions with a thickness each, of which components are made."""
    mesh = shell_mesh(rectangle(1.0, 0.5), 12, 5, distort=0.1)
    at = np.clip((mesh.xyz[mesh.cells].mean(axis=1)[:, 0] * 3.0).astype(int), 0, 2)
    regions = [mesh.cells[at == i] for i in range(3)]
    shells = [ShellPart(c, Section(_STEEL, 0.010 + 0.003 * i)) for i, c in enumerate(regions)]
    structure = shell_structure(mesh.xyz, shells, consistent_mass=True)
    parameters = ParameterSet(tuple(Parameter(n, lower=0.75, upper=1.25) for n in moved))
    assignments = [Assignment(n, FieldRef("PSHELL", int(n[1]), "T")) for n in moved]
    ends = np.cumsum([0, *map(len, regions)])
    ids = [frozenset(range(a + 1, b + 1)) for a, b in pairwise(ends)]
    chosen = {"a": ids[0], "b": ids[1], "c": ids[2]} if parts == 3 else {"a": ids[0], "bc": ids[1] | ids[2]}
    return configure(parametric_model(structure, parameters, assignments), Configuration()), Components(chosen)


def test_a_beam_of_two_halves_has_the_frequencies_of_the_closed_form() -> None:
    beam, halves = _beam(), _halves()
    full = solve_modes(beam.at(np.zeros(0)), 5)
    exact = np.array([exact_frequency(("clamped", "free"), f, I1, 0.0, 0.0) for f in full.freq_hz])
    # the first root of cos βL cosh βL = −1
    first = 1.8751040687**2 / (2.0 * np.pi) * np.sqrt(E * I1 / (RHO * A * L**4))
    assert exact[0] == pytest.approx(first, rel=1e-7)
    errors = []
    for multiple in (1.0, 2.0, 4.0):
        components = replace(halves, max_hz=dict.fromkeys(halves.elements, multiple * exact[-1]))
        found = component_model(beam, components, exact[-1])
        errors.append(reduced_modes(found.model.at(np.zeros(0)), 5).freq_hz / exact - 1.0)
    # from above, and the lower the more modes the components have
    assert (np.array(errors) > -1e-9).all()
    assert errors[0].max() > 3.0 * errors[1].max() > 9.0 * errors[2].max()
    assert errors[1].max() < 5e-3
    assert errors[2].max() < 1e-3


def test_the_assembly_is_that_of_components_reduced_one_by_one() -> None:
    """Each half as a model of its own, reduced by `craig_bampton` and joined by the names of its DOFs."""
    beam, halves = _beam(16), _halves(16)
    found = component_model(beam, halves, 2000.0)
    parts = []
    for name, own in zip(halves.elements, found.components.parts):
        off = frozenset(range(1, 17)) - halves.elements[name]
        half = configure(beam.model, replace(beam.configuration, elements_off=off))
        # the DOFs of the node in the middle, number 9
        shared = np.flatnonzero(half.free // 6 == 8)
        point = half.at(np.zeros(0))
        reduced = craig_bampton(point.stiffness, point.mass, shared, own.modes)
        parts.append(Component(reduced, half.free[shared].tolist()))
    joined = couple(parts)
    expected = eigvalsh(joined.stiffness, joined.mass)
    mine = reduced_modes(found.model.at(np.zeros(0)), 3).eigenvalues
    assert len(mine) == len(expected) == found.model.order == 2 + sum(p.modes for p in found.components.parts)
    np.testing.assert_allclose(mine, expected, rtol=1e-8)


@pytest.mark.parametrize("parts", [2, 3])
@pytest.mark.slow
def test_with_all_modes_the_model_is_the_full_one_and_converges_to_it(parts: int) -> None:
    plate, components = _plate(parts)
    x = np.array([0.2, -0.15, 0.1])
    full = solve_modes(plate.at(x), 16)
    values, high = full.eigenvalues[:16], float(full.freq_hz[-1])
    errors = [
        certified_error(component_model(plate, components, high * k, x).model, x, values).max() for k in (0.5, 1.0, 2.0)
    ]
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]
    assert errors[2] < 2e-3
    everything = component_model(plate, components, _EVERYTHING, x)
    assert certified_error(everything.model, x, values).max() < 1e-8


@pytest.mark.slow
def test_derivatives_are_those_of_the_reduced_matrices() -> None:
    plate, components = _plate(3)
    model, x, h = component_model(plate, components, 400.0).model, np.array([0.1, -0.1, 0.05]), 1e-20
    modes = reduced_modes(model.at(x), 12)
    for j in (7, 9, 11):
        found = reduced_derivative(modes, [j])
        y, value = modes.shapes[:, j], modes.eigenvalues[j]
        for i in range(3):
            step = model.at(x + 1j * h * np.eye(3)[i])
            exact = float((y @ (step.stiffness - value * step.mass) @ y).imag) / h
            assert found.stiffness[i, 0, 0] - value * found.mass[i, 0, 0] == pytest.approx(exact, rel=1e-9)
            difference = [reduced_modes(model.at(x + d * np.eye(3)[i]), 12).eigenvalues[j] for d in (1e-5, -1e-5)]
            assert exact == pytest.approx((difference[0] - difference[1]) / 2e-5, rel=1e-5)


def _trainer(plate: ConfiguredModel, components: Components, **more: object) -> ComponentTrainer:
    division = divide(plate, components)
    assert division is not None
    rules = TrainingRules(12, 2e-3, 8, 400, inner=6)
    return ComponentTrainer(plate, rules, components, division, **more)  # type: ignore[arg-type]


def _up_to(components: Components, hz: float) -> Components:
    return replace(components, max_hz=dict.fromkeys(components.elements, hz))


@pytest.mark.slow
def test_only_the_components_that_a_parameter_changes_are_rebuilt() -> None:
    plate, components = _plate(2, ("t2",))
    trainer = _trainer(plate, _up_to(components, 3000.0))
    # so strict that the components of the nominal thickness are not enough
    trainer = replace(trainer, rules=replace(trainer.rules, tolerance=3e-4))
    trained = trainer.train(trainer.start())
    assert trained.status is TrainingStatus.CONVERGED
    assert trained.components is not None
    builds = {p.part.name: len(p.built) for p in trained.components.parts}
    assert builds["a"] == 1
    assert 2 <= builds["bc"] <= 8
    # the full model was solved once
    assert len(trained.certified) == 1
    for x in (np.array([-0.2]), np.array([0.23])):
        truth = solve_modes(plate.at(x), 12).eigenvalues[:12]
        assert certified_error(trained.model, x, truth).max() < 3e-4


@pytest.mark.slow
def test_full_modes_make_the_model_right_where_they_are_solved() -> None:
    plate, components = _plate(2)
    trainer = _trainer(plate, components)
    trained, x = trainer.start(), np.array([0.2, 0.2, -0.2])
    solution = solve_modes(plate.at(x), 12)
    finer = replace(trainer, rules=replace(trainer.rules, negligible=1e-5))
    after = finer.enriched(trained, x, solution)
    assert after.certified[-1].error > 1e-4
    assert certified_error(after.model, x, solution.eigenvalues[:12]).max() < 1e-8
    assert after.components is not None
    # own columns of a component are zero outside its interior
    for own in after.components.parts:
        outside = np.ones(plate.n_free, bool)
        outside[own.part.interior] = False
        assert not after.basis[np.ix_(outside, own.columns)].any()


@pytest.mark.slow
def test_too_few_modes_are_made_up_for_by_full_solutions() -> None:
    plate, components = _plate(2, ("t2",))
    trainer = _trainer(plate, _up_to(components, 1.0))
    strict = replace(trainer, rules=replace(trainer.rules, tolerance=1e-5, negligible=1e-4))
    start = strict.start()
    assert start.components is not None
    assert [p.modes for p in start.components.parts] == [0, 0]
    # the error of the static shapes alone, and none with the parts of the modes of the full model
    assert start.certified[0].error > 0.01
    x = np.zeros(1)
    truth = solve_modes(plate.at(x), 12).eigenvalues[:12]
    assert certified_error(start.model, x, truth).max() < 1e-6
    trained = strict.train(start)
    assert trained.status is TrainingStatus.CONVERGED
    assert 2 <= len(trained.certified) <= 8
    limited = replace(strict, rules=replace(strict.rules, full_solutions=1))
    assert limited.train(limited.start()).status is TrainingStatus.SOLUTIONS


_COUPLED = """SOL 103
CEND
BEGIN BULK
MAT1,1,2.1+11,,.3,7850.
PBAR,1,1,1.-3,2.-7,5.-7,4.-7
PELAS,7,1.+6
GRID,1,,0.,0.,0.
GRID,2,,.5,0.,0.
GRID,3,,1.,0.,0.
GRID,11,,1.,.1,0.
GRID,12,,1.5,.1,0.
GRID,13,,2.,.1,0.
GRID,21,,2.,.2,0.
GRID,22,,2.5,.2,0.
CBAR,1,1,1,2,0.,1.,0.
CBAR,2,1,2,3,0.,1.,0.
CBAR,11,1,11,12,0.,1.,0.
CBAR,12,1,12,13,0.,1.,0.
CBAR,21,1,21,22,0.,1.,0.
CONM2,90,12,,2.0
CELAS1,71,7,2,3,21,3
CELAS1,72,7,2,2,22,2
{joint}
SPC1,1,123456,22
ENDDATA
"""
_JOINT = "RBE2,81,3,123456,11\nRBE2,82,13,123456,21"
_FRAMES = Components({"one": frozenset({1, 2}), "two": frozenset({11, 12}), "three": frozenset({21})})


def _coupled(folder: Path, joint: str = _JOINT) -> ConfiguredModel:
    path = folder / "frames.bdf"
    path.write_text(_COUPLED.format(joint=joint).replace("CEND", "CEND\nSPC = 1" + "\nK2GG = KJ" * ("DMIG" in joint)))
    return model_of(path)


def _nodes(configured: ConfiguredModel, dofs: Reals) -> set[int]:
    return {configured.free_dof(int(i)).node for i in dofs}


def test_interfaces_follow_rigid_elements_and_springs(tmp_path: Path) -> None:
    frames = _coupled(tmp_path)
    division = divide(frames, _FRAMES)
    assert division is not None
    assert _nodes(frames, division.interface) == {2, 3, 13}
    # a spring of no component acts on the Z direction of grid point 2; another ends at a support
    inside = [frames.free_dof(int(i)) for i in division.interface]
    assert [dof.component for dof in inside if dof.node == 2] == [3]
    # the mass belongs to the component on whose grid point it is
    two = next(p for p in division.parts if p.name == "two")
    assert _nodes(frames, two.interior) == {12}
    x = np.zeros(0)
    full = solve_modes(frames.at(x), 8)
    found = component_model(frames, _FRAMES, _EVERYTHING)
    np.testing.assert_allclose(reduced_modes(found.model.at(x), 8).freq_hz[:8], full.freq_hz[:8], rtol=1e-7)


_RBE3 = f"{_JOINT}\nGRID,50,,1.,.5,0.\nRBE3,83,,50,123456,1.,123,2\n,12,21"
_DMIG = f"{_JOINT}\nDMIG,KJ,0,6,1,0\nDMIG,KJ,2,2,,12,2,1.+5\nDMIG,KJ,2,2,,2,2,1.+6\nDMIG,KJ,12,2,,12,2,1.+6"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("joint", "elements"),
    [
        (_RBE3, _FRAMES.elements),
        (_DMIG, _FRAMES.elements),
        # a component that is all interface, and one with everything else as the other
        (_JOINT, {**_FRAMES.elements, "springs": frozenset({71, 72})}),
        (_JOINT, {"one": frozenset({1, 2})}),
    ],
    ids=["rbe3 and added masses", "dmig", "all interface", "other elements"],
)
def test_with_all_modes_the_model_is_the_full_one(tmp_path: Path, joint: str, elements: dict) -> None:
    model = _coupled(tmp_path, joint).model
    masses = (AddedMass(50, 1.0), AddedMass(12, 0.1)) if joint == _RBE3 else ()
    frames, x = configure(model, Configuration(masses=masses)), np.zeros(0)
    full = solve_modes(frames.at(x), 8).freq_hz[:8]
    found = component_model(frames, Components(elements), _EVERYTHING)
    np.testing.assert_allclose(reduced_modes(found.model.at(x), 8).freq_hz[:8], full, rtol=1e-9)
    if joint == _DMIG:
        assert any(frames.model.structure.assembled)
        assert "12Y" in {str(frames.free_dof(int(i)))[:3] for i in found.components.interface}


def test_one_component_alone_with_free_and_with_fixed_interface(tmp_path: Path) -> None:
    frames = _coupled(tmp_path)
    found = alone(frames, _FRAMES, ["two"])
    assert found.elements_off == {1, 2, 21, 71, 72, 81, 82}
    assert dict(found.interface) == {11: "123456", 13: "123456"}
    both = alone(frames, _FRAMES, ["one", "two"])
    assert both.elements_off == {21, 71, 72, 82}
    assert {node for node, _ in both.interface} == {2, 13}


def test_a_component_with_the_rigid_element_keeps_it(tmp_path: Path) -> None:
    components = Components({"one": frozenset({1, 2, 81}), "two": frozenset({11, 12}), "three": frozenset({21})})
    found = alone(_coupled(tmp_path), components, ["one"])
    assert 81 not in found.elements_off
    # grid point 11 moves with grid point 3, which is held
    assert {node for node, _ in found.interface} == {2, 3}


def test_what_is_one_component_is_not_divided(tmp_path: Path) -> None:
    frames = _coupled(tmp_path)
    others = frozenset({1, 2, 21, 71, 72, 81, 82})
    lone = configure(frames.model, Configuration("lone", elements_off=others))
    assert divide(lone, _FRAMES) is None
    with pytest.raises(FemtuneError) as error:
        component_model(lone, _FRAMES, 100.0)
    check_shown("reduce.component-single", error.value)


def test_a_component_without_connection_is_refused(tmp_path: Path) -> None:
    frames = _coupled(tmp_path, "RBE2,81,3,123456,11")
    apart = configure(frames.model, Configuration("apart", elements_off=frozenset({71})))
    with pytest.raises(FemtuneError) as error:
        divide(apart, _FRAMES)
    check_shown("reduce.component-alone", error.value)


def test_a_loose_piece_of_a_component_is_refused(tmp_path: Path) -> None:
    frames = _coupled(tmp_path, "RBE2,82,13,123456,21")
    components = Components({"ends": frozenset({1, 2, 21}), "two": frozenset({11, 12}), "spring": frozenset({71})})
    with pytest.raises(FemtuneError) as error:
        component_model(frames, components, 100.0)
    check_shown("reduce.component-loose", error.value)


def test_empty_and_overlapping_components_are_refused() -> None:
    with pytest.raises(FemtuneError) as error:
        Components({"a": frozenset()})
    check_shown("reduce.component-empty", error.value)
    with pytest.raises(FemtuneError) as error:
        Components({"a": frozenset({1, 2, 3}), "b": frozenset({3, 4})})
    check_shown("reduce.components-overlap", error.value)


@pytest.mark.slow
def test_an_order_above_the_limit_is_refused() -> None:
    plate, components = _plate(2)
    trainer = _trainer(plate, components)
    with pytest.raises(FemtuneError) as error:
        replace(trainer, rules=replace(trainer.rules, order=20)).start()
    check_shown("reduce.components-order", error.value)
