"""The forecast of the terms' memory beside what they are measured to take."""

from __future__ import annotations

import gc
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from femtune.fem import FieldRef, Structure
from femtune.files.nastran import build_structure, read_deck
from femtune.model import Assignment, parametric_model, terms
from femtune.parameters import Parameter, ParameterSet
from structures.bracket import solid_bracket, solid_bracket_parameters
from structures.meshed import write_structure
from structures.shells import Isotropic, Section, ShellPart, cylinder, shell_mesh, shell_structure
from structures.subframe import subframe, subframe_study_parameters


def shells(cells: str) -> Structure:
    """2,500 elements or more of a curved, distorted panel, in two regions of thickness."""
    mesh = shell_mesh(cylinder(0.5, 1.0, 0.2, 1.5), 50, 50, cells=cells, distort=0.2)
    steel, (first, last) = Isotropic(2.1e11, 0.3, 7850.0), np.array_split(mesh.cells, [len(mesh.cells) // 3])
    return shell_structure(mesh.xyz, [ShellPart(first, Section(steel, 0.004)), ShellPart(last, Section(steel, 0.006))])


THICKNESS = [FieldRef("PSHELL", 1, "T"), FieldRef("PSHELL", 2, "T")]
MODULUS = [FieldRef("MAT1", 1, "E")]


@pytest.mark.parametrize(("cells", "refs"), [("quad", THICKNESS[:1]), ("union", [*THICKNESS, *MODULUS]), ("quad", [])])
@pytest.mark.quick(2, rest="long")
@pytest.mark.slow
def test_shells(cells: str, refs: list[FieldRef], monkeypatch: pytest.MonkeyPatch) -> None:
    assert_foreseen(shells(cells), refs, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("made", [pytest.param("subframe", marks=pytest.mark.long), "bracket"])
def test_structures(made: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Shells in all directions with thicknesses and a modulus, solids with moduli and densities."""
    mesh, refs = MODELS[made]
    deck = tmp_path / "model.bdf"
    write_structure(mesh(), deck)
    assert_foreseen(build_structure(read_deck(deck)).structure, list(refs()), monkeypatch)


MODELS = {
    "subframe": (lambda: subframe(20_000), subframe_study_parameters),
    "bracket": (lambda: solid_bracket(15_000), solid_bracket_parameters),
}


def assert_foreseen(structure: Structure, refs: list[FieldRef], monkeypatch: pytest.MonkeyPatch) -> None:
    """The forecast is within 15 % of the memory that is taken and kept."""
    foreseen: list[int] = []
    monkeypatch.setattr(terms, "require_memory", lambda needed, *_, **__: foreseen.append(needed))
    names = tuple(Parameter(f"p{i}") for i in range(len(refs)))
    assigned = [Assignment(p.name, ref) for p, ref in zip(names, refs)]
    gc.collect()
    tracemalloc.start()
    try:
        model = parametric_model(structure, ParameterSet(names), assigned)
        gc.collect()
        taken = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert model.terms
    assert taken > 2_000_000
    np.testing.assert_allclose(foreseen, [taken], rtol=0.15)
