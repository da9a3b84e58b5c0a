"""The rack of solids with CalculiX as its solver: its study, and its modes beside those of the mixed model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from geometry import NOMINAL, sensors
from laboratory import RIGID, solved
from mixed import deck_text
from solid import input_text, mass

from femtune.dofs import DofSet, parse_dof
from femtune.modal.shape_criteria import mac
from femtune.model.response import make_ports
from femtune.runs import ExternalSolver, ResultFile, Templates, read_template

FREE_MODES, TABLE_MODES, COMPARED = 16, 200, 10
"""Modes that CalculiX computes, free and on the table, and elastic modes that are compared with the mixed model."""


def weighed_density(weighed: float) -> float:
    """Density of the steel, with which the solid model has the mass that was weighed, kg/m³."""
    light = mass({**NOMINAL, "D2": 0.0})
    return round(NOMINAL["D2"] * (weighed - light) / (mass(NOMINAL) - light), 3)


def write_inputs(folder: Path, weighed: float) -> None:
    """The input files free.inp and bolted.inp with placeholders for the moduli."""
    densities = {"D1": NOMINAL["D1"], "D2": weighed_density(weighed)}
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "free.inp").write_text(input_text(FREE_MODES, values=densities))
    (folder / "bolted.inp").write_text(input_text(TABLE_MODES, table=True, values=densities))


def beside_mixed(program: str, folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies of the solid and the mixed model, free, at the values of the drawings, and MAC (solid, mixed)."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "free.inp").write_text(input_text(FREE_MODES))
    inputs = Templates((read_template(folder / "free.inp"),))
    result = ResultFile("free.frd", "calculix-frd")
    solver = ExternalSolver((program, "free"), inputs, result, folder / "runs", environment=(("OMP_NUM_THREADS", "1"),))
    found = solver.run(NOMINAL).modes
    if found is None:
        raise SystemExit("CalculiX failed with the solid model at the values of the drawings")
    elastic = slice(RIGID, RIGID + COMPARED)
    rows = np.searchsorted(found.nodes, list(sensors()))
    solid = found.shapes[rows][:, :3, elastic].reshape(-1, COMPARED)
    mixed = solved(folder / "mixed", deck_text(modes=RIGID + COMPARED), RIGID + COMPARED)
    dofs = DofSet(parse_dof(f"{number}{axis}+") for number in sensors() for axis in "XYZ")
    shapes = np.asarray(make_ports(mixed.point.configured, [dofs[0]], dofs).outputs @ mixed.shapes[:, elastic])
    return found.freq_hz[elastic], mixed.freq_hz[elastic], mac(solid, shapes)
