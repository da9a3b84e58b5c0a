"""Digests of what matrices are made of: never the same where matrices differ, and the same however they are split."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.gradients.field_decks import DECKS

from femtune.fem import FieldRef, Structure
from femtune.fem.fields import MatrixKind
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.model import AddedMass, Assignment, Configuration, ModelPoint, configure, matrices_digest, parametric_model
from femtune.parameters import Parameter, ParameterSet

KINDS: tuple[MatrixKind, ...] = ("stiffness", "mass", "viscous", "hysteretic")
AS_IT_IS = Configuration()


@pytest.fixture(scope="module")
def structures(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Structure]:
    folder = tmp_path_factory.mktemp("decks")
    for name, text in DECKS.items():
        (folder / name).write_text(text)
    return {name: build_structure(read_deck(folder / name)).structure for name in DECKS}


def plain(structure: Structure, configuration: Configuration = AS_IT_IS) -> ModelPoint:
    return configure(parametric_model(structure, ParameterSet(()), ()), configuration).at(np.zeros(0))


def moved(
    structure: Structure, x: float, *fields: str, elements: frozenset[int] | None = None, upper: float = 2.0
) -> ModelPoint:
    """One factor on some fields."""
    refs = [FieldRef(card, int(number), name) for card, number, name in (text.split() for text in fields)]
    assignments = [Assignment("p", ref, True, elements) for ref in refs]
    model = parametric_model(structure, ParameterSet((Parameter("p", upper=upper),)), assignments)
    return configure(model, Configuration()).at(np.array([x]))


def same_matrix(one: ModelPoint, other: ModelPoint, kind: MatrixKind) -> bool:
    difference = abs(getattr(one, kind) - getattr(other, kind)).max()
    return bool(difference <= 1e-13 * abs(getattr(one, kind)).max())


@pytest.mark.slow
@pytest.mark.parametrize("entries", [6, pytest.param(12, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", DECKS)
def test_a_value_counts_where_it_changes_a_matrix(structures: dict[str, Structure], name: str, entries: int) -> None:
    """Entries of the value table by themselves, a tenth more in the deck."""
    structure = structures[name]
    base, table = plain(structure), structure.values
    own = {kind: matrices_digest(base, kind) for kind in KINDS}
    for i in range(0, len(table.refs), 1 + len(table.refs) // entries):
        values = table.values.copy()
        values[i] *= 1.1
        other = plain(replace(structure, values=replace(table, values=values)))
        for kind in KINDS:
            if not same_matrix(base, other, kind):
                assert matrices_digest(other, kind) != own[kind], f"{kind} of {table.refs[i]}"


@pytest.mark.slow
def test_damping_does_not_matter_to_stiffness_and_mass(structures: dict[str, Structure]) -> None:
    for name, field in (("lines", "MAT1 1 GE"), ("shells", "MAT1 1 GE"), ("small", "PBUSH 21 B1")):
        structure = structures[name]
        card, number, value = field.split()
        at, values = structure.values.index(FieldRef(card, int(number), value)), structure.values.values.copy()
        values[at] *= 1.1
        other = plain(replace(structure, values=replace(structure.values, values=values)))
        found = [
            matrices_digest(p, "stiffness", "mass") for p in (plain(structure), other, moved(structure, 0.1, field))
        ]
        assert len(set(found)) == 1
        assert matrices_digest(other, *KINDS) != matrices_digest(plain(structure), *KINDS)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("lines", ("MAT1 1 E", "PBAR 11 I1")),
        ("shells", ("MAT1 1 E", "PSHELL 2 T")),
        ("solids", ("MAT9 1 G11", "MAT11 2 RHO")),
    ],
)
def test_the_split_does_not_matter(structures: dict[str, Structure], name: str, fields: tuple[str, ...]) -> None:
    structure = structures[name]
    points = [plain(structure), moved(structure, 0.0, *fields), moved(structure, 0.0, fields[0])]
    points.append(moved(structure, 0.0, fields[0], elements=frozenset({1})))
    points.append(moved(structure, 0.0, fields[0], upper=1.2))
    assert len({matrices_digest(p, *KINDS) for p in points}) == 1
    for kind in KINDS:
        assert all(same_matrix(points[0], p, kind) for p in points)


@pytest.mark.slow
def test_a_value_of_a_part_of_the_elements_is_another_model(structures: dict[str, Structure]) -> None:
    whole, part = (moved(structures["lines"], 0.1, "MAT1 1 E", elements=e) for e in (None, frozenset({1, 2})))
    assert matrices_digest(whole, "stiffness") != matrices_digest(part, "stiffness")
    assert matrices_digest(whole, "mass") == matrices_digest(part, "mass")


@pytest.mark.slow
def test_bounds_do_not_change_the_terms(structures: dict[str, Structure]) -> None:
    for name, field in (("lines", "MAT1 1 E"), ("shells", "PSHELL 2 T"), ("solids", "MAT9 1 G11")):
        one, other = (moved(structures[name], 0.05, field, upper=upper).configured for upper in (1.1, 3.0))
        assert one.terms_digest == other.terms_digest


CHANGES: dict[str, Callable[[Structure], ModelPoint]] = {
    "weight": lambda s: plain(replace(s, mass_factor=0.7)),
    "mass": lambda s: plain(replace(s, consistent_mass=False)),
    "drilling": lambda s: plain(replace(s, drilling=10.0)),
    "place": lambda s: plain(replace(s, nodes=replace(s.nodes, xyz=s.nodes.xyz + np.eye(len(s.nodes.ids), 3) / 9))),
    "off": lambda s: plain(s, Configuration(elements_off=frozenset({3}))),
    "added": lambda s: plain(s, Configuration(masses=(AddedMass(3, 0.5),))),
    "held": lambda s: plain(s, Configuration(supports_added=((3, "1"),))),
    "free": lambda s: plain(s, Configuration(supports_removed=((4, "1"),))),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
def test_settings_and_configurations_count(structures: dict[str, Structure], change: str) -> None:
    structure = structures["shells"]
    own, other = plain(structure), CHANGES[change](structure)
    assert matrices_digest(own, "stiffness", "mass") != matrices_digest(other, "stiffness", "mass")


def test_assembled_matrices_count_with_their_factors(tmp_path: Path) -> None:
    text = (
        "SOL 103\nCEND\nK2GG={}*KA\nM2GG=MA\nBEGIN BULK\nGRID,1,,0.,0.,0.\n"
        "DMIG,KA,0,6,1,0\nDMIG,KA,1,1,,1,1,{}\nDMIG,MA,0,6,1,0\nDMIG,MA,1,1,,1,1,2.\nENDDATA\n"
    )
    found = []
    for i, numbers in enumerate((("1.", "3."), ("2.", "3."), ("1.", "4."))):
        (tmp_path / f"{i}.bdf").write_text(text.format(*numbers))
        found.append(plain(build_structure(read_deck(tmp_path / f"{i}.bdf")).structure))
    assert len({matrices_digest(p, "stiffness") for p in found}) == 3
    assert len({matrices_digest(p, "mass") for p in found}) == 1
