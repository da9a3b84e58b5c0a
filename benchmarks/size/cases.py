"""What is measured: two generated structures at any size, their parameters, and where their sensors are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.fem import FieldRef, Structure
from femtune.model import Assignment, ConfiguredModel, ParametricModel, parametric_model
from femtune.parameters import Parameter, ParameterSet
from structures.bracket import solid_bracket, solid_bracket_parameters
from structures.meshed import MeshedStructure, write_structure
from structures.subframe import subframe, subframe_study_parameters

MODES, SENSORS, CHANGE = 50, 60, 0.1


@dataclass(frozen=True)
class Case:
    """One structure at any size.

    Parameters
    ----------
    main_size : degrees of freedom at which all ways are compared
    sizes : those of the cost against size
    calculix : its elements are solids, so that CalculiX solves the same mesh
    """

    name: str
    title: str
    generate: Callable[[int], MeshedStructure]
    parameters: Callable[[], tuple[FieldRef, ...]]
    main_size: int
    sizes: tuple[int, ...]
    calculix: bool


CASES = {
    case.name: case
    for case in (
        Case(
            "subframe", "shell subframe", subframe, subframe_study_parameters, 600_000,
            (50_000, 100_000, 200_000, 400_000, 600_000, 1_000_000), False,
        ),
        Case(
            "bracket", "solid bracket", solid_bracket, solid_bracket_parameters, 200_000, (60_000, 200_000), True,
        ),
    )
}  # fmt: skip


def write_case(case: Case, size: int, deck: Path) -> MeshedStructure:
    """Generate the structure and write it as a deck."""
    structure = case.generate(size)
    write_structure(structure, deck)
    return structure


def compiled(case: Case, structure: Structure) -> ParametricModel:
    """The terms; every parameter scales one field."""
    refs = case.parameters()
    names = [f"p{i}" for i in range(1, len(refs) + 1)]
    assigned = [Assignment(name, ref) for name, ref in zip(names, refs, strict=True)]
    return parametric_model(structure, ParameterSet(tuple(Parameter(name) for name in names)), assigned)


def changed(count: int) -> NDArray[np.float64]:
    """All parameters by ten per cent, upwards or downwards."""
    return CHANGE * np.random.default_rng(4).choice([-1.0, 1.0], count)


def sensor_rows(model: ConfiguredModel) -> sp.csr_array:
    """(60, n_free) one direction at each of 60 grids: those of the accelerometers (CONM2), or spread over the list."""
    structure = model.model.structure
    n = len(structure.nodes.ids)
    dofs = 6 * _sensor_nodes(structure, n) + np.arange(SENSORS) % 3
    return sp.csr_array(model.transformation[dofs])


def _sensor_nodes(structure: Structure, n: int) -> NDArray[np.int64]:
    lowest = np.argsort(structure.nodes.ids)[:SENSORS]
    if (structure.nodes.ids[lowest] < 1000).all():
        return np.asarray(lowest)
    return np.linspace(0, n - 1, SENSORS).astype(np.int64)
