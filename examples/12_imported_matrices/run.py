"""Update a model of imported matrices and compare it with its deck: python run.py [--quick] [--evidence DIR].

A portal of columns, a beam and a shell panel is written as matrices, one file per group: the stiffness of the columns,
of the beam, and of the panel at seven thicknesses, and likewise the mass. The matrices are imported, compared with the
modes listed for the deck, and updated with a simulated test, as is the deck. Both must give the same values.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse as sp

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.nastran import build_structure, read_deck
from femtune.files.uff import write_uff_modes
from femtune.modal import ModeSet
from femtune.model import Configuration, grid_matrix, parametric_model
from femtune.parameters import ParameterSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import unit_system

_WIDTH, _HEIGHT = 2.0, 3.0
_NOMINAL, _TRUE = (
    {"columns": 2.1e11, "beam": 2.1e11, "panel": 0.010},
    {"columns": 1.8e11, "beam": 2.4e11, "panel": 0.012},
)
_THICKNESSES = (0.006, 0.0075, 0.009, 0.0105, 0.012, 0.014, 0.016)
_SENSORS = (
    "{top_left}X+",
    "{top_left}Y+",
    "{top_right}Y+",
    "{middle}Y+",
    "{half_left}X+",
    "{half_left}Y+",
    "{half_right}Y+",
)
_MODES = 5


def node(i: int, j: int, n: int) -> int:
    """Number of the grid point in column i, row j of the panel."""
    return 1 + i + j * (n + 1)


def deck(n: int, values: dict[str, float]) -> str:
    """The portal with a panel of n × n shells; elements 1… are columns, 1000… the beam, 5000… the panel."""
    points = [
        f"GRID,{node(i, j, n)},,{_WIDTH * i / n:.9f},0.,{_HEIGHT * j / n:.9f}"
        for i in range(n + 1)
        for j in range(n + 1)
    ]
    columns = [
        f"CBAR,{1 + 2 * j + side},1,{node(i, j, n)},{node(i, j + 1, n)},0.,1.,0."
        for j in range(n)
        for side, i in enumerate((0, n))
    ]
    beam = [f"CBAR,{1000 + i},2,{node(i, n, n)},{node(i + 1, n, n)},0.,1.,0." for i in range(n)]
    panel = [
        f"CQUAD4,{5000 + i + j * n},3,{node(i, j, n)},{node(i + 1, j, n)},{node(i + 1, j + 1, n)},{node(i, j + 1, n)}"
        for j in range(n)
        for i in range(n)
    ]
    feet = [f"SPC1,1,123456,{node(i, 0, n)}" for i in range(n + 1)]
    properties = [
        f"MAT1,1,{values['columns']:.6E},,.3,7850.",
        f"MAT1,2,{values['beam']:.6E},,.3,7850.", "MAT1,3,7.0+10,,.33,2700.",
        "PBAR,1,1,2.-3,6.-6,2.-6,4.-6", "PBAR,2,2,3.-3,9.-6,3.-6,6.-6", f"PSHELL,3,3,{values['panel']:.9f},3,,3",
    ]  # fmt: skip
    return "\n".join(["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", *points, *columns, *beam, *panel, *feet, *properties,
                      "ENDDATA", ""])  # fmt: skip


def group_matrices(path: Path, group: str) -> dict[str, sp.csr_array]:
    """Stiffness and mass of the elements of one group of a deck, on all grid points."""
    structure = build_structure(read_deck(path)).structure
    first = {"columns": 1, "beam": 1000, "panel": 5000, "end": 10**6}
    after = list(first)[list(first).index(group) + 1]
    off = frozenset(e for e in structure.element_kinds if not first[group] <= e < first[after])
    model = parametric_model(structure, ParameterSet(()), ())
    alone = Configuration(group, elements_off=off)
    return {kind: grid_matrix(model, alone, kind) for kind in ("stiffness", "mass")}


def write_matrices(folder: Path, n: int) -> None:
    """All matrices in Matrix Market form, and the list of their DOFs."""
    for group in ("columns", "beam"):
        for kind, matrix in group_matrices(folder / "portal.bdf", group).items():
            scipy.io.mmwrite(folder / f"{group}_{kind}.mtx", matrix, precision=17)
    for i, thickness in enumerate(_THICKNESSES):
        (folder / "set.bdf").write_text(deck(n, {**_NOMINAL, "panel": thickness}))
        for kind, matrix in group_matrices(folder / "set.bdf", "panel").items():
            scipy.io.mmwrite(folder / f"panel{i}_{kind}.mtx", matrix, precision=17)
    rows = [f"{number} {component}" for number in range(1, (n + 1) ** 2 + 1) for component in range(1, 7)]
    (folder / "portal.dof").write_text("\n".join(rows) + "\n")


def simulate(folder: Path, n: int) -> None:
    """A test of the portal with the true values, without scatter."""
    (folder / "true.bdf").write_text(deck(n, _TRUE))
    names = {
        "top_left": node(0, n, n), "top_right": node(n, n, n), "middle": node(n // 2, n, n),
        "half_left": node(0, n // 2, n), "half_right": node(n, n // 2, n),
    }  # fmt: skip
    sensors = DofSet.parse([text.format(**names) for text in _SENSORS])
    modes = ft.modes(folder / "true.bdf").mode_sets["baseline"].select_dofs(sensors).select_modes(range(_MODES))
    points = build_structure(read_deck(folder / "true.bdf")).structure.nodes
    at = [points.position(number) for number in sorted(set(map(int, sensors.nodes)))]
    frame = WireFrame(points.ids[at], points.xyz[at], points.frames[at])
    measured = ModeSet(modes.freq_hz, modes.shapes, sensors, source="simulated")
    write_uff_modes(folder / "test.uff", ModalTest("test", unit_system("m-kg-s"), frame, modes=measured))


_COMMON = """
[modes]
count = 8

[[configuration]]
name = "portal"
test = "test.uff"
{supports}

[residuals]
frequency_sd = 0.001

[output]
folder = "run_{name}"
"""


def parameter(name: str, fields: list[str], lower: float, upper: float, absolute: bool = False) -> str:
    """A [[parameter]]."""
    listed = ", ".join(f'"{field}"' for field in fields)
    more = "absolute = true\n" if absolute else ""
    return f'\n[[parameter]]\nname = "{name}"\nfields = [{listed}]\nlower = {lower}\nupper = {upper}\n{more}'


def deck_study(folder: Path) -> Path:
    """The study of the deck."""
    text = '[study]\ntitle = "Portal, deck"\ndeck = "portal.bdf"\nunits = "m-kg-s"\n'
    text += _COMMON.format(name="deck", supports="")
    text += parameter("columns", ["MAT1 1 E"], 0.5, 2.0) + parameter("beam", ["MAT1 2 E"], 0.5, 2.0)
    text += parameter("panel", ["PSHELL 3 T"], 0.006, 0.016, absolute=True)
    (folder / "deck.toml").write_text(text)
    return folder / "deck.toml"


def matrix(name: str, kind: str, file: str, more: str = "") -> str:
    """A [[matrix]]."""
    return f'\n[[matrix]]\nname = "{name}"\nkind = "{kind}"\nfile = "{file}"\n{more}'


def matrix_study(folder: Path, n: int, listed: tuple[float, ...], mass_factor: float = 1.0) -> Path:
    """The study of the matrices."""
    text = '[study]\ntitle = "Portal, matrices"\nunits = "m-kg-s"\n'
    text += f'\n[model]\ngrid = "portal.bdf"\ndofs = "portal.dof"\nlisted_hz = {list(listed)}\n'
    text += f'\n[[variable]]\nname = "T"\nnominal = {_NOMINAL["panel"]}\ndegree = 5\n'
    for group, short in (("columns", "C"), ("beam", "B")):
        text += matrix(f"{short}K", "stiffness", f"{group}_stiffness.mtx")
        text += matrix(f"{short}M", "mass", f"{group}_mass.mtx", f"factor = {mass_factor}\n")
    for i, thickness in enumerate(_THICKNESSES):
        text += matrix("PK", "stiffness", f"panel{i}_stiffness.mtx", f"at = {{ T = {thickness} }}\n")
        more = f"at = {{ T = {thickness} }}\nfactor = {mass_factor}\n"
        text += matrix("PM", "mass", f"panel{i}_mass.mtx", more)
    text += _COMMON.format(name="matrices", supports=f'supports_added = ["1 THRU {n + 1}:123456"]')
    text += parameter("columns", ["MATRIX CK"], 0.5, 2.0) + parameter("beam", ["MATRIX BK"], 0.5, 2.0)
    text += parameter("panel", ["VARIABLE T"], 0.006, 0.016, absolute=True)
    (folder / "matrices.toml").write_text(text)
    return folder / "matrices.toml"


def updated(study: Path) -> tuple[dict[str, float], tuple[float, ...]]:
    """Values of the parameters, and frequencies after the update."""
    found = ft.run(study).results
    assert found.update is not None
    assert found.update.ok
    after = next(m for m in reversed(found.modes) if m.stage == "after")
    return {p.name: p.value for p in found.update.parameters}, after.freq_hz


def refused(study: Path) -> str:
    """The message for matrices whose masses are in other units."""
    try:
        ft.info(study)
    except FemtuneError as error:
        return str(error)
    raise AssertionError("masses in grams were not noticed")


def evidence(folder: Path, n: int) -> str:
    """The page."""
    (folder / "portal.bdf").write_text(deck(n, _NOMINAL))
    write_matrices(folder, n)
    simulate(folder, n)
    listed = ft.modes(folder / "portal.bdf")[0].freq_hz[:6]
    by_deck, hz_deck = updated(deck_study(folder))
    by_matrices, hz_matrices = updated(matrix_study(folder, n, listed))
    true = {name: _TRUE[name] / (_NOMINAL[name] if name != "panel" else 1.0) for name in _TRUE}
    rows = [f"| {name} | {true[name]:.6g} | {by_deck[name]:.6g} | {by_matrices[name]:.6g} |" for name in true]
    for name, value in true.items():
        assert abs(by_matrices[name] / by_deck[name] - 1.0) < 1e-6, (name, by_matrices, by_deck)
        assert abs(by_matrices[name] / value - 1.0) < 1e-4, (name, by_matrices)
    difference = float(np.abs(np.array(hz_matrices) / np.array(hz_deck) - 1.0).max())
    assert difference < 1e-7, (hz_deck, hz_matrices)
    message = refused(matrix_study(folder, n, listed, mass_factor=1000.0))
    assert "matrices.modes-differ" in message
    assert "factor of 1000" in message.partition("likely cause 1")[2].partition("\n")[0]
    return "\n".join([
        "# Imported matrices compared with their deck", "",
        f"A portal frame with a panel of {n} × {n} shells, as a deck and as matrices (those of the panel at seven "
        "thicknesses, as a polynomial of degree 5), updated with a simulated test.", "",
        "| parameter | true | with the deck | with the matrices |", "| --- | --- | --- | --- |", *rows, "",
        f"Largest difference of a frequency after both updates: {difference:.1e}.", "",
        "With masses in grams the matrices are rejected:", "", "```text", message, "```", "",
    ])  # fmt: skip


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a coarser mesh")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        text = evidence(Path(folder).resolve(), 4 if options.quick else 10)
    print(text.replace(str(Path(tempfile.gettempdir())), ""))
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "12_imported_matrices.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
